// `stipple study SCENE --calibrate`.
#pragma once

#include <functional>
#include <memory>

#include "apps/stipple/common.h"
#include "apps/study/sweep/plan.h"

namespace stipple::app {

/// Measures and keeps; prints a table, or JSON.
Result<void> calibrate(const study::StudyScene& scene, const study::StudySettings& settings,
                       std::unique_ptr<render::Backend> backend, Executor& executor, bool isJson,
                       const std::function<Result<void>(uint64_t done, uint64_t total)>& say);

}  // namespace stipple::app
