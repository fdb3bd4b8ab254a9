#include "engine/cpu/passes/seconds.h"

#include <algorithm>

#include "shaders/shared/pack.h"

namespace stipple::cpu {

bool takeSeconds(const RowPlace& at, const SurfaceRow& first, SurfaceRow& second) {
    const SecondPixels seconds = at.frame.seconds();
    if (!seconds.mayHave(at.first, at.n)) return false;
    const auto isOne = [](uint8_t kind) { return kind != shared::kSecondNone; };
    if (!std::any_of(seconds.kinds + at.first, seconds.kinds + at.first + at.n, isOne)) return false;
    second.hasTriangles = second.hasEmission = second.hasCoverage = false;
    second.hasMaterials = first.hasMaterials;
    second.shadowSlots = 0;
    second.mirroredRed = second.mirroredGreen = second.mirroredBlue = nullptr;
    for (float* const plane : {second.depth, second.nx, second.ny, second.red, second.green, second.blue, second.leaf})
        std::fill_n(plane, at.n, 0.0F);
    std::fill_n(second.nz, at.n, -1.0F);
    std::fill_n(second.material, at.n, shared::kPlainSurface);
    for (size_t i = 0; i < at.n; ++i) {
        const SecondPixel* const s = seconds.at(at.first + i);
        if (s == nullptr) continue;
        const shared::vec3 n = shared::octDecode(s->shown.normal);
        second.depth[i] = s->depth;
        second.nx[i] = n.x;
        second.ny[i] = n.y;
        second.nz[i] = n.z;
        second.red[i] = shared::unpackRed(s->shown.colour);
        second.green[i] = shared::unpackGreen(s->shown.colour);
        second.blue[i] = shared::unpackBlue(s->shown.colour);
        second.leaf[i] = (s->shown.cover & shared::kFilteredLeaf) != 0 ? 1.0f : 0.0f;
        if (first.hasMaterials && (s->shown.cover & shared::kFilteredMaterial) != 0)
            second.material[i] = shared::surfaceWord(shared::surfaceOfPoint(s->shown.cover >> 16));
    }
    return true;
}

void mixSeconds(const RowPlace& at, const SurfaceRow& second, SurfaceRow& row) {
    const SecondPixels seconds = at.frame.seconds();
    for (size_t i = 0; i < at.n; ++i) {
        const SecondPixel* const s = seconds.at(at.first + i);
        if (s == nullptr) continue;
        row.red[i] += s->share * (second.red[i] - row.red[i]);
        row.green[i] += s->share * (second.green[i] - row.green[i]);
        row.blue[i] += s->share * (second.blue[i] - row.blue[i]);
        if (seconds.kinds[at.first + i] != shared::kSecondFront) continue;
        row.depth[i] = row.ownDepth[i] = second.depth[i];
        row.nx[i] = second.nx[i];
        row.ny[i] = second.ny[i];
        row.nz[i] = second.nz[i];
    }
}

}  // namespace stipple::cpu
