// Backends by the names that people give them.
#pragma once

#include <memory>
#include <string>

#include "engine/base/executor.h"
#include "engine/base/result.h"
#include "engine/render/backend.h"

namespace stipple {

/// auto (a real GPU if there is one, else cpu), cpu, gpu, gpu:NAME, or reference.
Result<std::unique_ptr<render::Backend>> makeBackend(const std::string& device, Executor& executor);
/// Every backend and device, one per line.
std::string listDevices();

}  // namespace stipple
