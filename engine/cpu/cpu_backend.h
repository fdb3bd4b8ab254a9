// The cpu backend: the passes as native SIMD kernels over tiles, on an executor. The default where there is no GPU.
#pragma once

#include <memory>

#include "engine/base/executor.h"
#include "engine/cpu/kernels.h"
#include "engine/render/backend.h"

namespace stipple::cpu {

/// `kernels`: nullptr for the best ones.
std::unique_ptr<render::Backend> makeCpuBackend(Executor& executor, const Kernels* kernels = nullptr);

}  // namespace stipple::cpu
