#include "lod/builder/patch_store/level_mesh.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <tuple>

#include "lod/builder/patches/mesh_surface.h"
#include "lod/primitives/octahedral.h"
#include "shaders/shared/record.h"

namespace stipple::lod {
namespace {

constexpr double kShare = 0.25;        ///< of the triangles that a level keeps
constexpr double kUnimportant = 0.05;  ///< share of the wanted error that nobody looks closer at
constexpr double kMostMissed = 2;      ///< distance measured, in wanted errors: quadrics do not bound it
constexpr double kNextTry = 0.3;       ///< error asked for then, in that of the try before
constexpr int kMostTries = 4;
constexpr size_t kFewest = 64;  ///< triangles that are not worth simplifying

/// A look that can be added up: colours are squared, which is nearly linear light.
struct LookSum {
    glm::dvec3 normal{0}, colour{0};
    double count = 0;
    void add(const shared::MeshVertex& v) {
        if ((v.surface & shared::kSurfaceFlat) == 0) normal += glm::dvec3(glm::vec3(shared::octDecode(v.normal)));
        for (int a = 0; a < 3; ++a) {
            const double c = v.colour >> (8 * a) & 255u;
            colour[a] += c * c;
        }
        ++count;
    }
    void to(shared::MeshVertex& v) const {
        const double length = glm::length(normal);
        if (length > 1e-3) {
            v.normal = octEncode(glm::vec3(normal / length));
            v.surface &= ~shared::kSurfaceFlat;
        }
        v.colour &= 0xff000000u;
        for (int a = 0; a < 3; ++a)
            v.colour |= static_cast<uint32_t>(std::lround(std::sqrt(colour[a] / count))) << (8 * a);
    }
};

/// Each look becomes the mean of its own and its neighbours', so that the vertices that stay have what goes. Vertices
/// of the border keep theirs: others have them, too.
void spreadLooks(Soup& soup) {
    std::vector<LookSum> sums(soup.vertices.size());
    std::vector<std::pair<uint32_t, uint32_t>> edges;
    for (size_t i = 0; i < soup.indices.size(); i += 3)
        for (size_t k = 0; k < 3; ++k) {
            const uint32_t a = soup.indices[i + k], b = soup.indices[i + (k + 1) % 3];
            edges.emplace_back(std::min(a, b), std::max(a, b));
        }
    std::sort(edges.begin(), edges.end());
    std::vector<uint8_t> isBorder(sums.size(), 0);
    for (size_t v = 0; v < sums.size(); ++v) sums[v].add(soup.vertices.low[v]);
    for (size_t k = 0, end = 0; k < edges.size(); k = end) {
        for (end = k + 1; end < edges.size() && edges[end] == edges[k];) ++end;
        const auto [a, b] = edges[k];
        sums[a].add(soup.vertices.low[b]);
        sums[b].add(soup.vertices.low[a]);
        if (end - k == 1) isBorder[a] = isBorder[b] = 1;
    }
    for (size_t v = 0; v < sums.size(); ++v)
        if (isBorder[v] == 0) sums[v].to(soup.vertices.low[v]);
}

void dropUnused(Soup& soup) {
    Soup used;
    appendSoup(soup, used);
    soup = std::move(used);
}

/// Raises the locks of vertices where the two surfaces are farther apart than `limit`: thin fins, and specks that are
/// gone as a whole, cost quadrics nothing.
void lockFar(const LocalMesh& local, const std::vector<uint32_t>& coarse, double limit, std::vector<uint8_t>& locks) {
    const auto executor = makeSerialExecutor();
    const auto surfaceOf = [&](const std::vector<uint32_t>& indices) {
        TriangleMesh mesh;
        for (const glm::vec3& p : local.position) mesh.position.emplace_back(p);
        mesh.indices = indices;
        return meshSurface(std::move(mesh), *executor);
    };
    const MeshSurface fine = surfaceOf(local.indices), left = surfaceOf(coarse);
    const auto lock = [&](const std::array<uint32_t, 3>& vertices) {
        for (const uint32_t v : vertices) locks[v] = 1;
    };
    const auto look = [&](const MeshSurface& from, const MeshSurface& to, const auto& onFar) {
        size_t hint = 0;
        for (size_t t = 0; t < from.size() && to.size() > 0; ++t)
            for (size_t k = 0; k < 3; ++k) {
                const glm::dvec3 corner = from.at(t, k), edge = 0.5 * (corner + from.at(t, (k + 1) % 3));
                for (const glm::dvec3& p : {corner, edge, from.elements.centre[t]}) {
                    const auto [distance, near] = to.nearest(p + from.middle - to.middle, hint, limit);
                    hint = near;
                    if (distance > limit) onFar(t, near);
                }
            }
    };
    look(fine, left, [&](size_t t, size_t) { lock(fine.vertices[t]); });
    look(left, fine, [&](size_t, size_t near) { lock(fine.vertices[near]); });
}

/// To a quarter, edge by edge; `error`: in parts of the extent. Triangles with a locked vertex stay: to the others they
/// are a border.
std::vector<uint32_t> collapsed(const LocalMesh& local, double error, const std::vector<uint8_t>& locks) {
    std::vector<uint32_t> free, kept;
    for (size_t i = 0; i < local.indices.size(); i += 3) {
        bool isKept = false;
        for (size_t k = 0; k < 3; ++k) isKept = isKept || locks[local.indices[i + k]] != 0;
        std::vector<uint32_t>& to = isKept ? kept : free;
        for (size_t k = 0; k < 3; ++k) to.push_back(local.indices[i + k]);
    }
    const auto target = static_cast<size_t>(kShare * static_cast<double>(local.indices.size() / 3)) * 3;
    std::vector<uint32_t> out(free.size());
    if (!free.empty())
        out.resize(meshopt_simplify(out.data(), free.data(), free.size(), &local.position[0].x, local.position.size(),
                                    sizeof(glm::vec3), target, static_cast<float>(error), meshopt_SimplifyLockBorder,
                                    nullptr));
    out.insert(out.end(), kept.begin(), kept.end());
    return out;
}

/// To so many triangles, cell by cell.
std::vector<uint32_t> united(const LocalMesh& local, size_t most) {
    std::vector<uint32_t> out(local.indices.size());
    out.resize(meshopt_simplifySloppy(out.data(), local.indices.data(), local.indices.size(), &local.position[0].x,
                                      local.position.size(), sizeof(glm::vec3), 3 * most, 1e9f, nullptr));
    return out;
}

double distanceTo(const WeldedMesh& mesh, const LocalMesh& local, const std::vector<uint32_t>& coarse, double wanted,
                  bool isBorderKept) {
    return measureDeviation(mesh, local, coarse, kUnimportant * wanted, isBorderKept);
}

}  // namespace

void SoupPart::add(size_t triangle) {
    for (size_t k = 0; k < 3; ++k) {
        const uint32_t v = from_.indices[3 * triangle + k];
        if (place_[v] == ~0u) {
            place_[v] = static_cast<uint32_t>(to_.vertices.size());
            to_.vertices.add(from_.vertices, v);
        }
        to_.indices.push_back(place_[v]);
    }
}

void appendSoup(const Soup& from, Soup& to) {
    SoupPart part(from, to);
    for (size_t t = 0; t < from.indices.size() / 3; ++t) part.add(t);
}

void uniteByPlace(Soup& soup) {
    const std::vector<shared::MeshVertex>& v = soup.vertices.low;
    std::vector<uint32_t> order(v.size()), place(v.size());
    std::iota(order.begin(), order.end(), 0u);
    const auto key = [&](uint32_t i) { return std::tie(v[i].x, v[i].y, v[i].z); };
    std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
        return key(a) != key(b) ? key(a) < key(b)
                                : std::tie(v[a].normal, v[a].colour, v[a].surface) <
                                      std::tie(v[b].normal, v[b].colour, v[b].surface);
    });
    Soup out;
    for (size_t i = 0, end = 0; i < order.size(); i = end) {
        LookSum sum;
        shared::MeshVertex vertex = v[order[i]];
        for (end = i; end < order.size() && key(order[end]) == key(order[i]); ++end) {
            sum.add(v[order[end]]);
            place[order[end]] = static_cast<uint32_t>(out.vertices.size());
        }
        sum.to(vertex);
        // (Texture coordinates and materials mean nothing any more.)
        vertex.u = vertex.v = 0;
        vertex.surface = (vertex.surface & (shared::kSurfaceTwoSided | shared::kSurfaceFlat)) | kNoMaterial;
        out.vertices.low.push_back(vertex);
    }
    std::vector<std::array<uint32_t, 3>> triangles;
    for (size_t i = 0; i < soup.indices.size(); i += 3) {
        std::array<uint32_t, 3> t{place[soup.indices[i]], place[soup.indices[i + 1]], place[soup.indices[i + 2]]};
        if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) continue;
        std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
        triangles.push_back(t);
    }
    std::sort(triangles.begin(), triangles.end());
    triangles.erase(std::unique(triangles.begin(), triangles.end()), triangles.end());
    for (const auto& t : triangles) out.indices.insert(out.indices.end(), t.begin(), t.end());
    soup = std::move(out);
}

