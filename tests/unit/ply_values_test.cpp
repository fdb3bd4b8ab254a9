// What PLY files say in other types and units than most: colours of 16 bits and floats, normals of any length, meshes
// of any size.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "engine/cpu/cpu_backend.h"
#include "lod/import/import.h"
#include "lod/import/ply/mesh.h"
#include "lod/primitives/octahedral.h"
#include "tests/support/meshes.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

struct Colour {
    double r, g, b;
};

/// Three points, or a triangle of them, whose colours are written as they are.
void writeColours(const std::string& path, const char* type, const std::vector<Colour>& colours, bool isMesh) {
    std::ofstream out(path);
    out.precision(17);
    out << "ply\nformat ascii 1.0\nelement vertex " << colours.size()
        << "\nproperty float x\nproperty float y\nproperty float z\n";
    for (const char* channel : {"red", "green", "blue"}) out << "property " << type << ' ' << channel << '\n';
    if (isMesh) out << "element face 1\nproperty list uchar int vertex_indices\n";
    out << "end_header\n";
    for (size_t i = 0; i < colours.size(); ++i)
        out << i << ' ' << i * i << " 0 " << colours[i].r << ' ' << colours[i].g << ' ' << colours[i].b << '\n';
    if (isMesh) out << "3 0 1 2\n";
}

TEST(PlyValues, ColoursOfAnyTypeAreWhatTheyWereBeforeTheyWereWritten) {
    const test::TempFolder folder;
    const std::vector<std::array<uint32_t, 3>> bytes{{0, 128, 255}, {1, 2, 200}, {90, 17, 64}};
    for (const auto& [type, unit] : {std::pair{"uchar", 1.0},
                                     {"ushort", 1.0},
                                     {"ushort", 257.0},
                                     {"short", 1.0},
                                     {"int", 1.0},
                                     {"uint", 257.0},
                                     {"float", 1 / 255.0},
                                     {"float", 1.0},
                                     {"float", 257.0},
                                     {"double", 1 / 255.0},
                                     {"double", 1.0}})
        for (const bool isMesh : {false, true}) {
            std::vector<Colour> colours;
            for (const auto& [r, g, b] : bytes) colours.push_back({r * unit, g * unit, b * unit});
            writeColours(folder / "a.ply", type, colours, isMesh);
            std::vector<uint32_t> read;
            if (isMesh) {
                const auto source = lod::openPlyMesh(folder / "a.ply", 1 << 20, folder.path());
                ASSERT_TRUE(source) << source.error().line();
                for (const uint32_t c : test::collect(*source).colour) read.push_back(c & 0xffffffu);
            } else {
                const auto source = lod::openPointSource(folder / "a.ply");
                ASSERT_TRUE(source) << source.error().line();
                for (int again = 0; again < 2; ++again) {
                    read.clear();
                    ASSERT_TRUE(lod::readPoints(*source, [&](const lod::PointBlock& block) -> Result<void> {
                        read.insert(read.end(), block.colour.begin(), block.colour.end());
                        return {};
                    }));
                }
            }
            ASSERT_EQ(read.size(), 3u) << type;
            for (size_t i = 0; i < 3; ++i)
                EXPECT_EQ(read[i], bytes[i][0] | bytes[i][1] << 8 | bytes[i][2] << 16)
                    << type << " by " << unit << (isMesh ? ", a mesh" : ", points");
        }
}

TEST(PlyValues, ColoursThatAreNoNumbersAreBlackAndSpoilNoOthers) {
    const test::TempFolder folder;
    const double nan = std::nan(""), inf = INFINITY;
    for (const bool isMesh : {false, true}) {
        writeColours(folder / "a.ply", "double", {{nan, 0.5, 1e300}, {inf, -inf, 1}, {-5, 0, 1.2}}, isMesh);
        std::vector<uint32_t> read;
        if (isMesh) {
            for (const uint32_t c : test::collect(*lod::openPlyMesh(folder / "a.ply", 1 << 20, folder.path())).colour)
                read.push_back(c & 0xffffffu);
        } else {
            ASSERT_TRUE(lod::readPoints(*lod::openPointSource(folder / "a.ply"),
                                        [&](const lod::PointBlock& block) -> Result<void> {
                                            read.insert(read.end(), block.colour.begin(), block.colour.end());
                                            return {};
                                        }));
        }
        EXPECT_EQ(read, (std::vector<uint32_t>{128u << 8 | 255u << 16, 255u | 255u << 16, 255u << 16}));
    }
}

double degreesBetween(const glm::dvec3& a, const glm::dvec3& b) {
    return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b)) * 57.29577951308232;
}

