// Points that a program makes, of which never more than a run is in memory: points STORE.stipple
#include <stipple/build.h>
#include <stipple/store.h>

#include <cmath>
#include <cstdio>

int main(int argc, char** argv) {
    if (argc != 2) return std::fprintf(stderr, "usage: points STORE.stipple\n"), 2;
    constexpr uint64_t kParts = 4, kPoints = 250'000;  // of each part
    stipple::PointSource ball;
    ball.name = "ball";
    ball.parts.assign(kParts, kPoints);
    ball.hasNormal = ball.hasColour = true;
    ball.read = [](size_t part, uint64_t first, uint64_t count, stipple::Points& to) -> stipple::Result<void> {
        for (uint64_t i = first; i < first + count; ++i) {
            const double n = static_cast<double>(part * kPoints + i) + 0.5;
            const double z = 1 - 2 * n / (kParts * kPoints), r = std::sqrt(1 - z * z), a = 2.399963229728653 * n;
            const double x = r * std::cos(a), y = r * std::sin(a);
            // (These are 500 km and more from the origin, in metres, as on a map: coordinates stay exact there.)
            to.position.push_back({500'000 + 10 * x, 5'200'000 + 10 * y, 400 + 10 * z});
            to.normal.push_back({static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)});
            to.colour.push_back({static_cast<uint8_t>(127 + 120 * x), static_cast<uint8_t>(127 + 120 * y), 160});
        }
        return {};
    };
    stipple::BuildSettings settings;
    settings.listener.progress = [](const stipple::Progress& p) {
        std::fprintf(stderr, "\r%3.0f %% %s", 100 * p.fraction, p.stage.c_str());
    };
    const auto built = stipple::buildPoints(ball, argv[1], settings);
    if (!built) return std::fprintf(stderr, "%s\n", built.error().line().c_str()), static_cast<int>(built.error().kind);
    const auto store = stipple::Store::open(argv[1]);
    if (!store) return std::fprintf(stderr, "%s\n", store.error().line().c_str()), static_cast<int>(store.error().kind);
    std::printf("%s: %llu points in %llu nodes, coordinates rounded by %g at most\n", argv[1],
                static_cast<unsigned long long>(store->primitives()), static_cast<unsigned long long>(store->nodes()),
                store->rounding());
    return 0;
}
