#include "lod/builder/patches/height_grid.h"

#include <algorithm>
#include <cmath>

#include "engine/base/check.h"
#include "lod/primitives/octahedral.h"

namespace stipple::lod {
namespace {

constexpr double kQuantaAStep = 128;  ///< rounding of a height: at most 1/256 of a step
constexpr double kMostCodes = 65534;

/// Any two axes across a third.
void axesAcross(const glm::dvec3& n, glm::dvec3& u, glm::dvec3& v) {
    u = glm::normalize(glm::cross(std::abs(n.x) < 0.6 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0), n));
    v = glm::cross(n, u);
}

/// Turned about n so that the first lies along what is spread most.
void turnAlong(size_t count, const std::function<glm::dvec3(size_t)>& place, glm::dvec3& u, glm::dvec3& v) {
    glm::dvec2 mean(0);
    const glm::dvec3 first = place(0);
    for (size_t k = 0; k < count; ++k) {
        const glm::dvec3 d = place(k) - first;
        mean += glm::dvec2(glm::dot(d, u), glm::dot(d, v));
    }
    mean /= static_cast<double>(count);
    double xx = 0, xy = 0, yy = 0;
    for (size_t k = 0; k < count; ++k) {
        const glm::dvec3 d = place(k) - first;
        const glm::dvec2 q = glm::dvec2(glm::dot(d, u), glm::dot(d, v)) - mean;
        xx += q.x * q.x;
        xy += q.x * q.y;
        yy += q.y * q.y;
    }
    const double angle = 0.5 * std::atan2(2 * xy, xx - yy);
    if (!std::isfinite(angle)) return;
    const glm::dvec3 along = u * std::cos(angle) + v * std::sin(angle);
    v = v * std::cos(angle) - u * std::sin(angle);
    u = along;
}

}  // namespace

bool planGrid(size_t count, const std::function<glm::dvec3(size_t)>& place, const glm::dvec3& axis, double step,
              uint32_t margin, size_t mostSamples, HeightGrid& grid) {
    glm::dvec3 u, v;
    axesAcross(axis, u, v);
    turnAlong(count, place, u, v);
    grid.turn = glm::quat(glm::quat_cast(glm::dmat3(u, v, axis)));
    grid.frame = glm::mat3_cast(glm::normalize(glm::dquat(grid.turn)));
    grid.step = static_cast<double>(static_cast<float>(step));
    glm::dvec3 lo(std::numeric_limits<double>::max()), hi(std::numeric_limits<double>::lowest());
    for (size_t k = 0; k < count; ++k) {
        const glm::dvec3 q = glm::transpose(grid.frame) * place(k);
        lo = glm::min(lo, q);
        hi = glm::max(hi, q);
    }
    const double border = margin;
    const double wide = (hi.x - lo.x) / grid.step + 2 * border, high = (hi.y - lo.y) / grid.step + 2 * border;
    if (!(wide >= 0 && high >= 0) || wide > Patch::kMostSide - 3 || high > Patch::kMostSide - 3) return false;
    grid.width = static_cast<uint32_t>(wide) + 2;
    grid.height = static_cast<uint32_t>(high) + 2;
    const size_t samples = size_t{grid.width} * grid.height;
    if (samples > mostSamples) return false;
    // The places in the middle of what is a whole number of cells.
    const glm::dvec2 spare((grid.width - 1 - wide) / 2 + border, (grid.height - 1 - high) / 2 + border);
    grid.origin = grid.frame * glm::dvec3(lo.x - spare.x * grid.step, lo.y - spare.y * grid.step, lo.z);
    grid.heights.assign(samples, HeightGrid::kNone);
    grid.normals.assign(samples, glm::vec3(0));
    grid.colours.assign(samples, 0);
    grid.materials.assign(samples, 0);
    grid.cells.assign(size_t{grid.width - 1} * (grid.height - 1), 0);
    return true;
}

namespace {

/// What of a grid its cells use, samples: [i0, i1] x [j0, j1].
struct Used {
    uint32_t i0 = ~0u, j0 = ~0u, i1 = 0, j1 = 0;
    std::vector<uint8_t> samples;
    double lowest = 1e300, highest = -1e300;
};

Used usedOf(const HeightGrid& grid) {
    Used used;
    used.samples.assign(grid.heights.size(), 0);
    for (uint32_t j = 0; j + 1 < grid.height; ++j)
        for (uint32_t i = 0; i + 1 < grid.width; ++i) {
            if (grid.cells[grid.cell(i, j)] == 0) continue;
            used.i0 = std::min(used.i0, i);
            used.j0 = std::min(used.j0, j);
            used.i1 = std::max(used.i1, i + 1);
            used.j1 = std::max(used.j1, j + 1);
            for (const size_t s : grid.corners(i, j)) {
                used.samples[s] = 1;
                used.lowest = std::min(used.lowest, grid.heights[s]);
                used.highest = std::max(used.highest, grid.heights[s]);
            }
        }
    return used;
}

}  // namespace

