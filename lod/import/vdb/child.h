// Runs the program that reads and writes OpenVDB files (program/): a crash of it, or memory that it may not have, is an
// error here.
#pragma once

#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "engine/base/result.h"

namespace stipple::lod {

/// A file without a name, gone when the last owner is.
class NamelessFile {
  public:
    /// `folder` empty: the system's.
    static Result<std::shared_ptr<const NamelessFile>> create(const std::string& folder);
    explicit NamelessFile(int descriptor) : descriptor_(descriptor) {}
    ~NamelessFile();
    NamelessFile(const NamelessFile&) = delete;
    NamelessFile& operator=(const NamelessFile&) = delete;
    int descriptor() const { return descriptor_; }
    /// By which this process can open it again.
    std::string path() const { return "/proc/self/fd/" + std::to_string(descriptor_); }

  private:
    int descriptor_;
};

/// Gives the program its request, and `columns` as the file that it writes to or reads from. Waits for its answer;
/// where `isStopped` (asked ten times a second) says so, it is ended. `where`: the file that it is about, for errors.
Result<nlohmann::json> runVdbProgram(nlohmann::json request, const NamelessFile& columns, const std::string& where,
                                     const std::function<bool()>& isStopped);

}  // namespace stipple::lod
