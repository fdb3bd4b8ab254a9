#include "engine/render/frame_passes.h"

#include "engine/render/effects/table.h"

namespace stipple::render {

std::vector<Pass> passesOf(Mode mode, const FrameContent& content, EffectSet ofFrame) {
    const Reconstruction& r = reconstructionOf(mode);
    std::vector<Pass> passes{Pass::clear};
    const auto addPoints = [&] {
        if (!content.hasPoints) return;
        passes.push_back(r.points);
        if (content.hasWideDiscs && r.hasPyramid) passes.push_back(Pass::discs);
    };
    if (!r.pointsAreLast) addPoints();
    if (content.hasStrands) passes.push_back(Pass::strands);
    if (content.hasTriangles) passes.push_back(Pass::rasterise);
    if (r.pointsAreLast) addPoints();
    passes.push_back(Pass::resolve);
    // Triangles keep their exact pixels: only splats are reconstructed.
    if (r.hasPyramid && (content.hasPoints || content.hasStrands)) {
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

}  // namespace stipple::render
