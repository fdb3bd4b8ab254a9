#include <algorithm>
#include <cmath>
#include <memory>

#include "engine/base/numbers.h"
#include "lod/primitives/curve_source.h"

namespace stipple::lod {
namespace {

constexpr double kShortest = 1e-150;    ///< segment that has a direction in doubles
constexpr double kLargestTwist = 1.05;  ///< radians between two vertices of a ribbon

struct Vertex {
    glm::dvec3 p;
    float radius;
    glm::vec3 normal;
    uint32_t colour;
};

glm::vec3 anyAcross(const glm::vec3& t) {
    return glm::normalize(std::abs(t.x) < 0.7f ? glm::vec3(0, -t.z, t.y) : glm::vec3(-t.z, 0, t.x));
}

uint32_t mixColours(uint32_t a, uint32_t b, double t) {
    uint32_t out = 0;
    for (uint32_t shift = 0; shift < 24; shift += 8)
        out |= static_cast<uint32_t>(std::lround((1 - t) * (a >> shift & 255u) + t * (b >> shift & 255u))) << shift;
    return out;
}

/// Normals at right angles to the curve, of length 1; missing ones carried on from the neighbour with the least turn.
void makeFrames(std::vector<Vertex>& v) {
    const auto tangentAt = [&](size_t i) {
        const size_t a = i > 0 ? i - 1 : 0, b = std::min(i + 1, v.size() - 1);
        const glm::dvec3 d = v[b].p - v[a].p;
        const glm::dvec3 chord = glm::length(d) > 0 ? d : v[std::min(i + 1, v.size() - 1)].p - v[i].p;  // turned back
        return glm::vec3(glm::length(chord) > 0 ? glm::normalize(chord) : glm::dvec3(0, 0, 1));
    };
    const auto across = [&](size_t i, const glm::vec3& n) { return n - glm::dot(n, tangentAt(i)) * tangentAt(i); };
    size_t known = v.size();
    for (size_t i = 0; i < v.size(); ++i) {
        const glm::vec3 n = across(i, v[i].normal);
        const bool isKnown = glm::length(v[i].normal) > 0 && glm::length(n) > 1e-3f * glm::length(v[i].normal);
        v[i].normal = isKnown ? glm::normalize(n) : glm::vec3(0);
        if (isKnown && known == v.size()) known = i;
    }
    if (known == v.size()) {
        known = 0;
        v[0].normal = anyAcross(tangentAt(0));
    }
    const auto carry = [&](size_t from, size_t to) {
        if (glm::length(v[to].normal) > 0) return;
        const glm::vec3 n = across(to, v[from].normal);
        v[to].normal = glm::length(n) > 1e-6f ? glm::normalize(n) : anyAcross(tangentAt(to));
    };
    for (size_t i = known; i-- > 0;) carry(i + 1, i);
    for (size_t i = known + 1; i < v.size(); ++i) carry(i - 1, i);
}

/// Vertices between two whose normals are too far apart, turned evenly about the segment.
void addTwist(const Vertex& a, const Vertex& b, std::vector<Vertex>& out) {
    const glm::dvec3 t = glm::normalize(b.p - a.p), na(a.normal), nb(b.normal);
    double angle = std::atan2(glm::dot(glm::cross(na, nb), t), glm::dot(na, nb));
    const int pieces = toWhole<int>(std::ceil(std::abs(angle) / kLargestTwist));
    for (int k = 1; k < pieces; ++k) {
        const double s = static_cast<double>(k) / pieces, turn = angle * s;
        const glm::dvec3 n = na * std::cos(turn) + glm::cross(t, na) * std::sin(turn);
        out.push_back({glm::mix(a.p, b.p, s), static_cast<float>((1 - s) * a.radius + s * b.radius), glm::vec3(n),
                       mixColours(a.colour, b.colour, s)});
    }
}

}  // namespace

CurveSet cleanCurves(CurveSet in, double defaultRadius, double extent) {
    CurveSet out;
    out.hasColour = in.hasColour;
    out.up = in.up;
    out.dropped = std::move(in.dropped);
    out.mended = std::move(in.mended);
    out.segmentsAdded = in.segmentsAdded;
    out.segmentsIn = in.segmentsIn > 0 ? in.segmentsIn : in.position.size() - in.curves();
    out.notes = std::move(in.notes);
    if (!(extent > 0)) {
        CurveBounds bounds;
        for (const glm::dvec3& p : in.position) bounds.add(p);
        extent = bounds.extent();
    }
    const auto fallback = static_cast<float>(defaultRadius > 0 ? defaultRadius : extent / 4000);
    const auto count = [](std::map<std::string, uint64_t>& to, const char* what, uint64_t n = 1) {
        if (n > 0) to[what] += n;
    };
    for (size_t s = 0; s < in.curves(); ++s) {
        std::vector<Vertex> v;
        const bool hasRadii = std::any_of(in.radius.begin() + in.first[s], in.radius.begin() + in.first[s + 1],
                                          [](float r) { return std::isfinite(r) && r > 0; });
        uint64_t notFinite = 0, repeated = 0, noRadius = 0;
        for (uint32_t i = in.first[s]; i < in.first[s + 1]; ++i) {
            if (!isFinite(in.position[i])) {
                ++notFinite;
                continue;
            }
            if (!v.empty() && !(glm::length(in.position[i] - v.back().p) > kShortest)) {
                ++repeated;
                continue;
            }
            const float r = in.radius[i];
            const bool hasRadius = std::isfinite(r) && (r > 0 || (r == 0 && hasRadii));  // a curve may end in a tip
            noRadius += !hasRadius && r != 0 ? 1 : 0;
            const glm::vec3 n = in.normal[i];
            v.push_back({in.position[i], hasRadius ? r : fallback, isFinite(n) ? n : glm::vec3(0), in.colour[i]});
        }
        // (Of a curve without vertices the last one has no segment to take along.)
        count(out.dropped, "at vertices that are not finite", v.empty() && notFinite > 0 ? notFinite - 1 : notFinite);
        count(out.dropped, "at vertices that repeat the one before", repeated);
        count(out.mended, "radii that are negative or not finite (replaced)", noRadius);
        if (v.size() < 2) {
            count(out.mended, in.first[s + 1] - in.first[s] < 2 ? "curves of one vertex (left out)"
                                                                : "curves without length (left out)");
            continue;
        }
        const bool isRibbon = in.isRibbon[s] != 0;
        if (isRibbon) makeFrames(v);
        std::vector<Vertex> smooth;
        for (size_t i = 0; i < v.size(); ++i) {
            if (i > 0 && isRibbon && glm::dot(v[i - 1].normal, v[i].normal) < 0.5f) addTwist(v[i - 1], v[i], smooth);
            smooth.push_back(v[i]);
        }
        out.segmentsAdded += smooth.size() - v.size();
        for (const Vertex& q : smooth) out.addVertex(q.p, q.radius, isRibbon ? q.normal : glm::vec3(0), q.colour);
        out.endCurve(isRibbon);
    }
    return out;
}

CurveSource cleanSource(const CurveSource& raw, double defaultRadius) {
    CurveSource source = raw;
    // The extent of all of them, found when it is first needed.
    const auto extent = std::make_shared<double>(0.0);
    source.read = [raw, defaultRadius, extent](const CurveSource::Take& take) -> Result<void> {
        if (!(*extent > 0)) {
            CurveBounds bounds;
            Result<void> read = raw.read([&](const CurveSet& block) -> Result<void> {
                for (const glm::dvec3& p : block.position) bounds.add(p);
                return {};
            });
            if (!read) return read;
            *extent = bounds.extent();
        }
        return raw.read([&](const CurveSet& block) { return take(cleanCurves(block, defaultRadius, *extent)); });
    };
    return source;
}

}  // namespace stipple::lod
