#include "apps/stipple/scene_opener.h"

#include <filesystem>

#include "engine/base/executor.h"
#include "engine/base/process.h"
#include "engine/base/stop.h"

namespace stipple::app {

SceneOpener::~SceneOpener() {
    if (!isBusy()) return;
    askToStop();
    result_.wait();
}

double SceneOpener::seconds() const { return nowSeconds() - since_; }

void SceneOpener::start(std::vector<std::string> inputs) {
    name_ = std::filesystem::path(inputs.front()).filename().string();
    since_ = nowSeconds();
    const auto launch = [&](auto&& work) {
        try {
            result_ = std::async(std::launch::async, work);
        } catch (const std::system_error&) {  // no thread is to be had: then not beside the window
            result_ = std::async(std::launch::deferred, work);
            result_.wait();
        }
    };
    launch([inputs = std::move(inputs), build = build_]() {
        try {
            const auto executor = makeTbbExecutor(build.threads);
            return scene::openScene(inputs, build.told(false), *executor);
        } catch (const std::bad_alloc&) {
            return Result<OpenedScene>(fail(ErrorKind::budget, "there is not enough memory to open it", inputs.front(),
                                            "give a smaller --memory"));
        } catch (const std::exception& e) {
            return Result<OpenedScene>(fail(ErrorKind::input, e.what(), inputs.front()));
        }
    });
}

std::optional<Result<OpenedScene>> SceneOpener::take() {
    if (!isBusy() || result_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return {};
    return result_.get();
}

}  // namespace stipple::app
