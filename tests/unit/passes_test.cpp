// The passes that a frame has, by its reconstruction and by what it calls for.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "engine/render/effects/table.h"
#include "engine/render/frame_passes.h"
#include "engine/render/shadow_frame.h"

namespace stipple::render {
namespace {

std::vector<FrameContent> allContents() {
    std::vector<FrameContent> out;
    for (uint32_t kinds = 0; kinds < 1u << lod::kKinds; ++kinds)
        for (const bool hasWideDiscs : {false, true})
            for (const bool hasSmoothDiscs : {false, true}) out.push_back({kinds, hasWideDiscs, hasSmoothDiscs});
    return out;
}
/// None, all, each alone, and every two of them together: with the others and without.
std::vector<EffectSet> allSets() {
    std::vector<EffectSet> out{{}, allEffects()};
    for (size_t a = 0; a < effects().size(); ++a)
        for (size_t b = a; b < effects().size(); ++b) {
            EffectSet two;
            two.add(a);
            two.add(b);
            out.push_back(two);
            out.push_back({allEffects().bits & ~two.bits});
        }
    return out;
}
bool has(const std::vector<Pass>& passes, Pass pass) {
    return std::find(passes.begin(), passes.end(), pass) != passes.end();
}

TEST(Passes, ReadNothingThatNobodyWrote) {
    for (const Reconstruction& r : reconstructions())
        for (const FrameContent& content : allContents())
            for (const EffectSet set : allSets()) {
                Planes written;
                const std::vector<Pass> passes = passesOf(r.mode, content, set);
                for (const Pass pass : passes) {
                    const PassInfo& info = passInfo(pass);
                    for (uint32_t p = 0; p <= static_cast<uint32_t>(Plane::image); ++p) {
                        const auto plane = static_cast<Plane>(p);
                        // Backends read the levels above the first only where push ran (Frames, Gpu: nothing of those
                        // before).
                        if (plane == Plane::coarse && pass == Pass::surface && !has(passes, Pass::push)) continue;
                        if (plane == Plane::smooth && !has(passes, Pass::smooth)) continue;
                        if (plane == Plane::shadows && !has(passes, Pass::shadow)) continue;  // all light comes there
                        if (plane == Plane::filtered && !has(passes, Pass::ewa)) continue;    // so are blended pixels
                        if (plane == Plane::mirrored && !has(passes, Pass::reflection)) continue;  // nothing is added
                        if (plane == Plane::behind && !has(passes, Pass::background)) continue;    // it is one colour
                        if (info.reads.has(plane))
                            EXPECT_TRUE(written.has(plane)) << r.name << ": " << info.name << " reads " << p;
                    }
                    written.bits |= info.writes.bits;
                }
                EXPECT_TRUE(written.has(Plane::image)) << r.name;
            }
}

TEST(Passes, AreThereOnlyWhereTheFrameCallsForThem) {
    for (const Reconstruction& r : reconstructions())
        for (const FrameContent& c : allContents()) {
            const std::vector<Pass> passes = passesOf(r.mode, c, {});
            EXPECT_EQ(std::set<Pass>(passes.begin(), passes.end()).size(), passes.size());
            const bool hasPoints = c.has(lod::Kind::points), hasCurves = c.has(lod::Kind::curves);
            EXPECT_EQ(has(passes, Pass::rasterise), c.has(lod::Kind::triangles));
            EXPECT_EQ(has(passes, Pass::curves), hasCurves);
            EXPECT_EQ(has(passes, r.points), hasPoints);
            EXPECT_EQ(has(passes, Pass::push), r.hasPyramid && (hasPoints || hasCurves));
            EXPECT_EQ(has(passes, Pass::discs), r.hasPyramid && hasPoints && c.hasWideDiscs);
            EXPECT_EQ(has(passes, Pass::smooth), r.smoothsSplats && hasPoints && c.hasSmoothDiscs);
            EXPECT_EQ(passes.back(), Pass::output);
            // Tiles of discs are nobody else's while they are drawn: all other visibility is there before.
            const auto at = [&](Pass pass) { return std::find(passes.begin(), passes.end(), pass) - passes.begin(); };
            for (const Pass before : {Pass::curves, Pass::rasterise})
                for (const Pass tiles : {Pass::splat, Pass::ewa, Pass::exact})
                    if (has(passes, tiles) && has(passes, before)) EXPECT_LT(at(before), at(tiles));
        }
}

TEST(Passes, OfAnEffectAreThereOnlyWithTheEffect) {
    for (const Reconstruction& r : reconstructions())
        for (const FrameContent& content : allContents()) {
            const std::vector<Pass> plain = passesOf(r.mode, content, {});
            for (const EffectSet set : allSets()) {
                std::vector<Pass> passes = passesOf(r.mode, content, set);
                size_t of = 0;
                for (size_t e = 0; e < effects().size(); ++e)
                    for (const Pass pass : effects()[e]->passes) {
                        EXPECT_EQ(has(passes, pass), set.has(e)) << effects()[e]->name;
                        std::erase(passes, pass);
                        of += set.has(e);
                        // Between what makes surfaces and what shows them.
                        EXPECT_FALSE(has(plain, pass));
                    }
                EXPECT_EQ(passes, plain) << "nothing else changes";
                EXPECT_EQ(plain.size() + of, passesOf(r.mode, content, set).size());
            }
        }
}

TEST(Passes, OfCastersEndWithWhatTheLightMeets) {
    for (const FrameContent& content : allContents()) {
        std::vector<Pass> passes = passesOfCasters(content), plain = passesOf(kCasterMode, content, {});
        EXPECT_EQ(passes.back(), Pass::cast);
        passes.pop_back();
        plain.pop_back();
        EXPECT_EQ(passes, plain);
    }
}

TEST(Passes, ModesAreFoundByTheirNames) {
    std::set<std::string> names;
    for (const Reconstruction& r : reconstructions()) {
        EXPECT_TRUE(names.insert(r.name).second);
        EXPECT_EQ(reconstructionNamed(r.name), &r);
        EXPECT_EQ(reconstructionOf(r.mode).name, r.name);
    }
    EXPECT_EQ(reconstructionNamed("splatt"), nullptr);
    Mode mode = reconstructions().front().mode;
    for (size_t i = 0; i < reconstructions().size(); ++i) mode = nextMode(mode);
    EXPECT_EQ(mode, reconstructions().front().mode) << "around";
}

}  // namespace
}  // namespace stipple::render
