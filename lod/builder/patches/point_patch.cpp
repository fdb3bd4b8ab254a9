#include "lod/builder/patches/point_patch.h"

#include <algorithm>
#include <cmath>

#include "engine/base/numbers.h"
#include "lod/builder/patches/cone.h"
#include "lod/builder/patches/height_grid.h"
#include "lod/builder/patches/moving_least_squares.h"
#include "shaders/shared/record.h"

namespace stipple::lod {
namespace {

constexpr uint32_t kMargin = 3;
constexpr double kMostEmpty = 8;      ///< samples of the grid for each over the segment, before it is worth splitting
constexpr size_t kFewSamples = 4096;  ///< that are always worth it
constexpr double kReach = 1.5;        ///< of a point, steps or spacings, whichever is more
constexpr double kMostReach = 4;      ///< steps
constexpr double kExcepted = 0.02;    ///< of the points, in cells that fold
constexpr double kUneven = 0.75;      ///< steps, between samples and the slope of their neighbours
constexpr double kFewestShare = 0.5;  ///< of its points, that a patch stands for
constexpr uint32_t kNobody = ~0u;

class Sampler {
  public:
    Sampler(const PointSurface& surface, const Segment& segment, double step, PatchClosing closing)
        : s_(surface), all_(segment), closing_(closing) {
        leaveSteep();
        isPlanned_ = step > 0 && !segment_.empty() &&
                     planGrid(
                         segment_.size(), [&](size_t k) { return s_.elements.centre[segment_[k]]; }, cone_.axis, step,
                         kMargin, kFewSamples + toWhole<size_t>(kMostEmpty * area_ / (step * step)), grid_);
    }

    PointPatch run() {
        PointPatch out;
        out.isFolded = !isPlanned_ || isFolded();
        if (out.isFolded) return out;
        findGuides();
        sampleAll();
        chooseCells();
        out.patch = toPatch(grid_);
        if (out.patch.width > 0) measure(out);
        out.left.insert(out.left.end(), steep_.begin(), steep_.end());
        const bool isWorthIt = static_cast<double>(out.represented) >= kFewestShare * static_cast<double>(all_.size());
        out.segment = std::move(segment_);
        if (out.represented > 0 && isWorthIt) return out;
        out = {};
        out.left = all_;
        return out;
    }

  private:
    /// About the mean normal, without points that are too steep for it (they stay points): a few normals beside an
    /// edge would turn the plane of all others away.
    void leaveSteep() {
        glm::dvec3 sum(0);
        for (const uint32_t i : all_) sum += s_.elements.area[i] * glm::dvec3(s_.elements.normal[i]);
        const double length = glm::length(sum);
        if (!(length > 0) || !std::isfinite(length)) return;
        cone_.axis = sum / length;
        area_ = length;
        for (const uint32_t i : all_) {
            const double facing = glm::dot(glm::dvec3(s_.elements.normal[i]), cone_.axis);
            (facing < kLeastFacing ? steep_ : segment_).push_back(i);
            if (facing >= kLeastFacing) cone_.cosine = std::min(cone_.cosine, facing);
        }
    }

    bool isFolded() const {
        std::vector<float> noise;
        std::vector<std::array<double, 2>> spread(grid_.cells.size(), {1e300, -1e300});
        const auto cellOf = [&](const glm::dvec3& q) {
            return grid_.cell(static_cast<uint32_t>(q.x), static_cast<uint32_t>(q.y));
        };
        for (const uint32_t i : segment_) {
            noise.push_back(s_.noise[i]);
            const glm::dvec3 q = grid_.local(s_.elements.centre[i]);
            auto& [lo, hi] = spread[cellOf(q)];
            lo = std::min(lo, q.z);
            hi = std::max(hi, q.z);
        }
        std::nth_element(noise.begin(), noise.begin() + static_cast<ptrdiff_t>(noise.size() / 2), noise.end());
        const double sine = std::sqrt(std::max(0.0, 1 - cone_.cosine * cone_.cosine));
        const double most = std::sqrt(2.0) * grid_.step * sine / cone_.cosine +
                            3 * static_cast<double>(noise[noise.size() / 2]) + kFlatness * grid_.step;
        size_t folded = 0;
        for (const uint32_t i : segment_) {
            const auto& [lo, hi] = spread[cellOf(grid_.local(s_.elements.centre[i]))];
            folded += hi - lo > most ? 1 : 0;
        }
        return folded > std::max<size_t>(8, static_cast<size_t>(kExcepted * static_cast<double>(segment_.size())));
    }

