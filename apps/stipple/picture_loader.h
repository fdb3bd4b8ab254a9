// What writes pictures is 260 libraries: they are loaded with the first picture, or beside work that is long.
#pragma once

#include <atomic>
#include <future>
#include <thread>

#include "engine/base/result.h"

namespace stipple::app {

class PictureLoader {
  public:
    ~PictureLoader() { over_.set_value(); }
    /// An error where there is nothing to load. Libraries come with the first picture that is written, or beside work
    /// of more than two seconds, which is asked to stop where they cannot be loaded. (Not at once: while glibc loads
    /// them, no thread starts and none takes its first thread-local object.)
    Result<void> start();
    /// What to say of work that ended with this error: why it was to stop, where it was for that.
    Error told(Error error) const;

  private:
    void load();

    std::promise<void> over_;  ///< the work is
    std::atomic<bool> hasFailed_ = false;
    Error problem_;        ///< once it has
    std::jthread thread_;  ///< the last member: it uses the others
};

}  // namespace stipple::app
