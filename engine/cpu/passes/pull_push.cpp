// Pull and push over the levels of the pyramid; the last push runs row by row with what follows it (rows.cpp).
#include "engine/cpu/passes/passes.h"

namespace stipple::cpu {

constinit const CpuPass pullPass{.run = [](Frame& frame) { frame.pyramid.pull(); }};
constinit const CpuPass pushPass{.run = [](Frame& frame) { frame.pyramid.push(); }};

}  // namespace stipple::cpu
