// Simplification of small separate parts that keeps what they cover.
//
// Collapsing edges takes area away: a twig becomes a sliver, a leaf loses its curve. What a picture shows of many small
// parts, seen from all sides, is their mean projected area (Cauchy: a quarter of the surface of what is convex). It is
// measured along directions all around before and after, and the difference is made up for by widening what is left:
// across the line that a part bends round (leaves, what has become flat) or along the normals (tubes), whichever moves
// less. Bodies are left alone: what they lose is on their outline, and hidden folds would make them grow. How far
// vertices move is measured with all the rest (deviation.cpp), so that the stated error bounds it.
#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>

#include "engine/base/numbers.h"
#include "lod/builder/mesh/parts.h"
#include "lod/builder/mesh/parts_cover.h"
#include "lod/builder/mesh/parts_versions.h"

namespace stipple::lod {
namespace {

constexpr double kMostWiden = 6;                   ///< times; more would turn a rest into something else
constexpr double kMostNarrow = 0.9;                ///< of the width
constexpr double kFewestOf = 0.02;                 ///< of what it covered: less is nothing to widen
constexpr int kRowsOfPart = 6, kRowsOfGroup = 24;  ///< see coverOf
constexpr double kCloseEnough = 1e-3;

/// By number of vertex in a part: where it may move, or how far along.
using Places = std::vector<glm::dvec3>;

/// One part of a group while it is simplified; indices into `at`.
struct Part {
    std::vector<uint32_t> fine, coarse;  ///< local vertices, 3 a triangle
    PartShape shape;                     ///< of `fine`
    double wanted = 0, reached = 0;      ///< mean projected area
    bool isCoarser = false;
};

/// Mean projected area over directions all around. Of what is drawn from one side only: of the faces in front; of the
/// rest: of the larger of the two sides, since what is closed shows one of them.
class Coverage {
  public:
    Coverage(const WeldedMesh& mesh, const LocalMesh& local) : mesh_(mesh), local_(local) {}
    /// `at(i)`: where the i-th corner is.
    template <typename At>
    double of(const std::vector<uint32_t>& indices, const At& at) const {
        std::array<double, kCoverDirections> front{}, back{};
        double oneSided = 0;
        bool isAnyTwoSided = false;
        for (size_t i = 0; i < indices.size(); i += 3) {
            const glm::dvec3 a = at(i), n = 0.5 * glm::cross(at(i + 1) - a, at(i + 2) - a);
            if ((mesh_.vertices.low[local_.global[indices[i]]].surface & shared::kSurfaceTwoSided) == 0) {
                oneSided += 0.25 * glm::length(n);
                continue;
            }
            isAnyTwoSided = true;
            for (size_t d = 0; d < kCoverDirections; ++d) {
                const double share = glm::dot(n, directions_.at(d).to);
                (share > 0 ? front : back).at(d) += std::abs(share);
            }
        }
        if (!isAnyTwoSided) return oneSided;
        double sum = 0;
        for (size_t d = 0; d < kCoverDirections; ++d)
            sum += directions_.at(d).share * std::max(front.at(d), back.at(d));
        return sum + oneSided;
    }
    double of(const std::vector<uint32_t>& indices) const {
        return of(indices, [&](size_t i) { return glm::dvec3(local_.position[indices[i]]); });
    }

