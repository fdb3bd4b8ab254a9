// The tables of passes and of kinds.
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

bool joinsRows(render::Pass pass) { return cpuPassOf(pass).run == nullptr && render::passInfo(pass).isOfOwnPixel; }

const CpuKind& cpuKind(lod::Kind kind) {
    static constexpr std::array kTable{
#define STIPPLE_KIND(name) &name##OnCpu,
#include "lod/primitives/kinds.inl"
#undef STIPPLE_KIND
    };
    return *kTable.at(static_cast<size_t>(kind));
}

}  // namespace stipple::cpu
