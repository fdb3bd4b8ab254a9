// Formulas of glass against the textbook, what files and stores say of it, and the sharp maps of environments.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/render/environment.h"
#include "engine/render/layers.h"
#include "engine/scene/scene.h"
#include "engine/scene/triangles.h"
#include "lod/store/description.h"
#include "shaders/shared/optics.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using glm::dvec3;

shared::vec3 narrow(const dvec3& v) { return glm::vec3(v); }
dvec3 wide(const shared::vec3& v) { return dvec3(v); }

/// Into the denser side or out of it, by the shared formulas.
dvec3 bent(const dvec3& d, const dvec3& n, double from, double to) {
    const auto c = static_cast<float>(-glm::dot(n, d)), eta = static_cast<float>(from / to);
    return wide(shared::bentRay(narrow(d), narrow(n), c, eta, shared::bentCosine2(c, eta)));
}

/// How far a slab of thickness 1 moves a ray aside, that comes at an angle.
double slabShift(double angle, double ior, double seemsIor) {
    const dvec3 n(0, 0, -1), d(std::sin(angle), 0, std::cos(angle));
    const dvec3 inside = bent(d, n, 1, seemsIor), out = bent(inside, n, ior, 1);
    const dvec3 exit = inside / inside.z;
    EXPECT_LT(glm::length(out - d), ior == seemsIor ? 1e-5 : 1.0);
    return glm::length(glm::cross(exit, d));
}

TEST(Optics, ASlabMovesRaysAside) {
    double worst = 0;
    for (const double ior : {1.1, 1.333, 1.5, 2.42})
        for (double angle = 0.01; angle < 1.5; angle += 0.05) {
            const double s = std::sin(angle);
            const double truth = s * (1 - std::cos(angle) / std::sqrt(ior * ior - s * s));
            worst = std::max(worst, std::abs(slabShift(angle, ior, ior) - truth));
            if (angle > 0.3) {
                EXPECT_GT(std::abs(slabShift(angle, ior, 1.3 * ior) - truth), 1e-3) << "the control";
            }
        }
    std::printf("slab of thickness 1: %.2g at most off\n", worst);
    EXPECT_LT(worst, 1e-5);
}

/// Of unpolarised light, without approximation.
double fresnel(double n1, double n2, double c) {
    const double k = 1 - n1 * n1 / (n2 * n2) * (1 - c * c);
    if (k < 0) return 1;
    const double t = std::sqrt(k), s = (n1 * c - n2 * t) / (n1 * c + n2 * t), p = (n1 * t - n2 * c) / (n1 * t + n2 * c);
    return 0.5 * (s * s + p * p);
}

TEST(Optics, GlassReflectsAllBeyondTheCriticalAngleAndNearlyAllBefore) {
    const double critical = std::sqrt(1 - 1 / (1.5 * 1.5));  // cosine
    const auto inside = [](double c) { return shared::fresnelBetween(1.5f, 1.0f, static_cast<float>(c)); };
    EXPECT_EQ(inside(critical - 1e-3), 1.0f);
    EXPECT_EQ(inside(0.05), 1.0f);
    const double before = critical + 1.4e-4;  // the thin side's cosine is 0.02
    EXPECT_GT(inside(before), 0.88f);
    EXPECT_NEAR(fresnel(1.5, 1, before), 0.89, 0.03);
    // The same formula with the denser side's cosine.
    const double wrong = 0.04 + 0.96 * std::pow(1 - before, 5);
    EXPECT_LT(wrong, 0.05) << "the control: 4 % is reflected where nearly all is";
    double worst = 0;
    for (double c = critical + 1e-4; c < 1; c += 0.001)
        worst = std::max(worst, std::abs(inside(c) - fresnel(1.5, 1, c)));
    for (double c = 0.001; c < 1; c += 0.001)
        worst =
            std::max(worst, std::abs(shared::fresnelBetween(1.0f, 1.5f, static_cast<float>(c)) - fresnel(1, 1.5, c)));
    std::printf("Schlick against Fresnel, both ways: %.3f at most off\n", worst);
    EXPECT_LT(worst, 0.06);
    // From outside both forms are one.
    for (double c = 0.01; c < 1; c += 0.01) {
        const auto cf = static_cast<float>(c);
        EXPECT_NEAR(shared::fresnelOutside({0.04f, 0.04f, 0.04f}, 1, 0, cf).x, shared::fresnelBetween(1, 1.5f, cf),
                    1e-6);
    }
}

