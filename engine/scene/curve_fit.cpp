// How a part becomes a curve: the length of the shortest way along its edges from one end to the other orders its
// surface; slices of equal length each give a joint. Samples of the surface say how wide it is there and how far off
// the curve is.
#include "engine/scene/curve_fit.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <queue>

#include "engine/base/numbers.h"
#include "engine/base/process.h"
#include "engine/scene/triangles.h"
#include "shaders/shared/record.h"

namespace stipple::scene {
namespace {

using glm::dvec3;

struct Sample {
    dvec3 p{0}, normal{0};
    double area = 0, along = 0;  ///< along: share of the way from one end to the other
};

struct Joint {
    dvec3 centre{0}, normal{0};
    double radius = 0;
};

/// One way to see a part.
struct Candidate {
    bool isRibbon = false;
    std::vector<Joint> joints;
    double width = 0;                ///< mean, whole
    std::vector<double> deviations;  ///< of each sample
    double worst() const {
        return deviations.empty() ? 1e300 : *std::max_element(deviations.begin(), deviations.end());
    }
    /// What 95 of 100 samples stay below.
    double usual() const {
        std::vector<double> d = deviations;
        if (d.empty()) return 1e300;
        const auto at = d.begin() + static_cast<ptrdiff_t>((d.size() - 1) * 95 / 100);
        std::nth_element(d.begin(), at, d.end());
        return *at;
    }
};

class PartFitter {
  public:
    PartFitter(const std::vector<dvec3>& position, const std::vector<std::array<uint32_t, 3>>& triangles,
               const CurveFitSettings& settings)
        : position_(position), triangles_(triangles), settings_(settings) {}

    /// The better of both ways; false if neither will do.
    bool fit(Candidate& out) {
        if (!order()) return false;
        sample();
        // No more joints than it takes: what is well within the tolerance is good enough.
        constexpr double kWell = 0.4, kFlat = 0.7, kSlender = 3;
        for (const bool isRibbon : {true, false}) {
            for (int segments = 2; segments <= settings_.joints; segments += (segments + 1) / 2) {
                Candidate c = attempt(isRibbon, segments);
                const double limit = settings_.tolerance * c.width, most = isRibbon ? kFlat * limit : limit;
                if (c.joints.size() < 2 || !(c.usual() <= most) || !(c.worst() <= c.width)) continue;
                if (!isRibbon && lengthOf(c) < kSlender * c.width) continue;  // a ball or a box
                const bool isWell = c.usual() <= kWell * limit;
                if (out.joints.empty() || c.usual() < out.usual()) out = std::move(c);
                if (isWell) break;
            }
            if (!out.joints.empty() && out.usual() <= kWell * settings_.tolerance * out.width) break;
        }
        return !out.joints.empty();
    }
    const std::vector<Sample>& samples() const { return samples_; }

  private:
    /// Distances along edges from the two ends of the part.
    bool order() {
        std::vector<std::vector<std::pair<uint32_t, double>>> edges(position_.size());
        for (const auto& t : triangles_)
            for (size_t k = 0; k < 3; ++k) {
                const uint32_t a = t.at(k), b = t.at((k + 1) % 3);
                const double d = glm::length(position_[b] - position_[a]);
                edges[a].emplace_back(b, d);
                edges[b].emplace_back(a, d);
            }
        const auto from = [&](uint32_t start) {
            std::vector<double> distance(position_.size(), 1e300);
            using Item = std::pair<double, uint32_t>;
            std::priority_queue<Item, std::vector<Item>, std::greater<>> open;
            distance[start] = 0;
            open.emplace(0, start);
            while (!open.empty()) {
                const auto [d, v] = open.top();
                open.pop();
                if (d > distance[v]) continue;
                for (const auto& [w, step] : edges[v])
                    if (d + step < distance[w]) {
                        distance[w] = d + step;
                        open.emplace(d + step, w);
                    }
            }
            return distance;
        };
        const auto farthest = [](const std::vector<double>& d) {
            return static_cast<uint32_t>(std::max_element(d.begin(), d.end()) - d.begin());
        };
        const uint32_t a = farthest(from(0));
        const std::vector<double> da = from(a);
        const uint32_t b = farthest(da);
        const std::vector<double> db = from(b);
        length_ = da[b];
        if (!(length_ > 0) || !std::isfinite(length_)) return false;
        along_.resize(position_.size());
        double low = 1e300, high = -1e300;
        for (size_t v = 0; v < along_.size(); ++v) {
            along_[v] = da[v] - db[v];
            low = std::min(low, along_[v]);
            high = std::max(high, along_[v]);
        }
        for (double& v : along_) v = (v - low) / std::max(high - low, 1e-300);
        return true;
    }