double simplify(Soup& soup, double wanted, size_t most) {
    uniteByPlace(soup);
    if (soup.indices.size() / 3 <= kFewest) return 0;
    spreadLooks(soup);
    WeldedMesh mesh;
    mesh.vertices = soup.vertices;
    for (shared::MeshVertex& v : mesh.vertices.low) v.colour = 0;  // distances are of places alone
    mesh.position.resize(mesh.vertices.size());
    std::iota(mesh.position.begin(), mesh.position.end(), 0u);
    Cluster all;
    all.indices = soup.indices;
    const LocalMesh local = makeLocal(mesh, {&all});
    const float scale = meshopt_simplifyScale(&local.position[0].x, local.position.size(), sizeof(glm::vec3));
    std::vector<uint32_t> coarse;
    double error = 0, said = wanted;
    std::vector<uint8_t> locks(local.position.size(), 0);
    for (int tries = 0; tries < kMostTries; ++tries) {
        std::vector<uint32_t> made = collapsed(local, said / std::max(double{scale}, 1e-30), locks);
        const bool isBorderKept = made.size() / 3 <= most;
        if (!isBorderKept && tries > 0) break;
        if (!isBorderKept) made = united(local, most);
        if (made.empty() || made.size() == local.indices.size()) return 0;
        const double now = distanceTo(mesh, local, made, wanted, isBorderKept);
        if (tries == 0 || now < error) {
            error = now;
            coarse = std::move(made);
        }
        if (error <= kMostMissed * wanted || !isBorderKept) break;
        if (tries > 0) said *= kNextTry;
        lockFar(local, coarse, kMostMissed * wanted, locks);
    }
    soup.indices.clear();
    for (const uint32_t v : coarse) soup.indices.push_back(local.global[v]);
    dropUnused(soup);
    return error;
}

}  // namespace stipple::lod
