// The cpu backend: the passes as native SIMD kernels over tiles, on an executor. The default where there is no GPU.
#pragma once

#include <memory>

#include "engine/base/executor.h"
#include "engine/cpu/kernels.h"
#include "engine/render/backend.h"

namespace stipple::cpu {

/// What lists of discs by tile may hold at a time, 4 bytes each. Where they would hold more, tiles are drawn some rows
/// after others.
constexpr uint64_t kMostTileEntries = uint64_t{1} << 26;

/// `kernels`: nullptr for the best ones.
std::unique_ptr<render::Backend> makeCpuBackend(Executor& executor, const Kernels* kernels = nullptr,
                                                uint64_t mostTileEntries = kMostTileEntries);

}  // namespace stipple::cpu
