#include "apps/study/sweep/shadow_errors.h"

#include "apps/study/audit/shadows.h"
#include "engine/reference/reference.h"
#include "engine/render/effects/table.h"

namespace stipple::study {
namespace {

using Lights = std::vector<render::WorldLight>;

/// The same lights, of which one casts no shadow, or gives no light.
Lights withoutShadow(Lights lights, size_t of) {
    lights[of].castsShadow = false;
    return lights;
}
Lights without(Lights lights, size_t of) {
    lights[of].castsShadow = false;
    lights[of].colour = glm::vec3(0);
    return lights;
}

}  // namespace

Result<std::optional<LightTruth>> lightTruthOf(const StudyScene& scene, const lod::View& view, Executor& executor) {
    const Lights& lights = scene.draw.lights;
    const auto casts = [](const render::WorldLight& l) { return l.castsShadow && l.kind != shared::kLightPoint; };
    const auto caster = std::find_if(lights.begin(), lights.end(), casts);
    if (caster == lights.end() || !scene.draw.lit || !render::isRequested("shadow", scene.draw))
        return std::optional<LightTruth>();
    LightTruth truth;
    truth.light = static_cast<size_t>(caster - lights.begin());
    const auto traced = [&](const Lights& lit) {
        reference::TraceSettings settings{1, scene.draw};
        settings.draw.lights = lit;
        return reference::trace(scene.placed, view, settings, executor);
    };
    STIPPLE_ASSIGN(const render::Image with, traced(lights));
    STIPPLE_ASSIGN(const render::Image dark, traced(without(lights, truth.light)));
    STIPPLE_ASSIGN(truth.open, traced(withoutShadow(lights, truth.light)));
    truth.shares = lightShares({with, truth.open, dark});
    return std::optional(std::move(truth));
}

Result<void> auditShadowsOf(SceneDrawer& drawer, const LightTruth& truth, const lod::View& view, const Cell& cell,
                            CellErrors& errors) {
    const Lights lights = drawer.lights();
    const auto drawn = [&](const Lights& lit) -> Result<render::Image> {
        drawer.setLights(lit);
        STIPPLE_ASSIGN(const render::Image* image, drawer.draw(view, cell.mode, cell.target, cell.records));
        return *image;
    };
    const auto open = drawn(withoutShadow(lights, truth.light));
    const auto dark = open ? drawn(without(lights, truth.light)) : open;
    const auto with = dark ? drawn(lights) : dark;
    drawer.setLights(lights);
    if (!with) return tl::unexpected(with.error());
    const std::vector<double> stated = statedBorders(drawer.state(), view, truth.open, lights[truth.light]);
    const ShadowAudit audit = auditShadows(lightShares({*with, *open, *dark}), truth.shares, stated, view.width);
    errors.shadowPixels = static_cast<double>(audit.lookedAt);
    errors.shadowWrong = static_cast<double>(audit.wrong);
    errors.shadowBeyond = static_cast<double>(audit.beyond);
    errors.shadowMost = audit.worst;
    errors.shadowStated = audit.stated;
    return {};
}

}  // namespace stipple::study
