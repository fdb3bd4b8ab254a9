#include <array>
#include <cmath>

#include "engine/reference/variants/discs.h"
#include "engine/reference/variants/variants.h"

namespace stipple::reference {
namespace {

double box(double) { return 1; }
/// Two sigmas to the rim, shifted to end there.
double gaussian(double rho2) { return std::exp(-2 * rho2) - std::exp(-2.0); }

struct Row {
    Variant variant;
    Variation variation;
};
using enum render::Mode;

const std::array kRows{
    Row{{"squares", splat, "Botsch & Kobbelt 2003, 3.1 and Fig 3 left; Dachsbacher et al. 2003",
         "squares of the projected size: outlines grow, edges are steps"},
        {.showDiscs = showSquares}},
    Row{{"size-only", splat, "Botsch & Kobbelt 2003, 3.1 and Fig 3", "circles that face the eye: thin parts grow fat"},
        {.showDiscs = showCircles}},
    Row{{"reduced-radii", splat, "Botsch & Kobbelt 2003, Fig 1 and 3",
         "half the radii: single discs, and the gaps between them"},
        {.showDiscs = showReduced}},
    Row{{"flat-depth", splat, "Botsch & Kobbelt 2003, Eq 4 and Fig 6", "no depth correction: every disc is a step"},
        {.showDiscs = showFlatDepth}},
    Row{{"sorted-blending", ewa, "Botsch & Kobbelt 2003, 5; before it Rusinkiewicz & Levoy 2000",
         "one pass from far to near: what lies behind shines through"},
        {.showDiscs = blendSorted}},
    Row{{"z-shift", ewa, "Ren, Pfister & Zwicker 2002, Fig 4 and 5",
         "fronts moved along the axis and not along the ray: off the axis they miss what they stand for"},
        {.showDiscs = blendMovedAway}},
    Row{{"unnormalised", ewa, "Ren, Pfister & Zwicker 2002, 7",
         "sums as they are: brightness ripples with the sampling"},
        {.showDiscs = blendUnnormalised}},
    Row{{"box-kernel", pullpush, "Marroquim, Kraus & Cavalcanti 2008, Fig 4",
         "all parts of an ellipse count alike: discs show"},
        {.kernel = box}},
    Row{{"gaussian-kernel", pullpush, "Marroquim, Kraus & Cavalcanti 2008, 3.3 and Fig 4",
         "the paper's kernel, beside (1 - rho^2)^2"},
        {.kernel = gaussian}},
    Row{{"centre-test", pullpush, "Marroquim, Kraus & Cavalcanti 2008, 3.2",
         "only ellipses that contain their parent's centre are pulled: holes"},
        {.pullsContained = true}},
    Row{{"light-per-point", pullpush, "Marroquim, Kraus & Cavalcanti 2008, 3.4 and Fig 5",
         "lit before blending: shading as coarse as the points"},
        {.lightsPoints = true}},
    Row{{"no-colour", pullpush, "Marroquim, Kraus & Cavalcanti 2008, Table 1", "the frame without its colour plane"},
        {.hasColours = false}},
};

}  // namespace

std::span<const Variant> variants() {
    static const auto all = [] {
        std::array<Variant, kRows.size()> out{};
        for (size_t i = 0; i < kRows.size(); ++i) out[i] = kRows[i].variant;
        return out;
    }();
    return all;
}

std::unique_ptr<render::Backend> makeVariantBackend(std::string_view name, Executor& executor) {
    for (const Row& row : kRows)
        if (name == row.variant.name) return makeReferenceBackend(executor, row.variation);
    return nullptr;
}

}  // namespace stipple::reference