    /// For each sample the nearest point of the segment within reach, as it lies in the plane.
    void findGuides() {
        guide_.assign(grid_.heights.size(), kNobody);
        std::vector<double> nearest(grid_.heights.size(), 1e300);
        for (const uint32_t i : segment_) {
            const glm::dvec3 q = grid_.local(s_.elements.centre[i]);
            double reach =
                std::min(kReach * std::max(1.0, static_cast<double>(s_.spacing[i]) / grid_.step), kMostReach);
            if (closing_ == PatchClosing::overlap) reach += 1;
            const auto from = [](double v) { return static_cast<uint32_t>(std::max(0.0, std::ceil(v))); };
            const auto to = [](double v, uint32_t n) {
                return static_cast<uint32_t>(std::clamp(std::floor(v), -1.0, static_cast<double>(n) - 1) + 1);
            };
            for (uint32_t y = from(q.y - reach); y < to(q.y + reach, grid_.height); ++y)
                for (uint32_t x = from(q.x - reach); x < to(q.x + reach, grid_.width); ++x) {
                    const glm::dvec2 d(x - q.x, y - q.y);
                    const double squared = glm::dot(d, d);
                    const size_t at = grid_.at(x, y);
                    if (squared > reach * reach || squared >= nearest[at]) continue;
                    nearest[at] = squared;
                    guide_[at] = i;
                }
        }
    }

    /// By squares of samples, whose neighbours are looked for once.
    void sampleAll() {
        slopes_.assign(grid_.heights.size(), glm::dvec2(0));
        nearest_.assign(grid_.heights.size(), 0);
        nearestPoint_.assign(grid_.heights.size(), PointPatch::kNoPoint);
        Square square;
        for (uint32_t y = 0; y < grid_.height; y += kSquare)
            for (uint32_t x = 0; x < grid_.width; x += kSquare) {
                square.n = 0;
                for (uint32_t j = y; j < std::min(y + kSquare, grid_.height); ++j)
                    for (uint32_t i = x; i < std::min(x + kSquare, grid_.width); ++i) addTo(square, grid_.at(i, j));
                if (square.n > 0) sampleSquare(square);
            }
    }
    static constexpr uint32_t kSquare = 4;
    struct Square {
        std::array<size_t, kSquare * kSquare> sample;
        std::array<glm::dvec3, kSquare * kSquare> place;
        std::array<double, kSquare * kSquare> start;  ///< above the plane
        std::array<uint32_t, kSquare * kSquare> guide;
        size_t n = 0;
    };
    void addTo(Square& square, size_t s) const {
        if (guide_[s] == kNobody) return;
        const uint32_t i = guide_[s];
        const glm::dvec3 q = grid_.local(s_.elements.centre[i]);
        const glm::dvec2 at(static_cast<double>(s % grid_.width), static_cast<double>(s / grid_.width));
        // On the guide's own plane.
        const glm::dvec3 n = glm::transpose(grid_.frame) * glm::dvec3(s_.elements.normal[i]);
        const double start = q.z - (n.x * (at.x - q.x) + n.y * (at.y - q.y)) * grid_.step / std::max(n.z, kLeastFacing);
        square.sample.at(square.n) = s;
        square.place.at(square.n) =
            grid_.origin + grid_.frame * glm::dvec3(at.x * grid_.step, at.y * grid_.step, start);
        square.start.at(square.n) = start;
        square.guide.at(square.n) = i;
        ++square.n;
    }
    void sampleSquare(const Square& square) {
        PlacesNear places(s_, {square.place.data(), square.n}, {square.guide.data(), square.n});
        for (size_t k = 0; k < square.n; ++k) {
            const size_t s = square.sample.at(k);
            LeastSquaresSample sample;
            if (!leastSquaresAt(places, square.place.at(k), grid_.frame, square.guide.at(k), sample)) continue;
            // Without overlap, what is nearest to another segment's points is that one's.
            if (closing_ != PatchClosing::overlap &&
                !std::binary_search(segment_.begin(), segment_.end(), sample.nearestPoint))
                continue;
            grid_.heights[s] = square.start.at(k) + sample.height;
            slopes_[s] = sample.slope;
            nearest_[s] = sample.nearest;
            nearestPoint_[s] = sample.nearestPoint;
            grid_.normals[s] = glm::vec3(grid_.frame * glm::normalize(glm::dvec3(-sample.slope, 1)));
            grid_.colours[s] = s_.colour.empty() ? kPlainColour : packed(sample.colour);
        }
    }
    static uint32_t packed(const glm::vec3& linear) {
        uint32_t rgb = 0;
        for (int k = 0; k < 3; ++k) rgb |= unitToByte(shared::srgbFromLinear(std::max(linear[k], 0.0f))) << (8 * k);
        return rgb;
    }

    /// With four samples, none of which jumps from the slope of its neighbours.
    void chooseCells() {
        for (uint32_t j = 0; j + 1 < grid_.height; ++j)
            for (uint32_t i = 0; i + 1 < grid_.width; ++i) {
                const auto c = grid_.corners(i, j);
                bool all = true;
                for (const size_t s : c) all = all && grid_.has(s);
                grid_.cells[grid_.cell(i, j)] = all && isEven(c[0], c[1], 0) && isEven(c[2], c[3], 0) &&
                                                        isEven(c[0], c[2], 1) && isEven(c[1], c[3], 1)
                                                    ? 1
                                                    : 0;
            }
    }
    bool isEven(size_t a, size_t b, int axis) const {
        const double rise = (grid_.heights[b] - grid_.heights[a]) / grid_.step;
        return std::abs(rise - slopes_[a][axis]) <= kUneven || std::abs(rise - slopes_[b][axis]) <= kUneven;
    }

