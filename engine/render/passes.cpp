#include "engine/render/passes.h"

#include <array>
#include <cstddef>

namespace stipple::render {
namespace {

using enum Plane;

constexpr std::array kPasses{
#define STIPPLE_PASS(name, reads, writes, isOfOwnPixel) PassInfo{Pass::name, #name, reads, writes, isOfOwnPixel},
#include "engine/render/passes.inl"
#undef STIPPLE_PASS
};

}  // namespace

const PassInfo& passInfo(Pass pass) { return kPasses.at(static_cast<size_t>(pass)); }
const char* passName(Pass pass) { return passInfo(pass).name; }

}  // namespace stipple::render