  private:
    const WeldedMesh& mesh_;
    const LocalMesh& local_;
    const std::array<CoverDirection, kCoverDirections>& directions_ = coverDirections();
};

/// The line that a part bends round: its longest axis, bent by a polynomial of as high a degree as its vertices tell.
class Bend {
  public:
    Bend(const std::vector<uint32_t>& indices, const LocalMesh& local, const PartShape& shape) : shape_(shape) {
        std::vector<uint32_t> vertices = indices;
        std::sort(vertices.begin(), vertices.end());
        vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
        const auto at = [&](uint32_t v) { return glm::dvec3(local.position[v]); };
        for (const uint32_t v : vertices)
            reach_ = std::max(reach_, std::abs(glm::dot(at(v) - shape.centre, shape.axis)));
        const int degree = vertices.size() < 8 ? 0 : vertices.size() < 16 ? 2 : 4;
        if (degree == 0 || reach_ <= 0) return;
        Eigen::MatrixXd m = Eigen::MatrixXd::Zero(degree + 1, degree + 1);
        Eigen::MatrixXd places = Eigen::MatrixXd::Zero(degree + 1, 3);
        for (const uint32_t v : vertices) {
            const Powers p = powersOf(at(v));
            const glm::dvec3 off = straight(at(v));
            for (int i = 0; i <= degree; ++i) {
                for (int j = 0; j <= degree; ++j)
                    m(i, j) += p.at(static_cast<size_t>(i)) * p.at(static_cast<size_t>(j));
                for (int k = 0; k < 3; ++k) places(i, k) += p.at(static_cast<size_t>(i)) * off[k];
            }
        }
        constexpr double kLittle = 1e-6;  // where rings stand at fewer places than the degree asks for
        m.diagonal().array() += kLittle * static_cast<double>(vertices.size());
        const Eigen::MatrixXd solved = m.ldlt().solve(places);
        for (int i = 0; i <= degree; ++i) weights_.emplace_back(solved(i, 0), solved(i, 1), solved(i, 2));
    }
    /// From the axis to `p`.
    glm::dvec3 straight(const glm::dvec3& p) const {
        const glm::dvec3 d = p - shape_.centre;
        return d - glm::dot(d, shape_.axis) * shape_.axis;
    }
    /// From the line to `p`, at right angles to the axis.
    glm::dvec3 across(const glm::dvec3& p) const {
        glm::dvec3 d = straight(p);
        if (weights_.empty()) return d;
        const Powers powers = powersOf(p);
        for (size_t i = 0; i < weights_.size(); ++i) d -= powers.at(i) * weights_[i];
        return d;
    }

  private:
    using Powers = std::array<double, 5>;
    Powers powersOf(const glm::dvec3& p) const {
        const double t = glm::dot(p - shape_.centre, shape_.axis) / reach_;
        return {1, t, t * t, t * t * t, t * t * t * t};
    }
    PartShape shape_;
    double reach_ = 0;
    std::vector<glm::dvec3> weights_;
};

class Widening {
  public:
    Widening(const WeldedMesh& mesh, const LocalMesh& local, const Coverage& coverage)
        : mesh_(mesh), local_(local), coverage_(coverage) {}

    /// Where the vertices of `part` are to be so that it covers what is wanted, as far as that goes: by vertex.
    void widen(Part& part, std::vector<glm::dvec3>& to) {
        const PartShape& shape = part.shape;
        collect(part);
        const double now = coverage_.of(part.coarse);
        part.reached = now;
        if (now < kFewestOf * part.wanted || part.wanted <= 0) return;
        if (shape.thickness > kThickPart) {
            part.wanted = now;
            return;
        }
        const Bend bend(part.fine, local_, shape);
        across_.clear();
        for (const glm::dvec3& p : at_) across_.push_back(bend.across(p));
        Move best = solve(part, now, part.wanted / now - 1, kMostWiden - 1, across_);
        const Places* field = &across_;
        const auto tryAlso = [&](const Move& move, const Places& by) {
            if (!move.isBetterThan(best, part.wanted)) return;
            best = move;
            field = &by;
        };
        if (part.wanted > now) {
            const double reach = typical(across_);
            tryAlso(solve(part, now, reach * (part.wanted / now - 1), reach * kMostWiden, normal_), normal_);
        } else {
            straight_.clear();
            for (const glm::dvec3& p : at_) straight_.push_back(bend.straight(p));
            tryAlso(solve(part, now, part.wanted / now - 1, kMostWiden - 1, straight_), straight_);
        }
        for (size_t k = 0; k < vertices_.size(); ++k) to[vertices_[k]] = at_[k] + best.by * (*field)[k];
        part.reached = best.covers;
    }

