// Files: positioned reads with checked sizes, and a writer whose file appears whole or not at all.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "engine/base/byte_source.h"
#include "engine/base/result.h"

namespace stipple {

/// A read-only file. readAt is safe from several threads.
class InputFile final : public ByteSource {
  public:
    static Result<InputFile> open(const std::string& path);
    InputFile(InputFile&& other) noexcept;
    InputFile& operator=(InputFile&& other) noexcept;
    ~InputFile() override;
    uint64_t sizeBytes() const override { return sizeBytes_; }
    const std::string& path() const override { return path_; }
    uint64_t identity() const override;
    Result<void> readAt(uint64_t offset, void* destination, size_t count) const override;

  private:
    InputFile(int descriptor, uint64_t sizeBytes, std::string path);
    int descriptor_ = -1;
    uint64_t sizeBytes_ = 0;
    std::string path_;
};

Result<std::vector<uint8_t>> readWhole(const std::string& path);

/// Changes when the file does: of its path, size and time.
uint64_t fileIdentity(const std::string& path);

/// The file that is written where `path` is named: links are followed. Refuses what is there and no regular file
/// (folders, pipes, devices), a link that leads nowhere, and a file that must not be written.
Result<std::string> outputTarget(const std::string& path);

/// Writes to "<path>.partial.<pid>", which commit() renames to `path`; without commit() it is removed again. What
/// killed processes left of earlier writes to the same path is removed. Where `path` is a link, what it leads to is
/// replaced.
class OutputFile {
  public:
    static Result<OutputFile> create(const std::string& path);
    /// The first `bytes` bytes of the file at `temporaryPath`, which is made if it is not there and stays without
    /// commit(), so that work can go on later. Refused while another process writes to it.
    static Result<OutputFile> resume(const std::string& path, const std::string& temporaryPath, uint64_t bytes);
    OutputFile(OutputFile&& other) noexcept;
    OutputFile& operator=(OutputFile&&) = delete;
    ~OutputFile();
    Result<void> append(const void* bytes, size_t count);
    Result<void> writeAt(uint64_t offset, const void* bytes, size_t count);
    uint64_t position() const { return position_; }
    const std::string& temporaryPath() const { return temporaryPath_; }
    /// Flushes to disk; the temporary file stays where it is (so that it can be verified before commit).
    Result<void> flush();
    Result<void> commit();

  private:
    OutputFile(int descriptor, std::string path, std::string target, std::string temporaryPath);
    int descriptor_ = -1;  ///< locked, so that no other process takes the file for a left-over
    uint64_t position_ = 0;
    std::string path_, target_, temporaryPath_;
    bool isKept_ = false;
};

/// Writes into a file at `offset`; makes the file if it is not there.
Result<void> writeFileAt(const std::string& path, uint64_t offset, const void* bytes, size_t count);
Result<std::string> readTextFile(const std::string& path, uint64_t sizeLimitBytes);
/// Writes a whole file through OutputFile.
Result<void> writeWholeFile(const std::string& path, const void* bytes, size_t count);

}  // namespace stipple
