#include "tests/support/patch_shapes.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

namespace stipple::test {
namespace {

constexpr double kTurn = 6.283185307179586;

std::vector<size_t> anyOrder(size_t count, Rng& rng) {
    std::vector<size_t> order(count);
    std::iota(order.begin(), order.end(), size_t{0});
    for (size_t k = count; k > 1; --k) std::swap(order[k - 1], order[rng.below(k)]);
    return order;
}

}  // namespace

lod::TriangleMesh sheet(uint32_t across, uint32_t along, const std::function<glm::dvec3(double, double)>& place) {
    lod::TriangleMesh mesh;
    for (uint32_t j = 0; j <= along; ++j)
        for (uint32_t i = 0; i <= across; ++i) mesh.position.push_back(place(double(i) / across, double(j) / along));
    for (uint32_t j = 0; j < along; ++j)
        for (uint32_t i = 0; i < across; ++i) {
            const uint32_t a = j * (across + 1) + i, b = a + 1, c = a + across + 1, d = c + 1;
            mesh.indices.insert(mesh.indices.end(), {a, b, d, a, d, c});
        }
    return mesh;
}

lod::TriangleMesh torusMesh(uint32_t around, uint32_t across) {
    return sheet(around, across, [&](double u, double v) {
        // The last row is the first one, to the bit.
        const double a = kTurn * (u == 1 ? 0 : u), b = kTurn * (v == 1 ? 0 : v), r = 1 + 0.4 * std::cos(b);
        return glm::dvec3(r * std::cos(a), r * std::sin(a), 0.4 * std::sin(b));
    });
}

lod::TriangleMesh boxMesh(uint32_t cells) {
    lod::TriangleMesh mesh;
    for (int axis = 0; axis < 3; ++axis)
        for (int side = 0; side < 2; ++side) {
            const lod::TriangleMesh face = sheet(cells, cells, [&](double u, double v) {
                glm::dvec3 p;
                p[axis] = side;
                p[(axis + 1) % 3] = side == 1 ? u : v;
                p[(axis + 2) % 3] = side == 1 ? v : u;
                return p;
            });
            const auto first = static_cast<uint32_t>(mesh.position.size());
            mesh.position.insert(mesh.position.end(), face.position.begin(), face.position.end());
            for (const uint32_t i : face.indices) mesh.indices.push_back(first + i);
        }
    return mesh;
}

lod::TriangleMesh shuffled(const lod::TriangleMesh& mesh, uint64_t seed) {
    Rng rng(seed);
    lod::TriangleMesh out;
    const std::vector<size_t> order = anyOrder(mesh.position.size(), rng);
    std::vector<uint32_t> number(order.size());
    for (size_t k = 0; k < order.size(); ++k) {
        out.position.push_back(mesh.position[order[k]]);
        if (!mesh.uv.empty()) out.uv.push_back(mesh.uv[order[k]]);
        if (!mesh.colour.empty()) out.colour.push_back(mesh.colour[order[k]]);
        if (!mesh.surface.empty()) out.surface.push_back(mesh.surface[order[k]]);
        if (!mesh.normal.empty()) out.normal.push_back(mesh.normal[order[k]]);
        number[order[k]] = static_cast<uint32_t>(k);
    }
    for (const size_t t : anyOrder(mesh.indices.size() / 3, rng)) {
        const uint64_t first = rng.below(3);
        for (size_t k = 0; k < 3; ++k) out.indices.push_back(number[mesh.indices[3 * t + (k + first) % 3]]);
    }
    return out;
}

lod::PointBlock shuffled(const lod::PointBlock& points, uint64_t seed) {
    Rng rng(seed);
    lod::PointBlock out;
    for (const size_t i : anyOrder(points.position.size(), rng)) {
        out.position.push_back(points.position[i]);
        if (!points.colour.empty()) out.colour.push_back(points.colour[i]);
        if (!points.normal.empty()) out.normal.push_back(points.normal[i]);
    }
    return out;
}

std::vector<Triangle> trianglesOf(const lod::TriangleMesh& mesh) {
    std::vector<Triangle> out;
    for (size_t t = 0; t + 2 < mesh.indices.size(); t += 3)
        out.push_back(
            {mesh.position[mesh.indices[t]], mesh.position[mesh.indices[t + 1]], mesh.position[mesh.indices[t + 2]]});
    return out;
}

std::vector<Triangle> trianglesOf(const lod::Patch& patch, const glm::dvec3& middle) {
    std::vector<Triangle> out;
    const lod::PatchSurface surface(patch);
    surface.triangles([&](size_t a, size_t b, size_t c) {
        out.push_back({middle + surface.position(a), middle + surface.position(b), middle + surface.position(c)});
    });
    return out;
}

std::vector<Triangle> trianglesOf(const lod::PatchSet& set) {
    std::vector<Triangle> out;
    for (const lod::Patch& patch : set.patches) {
        const std::vector<Triangle> own = trianglesOf(patch, set.middle);
        out.insert(out.end(), own.begin(), own.end());
    }
    for (const auto& gap : set.gaps) {
        Triangle t;
        for (size_t k = 0; k < 3; ++k)
            t.at(k) = set.middle + lod::PatchSurface(set.patches[gap.at(k).patch]).position(gap.at(k).sample);
        out.push_back(t);
    }
    return out;
}

void writeObj(const std::string& path, const lod::TriangleMesh& mesh) {
    std::string text;
    for (const glm::dvec3& p : mesh.position) text += fmt::format("v {:.17g} {:.17g} {:.17g}\n", p.x, p.y, p.z);
    for (size_t t = 0; t + 2 < mesh.indices.size(); t += 3)
        text += fmt::format("f {} {} {}\n", mesh.indices[t] + 1, mesh.indices[t + 1] + 1, mesh.indices[t + 2] + 1);
    spit(path, text);
}

lod::PatchSet patchesOf(const lod::TriangleMesh& mesh, const lod::PatchSettings& settings, int threads) {
    const auto executor = makeTbbExecutor(threads);
    Progress progress(ProgressStyle::silent);
    return lod::patchesOfMesh(mesh, settings, *executor, progress);
}
lod::PatchSet patchesOf(const lod::PointBlock& points, const lod::PatchSettings& settings, int threads) {
    const auto executor = makeTbbExecutor(threads);
    Progress progress(ProgressStyle::silent);
    return lod::patchesOfPoints(points, settings, *executor, progress);
}

}  // namespace stipple::test
