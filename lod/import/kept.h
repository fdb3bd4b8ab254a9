// What was made of files on the way to opening them.
#pragma once

#include <any>
#include <map>
#include <string>

#include "engine/base/one_at_a_time.h"
#include "engine/base/result.h"

namespace stipple::lod {

/// A build opens its inputs several times: what a format made of one (a conversion on disk, say) stays as long as this
/// lives.
class Kept {
  public:
    /// What is there under that name, or what `make` gives, a Result<T>. One thread at a time.
    template <typename T, typename Make>
    Result<T> once(const std::string& name, const Make& make) {
        return turns_([&]() -> Result<T> {
            if (const auto at = made_.find(name); at != made_.end()) return std::any_cast<T>(at->second);
            STIPPLE_ASSIGN(T made, make());
            made_.emplace(name, made);
            return made;
        });
    }

  private:
    OneAtATime turns_;
    std::map<std::string, std::any> made_;
};

}  // namespace stipple::lod
