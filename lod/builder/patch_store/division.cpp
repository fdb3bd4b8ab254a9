#include "lod/builder/patch_store/division.h"

#include <algorithm>
#include <cmath>

#include "lod/primitives/octahedral.h"
#include "shaders/shared/record.h"

namespace stipple::lod {
namespace {

using Corners = std::array<uint32_t, 3>;

double squaredLength(const Soup& soup, uint32_t a, uint32_t b) {
    const glm::dvec3 d(soup.vertices.at(a) - soup.vertices.at(b));
    return glm::dot(d, d);
}
double longestSquared(const Soup& soup, const Corners& t) {
    return std::max(
        {squaredLength(soup, t[0], t[1]), squaredLength(soup, t[1], t[2]), squaredLength(soup, t[2], t[0])});
}

uint32_t meanColour(uint32_t a, uint32_t b) {
    uint32_t out = 0;
    for (uint32_t shift = 0; shift < 32; shift += 8)
        out |= (((a >> shift & 255u) + (b >> shift & 255u) + 1) / 2) << shift;
    return out;
}

/// The same from either end.
shared::MeshVertex middle(const shared::MeshVertex& a, const shared::MeshVertex& b) {
    shared::MeshVertex m{};
    m.x = static_cast<int>((int64_t{a.x} + b.x) >> 1);
    m.y = static_cast<int>((int64_t{a.y} + b.y) >> 1);
    m.z = static_cast<int>((int64_t{a.z} + b.z) >> 1);
    const glm::vec3 sum = glm::vec3(shared::octDecode(a.normal)) + glm::vec3(shared::octDecode(b.normal));
    m.normal = glm::dot(sum, sum) > 1e-6f ? octEncode(glm::normalize(sum)) : std::min(a.normal, b.normal);
    m.colour = meanColour(a.colour, b.colour);
    m.u = 0.5f * (a.u + b.u);
    m.v = 0.5f * (a.v + b.v);
    m.surface = std::min(a.surface, b.surface);
    return m;
}

class Divider {
  public:
    Divider(Soup& soup, double longest) : soup_(soup), limit_(longest * longest) {}

    void run() {
        const std::vector<uint32_t> all = std::move(soup_.indices);
        soup_.indices.clear();
        soup_.indices.reserve(all.size());
        for (size_t i = 0; i + 3 <= all.size(); i += 3) divide({all[i], all[i + 1], all[i + 2]});
    }

  private:
    bool isLong(uint32_t a, uint32_t b) const { return squaredLength(soup_, a, b) > limit_; }
    uint32_t between(uint32_t a, uint32_t b) {
        soup_.vertices.low.push_back(middle(soup_.vertices.low[a], soup_.vertices.low[b]));
        return static_cast<uint32_t>(soup_.vertices.size() - 1);
    }

    void divide(Corners t) {
        const std::array<bool, 3> isCut{isLong(t[0], t[1]), isLong(t[1], t[2]), isLong(t[2], t[0])};
        const int cuts = int{isCut[0]} + int{isCut[1]} + int{isCut[2]};
        if (cuts == 0) {
            keep(t);
            return;
        }
        // Turned so that the first edge is cut and, of two, the second one too; of one alone, no other.
        size_t first = 0;
        while (!(isCut.at(first) && (cuts != 2 || isCut.at((first + 1) % 3)))) ++first;
        std::rotate(t.begin(), t.begin() + static_cast<ptrdiff_t>(first), t.end());
        const uint32_t ab = between(t[0], t[1]);
        if (cuts == 1) {
            divide({t[0], ab, t[2]});
            divide({ab, t[1], t[2]});
            return;
        }
        const uint32_t bc = between(t[1], t[2]);
        divide({ab, t[1], bc});
        if (cuts == 2) {
            divide({t[0], ab, bc});
            divide({t[0], bc, t[2]});
            return;
        }
        const uint32_t ca = between(t[2], t[0]);
        divide({t[0], ab, ca});
        divide({ab, bc, ca});
        divide({ca, bc, t[2]});
    }

    void keep(const Corners& t) {
        const glm::dvec3 a(soup_.vertices.at(t[0])), b(soup_.vertices.at(t[1])), c(soup_.vertices.at(t[2]));
        if (glm::cross(b - a, c - a) != glm::dvec3(0)) soup_.indices.insert(soup_.indices.end(), t.begin(), t.end());
    }

    Soup& soup_;
    double limit_;
};

}  // namespace

void EdgeLengths::add(const Soup& soup) {
    for (size_t i = 0; i + 3 <= soup.indices.size(); i += 3) {
        const double squared = longestSquared(soup, {soup.indices[i], soup.indices[i + 1], soup.indices[i + 2]});
        const int octave = static_cast<int>(std::ceil(0.5 * std::log2(std::max(squared, 1.0))));
        ++triangles_.at(static_cast<size_t>(std::clamp(octave, 0, kOctaves - 1)));
    }
}

double EdgeLengths::pieces(int limitLog2) const {
    double sum = 0;
    for (int octave = 0; octave < kOctaves; ++octave)
        sum += static_cast<double>(triangles_.at(static_cast<size_t>(octave))) *
               std::exp2(2.0 * std::max(octave - limitLog2, 0));
    return sum;
}

void divideLong(Soup& soup, double longest) {
    for (size_t i = 0; i + 3 <= soup.indices.size(); i += 3)
        if (longestSquared(soup, {soup.indices[i], soup.indices[i + 1], soup.indices[i + 2]}) > longest * longest) {
            Divider(soup, longest).run();
            return;
        }
}

}  // namespace stipple::lod
