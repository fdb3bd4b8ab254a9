// What a light meets first: depths, and what leaves let through.
#include <algorithm>

#include "engine/cpu/passes/passes.h"
#include "shaders/shared/shade.h"

namespace stipple::cpu {

constinit const CpuPass castPass{
    .row = {
        .concerns = nullptr,
        .wants = [](const Frame&, SurfaceWants& wants) { wants.depth = wants.leaf = true; },
        .run =
            [](const RowPlace& at, SurfaceRow& row) {
                uint32_t* const through = at.frame.image->rgba.data() + at.first;
                std::copy_n(row.depth, at.n, at.frame.image->depth.data() + at.first);
                for (size_t i = 0; i < at.n; ++i)
                    through[i] = row.leaf[i] > 0.5f ? shared::throughLeaf({row.red[i], row.green[i], row.blue[i]}) : 0u;
            }}};

}  // namespace stipple::cpu