  private:
    struct Move {
        double by = 0, covers = 0, farthest = 0;
        bool isBetterThan(const Move& o, double wanted) const {
            const double off = std::abs(covers - wanted), other = std::abs(o.covers - wanted);
            constexpr double kSame = 0.02;
            if (std::max(off, other) > kSame * wanted && std::abs(off - other) > kSame * wanted) return off < other;
            return farthest < o.farthest;
        }
    };

    uint32_t positionOf(uint32_t v) const { return mesh_.position[local_.global[v]]; }

    /// The vertices that are left and their normals, one for all of a position.
    void collect(const Part& part) {
        vertices_ = part.coarse;
        std::sort(vertices_.begin(), vertices_.end());
        vertices_.erase(std::unique(vertices_.begin(), vertices_.end()), vertices_.end());
        at_.clear();
        for (const uint32_t v : vertices_) at_.emplace_back(local_.position[v]);
        corner_.clear();
        for (const uint32_t v : part.coarse)
            corner_.push_back(
                static_cast<uint32_t>(std::lower_bound(vertices_.begin(), vertices_.end(), v) - vertices_.begin()));
        byPosition_.clear();
        for (uint32_t k = 0; k < vertices_.size(); ++k) byPosition_.emplace_back(positionOf(vertices_[k]), k);
        std::sort(byPosition_.begin(), byPosition_.end());
        normal_.assign(vertices_.size(), glm::dvec3(0));
        for (size_t i = 0; i < corner_.size(); i += 3) {
            const glm::dvec3& a = at_[corner_[i]];
            const glm::dvec3 n = glm::cross(at_[corner_[i + 1]] - a, at_[corner_[i + 2]] - a);
            for (size_t k = 0; k < 3; ++k) normal_[corner_[i + k]] += n;
        }
        for (size_t i = 0; i < byPosition_.size();) {
            size_t j = i;
            glm::dvec3 sum(0);
            for (; j < byPosition_.size() && byPosition_[j].first == byPosition_[i].first; ++j)
                sum += normal_[byPosition_[j].second];
            const double length = glm::length(sum);
            for (; i < j; ++i) normal_[byPosition_[i].second] = length > 0 ? sum / length : glm::dvec3(0);
        }
    }

    /// Mean over the corners.
    double typical(const Places& field) const {
        double sum = 0;
        for (const uint32_t k : corner_) sum += glm::length(field[k]);
        return sum / static_cast<double>(corner_.size());
    }

    /// How much of `field` makes the part cover what is wanted: secants, from a guess, up to `most`.
    Move solve(const Part& part, double now, double guess, double most, const Places& field) {
        double low = 0, lowCovers = now;
        Move move{std::clamp(guess, -kMostNarrow, most), 0, 0};
        constexpr int kSteps = 8;
        Move best{0, now, 0};
        for (int k = 0; k < kSteps; ++k) {
            moved_.clear();
            for (size_t i = 0; i < at_.size(); ++i) moved_.push_back(at_[i] + move.by * field[i]);
            move.covers = coverage_.of(part.coarse, [&](size_t i) { return moved_[corner_[i]]; });
            if (std::abs(move.covers - part.wanted) < std::abs(best.covers - part.wanted)) best = move;
            if (std::abs(move.covers - part.wanted) <= kCloseEnough * part.wanted) break;
            const double slope = (move.covers - lowCovers) / (move.by - low);
            if (!std::isfinite(slope) || slope == 0) break;
            const double next = move.by + (part.wanted - move.covers) / slope;
            low = move.by;
            lowCovers = move.covers;
            move.by = std::clamp(next, -kMostNarrow, most);
            if (move.by == low) break;
        }
        for (const glm::dvec3& by : field) best.farthest = std::max(best.farthest, std::abs(best.by) * glm::length(by));
        return best;
    }