Patch toPatch(const HeightGrid& grid) {
    Patch patch;
    const Used used = usedOf(grid);
    if (used.i0 > used.i1) return patch;
    patch.turn = grid.turn;
    patch.step = static_cast<float>(grid.step);
    patch.width = used.i1 - used.i0 + 1;
    patch.height = used.j1 - used.j0 + 1;
    int exponent = 0;
    (void)std::frexp(grid.step / kQuantaAStep, &exponent);
    patch.quantumExponent = exponent - 1;
    while ((used.highest - used.lowest) / patch.quantum() > kMostCodes - 1) ++patch.quantumExponent;
    const double quantum = patch.quantum(), base = used.lowest - quantum;
    patch.origin = grid.origin + grid.frame * glm::dvec3(used.i0 * grid.step, used.j0 * grid.step, base);
    const size_t samples = size_t{patch.width} * patch.height;
    patch.heights.assign(samples, 0);
    patch.normals.assign(samples, 0);
    patch.colours.assign(samples, 0);
    std::vector<uint8_t> materials(samples, 0);
    const glm::mat3 toLocal(glm::transpose(grid.frame));
    for (uint32_t j = 0; j < patch.height; ++j)
        for (uint32_t i = 0; i < patch.width; ++i) {
            const size_t from = grid.at(i + used.i0, j + used.j0), to = patch.at(i, j);
            if (used.samples[from] == 0) continue;
            STIPPLE_CHECK(grid.has(from), "a cell of a patch has its four samples");
            patch.heights[to] = static_cast<uint16_t>(std::lround((grid.heights[from] - base) / quantum));
            const glm::vec3 normal = toLocal * grid.normals[from];
            patch.normals[to] = grid.hasFineNormals ? roundedNormal<8>(normal) : roundedNormal(normal);
            patch.colours[to] = grid.colours[from];
            materials[to] = grid.materials[from];
        }
    if (std::any_of(materials.begin(), materials.end(), [](uint8_t m) { return m != 0; }))
        patch.materials = std::move(materials);
    patch.cells.resize(size_t{patch.width - 1} * (patch.height - 1));
    for (uint32_t j = 0; j + 1 < patch.height; ++j)
        for (uint32_t i = 0; i + 1 < patch.width; ++i)
            patch.cells[size_t{j} * (patch.width - 1) + i] = grid.cells[grid.cell(i + used.i0, j + used.j0)];
    return patch;
}

double PatchHeights::at(double u, double v, glm::dvec2* slope) const {
    const double fi = std::floor(u), fj = std::floor(v);
    if (!(fi >= 0 && fj >= 0 && fi < patch_.width && fj < patch_.height)) return HeightGrid::kNone;
    auto i = static_cast<uint32_t>(fi), j = static_cast<uint32_t>(fj);
    // A place on a line between cells belongs to either.
    const auto isDrawn = [&](uint32_t a, uint32_t b) {
        return a + 1 < patch_.width && b + 1 < patch_.height && patch_.hasCell(a, b);
    };
    if (!isDrawn(i, j)) {
        const bool onU = u == fi && i > 0, onV = v == fj && j > 0;
        if (onU && isDrawn(i - 1, j)) {
            --i;
        } else if (onV && isDrawn(i, j - 1)) {
            --j;
        } else if (onU && onV && isDrawn(i - 1, j - 1)) {
            --i;
            --j;
        } else {
            return HeightGrid::kNone;
        }
    }
    const double x = u - i, y = v - j;
    const size_t s = patch_.at(i, j);
    const int h0 = patch_.heights[s], h1 = patch_.heights[s + 1], h2 = patch_.heights[s + patch_.width],
              h3 = patch_.heights[s + patch_.width + 1];
    glm::dvec2 d;
    double base = h0;
    if (cellTriangles(h0, h1, h2, h3)[2] == 3) {  // the diagonal rises from the lower left
        d = x >= y ? glm::dvec2(h1 - h0, h3 - h1) : glm::dvec2(h3 - h2, h2 - h0);
    } else if (x + y <= 1) {
        d = {h1 - h0, h2 - h0};
    } else {
        d = {h3 - h2, h3 - h1};
        base = h1 + h2 - h3;
    }
    if (slope) *slope = d * quantum_;
    return quantum_ * (base + d.x * x + d.y * y);
}

}  // namespace stipple::lod
