#include "apps/study/sweep/plan.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <numeric>

#include "engine/base/hash.h"
#include "engine/base/rng.h"

namespace stipple::study {

std::vector<Cell> cellsOf(const std::vector<StudyScene>& scenes, const StudySettings& settings) {
    std::vector<Cell> cells;
    for (uint32_t scene = 0; scene < scenes.size(); ++scene)
        for (uint32_t size = 0; size < settings.sizes.size(); ++size)
            for (uint32_t view = 0; view < scenes[scene].views.size(); ++view) {
                for (const render::Mode mode : settings.modes)
                    for (const double target : settings.targets) cells.push_back({scene, size, view, mode, target});
                for (const uint64_t records : settings.budgets)
                    cells.push_back({scene, size, view, settings.modes.front(), settings.targets.front(), records});
            }
    return cells;
}

size_t cellsOfView(const StudySettings& settings) {
    return settings.modes.size() * settings.targets.size() + settings.budgets.size();
}

std::vector<uint32_t> orderOf(size_t cells, uint32_t block, uint64_t seed) {
    std::vector<uint32_t> order(cells);
    std::iota(order.begin(), order.end(), 0u);
    Rng rng(seed + 0x9e3779b97f4a7c15ull * (block + 1));
    for (size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[rng.below(i)]);
    return order;
}

lod::View viewOf(const StudyScene& scene, const glm::uvec2& size, uint32_t view) {
    return scene::makeView(scene.views[view].camera, size.x, size.y, scene.nearPlane);
}

lod::View smallViewOf(const StudyScene& scene, const glm::uvec2& size, uint32_t view, uint32_t height) {
    const uint32_t h = std::min(height, size.y), w = std::max(1u, static_cast<uint32_t>(uint64_t{size.x} * h / size.y));
    return scene::makeView(scene.views[view].camera, w, h, scene.nearPlane);
}

std::string describePlan(const std::vector<StudyScene>& scenes, const StudySettings& settings) {
    std::string text;
    for (const StudyScene& s : scenes) {
        text += fmt::format("scene {} {}\n", s.name, hexDigits(s.hash));
        if (!s.against.empty())
            text += fmt::format("against {}\n",
                                hexDigits(hashBytes(s.against.data(), s.against.size() * sizeof(FullTriangle))));
        for (const PathView& v : s.views)
            text += fmt::format("view {} {} {} {} {} {} {} {} {} {} {} {} {}\n", v.path, v.number, v.camera.eye.x,
                                v.camera.eye.y, v.camera.eye.z, v.camera.target.x, v.camera.target.y, v.camera.target.z,
                                v.camera.up.x, v.camera.up.y, v.camera.up.z, v.camera.fovDegrees, v.camera.orthoWidth);
    }
    for (const glm::uvec2& size : settings.sizes) text += fmt::format("size {} {}\n", size.x, size.y);
    for (const render::Mode mode : settings.modes)
        text += fmt::format("mode {}\n", render::reconstructionOf(mode).name);
    text += fmt::format("budgets {}\n", fmt::join(settings.budgets, " "));
    text += fmt::format("targets {}\nblocks {} frames {} samples {} small {} shapes {} seed {} resident {}\n",
                        fmt::join(settings.targets, " "), settings.blocks, settings.frames, settings.samples,
                        settings.smallHeight, settings.auditShapes, settings.seed, settings.residentBytes);
    return text;
}

}  // namespace stipple::study