    const WeldedMesh& mesh_;
    const LocalMesh& local_;
    const Coverage& coverage_;
    std::vector<uint32_t> vertices_;    ///< of the part, ascending
    std::vector<uint32_t> corner_;      ///< of each corner its vertex's number in these
    Places at_, normal_;                ///< of each vertex
    Places across_, straight_, moved_;  ///< of each, while a part is widened
    std::vector<std::pair<uint32_t, uint32_t>> byPosition_;
};

/// Vertices that moved, as new ones.
void moveVertices(std::vector<uint32_t>& coarse, const std::vector<glm::dvec3>& to, int least, int largest,
                  const WeldedMesh& mesh, LocalMesh& local) {
    std::vector<uint32_t> copy(local.position.size(), ~0u);
    for (uint32_t& v : coarse) {
        if (copy[v] == ~0u) {
            const Steps from = mesh.at(local.global[v]);
            const glm::ivec3 moved = movedPlace(from, to[v] - glm::dvec3(local.position[v]), least, largest);
            copy[v] = v;
            if (Steps(moved) != from) {
                copy[v] = static_cast<uint32_t>(local.position.size());
                local.position.emplace_back(Steps(moved) - local.shift);
                local.global.push_back(local.global[v]);
                local.movedFrom.push_back(v);
                local.movedTo.push_back(moved);
            }
        }
        v = copy[v];
    }
}

/// `at(v)`: where vertex v is.
template <typename At>
std::vector<CoverTriangle> trianglesOf(const WeldedMesh& mesh, const LocalMesh& local,
                                       const std::vector<uint32_t>& indices, const At& at) {
    std::vector<CoverTriangle> out;
    out.reserve(indices.size() / 3);
    for (size_t i = 0; i < indices.size(); i += 3) {
        const uint32_t surface = mesh.vertices.low[local.global[indices[i]]].surface;
        out.push_back(
            {{at(indices[i]), at(indices[i + 1]), at(indices[i + 2])}, (surface & shared::kSurfaceTwoSided) != 0});
    }
    return out;
}

/// The parts of one group on their way to fewer triangles.
class PartGroup {
  public:
    PartGroup(const WeldedMesh& mesh, const LocalMesh& local)
        : mesh_(mesh), local_(local), coverage_(mesh, local), widening_(mesh, local, coverage_) {
        for (const glm::vec3& p : local.position) to_.emplace_back(p);
        std::vector<uint32_t> ofTriangle;
        parts_.resize(partsOf(mesh, local, local.indices, ofTriangle));
        for (size_t i = 0; i < local.indices.size(); ++i) parts_[ofTriangle[i / 3]].fine.push_back(local.indices[i]);
    }

    /// Where vertices are.
    auto from() const {
        return [this](uint32_t v) { return glm::dvec3(local_.position[v]); };
    }

    void simplify(size_t target) {
        std::vector<std::vector<PartVersion>> versions;
        versions.reserve(parts_.size());
        for (Part& part : parts_) {
            part.shape = shapeOf(part.fine, local_);
            const uint32_t surface = mesh_.vertices.low[local_.global[part.fine[0]]].surface;
            versions.push_back(versionsOf(part.fine, part.shape, local_, (surface & shared::kSurfaceTwoSided) != 0));
        }
        const std::vector<uint32_t> chosen = chooseVersions(versions, target);
        for (size_t k = 0; k < parts_.size(); ++k) {
            parts_[k].isCoarser = chosen[k] > 0;
            parts_[k].coarse = std::move(versions[k][chosen[k]].indices);
        }
    }

