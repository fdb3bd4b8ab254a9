#include "engine/render/frame_passes.h"

#include "engine/render/effects/table.h"
#include "engine/render/kinds/kind.h"

namespace stipple::render {

std::vector<Pass> passesOf(Mode mode, const FrameContent& content, EffectSet ofFrame) {
    const Reconstruction& r = reconstructionOf(mode);
    std::vector<Pass> passes{Pass::clear};
    bool isReconstructed = false;
    const auto addPoints = [&] {
        passes.push_back(r.points);
        if (content.hasWideDiscs && r.hasPyramid) passes.push_back(Pass::discs);
    };
    if (r.smoothsSplats && content.has(lod::Kind::points) && content.hasSmoothDiscs) passes.push_back(Pass::smooth);
    forEachKind([&](lod::Kind kind) {
        if (!content.has(kind)) return;
        const DrawnKind& drawn = drawnKind(kind);
        isReconstructed = isReconstructed || drawn.isReconstructed;
        if (drawn.pass)
            passes.push_back(*drawn.pass);
        else if (!r.pointsAreLast)
            addPoints();
    });
    if (r.pointsAreLast && content.has(lod::Kind::points)) addPoints();
    passes.push_back(Pass::resolve);
    // Other kinds keep their exact pixels.
    if (r.hasPyramid && isReconstructed) {
        passes.push_back(Pass::pull);
        passes.push_back(Pass::push);
    }
    passes.push_back(Pass::surface);
    for (const Stage stage : {Stage::surface, Stage::light, Stage::lit})
        for (size_t e = 0; e < effects().size(); ++e)
            if (ofFrame.has(e) && effects()[e]->stage == stage)
                passes.insert(passes.end(), effects()[e]->passes.begin(), effects()[e]->passes.end());
    passes.push_back(Pass::output);
    return passes;
}

std::vector<Pass> passesOfCasters(const FrameContent& content) {
    std::vector<Pass> passes = passesOf(kCasterMode, content, {});
    passes.back() = Pass::cast;
    return passes;
}

}  // namespace stipple::render
