#include "tests/support/meshes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "engine/scene/triangles.h"
#include "lod/store/mesh_place.h"

namespace stipple::test {

lod::TriangleMesh collect(const lod::MeshSource& source) {
    EXPECT_TRUE(source.survey(tellNobody));
    lod::TriangleMesh out;
    EXPECT_TRUE(source.read([&](const lod::TriangleMesh& block) -> Result<void> {
        lod::append(out, block);
        return {};
    }));
    return out;
}

lod::TriangleMesh growTriangles(const MeshRecipe& recipe, lod::MeshBuildSettings& settings) {
    scene::Scene scene = grow::growMesh(recipe.grow);
    if (!recipe.isTextured)
        for (scene::Material& m : scene.materials) m.baseColourTexture = m.normalTexture = {};
    for (scene::Material& m : scene.materials) m.isDoubleSided = recipe.isTwoSided;
    if (!recipe.isTextured) scene.textures.clear();
    scene.images.resize(scene.textures.size());
    scene.nodes[0].local = recipe.place;
    settings.description.source = recipe.grow.kind;
    settings.description.up = {0, 1, 0};
    settings.description.materials = scene::surfaceMaterials(scene);
    settings.description.optics = scene::surfaceOptics(scene, scene::placements(scene));
    settings.textures = scene::textureImages(scene);
    if (recipe.isTextured) {
        const grow::Textures t = grow::growTextures(recipe.grow);
        for (const auto& [index, pixels] : {std::pair{size_t{0}, &t.colour}, {size_t{1}, &t.normal}}) {
            settings.textures[index].width = settings.textures[index].height = pixels->size;
            settings.textures[index].rgba = pixels->rgba;
        }
    }
    return collect(scene::triangleSource(scene, scene::placements(scene)));
}

std::shared_ptr<const lod::Store> growMeshStore(const MeshRecipe& recipe, const std::string& path, Executor& executor) {
    lod::MeshBuildSettings settings;
    lod::TriangleMesh mesh = growTriangles(recipe, settings);
    Progress progress(false);
    const auto built = lod::buildMeshStore(lod::sourceOf(std::move(mesh)), path, settings, executor, progress);
    if (!built) throw std::runtime_error(built.error().line());
    auto store = lod::openStore(path);
    if (!store) throw std::runtime_error(store.error().line());
    return std::make_shared<const lod::Store>(std::move(*store));
}

namespace {

void append(const lod::Store& store, uint32_t node, const lod::Chunk& chunk, uint32_t first, uint32_t count,
            std::vector<Triangle>& out) {
    const lod::Hierarchy& h = store.hierarchy;
    for (uint32_t c = first; c < first + count; ++c)
        for (uint32_t t = 0; t < chunk.clusters[c].counts >> 16; ++t) {
            Triangle corners;
            for (uint32_t k = 0; k < 3; ++k) {
                const uint32_t corner = chunk.triangles[chunk.clusters[c].firstTriangle + t] >> (8 * k) & 255u;
                corners.at(k) = h.origin + h.unit * lod::vertexPlace(h.nodes[node], chunk, chunk.clusters[c], corner);
            }
            out.push_back(corners);
        }
}

lod::Chunk chunkOf(const lod::Store& store, uint32_t node) {
    auto chunk = lod::readChunk(store, node);
    if (!chunk) throw std::runtime_error(chunk.error().line());
    return std::move(*chunk);
}

}  // namespace

glm::dvec3 closestPlace(const Triangle& t, const glm::dvec3& p) {
    // The plane's point if it lies inside, else the nearest of the edges' points.
    const glm::dvec3 n = glm::cross(t[1] - t[0], t[2] - t[0]);
    const double n2 = glm::dot(n, n);
    if (n2 > 0) {
        const glm::dvec3 q = p - n * (glm::dot(p - t[0], n) / n2);
        bool isIn = true;
        for (size_t k = 0; k < 3; ++k)
            isIn = isIn && glm::dot(glm::cross(t.at((k + 1) % 3) - t.at(k), q - t.at(k)), n) >= 0;
        if (isIn) return q;
    }
    glm::dvec3 best = t[0];
    for (size_t k = 0; k < 3; ++k) {
        const glm::dvec3 d = t.at((k + 1) % 3) - t.at(k);
        const double s = std::clamp(glm::dot(p - t.at(k), d) / std::max(glm::dot(d, d), 1e-300), 0.0, 1.0);
        const glm::dvec3 q = t.at(k) + s * d;
        if (glm::length(q - p) < glm::length(best - p)) best = q;
    }
    return best;
}

std::vector<Triangle> leafTriangles(const lod::Store& store) {
    std::vector<Triangle> out;
    const lod::Hierarchy& h = store.hierarchy;
    for (uint32_t n = 0; n < h.nodes.size(); ++n) {
        const lod::Chunk chunk = chunkOf(store, n);
        for (uint32_t r = 0; r < h.groups[n].runs; ++r) {
            const lod::MeshRun& run = h.runs[h.groups[n].firstRun + r];
            if (run.producer == lod::MeshRun::kOriginal) append(store, n, chunk, run.firstCluster, run.clusters, out);
        }
    }
    return out;
}

std::vector<Triangle> drawnTriangles(const lod::Store& store, const std::vector<lod::CutMeshDraw>& draws) {
    std::vector<Triangle> out;
    for (const lod::CutMeshDraw& d : draws)
        append(store, d.node, chunkOf(store, d.node), d.firstCluster, d.clusters, out);
    return out;
}

double largestDistance(const std::vector<Triangle>& from, const std::vector<Triangle>& to, size_t samples,
                       uint64_t seed) {
    // Triangles by the cells of a grid that their boxes touch.
    glm::dvec3 lo(1e300), hi(-1e300);
    double longest = 0;
    for (const Triangle& t : to)
        for (size_t k = 0; k < 3; ++k) {
            lo = glm::min(lo, t.at(k));
            hi = glm::max(hi, t.at(k));
            longest += glm::length(t.at(k) - t.at((k + 1) % 3)) / static_cast<double>(3 * to.size());
        }
    const double cell = std::max(longest, glm::length(hi - lo) / 200);
    const auto cellOf = [&](const glm::dvec3& p) { return glm::ivec3(glm::floor((p - lo) / cell)); };
    std::map<std::array<int, 3>, std::vector<uint32_t>> grid;
    for (uint32_t i = 0; i < to.size(); ++i) {
        const glm::ivec3 a = cellOf(glm::min(to[i][0], glm::min(to[i][1], to[i][2]))),
                         b = cellOf(glm::max(to[i][0], glm::max(to[i][1], to[i][2])));
        for (int z = a.z; z <= b.z; ++z)
            for (int y = a.y; y <= b.y; ++y)
                for (int x = a.x; x <= b.x; ++x) grid[{x, y, z}].push_back(i);
    }
    const auto distance = [&](const glm::dvec3& p) {
        const glm::ivec3 c = cellOf(p);
        double best = 1e300;
        for (int r = 0; (r - 1) * cell < best && r < 400; ++r)
            for (int z = c.z - r; z <= c.z + r; ++z)
                for (int y = c.y - r; y <= c.y + r; ++y)
                    for (int x = c.x - r; x <= c.x + r; ++x) {
                        if (std::max({std::abs(x - c.x), std::abs(y - c.y), std::abs(z - c.z)}) != r) continue;
                        const auto found = grid.find({x, y, z});
                        if (found == grid.end()) continue;
                        for (const uint32_t i : found->second)
                            best = std::min(best, glm::length(closestPlace(to[i], p) - p));
                    }
        return best;
    };
    double worst = 0;
    Rng rng(seed);
    for (size_t s = 0; s < samples; ++s) {
        const Triangle& t = from[static_cast<size_t>(rng.uniform() * static_cast<double>(from.size()))];
        double u = rng.uniform(), v = rng.uniform();
        if (u + v > 1) {
            u = 1 - u;
            v = 1 - v;
        }
        worst = std::max(worst, distance(t[0] + u * (t[1] - t[0]) + v * (t[2] - t[0])));
        worst = std::max(worst, distance(t.at(s % 3)));
    }
    return worst;
}

std::vector<lod::CutMeshDraw> evenCut(const lod::Hierarchy& h, uint32_t code) {
    std::vector<lod::CutMeshDraw> draws;
    for (uint32_t n = 0; n < h.nodes.size(); ++n) {
        if (h.nodes[n].errorCode <= code) continue;
        for (uint32_t r = 0; r < h.groups[n].runs; ++r) {
            const lod::MeshRun& run = h.runs[h.groups[n].firstRun + r];
            if (run.producer != lod::MeshRun::kOriginal && h.nodes[run.producer].errorCode > code) continue;
            draws.push_back({0, n, n, run.firstCluster, run.clusters, run.triangles, 0});
        }
    }
    return draws;
}

}  // namespace stipple::test