// mix(mix(diffuse, through, transmission), metal, metallic), as the format says: the shares of all light add up to one
// but for what is reflected, whatever is half a metal.
TEST(Optics, SharesOfWhatIsPartlyMetalAreThoseOfTheFormat) {
    for (const float metallic : {0.0f, 0.25f, 0.5f, 1.0f})
        for (const float transmission : {0.0f, 0.4f, 1.0f}) {
            shared::Surface s{};
            s.colour = shared::vec3(0.9f, 0.5f, 0.2f);
            s.metallic = metallic;
            shared::Optic o{};
            o.transmission = transmission;
            o.straightOn = shared::vec3(0.05f, 0.05f, 0.05f);
            const shared::Surface opaque = shared::opaqueShare(s, o);
            const dvec3 diffuse = wide(opaque.colour) * (1.0 - double{opaque.metallic});
            const dvec3 mirror = wide(shared::straightOn(opaque)), colour = wide(s.colour);
            const double dielectric = 1 - double{metallic};
            EXPECT_LT(glm::length(diffuse - dielectric * (1.0 - transmission) * colour), 1e-6);
            EXPECT_LT(glm::length(mirror - (dielectric * dvec3(0.05) + double{metallic} * colour)), 1e-6);
            EXPECT_NEAR(double{shared::throughShare(s, o)}, dielectric * transmission, 1e-6);
        }
}

// As floats they were infinite, and infinitely much of a way of nothing is no number: black or white specks at edges.
TEST(Optics, TakeAllLightAwayAtOnceWithoutBeingInfinite) {
    lod::Optics o;
    o.attenuationDistance = 1e-40f;
    o.attenuationColour = {0.25f, 1, 0};
    for (const double scale : {1.0, 1e-6, 1e6}) {
        shared::Optic optic{};
        optic.absorption = glm::vec3(render::absorptionInWorld(o, scale));
        for (const float path : {0.0f, 1e-3f, 1e9f}) {
            const dvec3 left = wide(shared::absorbed(optic, path));
            EXPECT_EQ(left, path > 0 ? dvec3(0, 1, 0) : dvec3(1)) << path << ", " << scale;
        }
    }
    o.attenuationDistance = 2;
    EXPECT_NEAR(render::absorptionInWorld(o, 3).x * 6, std::log(4), 1e-12) << "a quarter is left after the distance";
}

TEST(Optics, AreKeptInStoresAndRefusedWhereImpossible) {
    lod::StoreDescription d;
    d.materials.resize(2);
    d.optics.resize(2);
    d.optics[0] = {0.9f, 1.33f, 0.5f, 2, {0.1f, 0.8f, 0.9f}, 0.7f, {1, 0.5f, 0.25f}};
    d.pointMaterials = {*lod::materialNamed("water"), *lod::materialNamed("metal")};
    const std::string text = lod::describeAsText(d);
    const lod::StoreDescription again = lod::descriptionFromText(text);
    EXPECT_EQ(again.optics, d.optics);
    EXPECT_EQ(again.pointMaterials, d.pointMaterials);
    const auto broken = [&](const std::string& from, const std::string& to) {
        std::string t = text;
        const size_t at = t.find(from);
        EXPECT_NE(at, std::string::npos);
        return t.replace(at, from.size(), to);
    };
    EXPECT_ANY_THROW(lod::descriptionFromText(broken("\"ior\":1.3", "\"ior\":0.3")));
    EXPECT_ANY_THROW(lod::descriptionFromText(broken("\"transmission\":0.", "\"transmission\":9.")));
    d.optics.pop_back();
    EXPECT_ANY_THROW(lod::descriptionFromText(lod::describeAsText(d))) << "fewer than materials";
    // What has none says nothing of it: such stores have the bytes that they had.
    d.optics.clear();
    d.pointMaterials = {*lod::materialNamed("metal")};
    EXPECT_EQ(lod::describeAsText(d).find("transmission"), std::string::npos);
}

TEST(Optics, AreReadFromGltfAndWritten) {
    const test::TempFolder folder;
    scene::Scene scene;
    scene.materials.resize(3);
    scene.materials[0].optics = {1, 1.33f, 0.25f, 0.5f, {0.2f, 0.9f, 0.8f}, 0.5f, {1, 0.75f, 0.5f}};
    scene.materials[1].optics.specular = 0.25f;
    scene::Primitive p;
    p.position = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    p.indices = {0, 1, 2};
    p.material = 0;
    scene.meshes.resize(1);
    scene.meshes[0].primitives = {p, p, p};
    scene.meshes[0].primitives[1].material = 1;
    scene.meshes[0].primitives[2].material = 2;
    scene.nodes.resize(1);
    scene.nodes[0].mesh = 0;
    ASSERT_TRUE(scene::writeGltf(scene, folder / "a.glb"));
    const auto read = scene::readGltf(folder / "a.glb");
    ASSERT_TRUE(read) << read.error().line();
    for (size_t m = 0; m < 3; ++m) EXPECT_EQ(read->materials.at(m).optics, scene.materials[m].optics) << m;
    EXPECT_TRUE(read->notes.empty());
    const std::vector<lod::Optics> optics = scene::surfaceOptics(*read, scene::placements(*read));
    ASSERT_EQ(optics.size(), 4u) << "and the one of what has no material";
    EXPECT_EQ(optics[0], scene.materials[0].optics);
    EXPECT_EQ(optics[3], optics[0]) << "no triangle has it";
    scene.materials.resize(3);
    for (scene::Material& m : scene.materials) m.optics = {};
    EXPECT_TRUE(scene::surfaceOptics(scene, scene::placements(scene)).empty());
}

