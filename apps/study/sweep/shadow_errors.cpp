#include "apps/study/sweep/shadow_errors.h"

#include <algorithm>

#include "apps/study/audit/shadows.h"

namespace stipple::study {
namespace {

/// Of one light all, its light without shadows, and none of it.
enum class Of { all, open, dark };
render::DrawSettings settingsOf(const render::DrawSettings& scene, size_t light, Of of) {
    render::DrawSettings draw = scene;
    draw.effects.emplace_back("shadow");
    draw.lights[light].castsShadow = of == Of::all;
    if (of == Of::dark) draw.lights[light].colour = glm::vec3(0);
    return draw;
}

}  // namespace

Result<std::optional<LightTruth>> lightTruthOf(const render::DrawSettings& draw, const reference::FullScene& full,
                                               const lod::View& view, Executor& executor) {
    const std::vector<render::WorldLight>& lights = draw.lights;
    const auto casts = [](const render::WorldLight& l) { return l.castsShadow && l.kind != shared::kLightPoint; };
    const auto caster = std::find_if(lights.begin(), lights.end(), casts);
    if (caster == lights.end() || !draw.lit) return std::optional<LightTruth>();
    LightTruth truth;
    truth.light = static_cast<size_t>(caster - lights.begin());
    const auto traced = [&](Of of) { return full.trace(view, {1, settingsOf(draw, truth.light, of)}, executor); };
    STIPPLE_ASSIGN(const render::Image with, traced(Of::all));
    STIPPLE_ASSIGN(const render::Image dark, traced(Of::dark));
    STIPPLE_ASSIGN(truth.open, traced(Of::open));
    truth.shares = lightShares({with, truth.open, dark});
    return std::optional(std::move(truth));
}

Result<void> auditShadowsOf(SceneDrawer& drawer, const LightTruth& truth, const lod::View& view, const Cell& cell,
                            CellErrors& errors) {
    const render::DrawSettings scene = drawer.drawSettings();
    const auto drawn = [&](Of of) -> Result<render::Image> {
        drawer.setDrawSettings(settingsOf(scene, truth.light, of));
        STIPPLE_ASSIGN(const render::Image* image, drawer.draw(view, cell.mode, cell.target, cell.records));
        return *image;
    };
    const auto open = drawn(Of::open);
    const auto dark = open ? drawn(Of::dark) : open;
    const auto with = dark ? drawn(Of::all) : dark;
    drawer.setDrawSettings(scene);
    if (!with) return tl::unexpected(with.error());
    const std::vector<double> stated = statedBorders(drawer.state(), view, truth.open, scene.lights[truth.light]);
    const ShadowAudit audit = auditShadows(lightShares({*with, *open, *dark}), truth.shares, stated, view.width);
    errors.shadowPixels = static_cast<double>(audit.lookedAt);
    errors.shadowDark = static_cast<double>(audit.dark);
    errors.shadowWrong = static_cast<double>(audit.wrong);
    errors.shadowBeyond = static_cast<double>(audit.beyond);
    errors.shadowMost = audit.worst;
    errors.shadowStated = audit.stated;
    return {};
}

}  // namespace stipple::study
