// Exposure and the filmic curve, on what surfaces send.
#include "engine/cpu/passes/passes.h"
#include "shaders/shared/bindings.h"

namespace stipple::cpu {

constinit const CpuPass tonePass{
    .row = {.concerns = nullptr,
            .wants = [](const Frame&, SurfaceWants&) {},
            .run =
                [](const RowPlace& at, SurfaceRow& row) {
                    at.frame.k.toneRow(*at.frame.draws->tableAt<shared::ToneConstants>(shared::kToneBinding), at.n,
                                       row);
                }}};

}  // namespace stipple::cpu
