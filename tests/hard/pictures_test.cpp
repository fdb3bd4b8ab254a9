// Pictures that hard cases spoil, by every backend: 9 (depths over many decades), 12 (grazing normals), 44
// (popping under motion below a pixel), 56 (lengths by squares), 23 (radii).
#include <algorithm>
#include <cmath>

#include "engine/render/reconstructions/table.h"
#include "tests/support/backends_here.h"
#include "tests/support/drawn_discs.h"
#include "tests/support/meshes.h"

namespace stipple {
namespace {

using glm::dvec3;

class HardPictures : public test::BackendsHere {
  protected:
    std::shared_ptr<const lod::Store> storeOf(const std::string& name, const std::vector<test::TestPoint>& points) {
        test::writePly(folder_ / (name + ".ply"), points, true, true);
        return test::buildAndOpen(folder_ / (name + ".ply"), folder_ / (name + ".stipple"), *executor_);
    }
};

/// Square, from the origin along -z.
lod::View ahead(uint32_t size, double focal, double nearPlane) {
    lod::View v;
    v.width = v.height = size;
    v.focalPixels = focal;
    v.nearPlane = nearPlane;
    return v;
}

/// A wall of discs at z = 0, facing +z.
std::vector<test::TestPoint> wall(uint32_t colour) {
    std::vector<test::TestPoint> all;
    for (int y = -8; y <= 8; ++y)
        for (int x = -8; x <= 8; ++x) all.push_back({{0.1 * x, 0.1 * y, 0}, {0, 0, 1}, colour, 0.09f});
    return all;
}

/// Of two walls so close together that only the last bits of a depth tell them apart the nearer one is seen, at any
/// distance. (Its instance comes last: were depths equal, the other one would be seen.)
TEST_F(HardPictures, OfTwoWallsAMillionthApartTheNearerIsSeenAtAnyDistance) {
    const auto red = storeOf("red", wall(0x0000ff)), green = storeOf("green", wall(0x00ff00));
    for (auto& [name, backend] : backends_)
        for (const render::Mode mode : {render::Mode::points, render::Mode::splat, render::Mode::pullpushExact})
            for (int decade = -2; decade <= 7; ++decade) {
                SCOPED_TRACE(name + " " + render::reconstructionOf(mode).name + " 1e" + std::to_string(decade));
                const double z = 1.7 * std::pow(10, decade);
                std::vector<render::PlacedStore> placed;
                for (const auto& [store, at] : {std::pair(green, z * (1 + 0x1p-20)), std::pair(red, z)}) {
                    lod::Instance place;
                    place.scale = z;
                    place.translation = {0, 0, -at};
                    placed.push_back({store, place, {}});
                }
                const render::Image image =
                    test::draw(placed, *backend, *executor_, ahead(64, 40, 1e-3 * z), test::drawnAs(mode, 1e-4, false));
                size_t nearer = 0, farther = 0;
                for (const uint32_t pixel : image.rgba) {
                    if (pixel >> 24 < 255) continue;
                    ++((pixel & 0xff) > 128 ? nearer : farther);
                }
                EXPECT_GT(nearer, mode == render::Mode::points ? 200u : 3'000u);
                EXPECT_EQ(farther, 0u);
            }
}

/// Discs seen at every slant down to none, from near and from far: depths are those of their planes, but for what fp32
/// can tell of places (2^-22 of the distance, at a slant as much longer), and nowhere beyond their discs.
TEST_F(HardPictures, DiscsAtGrazingAnglesAreAtTheDepthsOfTheirPlanes) {
    Rng rng(2);
    std::vector<test::TestPoint> points;
    const dvec3 eye(0, 0, 3);
    for (int i = 0; i < 400; ++i) {
        test::TestPoint p;
        p.position = {rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-0.5, 0.5)};
        const dvec3 v = glm::normalize(p.position - eye);
        const dvec3 across =
            glm::normalize(glm::cross(v, dvec3(rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1))));
        const double facing = -std::exp2(rng.uniform(-20, 0));
        p.normal = glm::vec3(facing * v + std::sqrt(1 - facing * facing) * across);
        p.radius = static_cast<float>(rng.uniform(0.05, 0.3));
        points.push_back(p);
    }
    const auto store = storeOf("grazing", points);
    const auto discs = test::leafDiscs(*store);
    ASSERT_EQ(discs.size(), points.size());
    constexpr uint32_t kSize = 128;
    for (auto& [name, backend] : backends_)
        for (const render::Mode mode : {render::Mode::splat, render::Mode::surface, render::Mode::pullpushExact})
            for (const double scale : {0.03, 1.0, 3e5}) {
                SCOPED_TRACE(testing::Message()
                             << name << " " << render::reconstructionOf(mode).name << " x " << scale);
                lod::Instance place;
                place.scale = scale;
                place.translation = dvec3(0, 0, -3 * scale);
                const lod::View view = ahead(kSize, 150, 1e-4 * scale);
                const render::Image image =
                    test::draw({{store, place, {}}}, *backend, *executor_, view, test::drawnAs(mode));
                std::vector<uint8_t> isKnown(image.depth.size(), 0), isCentre(image.depth.size(), 0);
                for (const reference::Disc& d : discs) {
                    const dvec3 c = (d.position - eye) / 1.0;
                    const double facing = std::abs(glm::dot(d.normal, glm::normalize(c)));
                    const double cx = 0.5 * kSize + 150 * c.x / -c.z, cy = 0.5 * kSize - 150 * c.y / -c.z;
                    const double slab = d.radius * std::sqrt(std::max(1 - d.normal.z * d.normal.z, 0.0));
                    // The pixel that holds a centre shows a disc that it may miss, no farther off than its rim.
                    if (cx >= 0 && cy >= 0 && cx < kSize && cy < kSize) {
                        const size_t i = static_cast<size_t>(cy) * kSize + static_cast<size_t>(cx);
                        const double z = double{image.depth[i]} / scale;
                        if (std::abs(z + c.z) <= slab * (1 + 1e-3) + 0x1p-22 * -c.z) isCentre[i] = 1;
                    }
                    for (size_t i = 0; i < image.depth.size(); ++i) {
                        const double z = double{image.depth[i]} / scale;
                        if (z <= 0 || isKnown[i] != 0) continue;
                        const dvec3 ray((static_cast<double>(i % kSize) + 0.5 - 0.5 * kSize) / 150,
                                        -(static_cast<double>(i / kSize) + 0.5 - 0.5 * kSize) / 150, -1);
                        const dvec3 off = z * ray - c;
                        const double rounding = 0x1p-22 * -c.z;
                        if (glm::length(off) > d.radius * (1 + 1e-3) + 4 * rounding / std::max(facing, 1e-9)) continue;
                        const double across = std::abs(glm::dot(d.normal, ray));
                        const double plane = glm::dot(d.normal, c) / glm::dot(d.normal, ray);
                        const double most = rounding + std::min(2 * slab, 4 * rounding / std::max(across, 1e-12));
                        isKnown[i] =
                            std::abs(z - plane) <= most || (most >= 2 * slab && std::abs(z + c.z) <= slab + rounding);
                    }
                }
                size_t drawn = 0, lost = 0;
                for (size_t i = 0; i < image.depth.size(); ++i) {
                    ASSERT_TRUE(std::isfinite(image.depth[i]));
                    drawn += image.depth[i] > 0;
                    lost += image.depth[i] > 0 && isKnown[i] == 0 && isCentre[i] == 0;
                }
                EXPECT_GT(drawn, 4'000u);
                EXPECT_LE(lost, drawn / 2000) << "of " << drawn;
            }
}

/// Triangles of any size have the normals of their shape: lengths that are zero or infinite as squares do not matter.
TEST_F(HardPictures, MeshesOfAnySizeAreShadedAlike) {
    std::map<double, std::shared_ptr<const lod::Store>> stores;
    for (const double size : {1.0, 1e-15, 1e-8, 1e8, 1e15}) {
        test::MeshRecipe recipe;
        recipe.grow = {"rock", 2'000, 1, 16};
        recipe.place = glm::dmat4(glm::dmat3(size));
        stores[size] =
            test::growMeshStore(recipe, folder_ / "rock.stipple" + std::to_string(stores.size()), *executor_);
    }
    for (auto& [name, backend] : backends_)
        for (const render::Mode mode : {render::Mode::surface, render::Mode::pullpush}) {
            const auto drawn = [&](double size) {
                lod::View view = ahead(96, 90, 1e-3 * size);
                view.eye = {0, 0, 3 * size};
                return test::renderView(stores.at(size), *backend, *executor_, view, test::drawnAs(mode));
            };
            const render::Image plain = drawn(1);
            for (const auto& [size, store] : stores) {
                SCOPED_TRACE(testing::Message() << name << " " << render::reconstructionOf(mode).name << " x " << size);
                const render::Image image = drawn(size);
                size_t covered = 0, apart = 0;
                for (size_t i = 0; i < image.depth.size(); ++i) {
                    const bool isIn = plain.depth[i] > 0, isHere = image.depth[i] > 0;
                    covered += isIn;
                    const auto normalOf = [i](const render::Image& of) {
                        return dvec3(of.normal[3 * i], of.normal[3 * i + 1], of.normal[3 * i + 2]);
                    };
                    const dvec3 n = normalOf(image);
                    if (isHere) ASSERT_NEAR(glm::length(n), 1, 1e-3);
                    apart += isIn != isHere || (isIn && glm::length(n - normalOf(plain)) > 0.01);
                }
                EXPECT_GT(covered, 2'000u);
                EXPECT_LE(apart, covered / 200);  // vertices are rounded to another lattice: edges by one pixel
            }
        }
}

/// Points of any size are drawn as they are at size 1, in every mode, down to the last bits: at 1e-20 the squares of
/// lengths are no floats any more.
TEST_F(HardPictures, PointsOfAnySizeAreDrawnAlike) {
    const auto ball = [&](double size) {
        std::vector<test::TestPoint> points = test::bumpySphere(600, 7);
        for (test::TestPoint& p : points) {
            p.position *= size;
            p.radius = static_cast<float>(0.1 * size);
        }
        return storeOf("ball" + std::to_string(std::ilogb(size)), points);
    };
    // By powers of two, so that nothing is rounded.
    std::map<double, std::shared_ptr<const lod::Store>> stores;
    for (const double size : {1.0, 0x1p-100, 0x1p-66, 0x1p66, 0x1p100}) stores[size] = ball(size);
    for (auto& [name, backend] : backends_)
        for (const render::Reconstruction& r : render::reconstructions()) {
            const auto drawn = [&](double size, bool isOrthographic) {
                lod::View view = ahead(64, 60, 1e-3 * size);
                view.eye = {0, 0, 3 * size};
                if (isOrthographic) view.focalPixels = 20 / size;
                view.isOrthographic = isOrthographic;
                return test::renderView(stores.at(size), *backend, *executor_, view, test::drawnAs(r.mode));
            };
            for (const bool isOrthographic : {false, true}) {
                const render::Image plain = drawn(1, isOrthographic);
                for (const auto& [size, store] : stores) {
                    SCOPED_TRACE(testing::Message() << name << " " << r.name << " x " << size << " " << isOrthographic);
                    const render::Image image = drawn(size, isOrthographic);
                    size_t covered = 0, apart = 0;
                    for (size_t i = 0; i < image.rgba.size(); ++i) {
                        covered += plain.rgba[i] >> 24 != 0;
                        apart += image.rgba[i] != plain.rgba[i] ||
                                 std::abs(image.depth[i] / size - plain.depth[i]) > 1e-5 * plain.depth[i];
                    }
                    EXPECT_GT(covered, r.mode == render::Mode::points ? 100u : 1'000u);
                    EXPECT_EQ(apart, 0u);
                }
            }
        }
}

/// A point that stands alone, or some in one place, are as wide as the radii that their file gives, whatever they span.
TEST_F(HardPictures, ALonePointIsAsWideAsItsRadius) {
    for (const size_t count : {1, 5}) {
        std::vector<test::TestPoint> points(count);
        for (size_t i = 0; i < count; ++i) {
            points[i].position = dvec3(0.5, -0.25, 3) + dvec3(1e-6 * static_cast<double>(i), 0, 0);
            points[i].normal = {0, 0, 1};
            points[i].radius = 0.5f;
        }
        const auto store = storeOf("lone" + std::to_string(count), points);
        for (auto& [name, backend] : backends_)
            for (const render::Mode mode : {render::Mode::surface, render::Mode::splat, render::Mode::pullpush}) {
                SCOPED_TRACE(testing::Message() << count << " " << name << " " << render::reconstructionOf(mode).name);
                lod::View view = ahead(64, 64, 1e-3);
                view.eye = {0.5, -0.25, 7};  // a unit is 16 px
                const render::Image image = test::renderView(store, *backend, *executor_, view, test::drawnAs(mode));
                const auto covered = static_cast<double>(
                    std::count_if(image.rgba.begin(), image.rgba.end(), [](uint32_t p) { return p >> 24 >= 128; }));
                // Radii are stored by sixteenths of an octave, outwards; ellipses end within half a pixel.
                const double wide = std::exp2(1.0 / 16) * 8;
                EXPECT_GE(covered, M_PI * 7.5 * 7.5);
                EXPECT_LE(covered, M_PI * (wide + 0.5) * (wide + 0.5));
            }
    }
}

/// A plane whose colours change smoothly, while the camera pans by a sixteenth of a pixel a frame: how far each change
/// is from the truth's, on average over pixels (ALGORITHMS 4). The worst frame is much better than that of a pyramid
/// that is anchored to the screen, which moves by whole pixels.
TEST_F(HardPictures, PansBelowAPixelChangeThePictureEvenly) {
    Rng rng(4);
    constexpr uint32_t kSize = 96;
    constexpr double kFocal = 100, kWave = 12;  // px
    const auto shadeAt = [](double x) { return 0.5 + 0.3 * std::sin(2 * M_PI * x * kFocal / kWave); };
    std::vector<test::TestPoint> points;
    for (int y = -40; y <= 40; ++y)
        for (int x = -40; x <= 40; ++x) {
            test::TestPoint p;
            p.position = dvec3(x + rng.uniform(-0.3, 0.3), y + rng.uniform(-0.3, 0.3), 0) * (1.5 / kFocal);
            p.normal = {0, 0, 1};
            p.radius = static_cast<float>(1.5 / kFocal);
            p.colour = static_cast<uint32_t>(std::lround(255 * shadeAt(p.position.x))) * 0x010101u;
            points.push_back(p);
        }
    const auto store = storeOf("plane", points);
    for (auto& [name, backend] : backends_)
        for (const render::Reconstruction& r : render::reconstructions()) {
            SCOPED_TRACE(name + " " + r.name);
            constexpr int kFrames = 20;
            // By what the camera has moved at a frame, px: with it, or to the next whole pixel.
            const auto worstOf = [&](bool isAnchored) {
                std::vector<double> before;
                double worst = 0;
                for (int f = 0; f < kFrames; ++f) {
                    const double moved = f / 16.0;
                    lod::View view = ahead(kSize, kFocal, 1e-3);
                    view.eye = {(isAnchored ? std::round(moved) : moved) / kFocal, 0, 1};
                    const render::Image image =
                        test::renderView(store, *backend, *executor_, view, test::drawnAs(r.mode, 1e-4, false));
                    std::vector<double> now;  // less the truth
                    for (uint32_t y = 16; y < kSize - 16; ++y)
                        for (uint32_t x = 16; x < kSize - 16; ++x)
                            now.push_back((image.rgba[y * kSize + x] & 0xff) -
                                          255 * shadeAt((x + 0.5 - 0.5 * kSize + moved) / kFocal));
                    double sum = 0;
                    for (size_t i = 0; i < before.size(); ++i) sum += std::abs(now[i] - before[i]);
                    worst = std::max(worst, sum / static_cast<double>(now.size()));
                    before = std::move(now);
                }
                return worst;
            };
            const double moving = worstOf(false), anchored = worstOf(true);
            std::printf("%s %s: %.2f of 255, by whole pixels %.2f\n", name.c_str(), r.name, moving, anchored);
            EXPECT_LE(moving, 0.5 * anchored);
        }
}

}  // namespace
}  // namespace stipple
