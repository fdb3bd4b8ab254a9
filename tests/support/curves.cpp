#include "tests/support/curves.h"

#include <gtest/gtest.h>

#include <cmath>

namespace stipple::test {

lod::CurveSet curls(const CurlRecipe& recipe) {
    lod::CurveSet out;
    out.hasColour = true;
    Rng rng(recipe.seed);
    const auto direction = [&] { return glm::normalize(glm::dvec3(rng.normal(), rng.normal(), rng.normal())); };
    for (size_t s = 0; s < recipe.count; ++s) {
        const glm::dvec3 at(rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1)), axis = direction();
        const glm::dvec3 x = glm::normalize(glm::cross(axis, direction())), y = glm::cross(axis, x);
        const bool isRibbon = rng.uniform() < recipe.ribbons;
        const double width = rng.uniform(0.05, 0.2), turns = rng.uniform(1, 8), length = rng.uniform(0.2, 0.6);
        const uint32_t colour = 0x404040u + static_cast<uint32_t>(rng.uniform() * 0xbf) * 0x10000u +
                                static_cast<uint32_t>(rng.uniform() * 0xbf) * 0x100u +
                                static_cast<uint32_t>(rng.uniform() * 0xbf);
        for (size_t i = 0; i < recipe.vertices; ++i) {
            const double u = static_cast<double>(i) / static_cast<double>(recipe.vertices - 1);
            const double a = turns * u, t = recipe.twist * u;
            const glm::dvec3 out_ = x * std::cos(a) + y * std::sin(a);
            const auto taper = static_cast<float>(1 - 0.67 * std::abs(2 * u - 1));
            const glm::dvec3 normal = isRibbon ? out_ * std::cos(t) + axis * std::sin(t) : glm::dvec3(0);
            out.addVertex(at + axis * (length * (u - 0.5)) + out_ * width, recipe.radius * taper, glm::vec3(normal),
                          colour);
        }
        out.endCurve(isRibbon);
    }
    return lod::cleanCurves(std::move(out), 0);
}

lod::CurveSet oneCurve(const std::vector<glm::dvec3>& places, float radius, const std::vector<glm::vec3>& normals) {
    lod::CurveSet out;
    for (size_t i = 0; i < places.size(); ++i)
        out.addVertex(places[i], radius, normals.empty() ? glm::vec3(0) : normals[i], 0xb0b0b0);
    out.endCurve(!normals.empty());
    return lod::cleanCurves(std::move(out), 0);
}

std::shared_ptr<const lod::Store> buildCurves(const lod::CurveSet& curves, const std::string& path, Executor& executor,
                                              uint32_t leafSegments) {
    lod::CurveBuildSettings settings;
    settings.leafSegments = leafSegments;
    Progress progress(false);
    const auto built = lod::buildCurveStore(lod::sourceOf(curves), path, settings, executor, progress);
    EXPECT_TRUE(built) << (built ? "" : built.error().line());
    auto store = lod::openStore(path);
    EXPECT_TRUE(store) << (store ? "" : store.error().line());
    return store ? std::make_shared<const lod::Store>(std::move(*store)) : nullptr;
}

}  // namespace stipple::test