    void sample() {
        constexpr int kGrid = 5;
        for (const auto& t : triangles_) {
            const dvec3 n = glm::cross(position_[t[1]] - position_[t[0]], position_[t[2]] - position_[t[0]]);
            const double area = 0.5 * glm::length(n);
            if (!(area > 0)) continue;
            for (int i = 0; i <= kGrid; ++i)
                for (int j = 0; i + j <= kGrid; ++j) {
                    const double u = static_cast<double>(i) / kGrid, v = static_cast<double>(j) / kGrid, w = 1 - u - v;
                    Sample s;
                    s.p = w * position_[t[0]] + u * position_[t[1]] + v * position_[t[2]];
                    s.along = w * along_[t[0]] + u * along_[t[1]] + v * along_[t[2]];
                    s.normal = n / (2 * area);
                    s.area = area;
                    samples_.push_back(s);
                }
            area_ += area;
        }
    }
    Candidate attempt(bool isRibbon, int joints) const {
        Candidate c;
        c.isRibbon = isRibbon;
        // What lies within half a slice of each joint.
        std::vector<std::vector<const Sample*>> near(static_cast<size_t>(joints) + 1);
        for (const Sample& s : samples_) near[static_cast<size_t>(std::lround(s.along * joints))].push_back(&s);
        for (const auto& some : near) {
            if (some.empty()) continue;
            Joint j;
            double weight = 0;
            for (const Sample* s : some) {
                j.centre += s->area * s->p;
                weight += s->area;
            }
            j.centre /= weight;
            c.joints.push_back(j);
        }
        if (c.joints.size() < 2) return c;
        // The ends of a slice at the end are where it is, not half a slice before.
        stretchEnds(c.joints);
        for (size_t k = 0; k < c.joints.size(); ++k) {
            const dvec3 t = tangent(c.joints, k);
            Joint& j = c.joints[k];
            const size_t at = nearIndex(near, k);
            double weight = 0, sum = 0, least = 1e300, most = -1e300;
            dvec3 normal(0);
            for (const Sample* s : near[at]) {
                normal += s->area * (glm::dot(s->normal, normal) < 0 ? -s->normal : s->normal);
                weight += s->area;
            }
            normal -= glm::dot(normal, t) * t;
            const bool hasNormal = glm::length(normal) > 1e-9 * weight;
            normal = hasNormal ? glm::normalize(normal) : dvec3(0);
            const dvec3 across = glm::cross(normal, t);
            for (const Sample* s : near[at]) {
                const dvec3 d = s->p - j.centre;
                if (isRibbon) {
                    least = std::min(least, glm::dot(d, across));
                    most = std::max(most, glm::dot(d, across));
                } else {
                    sum += s->area * glm::length(d - glm::dot(d, t) * t);
                }
            }
            if (isRibbon && !hasNormal) return {};
            j.normal = normal;
            if (isRibbon) j.centre += 0.5 * (least + most) * across;
            j.radius = isRibbon ? 0.5 * (most - least) : sum / weight;
        }
        keepArea(c);
        double width = 0;
        for (const Joint& j : c.joints) width += 2 * j.radius;
        c.width = width / static_cast<double>(c.joints.size());
        measure(c);
        return c;
    }

