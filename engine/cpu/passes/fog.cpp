// Fog, on what surfaces send.
#include "engine/cpu/passes/passes.h"
#include "shaders/shared/bindings.h"

namespace stipple::cpu {

constinit const CpuPass fogPass{.row = {.concerns = nullptr,
                                        .wants = [](const Frame&, SurfaceWants& wants) { wants.depth = true; },
                                        .run =
                                            [](const RowPlace& at, SurfaceRow& row) {
                                                const auto& f =
                                                    *at.frame.draws->tableAt<shared::FogConstants>(shared::kFogBinding);
                                                at.frame.k.fogRow(at.frame.constants, f, at.x0, at.y, at.n, row);
                                            }}};

}  // namespace stipple::cpu
