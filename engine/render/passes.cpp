#include "engine/render/passes.h"

#include <array>
#include <cstddef>

namespace stipple::render {
namespace {

using enum Plane;

constexpr std::array<PassInfo, 12> kPasses{{
    {Pass::clear, "clear", {}, {visibility, discList}, false},
    {Pass::project, "project", {}, {visibility, discList}, false},
    {Pass::discs, "discs", {discList}, {visibility}, false},
    {Pass::splat, "splat", {}, {visibility}, false},
    {Pass::strands, "strands", {}, {visibility}, false},
    {Pass::rasterise, "rasterise", {}, {visibility}, false},
    {Pass::resolve, "resolve", {visibility, discList}, {texels}, false},
    {Pass::pull, "pull", {texels}, {coarse}, false},
    {Pass::push, "push", {texels, coarse}, {coarse}, false},
    {Pass::surface, "surface", {texels, coarse}, {surface}, false},
    {Pass::light, "light", {surface}, {surface}, true},
    {Pass::output, "output", {surface}, {image}, true},
}};

}  // namespace

const PassInfo& passInfo(Pass pass) { return kPasses.at(static_cast<size_t>(pass)); }
const char* passName(Pass pass) { return passInfo(pass).name; }

}  // namespace stipple::render