    static double lengthOf(const Candidate& c) {
        double sum = 0;
        for (size_t k = 0; k + 1 < c.joints.size(); ++k)
            sum += glm::length(c.joints[k + 1].centre - c.joints[k].centre);
        return sum;
    }
    static size_t nearIndex(const std::vector<std::vector<const Sample*>>& near, size_t joint) {
        for (size_t k = 0, seen = 0; k < near.size(); ++k)
            if (!near[k].empty() && seen++ == joint) return k;
        return 0;
    }
    static dvec3 tangent(const std::vector<Joint>& joints, size_t k) {
        const dvec3 d = joints[std::min(k + 1, joints.size() - 1)].centre - joints[k > 0 ? k - 1 : 0].centre;
        return glm::length(d) > 0 ? glm::normalize(d) : dvec3(0, 1, 0);
    }
    /// Moves the first and the last joint to where the part ends.
    void stretchEnds(std::vector<Joint>& joints) const {
        for (const bool isFirst : {true, false}) {
            Joint& end = isFirst ? joints.front() : joints.back();
            const Joint& inner = isFirst ? joints[1] : joints[joints.size() - 2];
            const dvec3 out = end.centre - inner.centre;
            if (!(glm::length(out) > 0)) continue;
            const dvec3 d = glm::normalize(out);
            double reach = 0;
            for (const Sample& s : samples_)
                if (isFirst ? s.along < 0.25 : s.along > 0.75) reach = std::max(reach, glm::dot(s.p - end.centre, d));
            end.centre += reach * d;
        }
    }
    /// The curve covers as much as the part: a ribbon's area is the part's, a tube's side too.
    void keepArea(Candidate& c) const {
        double band = 0;
        for (size_t k = 0; k + 1 < c.joints.size(); ++k)
            band += glm::length(c.joints[k + 1].centre - c.joints[k].centre) *
                    (c.joints[k].radius + c.joints[k + 1].radius);
        if (!(band > 0)) return;
        const double wanted = c.isRibbon ? area_ : area_ / 3.14159265358979;
        const double factor = std::clamp(wanted / band, 0.7, 1.4);
        for (Joint& j : c.joints) j.radius *= factor;
    }

    void measure(Candidate& c) const {
        for (const Sample& s : samples_) {
            double best = 1e300;
            for (size_t k = 0; k + 1 < c.joints.size(); ++k) {
                const Joint &a = c.joints[k], &b = c.joints[k + 1];
                const dvec3 d = b.centre - a.centre;
                const double u = std::clamp(glm::dot(s.p - a.centre, d) / std::max(glm::dot(d, d), 1e-300), 0.0, 1.0);
                const dvec3 off = s.p - glm::mix(a.centre, b.centre, u);
                const double radius = glm::mix(a.radius, b.radius, u);
                if (!c.isRibbon) {
                    best = std::min(best, std::abs(glm::length(off) - radius));
                    continue;
                }
                const dvec3 t = glm::length(d) > 0 ? glm::normalize(d) : dvec3(0, 1, 0);
                const dvec3 n = glm::mix(a.normal, glm::dot(a.normal, b.normal) < 0 ? -b.normal : b.normal, u);
                const dvec3 across = glm::cross(n, t);
                const double length = glm::length(across);
                if (!(length > 1e-9)) continue;
                const double sideways = glm::dot(off, across / length);
                const dvec3 nearest = std::clamp(sideways, -radius, radius) * (across / length);
                best = std::min(best, glm::length(off - nearest));
            }
            c.deviations.push_back(best);
        }
    }

    const std::vector<dvec3>& position_;
    const std::vector<std::array<uint32_t, 3>>& triangles_;
    const CurveFitSettings& settings_;
    std::vector<double> along_;
    std::vector<Sample> samples_;
    double length_ = 0, area_ = 0;
};

/// A primitive's triangles by what hangs together: positions that are equal are one vertex.
struct Parts {
    std::vector<uint32_t> partOf;  ///< of each triangle
    uint32_t count = 0;
};
Parts partsOf(const Primitive& p) {
    std::vector<uint32_t> group(p.position.size());
    std::iota(group.begin(), group.end(), 0u);
    const auto root = [&](uint32_t v) {
        while (group[v] != v) v = group[v] = group[group[v]];
        return v;
    };
    std::map<std::array<double, 3>, uint32_t> known;
    for (uint32_t v = 0; v < p.position.size(); ++v) {
        const glm::dvec3 place = p.at(v);
        const auto [at, isNew] = known.try_emplace({place.x, place.y, place.z}, v);
        if (!isNew) group[root(v)] = root(at->second);
    }
    for (size_t i = 0; i + 3 <= p.indices.size(); i += 3) {
        group[root(p.indices[i])] = root(p.indices[i + 1]);
        group[root(p.indices[i + 1])] = root(p.indices[i + 2]);
    }
    Parts out;
    std::map<uint32_t, uint32_t> number;
    for (size_t i = 0; i + 3 <= p.indices.size(); i += 3)
        out.partOf.push_back(
            number.try_emplace(root(p.indices[i]), static_cast<uint32_t>(number.size())).first->second);
    out.count = static_cast<uint32_t>(number.size());
    return out;
}

uint32_t packed(const glm::vec3& linear) {
    const auto byte = [](float l) { return unitToByte(shared::srgbFromLinear(l > 0.0f ? std::min(l, 1.0f) : 0.0f)); };
    return byte(linear.r) | byte(linear.g) << 8 | byte(linear.b) << 16;
}

class SceneFitter {
  public:
    SceneFitter(const Scene& scene, const std::vector<DecodedImage>& images, const CurveFitSettings& settings,
                Executor& executor)
        : scene_(scene), images_(images), settings_(settings), executor_(executor) {}

