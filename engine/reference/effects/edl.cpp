// Eye-dome lighting once more, in fp64: the mean, over scales and neighbours, of how many times (base 2) a neighbour is
// nearer; parallel views as seen from where a view of 50 degrees shows as much.
#include <cmath>

#include "engine/reference/effects/effects.h"
#include "shaders/shared/bindings.h"
#include "shaders/shared/edl.h"

namespace stipple::reference {
namespace {

void onSurface(const render::DrawList& draws, Level& level) {
    const auto& c = *draws.tableAt<shared::EdlConstants>(shared::kEdlBinding);
    const shared::FrameConstants& f = draws.frame;
    const lod::View& view = draws.view;
    const double distance50 = view.height / (2 * std::tan(glm::radians(25.0))) / view.focalPixels;
    const auto width = static_cast<size_t>(level.width);
    std::vector<double> depths(level.samples.size(), HUGE_VAL);
    for (size_t i = 0; i < depths.size(); ++i)
        if (level.samples[i].valid)
            depths[i] = depthAt(level.samples[i],
                                {static_cast<double>(i % width) + 0.5, static_cast<double>(i / width) + 0.5}, view);
    const auto nearerAt = [&](double here, int x, int y) {
        if (x < 0 || y < 0 || x >= level.width || y >= level.height) return 0.0;
        const double there = depths[static_cast<size_t>(y) * width + static_cast<size_t>(x)];
        if (!(there < here)) return 0.0;
        return view.isOrthographic ? (here - there) / (std::log(2.0) * distance50) : std::log2(here / there);
    };
    const double weights[] = {c.weight0, c.weight1, c.weight2};
    const int straight[] = {c.straight0, c.straight1, c.straight2}, slanted[] = {c.slanted0, c.slanted1, c.slanted2};
    for (int y = 0; y < level.height; ++y)
        for (int x = 0; x < level.width; ++x) {
            Sample& s = level.ref(x, y);
            if (!s.valid) continue;
            const bool isLit = (f.shade & (s.isTriangle ? shared::kShadeTriangles : shared::kShadeLit)) != 0;
            if (isLit && (c.lit & (s.isTriangle ? shared::kEdlTriangles : shared::kEdlPoints)) == 0) continue;
            const double here = depths[static_cast<size_t>(y) * width + static_cast<size_t>(x)];
            double mean = 0;
            for (uint32_t k = 0; k < c.scales; ++k)
                for (int n = 0; n < 9; ++n) {
                    const int dx = n % 3 - 1, dy = n / 3 - 1, by = dx * dy == 0 ? straight[k] : slanted[k];
                    if (n != 4) mean += weights[k] / 8 * nearerAt(here, x + by * dx, y + by * dy);
                }
            s.colour *= std::exp(-8.0 * c.strength * mean);
        }
}

}  // namespace

constinit const RestatedEffect edlRestated{.onSurface = onSurface};

}  // namespace stipple::reference
