// The table of passes.
#include <array>

#include "engine/cpu/passes/passes.h"

namespace stipple::cpu {

const CpuPass& cpuPassOf(render::Pass pass) {
    static constexpr std::array kTable{
#define STIPPLE_PASS(name, reads, writes, isOfOwnPixel) &name##Pass,
#include "engine/render/passes.inl"
#undef STIPPLE_PASS
    };
    return *kTable.at(static_cast<size_t>(pass));
}

}  // namespace stipple::cpu