    void measure(PointPatch& out) const {
        Patch& p = out.patch;
        const PatchHeights heights(p);
        const glm::dvec3 axis = p.frame()[2];
        for (const uint32_t i : segment_) {
            const glm::dvec3 q = heights.local(s_.elements.centre[i]);
            glm::dvec2 slope(0);
            const double off = std::abs(heights.at(q.x, q.y, &slope) - q.z);
            if (!(off <= grid_.step)) {
                const double beside = closing_ == PatchClosing::overlap ? 1e300 : toSamples(p, q);
                if (beside <= kBeside * grid_.step) {
                    ++out.represented;
                    p.errorFromSource = std::max(p.errorFromSource, beside);
                    out.fromSource += beside * beside;
                } else {
                    out.left.push_back(i);
                }
                continue;
            }
            ++out.represented;
            p.errorFromSource = std::max(p.errorFromSource, off);
            const double squared = off * off / (1 + glm::dot(slope, slope) / (grid_.step * grid_.step));
            out.fromSource += squared;
        }
        measureSamples(axis, out);
    }
    /// From a place (as PatchHeights has it) to the nearest of the samples around it.
    static double toSamples(const Patch& p, const glm::dvec3& q) {
        double least = 1e300;
        const auto i = static_cast<int>(std::floor(q.x)), j = static_cast<int>(std::floor(q.y));
        for (int y = std::max(j - 1, 0); y <= std::min(j + 2, static_cast<int>(p.height) - 1); ++y)
            for (int x = std::max(i - 1, 0); x <= std::min(i + 2, static_cast<int>(p.width) - 1); ++x) {
                const uint16_t code = p.heights[p.at(static_cast<uint32_t>(x), static_cast<uint32_t>(y))];
                if (code == 0) continue;
                const double step = p.step;
                least = std::min(least,
                                 glm::length(glm::dvec3((q.x - x) * step, (q.y - y) * step, q.z - code * p.quantum())));
            }
        return least;
    }
    /// Of any place of a triangle: as far as one of its corners is from a point, and the way there more, which is at
    /// most the longest side over sqrt(3).
    void measureSamples(const glm::dvec3& axis, PointPatch& out) const {
        Patch& p = out.patch;
        const glm::dvec3 shift = grid_.local(p.origin + axis * (0.5 * p.quantum()));
        const auto i0 = static_cast<uint32_t>(std::lround(shift.x)), j0 = static_cast<uint32_t>(std::lround(shift.y));
        const PatchSurface surface(p);
        const auto inGrid = [&](size_t sample) {
            const auto i = static_cast<uint32_t>(sample % p.width), j = static_cast<uint32_t>(sample / p.width);
            return grid_.at(i + i0, j + j0);
        };
        const auto nearest = [&](size_t sample) { return nearest_[inGrid(sample)] + 0.5 * p.quantum(); };
        double sum = 0;
        uint64_t samples = 0;
        out.nearest.assign(p.heights.size(), PointPatch::kNoPoint);
        for (size_t s = 0; s < p.heights.size(); ++s)
            if (p.heights[s] != 0) {
                sum += nearest(s) * nearest(s);
                ++samples;
                out.nearest[s] = nearestPoint_[inGrid(s)];
            }
        surface.triangles([&](size_t a, size_t b, size_t c) {
            const glm::dvec3 x = surface.position(a), y = surface.position(b), z = surface.position(c);
            const double longest = std::max({glm::distance(x, y), glm::distance(y, z), glm::distance(z, x)});
            p.errorToSource =
                std::max(p.errorToSource, std::max({nearest(a), nearest(b), nearest(c)}) + longest / std::sqrt(3.0));
        });
        out.toSource = samples > 0 ? sum / static_cast<double>(samples) * static_cast<double>(out.represented) : 0;
    }

    static constexpr double kBeside = 1.5;       ///< steps: of points where patches end before their border
    static constexpr double kFlatness = 0.05;    ///< steps: of what is flat and without noise
    static constexpr double kLeastFacing = 0.2;  ///< cosine between a guide's normal and the axis

    const PointSurface& s_;
    const Segment& all_;
    Segment segment_, steep_;
    PatchClosing closing_;
    NormalCone cone_;
    double area_ = 0;  ///< over the plane
    HeightGrid grid_;
    bool isPlanned_ = false;
    std::vector<uint32_t> guide_;  ///< of samples
    std::vector<glm::dvec2> slopes_;
    std::vector<double> nearest_;
    std::vector<uint32_t> nearestPoint_;
};

}  // namespace

PointPatch patchOfPoints(const PointSurface& surface, const Segment& segment, double step, PatchClosing closing) {
    return Sampler(surface, segment, step, closing).run();
}

double stepOf(const PointSurface& surface, const Segment& segment, double samples) {
    glm::dvec3 sum(0);
    for (const uint32_t i : segment) sum += surface.elements.area[i] * glm::dvec3(surface.elements.normal[i]);
    return std::sqrt(glm::length(sum) / (samples * static_cast<double>(segment.size())));
}

}  // namespace stipple::lod
