// OpenVDB files that OpenVDB wrote: their surfaces against spheres and tori that are known, points against what was
// written, and files that are not what they say.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>

#include "engine/base/rng.h"
#include "lod/import/import.h"
#include "lod/import/vdb/header.h"
#include "lod/import/vdb/vdb.h"
#include "tests/support/support.h"
#include "tests/support/vdb_files.h"

namespace stipple {
namespace {
namespace fs = std::filesystem;
using glm::dmat4;
using glm::dvec3;
using test::VdbField;

/// A shape by its signed distance, and the largest curvature of its surface.
struct Shape {
    std::function<double(const dvec3&)> distance;
    double curvature;
};
Shape sphere(double radius, const dvec3& centre) {
    return {[=](const dvec3& p) { return glm::length(p - centre) - radius; }, 1 / radius};
}
/// Around z through `centre`.
Shape torus(double radius, double tube, const dvec3& centre) {
    return {[=](const dvec3& p) {
                const dvec3 q = p - centre;
                return std::hypot(std::hypot(q.x, q.y) - radius, q.z) - tube;
            },
            1 / tube};
}

/// Three voxels to both sides; `half`: of the box that is looked at, voxels around `middle`.
VdbField fieldOf(const Shape& shape, const dmat4& worldFromVoxel, int half, double band,
                 const glm::ivec3& middle = glm::ivec3(0)) {
    VdbField f;
    f.value = shape.distance;
    f.worldFromVoxel = worldFromVoxel;
    f.least = middle - half;
    f.greatest = middle + half;
    f.band = band;
    return f;
}
dmat4 scaled(const dvec3& size, const dvec3& translation) {
    dmat4 m(1);
    for (int a = 0; a < 3; ++a) m[a][a] = size[a];
    m[3] = glm::dvec4(translation, 1);
    return m;
}

lod::TriangleMesh collect(const lod::MeshSource& source) {
    lod::TriangleMesh all;
    if (source.survey) {
        EXPECT_TRUE(source.survey([](uint64_t, uint64_t) { return Result<void>(); }));
    }
    const auto read = source.read([&](const lod::TriangleMesh& block) -> Result<void> {
        lod::append(all, block);
        return {};
    });
    EXPECT_TRUE(read);
    return all;
}

lod::TriangleMesh trianglesOf(const std::string& path, const lod::FormatOptions& more = {}) {
    const auto opened = lod::openMesh(path, more);
    EXPECT_TRUE(opened) << (opened ? "" : opened.error().line());
    return opened ? collect(opened->source) : lod::TriangleMesh{};
}

/// What `info` says of the only grid.
std::map<std::string, double> statedOf(const std::string& path) {
    std::map<std::string, double> numbers;
    const auto parts = lod::describeVdb(path, true, {});
    EXPECT_TRUE(parts) << (parts ? "" : parts.error().line());
    if (!parts) return numbers;
    for (const lod::Fact& fact : parts->at(0).facts) {
        if (const auto* d = std::get_if<double>(&fact.value)) numbers[fact.name] = *d;
        if (const auto* n = std::get_if<uint64_t>(&fact.value)) numbers[fact.name] = static_cast<double>(*n);
    }
    return numbers;
}

/// Largest distance of corners, middles of edges and places within from the shape.
double farthest(const lod::TriangleMesh& mesh, const Shape& shape) {
    double most = 0;
    for (size_t t = 0; t < mesh.indices.size(); t += 3) {
        const dvec3 a = mesh.position[mesh.indices[t]], b = mesh.position[mesh.indices[t + 1]],
                    c = mesh.position[mesh.indices[t + 2]];
        for (int i = 0; i <= 4; ++i)
            for (int j = 0; i + j <= 4; ++j)
                most = std::max(most, std::abs(shape.distance(a + (b - a) * (i / 4.0) + (c - a) * (j / 4.0))));
    }
    return most;
}

/// Vertices - edges + triangles; 0 where an edge has not two triangles that run along it in opposite directions.
int64_t eulerNumber(const lod::TriangleMesh& mesh) {
    std::map<std::array<double, 3>, uint32_t> places;
    std::vector<uint32_t> same;
    for (const dvec3& p : mesh.position)
        same.push_back(places.try_emplace({p.x, p.y, p.z}, static_cast<uint32_t>(places.size())).first->second);
    std::map<std::pair<uint32_t, uint32_t>, int> edges;
    for (size_t i = 0; i < mesh.indices.size(); ++i) {
        const uint32_t a = same[mesh.indices[i]], b = same[mesh.indices[i % 3 == 2 ? i - 2 : i + 1]];
        edges[{std::min(a, b), std::max(a, b)}] += a < b ? 1 : 1000;
    }
    for (const auto& [edge, uses] : edges)
        if (uses != 1001) return 0;
    return static_cast<int64_t>(places.size()) - static_cast<int64_t>(edges.size()) +
           static_cast<int64_t>(mesh.indices.size() / 3);
}
double volume(const lod::TriangleMesh& mesh, const dvec3& around) {
    double sum = 0;
    for (size_t t = 0; t < mesh.indices.size(); t += 3)
        sum +=
            glm::dot(mesh.position[mesh.indices[t]] - around, glm::cross(mesh.position[mesh.indices[t + 1]] - around,
                                                                         mesh.position[mesh.indices[t + 2]] - around)) /
            6;
    return sum;
}

// Between voxels h apart, a field of second derivatives up to k is off by h^2/8 times their sum, 2k at most, so that
// its zero crossing lies that far from the shape. Corners of triangles lie in the hull of places on it in one cell,
// sqrt(3) h wide; edges lead from one cell to the next, 2 sqrt(3) h at most: 3/8 h^2 k + 12/8 h^2 k.
double ofField(double h, const Shape& s) { return h * h * s.curvature / 4; }
double ofTriangles(double h, const Shape& s) { return 15.0 / 8 * h * h * s.curvature; }

TEST(Vdb, ASphereIsAsFarOffAsIsSaid) {
    const test::TempFolder folder;
    const double h = 0.08;
    const Shape shape = sphere(1, dvec3(0.013, 0.007, -0.01));
    for (const bool isDouble : {false, true}) {
        VdbField f = fieldOf(shape, scaled(dvec3(h), dvec3(0)), 16, 3 * h);
        f.isDouble = isDouble;
        test::writeVdb(folder / "sphere.vdb", {f});
        const lod::TriangleMesh mesh = trianglesOf(folder / "sphere.vdb");
        auto said = statedOf(folder / "sphere.vdb");
        const double is = farthest(mesh, shape);
        EXPECT_GT(mesh.indices.size(), 3000u);
        EXPECT_LE(is, said["deviation"] + ofField(h, shape));
        EXPECT_GE(is, said["deviation"] - ofField(h, shape));
        EXPECT_LE(said["deviation"], ofTriangles(h, shape) + ofField(h, shape));
        EXPECT_NEAR(said["in voxels"], said["deviation"] / h, 1e-9);
        EXPECT_EQ(said["not measured at"], 0);
        EXPECT_GT(said["measured at"], 5.0 * static_cast<double>(mesh.indices.size()) / 3);
        EXPECT_EQ(eulerNumber(mesh), 2);
        EXPECT_NEAR(volume(mesh, dvec3(0)), 4.0 / 3 * 3.14159265, 0.05);  // outwards
        for (size_t i = 0; i < mesh.position.size(); ++i) {
            const dvec3 n = glm::normalize(mesh.position[i] - dvec3(0.013, 0.007, -0.01));
            EXPECT_GT(glm::dot(n, glm::normalize(dvec3(mesh.normal[i]))), std::cos(0.03));
        }
    }
}

TEST(Vdb, AnUnevenTransformFarFromTheOriginKeepsItsPlaces) {
    const test::TempFolder folder;
    const dvec3 utm(500000.25, 5400000.5, 300), size(0.05, 0.04, 0.08);
    const Shape shape = torus(1, 0.4, utm);
    // In voxels, and the same with the coordinates of a map in voxels: beyond 2^24, where fp32 counts in steps of 4.
    for (const bool inVoxels : {false, true}) {
        const glm::ivec3 middle = inVoxels ? glm::ivec3(utm / size) : glm::ivec3(0);
        const dvec3 translation = utm - dvec3(middle) * size;
        test::writeVdb(folder / "torus.vdb", {fieldOf(shape, scaled(size, translation), 40, 3 * 0.08, middle)});
        const lod::TriangleMesh mesh = trianglesOf(folder / "torus.vdb");
        auto said = statedOf(folder / "torus.vdb");
        const double is = farthest(mesh, shape);
        EXPECT_LE(is, said["deviation"] + ofField(0.08, shape)) << inVoxels;
        EXPECT_GE(is, said["deviation"] - ofField(0.08, shape)) << inVoxels;
        EXPECT_LE(said["deviation"], ofTriangles(0.08, shape) + ofField(0.08, shape)) << inVoxels;
        EXPECT_GT(said["in voxels"], said["deviation"] / 0.08 * 0.99);
        EXPECT_LT(said["in voxels"], said["deviation"] / 0.04 * 1.01);
        ASSERT_GT(mesh.indices.size(), 0u);
        EXPECT_GT(volume(mesh, utm), 0);
        // The control: coordinates in fp32. (By way of memory: GCC 12 takes a vector's double to float to double for
        // nothing, and rounds z alone.)
        const std::vector<glm::vec3> rounded(mesh.position.begin(), mesh.position.end());
        lod::TriangleMesh coarse = mesh;
        coarse.position.assign(rounded.begin(), rounded.end());
        EXPECT_GT(farthest(coarse, shape), said["deviation"] + ofField(0.08, shape));
    }
}

TEST(Vdb, AMirroringTransformAndOneThatIsNotGiven) {
    const test::TempFolder folder;
    test::writeVdb(folder / "mirror.vdb", {fieldOf(sphere(1, dvec3(0)), scaled({-0.1, 0.1, 0.1}, dvec3(0)), 14, 0.3)});
    EXPECT_GT(volume(trianglesOf(folder / "mirror.vdb"), dvec3(0)), 4);
    test::writeVdb(folder / "plain.vdb", {fieldOf(sphere(10, dvec3(0)), dmat4(1), 14, 3)});
    EXPECT_LE(farthest(trianglesOf(folder / "plain.vdb"), sphere(10, dvec3(0))),
              ofTriangles(1, sphere(10, dvec3(0))) + ofField(1, sphere(10, dvec3(0))));
}

struct Discs {
    std::vector<dvec3> place;
    std::vector<glm::vec3> normal;
    std::vector<float> radius;
};
Discs discsOf(const std::string& path) {
    Discs out;
    const auto source = lod::openPointSource(path, {}, {.onlyPoints = true});
    EXPECT_TRUE(source) << (source ? "" : source.error().line());
    if (!source) return out;
    EXPECT_TRUE(source->info.hasNormal && source->info.hasRadius);
    EXPECT_TRUE(lod::readPoints(*source, [&](const lod::PointBlock& b) -> Result<void> {
        out.place.insert(out.place.end(), b.position.begin(), b.position.end());
        out.normal.insert(out.normal.end(), b.normal.begin(), b.normal.end());
        out.radius.insert(out.radius.end(), b.radius.begin(), b.radius.end());
        return {};
    }));
    return out;
}

TEST(Vdb, SurfelsLieOnTheSurfaceAndCloseIt) {
    const test::TempFolder folder;
    const double h = 0.1;
    const Shape shape = torus(1, 0.5, dvec3(0));
    test::writeVdb(folder / "torus.vdb", {fieldOf(shape, scaled(dvec3(h), dvec3(0)), 19, 3 * h)});
    const Discs discs = discsOf(folder / "torus.vdb");
    ASSERT_GT(discs.place.size(), 1000u);
    for (const dvec3& p : discs.place) EXPECT_LE(std::abs(shape.distance(p)), ofField(h, shape) + 1e-6);
    // Rays along the normal of places of the torus: how many miss every disc?
    const auto missed = [&](double share) {
        Rng rng(7);
        int misses = 0;
        for (int i = 0; i < 2000; ++i) {
            const double u = rng.uniform() * 6.2831853, v = rng.uniform() * 6.2831853;
            const dvec3 n(std::cos(v) * std::cos(u), std::cos(v) * std::sin(u), std::sin(v));
            const dvec3 p = dvec3(std::cos(u), std::sin(u), 0.0) + 0.5 * n;
            bool isHit = false;
            for (size_t d = 0; d < discs.place.size() && !isHit; ++d) {
                const dvec3 m = glm::normalize(dvec3(discs.normal[d]));
                const double along = glm::dot(discs.place[d] - p, m) / glm::dot(n, m);
                isHit = std::abs(along) < h && glm::length(p + along * n - discs.place[d]) <= share * discs.radius[d];
            }
            misses += isHit ? 0 : 1;
        }
        return misses;
    };
    EXPECT_EQ(missed(1), 0);
    EXPECT_GT(missed(0.5), 20);  // the control: smaller discs leave gaps
}

std::vector<test::VdbPoint> somePoints(size_t count, const dvec3& around) {
    Rng rng(3);
    std::vector<test::VdbPoint> points;
    for (size_t i = 0; i < count; ++i) {
        test::VdbPoint p{};
        p.place = around + dvec3(rng.uniform(), rng.uniform(), 0.3 * rng.uniform()) * 10.0;
        p.colour = {static_cast<float>(i % 7) / 7.0f, 0.5f, 1};
        p.normal = glm::normalize(glm::vec3(1, static_cast<float>(i % 5), 2));
        p.radius = 0.01f * static_cast<float>(1 + i % 3);
        p.intensity = static_cast<float>(i) * 0.25f;
        p.category = static_cast<int32_t>(i % 9) - 3;
        points.push_back(p);
    }
    return points;
}

struct ReadPoints {
    lod::SourceInfo info;
    lod::PointBlock all;
};
ReadPoints readAll(const std::string& path, const std::vector<std::string>& attributes) {
    ReadPoints out;
    const auto source = lod::openPointSource(path, {attributes, false});
    EXPECT_TRUE(source) << (source ? "" : source.error().line());
    if (!source) return out;
    out.info = source->info;
    out.all.attributes.resize(attributes.size());
    EXPECT_TRUE(lod::readPoints(*source, [&](const lod::PointBlock& b) -> Result<void> {
        out.all.position.insert(out.all.position.end(), b.position.begin(), b.position.end());
        out.all.colour.insert(out.all.colour.end(), b.colour.begin(), b.colour.end());
        out.all.normal.insert(out.all.normal.end(), b.normal.begin(), b.normal.end());
        out.all.radius.insert(out.all.radius.end(), b.radius.begin(), b.radius.end());
        for (size_t a = 0; a < attributes.size(); ++a)
            out.all.attributes[a].insert(out.all.attributes[a].end(), b.attributes[a].begin(), b.attributes[a].end());
        return {};
    }));
    return out;
}
template <typename T>
T valueAt(const std::vector<uint8_t>& bytes, size_t i) {
    T v = 0;
    std::memcpy(&v, bytes.data() + sizeof(T) * i, sizeof(T));
    return v;
}

TEST(Vdb, PointsKeepPlacesAndAttributes) {
    const test::TempFolder folder;
    const dvec3 utm(500000, 5400000, 300);
    const double voxel = 0.5, rounding = voxel * std::ldexp(1.0, -24);
    const auto points = somePoints(4000, utm);
    test::writeVdbPoints(folder / "scan.vdb", points, voxel, utm);
    const ReadPoints read = readAll(folder / "scan.vdb", {"class", "intensity"});
    ASSERT_EQ(read.all.position.size(), points.size());
    EXPECT_TRUE(read.info.hasColour && read.info.hasNormal && read.info.hasRadius);
    std::map<float, size_t> byIntensity;  // (they come voxel by voxel)
    for (size_t i = 0; i < points.size(); ++i) byIntensity[points[i].intensity] = i;
    for (size_t i = 0; i < points.size(); ++i) {
        const test::VdbPoint& p = points[byIntensity.at(valueAt<float>(read.all.attributes[1], i))];
        const dvec3 off = glm::abs(read.all.position[i] - p.place);
        EXPECT_LE(std::max({off.x, off.y, off.z}), rounding + 2e-9);  // (and that of fp64 at such coordinates)
        EXPECT_EQ(valueAt<double>(read.all.attributes[0], i), p.category);
        EXPECT_EQ(read.all.radius[i], p.radius);
        EXPECT_EQ(read.all.normal[i], p.normal);
        // Linear 0.5 is 188 of sRGB; 1 is 255.
        EXPECT_EQ(read.all.colour[i] >> 8, 188u | 255u << 8);
    }
}

TEST(Vdb, PointsGoOutAndComeBack) {
    const test::TempFolder folder;
    const dvec3 utm(500000, 5400000, 300);
    test::writeVdbPoints(folder / "scan.vdb", somePoints(3000, utm), 0.5, utm);
    auto source = lod::openPointSource(folder / "scan.vdb", {{"class", "intensity"}, false});
    ASSERT_TRUE(source);
    const double voxel = 0.25;
    const auto written = lod::writeVdbPoints(*source, folder / "again.vdb", voxel, {});
    ASSERT_TRUE(written) << written.error().line();
    const ReadPoints before = readAll(folder / "scan.vdb", {"class", "intensity"}),
                     after = readAll(folder / "again.vdb", {"class", "intensity"});
    ASSERT_EQ(after.all.position.size(), before.all.position.size());
    std::map<double, size_t> byIntensity;
    for (size_t i = 0; i < before.all.position.size(); ++i)
        byIntensity[static_cast<double>(valueAt<float>(before.all.attributes[1], i))] = i;
    for (size_t i = 0; i < after.all.position.size(); ++i) {
        const size_t j = byIntensity.at(valueAt<double>(after.all.attributes[1], i));
        const dvec3 off = glm::abs(after.all.position[i] - before.all.position[j]);
        EXPECT_LE(std::max({off.x, off.y, off.z}), voxel * std::ldexp(1.0, -24) + 2e-9);
        EXPECT_EQ(valueAt<double>(after.all.attributes[0], i), valueAt<double>(before.all.attributes[0], j));
        EXPECT_EQ(after.all.colour[i], before.all.colour[j]);
        EXPECT_EQ(after.all.normal[i], before.all.normal[j]);
        EXPECT_EQ(after.all.radius[i], before.all.radius[j]);
    }
    // The same points, the same bytes.
    ASSERT_TRUE(lod::writeVdbPoints(*source, folder / "twice.vdb", voxel, {}));
    EXPECT_EQ(test::slurp(folder / "again.vdb"), test::slurp(folder / "twice.vdb"));
}

TEST(Vdb, TrianglesGoOutAndComeBack) {
    const test::TempFolder folder;
    const dvec3 utm(500000, 5400000, 300);
    const Shape shape = torus(1, 0.4, utm);
    test::writeVdb(folder / "torus.vdb", {fieldOf(shape, scaled(dvec3(0.05), utm), 32, 0.15)});
    const double voxel = 0.04;
    const auto mesh = lod::openMesh(folder / "torus.vdb", {});
    ASSERT_TRUE(mesh);
    const auto written = lod::writeVdbMesh(mesh->source, folder / "again.vdb", voxel, {});
    ASSERT_TRUE(written) << written.error().line();
    std::map<std::string, double> said;
    for (const lod::Fact& fact : written->facts) {
        if (const auto* d = std::get_if<double>(&fact.value)) said[fact.name] = *d;
        if (const auto* n = std::get_if<uint64_t>(&fact.value)) said[fact.name] = static_cast<double>(*n);
    }
    EXPECT_EQ(said["lost places"], 0);
    EXPECT_EQ(said["open edges"], 0);
    // Edges of up to 2 sqrt(3) 0.05 meet at angles a of that times k, 0.43, and a field between voxels rounds a ridge
    // by tan(a/2)/2 of one, 0.11; twice that, as places are sought along the gradient.
    EXPECT_LE(said["in voxels"], 0.25);
    EXPECT_GT(said["in voxels"], 0);
    const lod::TriangleMesh before = collect(mesh->source), after = trianglesOf(folder / "again.vdb");
    auto second = statedOf(folder / "again.vdb");
    EXPECT_LE(farthest(after, shape), farthest(before, shape) + said["deviation"] + second["deviation"]);
    EXPECT_EQ(eulerNumber(after), eulerNumber(before));
    ASSERT_TRUE(lod::writeVdbMesh(mesh->source, folder / "twice.vdb", voxel, {}));
    EXPECT_EQ(test::slurp(folder / "again.vdb"), test::slurp(folder / "twice.vdb"));
}

TEST(Vdb, AFailedWriteLeavesTheFileThatWasThere) {
    const test::TempFolder folder;
    test::writeVdb(folder / "good.vdb", {fieldOf(sphere(1, dvec3(0)), scaled(dvec3(0.2), dvec3(0)), 9, 0.6)});
    const std::string good = test::slurp(folder / "good.vdb");
    lod::TriangleMesh open;  // a sheet encloses nothing
    open.position = {dvec3(0), dvec3(1, 0, 0), dvec3(0, 1, 0)};
    open.indices = {0, 1, 2};
    const auto written = lod::writeVdbMesh(lod::sourceOf(open), folder / "good.vdb", 0.05, {});
    ASSERT_FALSE(written);
    EXPECT_NE(written.error().line().find("encloses nothing"), std::string::npos) << written.error().line();
    EXPECT_EQ(test::slurp(folder / "good.vdb"), good);
    // Voxels so small that there is no memory for them: the figure is said.
    const auto mesh = lod::openMesh(folder / "good.vdb", {});
    ASSERT_TRUE(mesh);
    const auto fine = lod::writeVdbMesh(mesh->source, folder / "good.vdb", 1e-6, {});
    ASSERT_FALSE(fine);
    EXPECT_EQ(fine.error().kind, ErrorKind::budget) << fine.error().line();
    EXPECT_NE(fine.error().line().find("GiB"), std::string::npos) << fine.error().line();
    EXPECT_EQ(test::slurp(folder / "good.vdb"), good);
    EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1);
}

std::string refusal(const std::string& path, const lod::FormatOptions& more = {}) {
    const auto has = lod::hasMesh(path, more);
    if (has && !*has) return "points";
    if (!has) return has.error().line();
    const auto mesh = lod::openMesh(path, more);
    return mesh ? "triangles" : mesh.error().line();
}
bool says(const std::string& text, const std::vector<std::string>& words) {
    return std::all_of(words.begin(), words.end(),
                       [&](const std::string& w) { return text.find(w) != std::string::npos; });
}

TEST(Vdb, WhatIsNotDrawnIsRefusedByName) {
    const test::TempFolder folder;
    const Shape shape = sphere(1, dvec3(0));
    VdbField fog = fieldOf(shape, scaled(dvec3(0.2), dvec3(0)), 9, 0.6), plain = fog, surface = fog, second = fog;
    fog.name = "smoke";
    fog.gridClass = "fog volume";
    plain.name = "nothing";
    plain.gridClass = "unknown";
    second.name = "other";
    test::writeVdb(folder / "fog.vdb", {fog});
    EXPECT_TRUE(says(refusal(folder / "fog.vdb"), {"'smoke'", "fog volume", "make a level set"}))
        << refusal(folder / "fog.vdb");
    test::writeVdbVectors(folder / "vectors.vdb");
    EXPECT_TRUE(says(refusal(folder / "vectors.vdb"), {"'velocity'", "vec3s"})) << refusal(folder / "vectors.vdb");
    test::writeVdb(folder / "plain.vdb", {plain});
    EXPECT_TRUE(says(refusal(folder / "plain.vdb"), {"'nothing'", "--grid"})) << refusal(folder / "plain.vdb");
    EXPECT_EQ(refusal(folder / "plain.vdb", {.part = "nothing"}), "triangles");

    test::writeVdb(folder / "all.vdb", {fog, surface, second});
    const auto all = lod::openMesh(folder / "all.vdb", {}), one = lod::openMesh(folder / "all.vdb", {.part = "other"});
    ASSERT_TRUE(all && one);
    EXPECT_EQ(collect(all->source).indices.size(), 2 * collect(one->source).indices.size());
    EXPECT_EQ(all->notes.size(), 3u);
    EXPECT_TRUE(says(all->notes.back(), {"left out", "'smoke'"}));
    EXPECT_TRUE(says(refusal(folder / "all.vdb", {.part = "smoke"}), {"fog volume"}));
    EXPECT_TRUE(says(refusal(folder / "all.vdb", {.part = "none"}), {"'none'", "'smoke'", "'surface'", "'other'"}));
    test::writeVdb(folder / "empty.vdb", {});
    EXPECT_TRUE(says(refusal(folder / "empty.vdb"), {"no grid"}));
    VdbField nowhere = surface;
    nowhere.value = [](const dvec3&) { return 0.1; };
    test::writeVdb(folder / "nowhere.vdb", {nowhere});
    EXPECT_TRUE(says(refusal(folder / "nowhere.vdb"), {"no surface"})) << refusal(folder / "nowhere.vdb");
}

TEST(Vdb, GridsThatMemoryDoesNotHoldAreRefusedWithTheFigure) {
    const test::TempFolder folder;
    for (const bool hasCounts : {true, false}) {  // said by the file, or counted
        test::writeVdbBlock(folder / "block.vdb", 1000, hasCounts);
        EXPECT_LT(fs::file_size(folder / "block.vdb"), 10'000'000u);
        const std::string why = refusal(folder / "block.vdb");
        EXPECT_TRUE(says(why, {"1000000000 voxels", "11.2 GiB", "--memory"})) << why;
    }
    test::writeVdbBlock(folder / "small.vdb", 20, true);
    EXPECT_EQ(refusal(folder / "small.vdb"), "triangles");
}

TEST(Vdb, DamagedFilesAreErrorsAndNothingElse) {
    const test::TempFolder folder;
    test::writeVdb(folder / "good.vdb", {fieldOf(sphere(1, dvec3(0)), scaled(dvec3(0.1), dvec3(0)), 14, 0.3)});
    const std::string good = test::slurp(folder / "good.vdb"), bad = folder / "bad.vdb";
    for (size_t cut = 0; cut < good.size(); cut += cut < 700 ? 13 : good.size() / 40) {
        test::spit(bad, good.substr(0, cut));
        const std::string why = refusal(bad);
        EXPECT_TRUE(says(why, {"bad.vdb: "})) << cut << ": " << why;
        EXPECT_EQ(why.find('\n'), std::string::npos);
    }
    Rng rng(11);
    int read = 0, refused = 0;
    for (int i = 0; i < 24; ++i) {
        std::string bytes = good;
        const size_t begin = 600, count = i % 2 == 0 ? 1 : 16;  // (behind what the header's own test walks)
        for (size_t k = 0; k < count; ++k)
            bytes[begin + rng.below(bytes.size() - begin)] = static_cast<char>(rng.below(256));
        if (i % 3 == 0)  // a count of the tree, which OpenVDB believes
            for (size_t k = 0; k < 4; ++k) bytes[begin + rng.below(200) + k] = '\x7f';
        test::spit(bad, bytes);
        const std::string why = refusal(bad);
        (why == "triangles" ? read : refused) += 1;
        EXPECT_TRUE(why == "triangles" || says(why, {"bad.vdb"})) << why;
    }
    EXPECT_GT(refused, 0);
    // What promises more than there is in its header: counts and lengths.
    for (size_t at = 56; at < 600; at += 17) {
        std::string bytes = good;
        for (size_t k = 0; k < 4; ++k) bytes[at + k] = '\x7f';
        test::spit(bad, bytes);
        const std::string why = refusal(bad);
        EXPECT_TRUE(why == "triangles" || says(why, {"bad.vdb"})) << at << ": " << why;
    }
}

TEST(Vdb, TheProgramItselfDoesNotLinkOpenVdb) {
    // (It would cost every command its start.)
    const std::string program = test::slurp(STIPPLE_PROGRAM);
    EXPECT_EQ(program.find("libopenvdb.so"), std::string::npos);
    EXPECT_NE(test::slurp(fs::path(STIPPLE_PROGRAM).replace_filename("stipple_vdb")).find("libopenvdb.so"),
              std::string::npos);
}

}  // namespace
}  // namespace stipple