TEST(Optics, WhatHardlyReflectsOtherwiseThanMostIsPlain) {
    lod::Optics o;
    EXPECT_TRUE(o.isPlain());
    o.ior = 1.45f;  // 0.034
    EXPECT_TRUE(o.isPlain());
    o.ior = 1.8f;  // 0.082
    EXPECT_FALSE(o.isPlain());
    EXPECT_NEAR(o.straightOn().x, 0.0816, 1e-4);
    o = {};
    o.specular = 0.5f;
    EXPECT_FALSE(o.isPlain());
    EXPECT_EQ(lod::opticsNamed("metal"), std::nullopt);
    for (const char* name : {"glass", "water"}) EXPECT_EQ(lod::opticsNamed(name)->transmission, 1) << name;
}

/// Light says where it comes from.
render::HdrImage directions(uint32_t width) {
    render::HdrImage image{width, width / 2, {}};
    for (uint32_t y = 0; y < image.height; ++y)
        for (uint32_t x = 0; x < width; ++x) {
            const double a = ((x + 0.5) / width - 0.5) * 2 * M_PI, e = (0.5 - (y + 0.5) / image.height) * M_PI;
            for (const double v : {std::sin(a) * std::cos(e), std::sin(e), -std::cos(a) * std::cos(e)})
                image.rgb.push_back(static_cast<float>(1 + 0.5 * v));
        }
    return image;
}

TEST(Optics, SharpMapsShowGridLinesAndAreThereOnlyForMirrors) {
    const auto executor = makeTbbExecutor(2);
    // Lines of one degree every ten.
    render::HdrImage grid = directions(4096);
    for (size_t i = 0; i < grid.rgb.size() / 3; ++i) {
        const double degrees = static_cast<double>(i % grid.width) * 360 / grid.width;
        const float v = std::fmod(degrees, 10) < 1 ? 1.0f : 0.0f;
        for (size_t k = 0; k < 3; ++k) grid.rgb[3 * i + k] = v;
    }
    const render::Environment plain = render::makeEnvironment(grid, 1, *executor),
                              sharp = render::makeEnvironment(grid, 1, *executor, true);
    EXPECT_EQ(plain.table.size(), size_t{shared::kEnvironmentFloats});
    EXPECT_EQ(plain.sharpEdge, 0u);
    EXPECT_EQ(sharp.sharpEdge, 2048u);
    EXPECT_TRUE(std::equal(plain.table.begin(), plain.table.end(), sharp.table.begin()));
    const auto contrast = [](const render::Environment& e) {
        double low = 0, high = 0;
        for (int k = 0; k < 36; ++k)
            for (const double off : {0.5, 5.5}) {
                const double a = ((k * 10 + off) / 360 - 0.5) * 2 * M_PI;
                const glm::dvec3 d(std::sin(a), 0, -std::cos(a));
                (off < 1 ? high : low) += shared::environmentMirror(e.table.data(), narrow(d), 0, e.sharpEdge).x / 36;
            }
        return high - low;
    };
    std::printf("contrast of lines of 1 degree: %.2f, without sharp maps %.2f\n", contrast(sharp), contrast(plain));
    EXPECT_GT(contrast(sharp), 0.98);
    EXPECT_LT(contrast(plain), 0.75) << "the control";
}

TEST(Optics, SharpMapsSayWhereLightComesFromWithinAFifthOfADegree) {
    const auto executor = makeTbbExecutor(2);
    const render::Environment e = render::makeEnvironment(directions(2048), 1, *executor, true);
    std::vector<double> off;
    for (int i = 0; i < 20'000; ++i) {
        const double z = 1 - (2 * i + 1) / 20'000.0, a = 2.399963229728653 * i, r = std::sqrt(1 - z * z);
        const dvec3 d(r * std::cos(a), z, r * std::sin(a));
        const dvec3 seen = (wide(shared::environmentMirror(e.table.data(), narrow(d), 0, e.sharpEdge)) - 1.0) * 2.0;
        off.push_back(std::atan2(glm::length(glm::cross(seen, d)), glm::dot(seen, d)) * 180 / M_PI);
    }
    std::sort(off.begin(), off.end());
    std::printf("direction by the sharp maps: p95 %.4f, most %.4f degrees\n", off[19'000], off.back());
    EXPECT_LT(off[19'000], 0.05);
    EXPECT_LT(off.back(), 0.2);
    // Between sharp maps and usual ones nothing jumps.
    const dvec3 d = glm::normalize(dvec3(0.3, 0.4, -0.8));
    for (const float r : {0.0625f, 0.125f, 0.1875f, 0.25f})
        EXPECT_LT(glm::length(wide(shared::environmentMirror(e.table.data(), narrow(d), r - 1e-5f, e.sharpEdge)) -
                              wide(shared::environmentMirror(e.table.data(), narrow(d), r + 1e-5f, e.sharpEdge))),
                  1e-3)
            << r;
}

}  // namespace
}  // namespace stipple