    CurveFit run() {
        out_.rest = scene_;
        out_.curves.up = {0, 1, 0};
        out_.curves.hasColour = true;
        const std::vector<Placement> placed = placements(scene_);
        for (size_t m = 0; m < scene_.meshes.size(); ++m)
            for (size_t k = 0; k < scene_.meshes[m].primitives.size(); ++k)
                if (scene_.meshes[m].primitives[k].kind == PrimitiveKind::triangles) fit(m, k, placed);
        finish();
        return std::move(out_);
    }

  private:
    struct Fitted {
        Candidate curve;
        std::vector<Sample> samples;
        uint32_t colour = 0;
    };

    void fit(size_t mesh, size_t primitive, const std::vector<Placement>& placed) {
        const Primitive& p = scene_.meshes[mesh].primitives[primitive];
        const Parts parts = partsOf(p);
        std::vector<std::vector<uint32_t>> trianglesOf(parts.count);
        for (uint32_t t = 0; t < parts.partOf.size(); ++t) trianglesOf[parts.partOf[t]].push_back(t);
        std::vector<Fitted> fitted(parts.count);
        if (isWhole(p))
            executor_.parallelFor(parts.count, 64, [&](size_t begin, size_t end) {
                for (size_t k = begin; k < end && !isStopRequested(); ++k) fitPart(p, trianglesOf[k], fitted[k]);
            });
        uint64_t places = 0;
        for (const Placement& at : placed) {
            if (at.mesh != static_cast<int>(mesh)) continue;
            ++places;
            for (const Fitted& f : fitted)
                if (!f.curve.joints.empty()) add(f, at.world);
        }
        out_.trianglesIn += p.indices.size() / 3 * places;
        Primitive& left = out_.rest.meshes[mesh].primitives[primitive];
        left.indices.clear();
        for (uint32_t t = 0; t < parts.partOf.size(); ++t)
            if (fitted[parts.partOf[t]].curve.joints.empty())
                left.indices.insert(left.indices.end(), p.indices.begin() + 3 * t, p.indices.begin() + 3 * t + 3);
        out_.trianglesLeft += left.indices.size() / 3 * places;
    }

    /// Pictures of leaves with holes in them are no ribbons.
    bool isWhole(const Primitive& p) const {
        constexpr double kMostCut = 0.1;
        if (p.material < 0) return true;
        const Material& m = scene_.materials[static_cast<size_t>(p.material)];
        const int texture = m.baseColourTexture.texture;
        if (m.alphaMode == AlphaMode::opaque || texture < 0) return true;
        const int image = scene_.textures[static_cast<size_t>(texture)].image;
        if (image < 0) return true;
        const std::vector<uint32_t>& rgba = images_[static_cast<size_t>(image)].rgba;
        const auto cut = std::count_if(rgba.begin(), rgba.end(), [&](uint32_t c) {
            return static_cast<float>(c >> 24) / 255.0f * m.baseColour.a < m.alphaCutoff;
        });
        return static_cast<double>(cut) <= kMostCut * static_cast<double>(rgba.size());
    }

