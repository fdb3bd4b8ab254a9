// Materials of elevation patches in pictures: what is lit as the oracle lights it, however patches are drawn.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/reference/reference.h"
#include "lod/primitives/patch_samples.h"
#include "lod/store/materials.h"
#include "tests/support/against_oracle.h"
#include "tests/support/glass.h"
#include "tests/support/patch_scene.h"

namespace stipple {
namespace {

using test::PatchScene;

const std::vector<lod::PointMaterial> kList{{1, 0}, {0.35f, 0}, {0.3f, 1}, {0, 1}};

/// A bent patch with bands of all materials, a few samples wide.
lod::Patch banded() {
    lod::Patch p = test::patchOfHeights(61, 57, [](double x, double y) { return 0.3 * x * x - 0.2 * y * y; });
    p.materials.assign(p.heights.size(), 0);
    for (size_t s = 0; s < p.heights.size(); ++s) p.materials[s] = static_cast<uint8_t>(s % p.width / 6 % kList.size());
    return p;
}

class PatchMaterials : public test::AgainstOracle {
  protected:
    std::shared_ptr<const render::Environment> light_ = std::make_shared<const render::Environment>(
        render::makeEnvironment(test::directionLight(512), 1, *executor_, true));

    render::DrawSettings settings(uint32_t as) const {
        render::DrawSettings s;
        s.patchAs = as;
        s.lit = true;
        s.worldUp = {0, 1, 0};
        s.environment = light_;
        return s;
    }
};

TEST_F(PatchMaterials, OfSamplesAreThoseOfTheOracle) {
    PatchScene scene({banded()}), matte({banded()});
    scene.setMaterials(kList);
    for (const bool isOrthographic : {false, true})
        for (const uint32_t as : {shared::kPatchStrips, shared::kPatchSplats, lod::kPatchesAsSamples}) {
            const lod::View view = test::glassView({0.5, 1.4, 2.4}, 240, isOrthographic);
            const render::Image expected = scene.draw(*oracle_, view, render::Mode::ewa, settings(as));
            for (const auto& [name, backend] : backends_) {
                const render::Image image = scene.draw(*backend, view, render::Mode::ewa, settings(as));
                EXPECT_GE(likeness(image, expected), 50) << name << ", as " << as << ", " << isOrthographic;
                EXPECT_LT(likeness(matte.draw(*backend, view, render::Mode::ewa, settings(as)), expected), 30)
                    << "the control: without materials";
            }
        }
}

// On a plane direct interpolation is correct, but for discs that reach beyond the border.
TEST_F(PatchMaterials, OfDirectSplatsAreThoseOfCorrectOnesOnAPlane) {
    lod::Patch plane = test::patchOfHeights(61, 57, [](double, double) { return 0; });
    plane.materials = banded().materials;
    std::fill(plane.colours.begin(), plane.colours.end(), 0x208040);  // (of mixed colours the two mix others)
    PatchScene scene({plane}), matte({plane});
    scene.setMaterials(kList);
    const lod::View view = test::glassView({0, 0.2, 2.6}, 240);
    for (const auto& [name, backend] : backends_) {
        const auto drawn = [&](PatchScene& of, uint32_t as) {
            return of.draw(*backend, view, render::Mode::ewa, settings(as));
        };
        const render::Image correct = drawn(scene, shared::kPatchSplats);
        const double direct = likeness(drawn(scene, shared::kPatchDirect), correct);
        EXPECT_GT(direct, 30) << name;
        EXPECT_GT(direct, likeness(drawn(matte, shared::kPatchDirect), correct) + 6) << name;
    }
}

// One for all of the store, and one for all of the picture instead of what samples have.
TEST_F(PatchMaterials, OfTheStoreAndOfThePictureAreOnAllSamples) {
    const lod::View view = test::glassView({0.5, 1.4, 2.4}, 240);
    lod::Patch plain = banded();
    plain.materials.clear();
    for (const auto& [name, backend] : backends_)
        for (const uint32_t as : {shared::kPatchStrips, shared::kPatchSplats, lod::kPatchesAsSamples}) {
            PatchScene store({plain}), samples({banded()});
            store.setMaterials({{0, 1}});
            samples.setMaterials(kList);
            const render::Image ofStore = store.draw(*backend, view, render::Mode::ewa, settings(as));
            render::DrawSettings asked = settings(as);
            asked.pointMaterial = lod::packed({0, 1});
            EXPECT_EQ(samples.draw(*backend, view, render::Mode::ewa, asked).rgba, ofStore.rgba) << name << as;
            EXPECT_NE(samples.draw(*backend, view, render::Mode::ewa, settings(as)).rgba, ofStore.rgba) << name << as;
        }
}

}  // namespace
}  // namespace stipple