    /// Each part on its own, as far as it can be widened; what is missing then, the others make up for.
    void widenParts() {
        double covered = 0, able = 0;
        for (Part& part : parts_) {
            part.wanted = part.reached = coverage_.of(part.fine);
            if (part.isCoarser) {
                part.wanted *= hiddenMore(part);
                widening_.widen(part, to_);
            }
            all_ += part.wanted;
            covered += part.reached;
        }
        const auto isAble = [](const Part& p) { return p.reached > 0 && p.reached >= 0.99 * p.wanted; };
        for (const Part& part : parts_) able += isAble(part) ? part.reached : 0;
        if (covered >= (1 - kCloseEnough) * all_ || able <= 0) return;
        for (Part& part : parts_)
            if (isAble(part)) widenBy(part, std::min(1 + (all_ - covered) / able, kMostWiden));
    }

    /// Parts hide each other: twigs begin inside of branches. Of that, too, there is to be as much as before.
    void widenTogether() {
        const glm::dvec3 axis(0.36, 0.48, 0.8);  // none that things stand along
        double changed = 0;
        for (const Part& part : parts_) changed += part.isCoarser ? part.reached : 0;
        const auto at = [&](uint32_t v) { return to_[v]; };
        const double before = coverOf(trianglesOf(mesh_, local_, local_.indices, from()), axis, kRowsOfGroup),
                     after = coverOf(trianglesOf(mesh_, local_, coarse(), at), axis, kRowsOfGroup);
        if (after <= 0 || changed <= 0) return;
        const double ratio = std::clamp(1 + (before / after - 1) * all_ / changed, 0.8, 1.25);
        for (Part& part : parts_)
            if (part.isCoarser) widenBy(part, ratio);
    }

    std::vector<uint32_t> coarse() const {
        std::vector<uint32_t> out;
        for (const Part& part : parts_) out.insert(out.end(), part.coarse.begin(), part.coarse.end());
        return out;
    }
    const std::vector<glm::dvec3>& places() const { return to_; }

  private:
    void widenBy(Part& part, double factor) {
        part.wanted *= factor;
        widening_.widen(part, to_);
    }
    /// How much more of its area the coarse version hides behind itself than the fine one.
    double hiddenMore(const Part& part) const {
        // Of leaves, of which both sides count, Coverage knows it well enough.
        if ((mesh_.vertices.low[local_.global[part.fine[0]]].surface & shared::kSurfaceTwoSided) != 0) return 1;
        const glm::dvec3& axis = part.shape.axis;
        const double coarse = coverOf(trianglesOf(mesh_, local_, part.coarse, from()), axis, kRowsOfPart),
                     fine = coverOf(trianglesOf(mesh_, local_, part.fine, from()), axis, kRowsOfPart);
        const double ofArea = fine * coverage_.of(part.coarse), area = coarse * coverage_.of(part.fine);
        return area > 0 ? std::clamp(ofArea / area, 0.5, 2.0) : 1;
    }

    const WeldedMesh& mesh_;
    const LocalMesh& local_;
    Coverage coverage_;
    Widening widening_;
    std::vector<Part> parts_;
    std::vector<glm::dvec3> to_;  ///< where each vertex of `local` is to be
    double all_ = 0;              ///< wanted of all parts
};

}  // namespace

glm::ivec3 movedPlace(const Steps& from, const glm::dvec3& by, int least, int largest) {
    const glm::dvec3 to = glm::clamp(glm::dvec3(from) + glm::round(by), glm::dvec3(least), glm::dvec3(largest));
    return {toWhole<int>(to.x), toWhole<int>(to.y), toWhole<int>(to.z)};
}

std::vector<uint32_t> simplifyParts(const WeldedMesh& mesh, LocalMesh& local, size_t target, int least, int largest) {
    PartGroup group(mesh, local);
    group.simplify(target);
    group.widenParts();
    group.widenTogether();
    std::vector<uint32_t> out = group.coarse();
    moveVertices(out, group.places(), least, largest, mesh, local);
    return out;
}

}  // namespace stipple::lod
