// Tone once more, in fp64: the filmic curve as a quotient of polynomials in the light.
#include <cmath>

#include "engine/reference/effects/effects.h"
#include "shaders/shared/bindings.h"

namespace stipple::reference {

glm::dvec3 tonedLight(const shared::ToneConstants& tone, const glm::dvec3& sent) {
    glm::dvec3 out = double{tone.exposure} * sent;
    if (tone.isFilmic == 0) return out;
    for (int c = 0; c < 3; ++c) {
        const double x = std::max(out[c], 0.0);
        out[c] = std::min((2.51 * x * x + 0.03 * x) / (2.43 * x * x + 0.59 * x + 0.14), 1.0);
    }
    return out;
}

namespace {

glm::dvec3 onSent(const render::DrawList& draws, const glm::dvec3& sent, const glm::dvec2&, double) {
    return tonedLight(*draws.tableAt<shared::ToneConstants>(shared::kToneBinding), sent);
}

}  // namespace

constinit const RestatedEffect toneRestated{.onSent = onSent};

}  // namespace stipple::reference
