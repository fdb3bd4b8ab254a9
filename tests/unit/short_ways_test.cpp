// Where nobody asks for more, frames go a shorter way: points that are not lit show their colours at once, depths and
// places are not made, texels are rounded without being packed. Pictures are those of the long way, to the last bit.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "engine/cpu/cpu_backend.h"
#include "shaders/shared/pack.h"
#include "tests/support/curves.h"
#include "tests/support/shapes.h"
#include "tests/support/support.h"
#include "tests/unit/kernel_formulas.h"

namespace stipple {
namespace {

using namespace shared;
using test::uniform;

/// Kernels that count the rows that go each way.
const cpu::Kernels* counted = nullptr;
size_t resolved = 0, shown = 0;
cpu::Kernels countingKernels(const cpu::Kernels& of) {
    counted = &of;
    cpu::Kernels table = of;
    table.resolveRow = [](const FrameConstants& f, const cpu::Tables& t, const cpu::ResolveInput& in, uint64_t* keys,
                          uint32_t x0, uint32_t y, uint32_t n, cpu::TexelRow& row, cpu::ClosedUpRow& closedUp,
                          float& largest, const cpu::SurfacePlanes& planes) {
        ++resolved;
        return counted->resolveRow(f, t, in, keys, x0, y, n, row, closedUp, largest, planes);
    };
    table.showPoints = [](const FrameConstants& f, const cpu::Tables& t, const cpu::BlockSource* blocks,
                          bool tellsSmooth, uint64_t* keys, uint32_t n, uint32_t nothing, uint32_t* rgba) {
        const cpu::RowContent content = counted->showPoints(f, t, blocks, tellsSmooth, keys, n, nothing, rgba);
        shown += content == cpu::RowContent::points ? 1 : 0;
        return content;
    };
    return table;
}

lod::View orthographic(lod::View view) {
    view.focalPixels /= glm::length(view.eye);
    view.isOrthographic = true;
    return view;
}

TEST(ShortWays, ShowWhatLongOnesShow) {
    const test::TempFolder folder;
    const auto executor = makeSerialExecutor();
    std::vector<test::TestPoint> points = test::bumpySphere(30'000, 1);
    Rng rng(7);
    for (test::TestPoint& p : points) p.colour = static_cast<uint32_t>(rng.below(1u << 24));
    test::writePly(folder / "a.ply", points);
    test::writePly(folder / "b.ply", points, false);
    lod::BuildSettings withoutNormals;
    withoutNormals.normals = lod::NormalsMode::none;
    withoutNormals.leafRecords = 512;
    test::build({folder / "b.ply"}, folder / "b.stipple", *executor, withoutNormals);
    const std::vector<std::shared_ptr<const lod::Store>> stores{
        test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor),
        std::make_shared<const lod::Store>(lod::openStore(folder / "b.stipple").value())};
    size_t kernelCount = 0, drawn = 0, wide = 0;
    const cpu::Kernels* const* const all = cpu::availableKernels(kernelCount);
    for (size_t k = 0; k < kernelCount; ++k)
        for (const auto& store : stores)
            for (const render::Mode mode : {render::Mode::surface, render::Mode::splat, render::Mode::points,
                                            render::Mode::ewa, render::Mode::pullpushExact, render::Mode::pullpush})
                for (const double tau : {1.0, 16.0})  // the latter: discs that mode surface smooths
                    for (const bool isLit : {false, true}) {
                        const cpu::Kernels kernels = countingKernels(*all[k]);
                        const auto backend = cpu::makeCpuBackend(*executor, &kernels);
                        const lod::View view = test::fitView(*store, 403, 301);
                        render::FrameSettings settings = test::drawnAs(mode, tau, isLit);
                        const render::Image longWay = test::renderView(store, *backend, *executor, view, settings);
                        settings.wantDepthAndNormal = false;
                        resolved = shown = 0;
                        const render::Image shortWay = test::renderView(store, *backend, *executor, view, settings);
                        const std::string what = fmt::format("{} {} tau {} lit {}", store->path,
                                                             render::reconstructionOf(mode).name, tau, isLit);
                        EXPECT_TRUE(longWay.rgba == shortWay.rgba) << what;
                        for (const uint32_t pixel : shortWay.rgba) drawn += pixel >> 24 != 0 ? 1 : 0;
                        const bool isShort = !isLit && mode != render::Mode::ewa && mode != render::Mode::pullpush;
                        const bool mayBeWide = mode == render::Mode::surface;  // some rows
                        if (!mayBeWide) EXPECT_EQ(shown > 0, isShort) << what;
                        if (isShort && !mayBeWide) EXPECT_EQ(resolved, 0u) << what;
                        wide += isShort && mayBeWide && resolved > 0 ? 1 : 0;
                        const lod::View flat = orthographic(view);
                        const render::Image flatShort = test::renderView(store, *backend, *executor, flat, settings);
                        settings.wantDepthAndNormal = true;
                        EXPECT_TRUE(test::renderView(store, *backend, *executor, flat, settings).rgba == flatShort.rgba)
                            << what << " orthographic";
                    }
    EXPECT_GT(drawn, 100'000u * kernelCount);
    EXPECT_GT(wide, 0u) << "rows of discs that are smoothed";
}

/// Of texels that are pushed into pictures nothing but colours is made where nobody asks for more.
TEST(ShortWays, PushColoursAloneAsWithTheRest) {
    const test::TempFolder folder;
    const auto executor = makeSerialExecutor();
    test::writePly(folder / "a.ply", test::bumpySphere(8'000, 3));
    test::Shapes shapes;
    shapes.square({0, 0, -1}, {1, 0, 0}, {0, 1, 0});
    shapes.ball({0.8, -0.5, 0.4}, 0.5);
    std::vector<render::PlacedStore> placed{
        {test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor), {}, {}},
        {test::buildCurves(test::curls({.count = 40, .radius = 0.06f}), folder / "b.stipple", *executor), {}, {}},
        {shapes.built(folder / "c.stipple", *executor), {}, {}}};
    placed[1].place.translation = {1.2, 0.4, 0};
    size_t kernelCount = 0, drawn = 0;
    const cpu::Kernels* const* const all = cpu::availableKernels(kernelCount);
    for (size_t k = 0; k < kernelCount; ++k)
        for (const size_t count : {size_t{1}, size_t{3}})  // points alone, or all kinds
            for (const bool isLit : {false, true})
                for (const bool isParallel : {false, true})
                    for (const uint32_t width : {1u, 15u, 257u}) {
                        const auto backend = cpu::makeCpuBackend(*executor, all[k]);
                        lod::View view = test::lookingAt({0.3, 0, 0}, {0, -4, 2}, isParallel);
                        view.width = width;
                        view.height = 131;
                        render::FrameSettings settings = test::drawnAs(render::Mode::pullpush, 4, isLit);
                        const std::vector<render::PlacedStore> some(placed.begin(), placed.begin() + long(count));
                        const render::Image longWay = test::draw(some, *backend, *executor, view, settings);
                        settings.wantDepthAndNormal = false;
                        const render::Image shortWay = test::draw(some, *backend, *executor, view, settings);
                        EXPECT_TRUE(longWay.rgba == shortWay.rgba)
                            << all[k]->name << " of " << count << " lit " << isLit << " parallel " << isParallel
                            << " width " << width;
                        for (const uint32_t pixel : shortWay.rgba) drawn += pixel >> 24 != 0 ? 1 : 0;
                    }
    EXPECT_GT(drawn, 20'000u * kernelCount);
}

TEST(ShortWays, EveryByteIsShownAsOutputShowsIt) {
    const cpu::Tables tables = cpu::makeTables();
    test::forKernels([&](const cpu::Kernels& k, const FrameConstants& f) {
        const auto row = std::make_unique<cpu::SurfaceRow>();
        std::vector<uint32_t> rgba(cpu::kTile);
        for (uint32_t first = 0; first < 256; first += cpu::kTile) {
            for (uint32_t i = 0; i < cpu::kTile; ++i) {
                const uint32_t byte = first + i,
                               packed = tables.red[byte] | tables.green[255 - byte] | tables.blue[byte];
                row->depth[i] = 1;
                row->red[i] = unpackRed(packed);
                row->green[i] = unpackGreen(packed);
                row->blue[i] = unpackBlue(packed);
            }
            k.outputRow(f, tables, cpu::kTile, *row, {rgba.data(), nullptr, nullptr, nullptr});
            for (uint32_t i = 0; i < cpu::kTile; ++i) {
                const uint32_t byte = first + i;
                EXPECT_EQ(rgba[i], tables.shownRed[byte] | tables.shownGreen[255 - byte] | tables.shownBlue[byte]);
            }
        }
    });
}

TEST(ShortWays, RoundedTexelsAreThoseThatWerePacked) {
    const cpu::Tables tables = cpu::makeTables();
    test::forKernels([&](const cpu::Kernels& k, FrameConstants f) {
        f.firstBlock.of[kKindCurves] = f.firstBlock.of[kKindTriangles] = f.firstBlock.of[kKindPatches] =
            f.firstBlock.of[kKindDiscs] = 1;
        Rng rng(3);
        const std::array<cpu::ResolveKind, kKindNothing> none{};
        double worst = 0;
        size_t compared = 0;
        for (int round = 0; round < 100; ++round) {
            const test::SomeShown of(rng, 0.8);
            const auto packed = std::make_unique<cpu::TexelRow>(), rounded = std::make_unique<cpu::TexelRow>();
            std::vector<uint32_t> words(size_t{6} * cpu::kTile);
            float largest = 0;
            const auto resolve = [&](bool rounds, cpu::TexelRow& row) {
                cpu::ResolveInput in{};
                in.blocks = &of.block;
                in.exactPoints = in.needsDepths = true;
                in.roundsPoints = rounds;
                in.ofKind = none.data();
                auto keys = of.keys;
                const auto closedUp = std::make_unique<cpu::ClosedUpRow>();
                ASSERT_TRUE(
                    k.resolveRow(f, tables, in, keys.data(), 200, 100, cpu::kTile, row, *closedUp, largest, {}));
                EXPECT_EQ(row.isRounded, rounds);
                for (const uint64_t key : keys) ASSERT_EQ(key, kNoKey);
            };
            resolve(false, *packed);
            resolve(true, *rounded);
            const auto plane = [&](size_t p) { return words.data() + p * cpu::kTile; };
            const cpu::Planes planes{
                reinterpret_cast<float*>(plane(0)), plane(1), plane(2), plane(3), plane(4), nullptr};
            k.packRow(*packed, cpu::kTile, planes);
            k.unpackRow(planes, cpu::kPad, cpu::kTile, ~0u, true, *packed);
            for (size_t i = cpu::kPad; i < cpu::kPad + cpu::kTile; ++i) {
                Texel t{};
                t.depth = packed->depth[i];
                t.radius = packed->radius[i];
                t.thickness = packed->thickness[i];
                t.offset = {packed->x[i], packed->y[i]};
                t.normalPerp = {packed->perpX[i], packed->perpY[i]};
                t.colour = {packed->red[i], packed->green[i], packed->blue[i]};
                worst = std::max(worst, test::farthest(*rounded, i, t));
                compared += t.depth > 0 ? 1 : 0;
            }
        }
        EXPECT_EQ(worst, 0);
        EXPECT_GT(compared, 5000u);
    });
}

}  // namespace
}  // namespace stipple