    void fitPart(const Primitive& p, const std::vector<uint32_t>& triangles, Fitted& out) const {
        constexpr size_t kMostTriangles = 4096;  // more than that is no leaf and no twig
        if (triangles.size() > kMostTriangles) return;
        std::map<std::array<double, 3>, uint32_t> known;
        std::vector<dvec3> position;
        std::vector<std::array<uint32_t, 3>> corners;
        glm::vec3 colour(0);
        for (const uint32_t t : triangles) {
            std::array<uint32_t, 3> own{};
            for (size_t k = 0; k < 3; ++k) {
                const uint32_t v = p.indices[3 * t + k];
                const dvec3 at = p.at(v);
                const auto [found, isNew] =
                    known.try_emplace({at.x, at.y, at.z}, static_cast<uint32_t>(position.size()));
                if (isNew) position.emplace_back(at);
                own.at(k) = found->second;
                colour += colourAt(p, v);
            }
            if (own[0] != own[1] && own[1] != own[2] && own[0] != own[2]) corners.push_back(own);
        }
        if (corners.empty()) return;
        PartFitter fitter(position, corners, settings_);
        if (!fitter.fit(out.curve)) return;
        out.samples = fitter.samples();
        out.colour = packed(colour / (3.0f * static_cast<float>(triangles.size())));
    }

    glm::vec3 colourAt(const Primitive& p, uint32_t v) const {
        static const Material plain;
        const Material& m = p.material < 0 ? plain : scene_.materials[static_cast<size_t>(p.material)];
        glm::vec3 c(m.baseColour);
        if (!p.colour.empty()) c *= glm::vec3(p.colour[v]);
        const TextureUse& use = m.baseColourTexture;
        if (use.texture < 0 || static_cast<size_t>(use.uvSet) >= p.uv.size()) return c;
        const int image = scene_.textures[static_cast<size_t>(use.texture)].image;
        if (image < 0 || images_[static_cast<size_t>(image)].rgba.empty()) return c;
        const DecodedImage& pixels = images_[static_cast<size_t>(image)];
        return c * meanColour(pixels);
    }
    /// Of what is not transparent: a leaf's picture stands for the whole leaf.
    glm::vec3 meanColour(const DecodedImage& image) const {
        glm::dvec3 sum(0);
        double weight = 0;
        const size_t stride = std::max<size_t>(1, image.rgba.size() / 4096);
        for (size_t i = 0; i < image.rgba.size(); i += stride) {
            const uint32_t c = image.rgba[i];
            const double a = (c >> 24) / 255.0;
            for (int k = 0; k < 3; ++k)
                sum[k] += a * shared::linearFromSrgb(static_cast<float>(c >> (8 * k) & 255u) / 255.0f);
            weight += a;
        }
        return weight > 0 ? glm::vec3(sum / weight) : glm::vec3(1);
    }

    void add(const Fitted& f, const glm::dmat4& world) {
        const double scale = std::cbrt(std::abs(glm::determinant(glm::dmat3(world))));
        const glm::dmat3 normals = glm::transpose(glm::inverse(glm::dmat3(world)));
        for (const Joint& j : f.curve.joints)
            out_.curves.addVertex(dvec3(world * glm::dvec4(j.centre, 1)), static_cast<float>(scale * j.radius),
                                  f.curve.isRibbon ? glm::vec3(normals * j.normal) : glm::vec3(0), f.colour);
        out_.curves.endCurve(f.curve.isRibbon);
        ++(f.curve.isRibbon ? out_.ribbons : out_.tubes);
        for (size_t k = 0; k < f.samples.size(); ++k)
            deviations_.emplace_back(scale * f.curve.deviations[k], scale * scale * f.samples[k].area);
    }

    void finish() {
        if (deviations_.empty()) return;
        std::sort(deviations_.begin(), deviations_.end());
        double whole = 0, sum = 0, passed = 0;
        for (const auto& [d, area] : deviations_) {
            whole += area;
            sum += area * d;
        }
        out_.meanDeviation = sum / whole;
        out_.largestDeviation = deviations_.back().first;
        for (const auto& [d, area] : deviations_) {
            passed += area;
            out_.p95Deviation = d;
            if (passed >= 0.95 * whole) break;
        }
    }

    const Scene& scene_;
    const std::vector<DecodedImage>& images_;
    const CurveFitSettings& settings_;
    Executor& executor_;
    CurveFit out_;
    std::vector<std::pair<double, double>> deviations_;  ///< and the area that each stands for
};

}  // namespace

CurveFit fitCurves(const Scene& scene, const std::vector<DecodedImage>& images, const CurveFitSettings& settings,
                   Executor& executor) {
    return SceneFitter(scene, images, settings, executor).run();
}

}  // namespace stipple::scene
