// Opens another scene while the window goes on: on a thread of its own, with workers of its own, as it may have to be
// built first.
#pragma once

#include <chrono>
#include <future>
#include <optional>
#include <string>
#include <vector>

#include "apps/stipple/common.h"

namespace stipple::app {

class SceneOpener {
  public:
    explicit SceneOpener(const BuildOptions& build) : build_(build) {}
    /// Stops what is under way.
    ~SceneOpener();
    SceneOpener(const SceneOpener&) = delete;
    SceneOpener& operator=(const SceneOpener&) = delete;

    bool isBusy() const { return result_.valid(); }
    /// What is being opened, for a person: the first of its files.
    const std::string& name() const { return name_; }
    double seconds() const;
    void start(std::vector<std::string> inputs);
    /// Once, when it is done.
    std::optional<Result<OpenedScene>> take();

  private:
    BuildOptions build_;
    std::string name_;
    double since_ = 0;
    std::future<Result<OpenedScene>> result_;
};

}  // namespace stipple::app