/// A bumpy sphere as a mesh, `scale` wide; normals of that length, or none.
std::vector<glm::dvec3> writeSphere(const std::string& path, double scale, const char* type, double normalLength) {
    constexpr int kRings = 24, kSegments = 48;
    std::vector<glm::dvec3> places, normals;
    for (int r = 0; r <= kRings; ++r)
        for (int s = 0; s < kSegments; ++s) {
            const double t = 3.14159265358979 * r / kRings, p = 6.28318530717959 * s / kSegments;
            const glm::dvec3 n(std::sin(t) * std::cos(p), std::cos(t), std::sin(t) * std::sin(p));
            places.push_back(n * scale * (1 + 0.1 * std::sin(5 * p) * std::sin(t)));
            normals.push_back(n);
        }
    std::ofstream out(path);
    out.precision(17);
    out << "ply\nformat ascii 1.0\nelement vertex " << places.size()
        << "\nproperty double x\nproperty double y\nproperty double z\n";
    if (normalLength > 0)
        for (const char* n : {"nx", "ny", "nz"}) out << "property " << type << ' ' << n << '\n';
    out << "element face " << 2 * kRings * kSegments << "\nproperty list uchar int vertex_indices\nend_header\n";
    for (size_t i = 0; i < places.size(); ++i) {
        out << places[i].x << ' ' << places[i].y << ' ' << places[i].z;
        const glm::dvec3 n = normals[i] * normalLength;
        if (normalLength > 0) out << ' ' << n.x << ' ' << n.y << ' ' << n.z;
        out << '\n';
    }
    for (int r = 0; r < kRings; ++r)
        for (int s = 0; s < kSegments; ++s) {
            const int a = r * kSegments + s, b = r * kSegments + (s + 1) % kSegments;
            out << "3 " << a << ' ' << b << ' ' << a + kSegments << "\n3 " << b << ' ' << b + kSegments << ' '
                << a + kSegments << '\n';
        }
    return normals;
}

TEST(PlyValues, NormalsOfAnyLengthAreKept) {
    const test::TempFolder folder;
    for (const auto& [type, length] : {std::pair{"float", 1e-30},
                                       {"float", 1e-9},
                                       {"float", 1e12},
                                       {"float", 1e30},
                                       {"double", 1e-300},
                                       {"double", 1e-30},
                                       {"double", 1e30},
                                       {"double", 1e300}}) {
        const std::vector<glm::dvec3> truth = writeSphere(folder / "a.ply", 1, type, length);
        size_t seen = 0;
        const double given = length;
        ASSERT_TRUE(
            lod::readPoints(*lod::openPointSource(folder / "a.ply"), [&](const lod::PointBlock& block) -> Result<void> {
                for (const glm::vec3& n : block.normal) {
                    EXPECT_LT(degreesBetween(glm::dvec3(n), truth[seen]), 0.01) << given;
                    ++seen;
                }
                return {};
            }));
        EXPECT_EQ(seen, truth.size());
        const lod::TriangleMesh mesh = test::collect(*lod::openPlyMesh(folder / "a.ply", 1 << 20, folder.path()));
        ASSERT_FALSE(mesh.normal.empty());
        for (size_t i = 0; i < mesh.normal.size(); ++i) {
            // (The bumps are not in the normals that the file has.)
            glm::dvec3 outward = glm::normalize(mesh.position[i]);
            EXPECT_LT(degreesBetween(glm::dvec3(mesh.normal[i]), outward), 0.02) << length;
        }
    }
}

TEST(PlyValues, NormalsAndPicturesOfAMeshDoNotHangOnItsSize) {
    // Sizes are powers of two: then every number of the program is the same but for its exponent, and so is the
    // picture.
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    const auto backend = cpu::makeCpuBackend(*executor);
    lod::TriangleMesh first;
    std::array<std::vector<uint32_t>, 2> truth;
    for (const int octaves : {0, -50, -40, -30, -20, 20, 40, 50}) {
        writeSphere(folder / "a.ply", std::ldexp(1, octaves), "float", 0);
        const lod::TriangleMesh mesh = test::collect(*lod::openPlyMesh(folder / "a.ply", 1 << 20, folder.path()));
        if (octaves == 0) first = mesh;
        ASSERT_EQ(mesh.normal.size(), first.normal.size());
        for (size_t i = 0; i < mesh.normal.size(); ++i) {
            ASSERT_EQ(mesh.normal[i], first.normal[i]) << "2^" << octaves;
            ASSERT_GT(glm::length(mesh.normal[i]), 0.99f) << "2^" << octaves;
        }
        for (const bool isFlat : {true, false}) {
            lod::MeshBuildSettings settings;
            settings.description.source = "a.ply";
            settings.description.up = {0, 1, 0};
            lod::TriangleMesh copy = mesh;
            if (isFlat) copy.normal.clear();
            Progress silent(false);
            const std::string path = folder / ("a" + std::to_string(octaves) + (isFlat ? "f" : "") + ".stipple");
            const auto built = lod::buildMeshStore(lod::sourceOf(std::move(copy)), path, settings, *executor, silent);
            ASSERT_TRUE(built) << built.error().line();
            auto opened = lod::openStore(path);
            ASSERT_TRUE(opened) << opened.error().line();
            const auto store = std::make_shared<const lod::Store>(std::move(*opened));
            render::FrameSettings frame;
            frame.draw.lit = true;
            lod::View view = test::fitView(*store, 200, 150);
            view.nearPlane = std::ldexp(1e-6, octaves);
            const render::Image image = test::renderView(store, *backend, *executor, view, frame);
            if (octaves == 0) truth[isFlat ? 1 : 0] = image.rgba;
            size_t differing = 0;
            for (size_t i = 0; i < image.rgba.size(); ++i) differing += image.rgba[i] != truth[isFlat ? 1 : 0][i];
            EXPECT_EQ(differing, 0u) << "2^" << octaves << (isFlat ? ", flat" : "");
        }
    }
}

}  // namespace
}  // namespace stipple
