#include "lod/builder/scan_store/scan_cell.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/base/numbers.h"
#include "lod/builder/scan_store/scan_levels.h"
#include "lod/builder/scan_store/scan_points.h"
#include "lod/store/patch_bytes.h"

namespace stipple::lod {
namespace {

constexpr double kFinest = 0.25;     ///< steps of leaves, in those of their level
constexpr double kFar = 0.5;         ///< steps, of patches from those of the children
constexpr double kUnited = 0.25;     ///< cells of discs of inner nodes, in steps
constexpr size_t kManyDiscs = 8192;  ///< of a node: of more, each level has a fourth
constexpr double kMostSamples = 2;   ///< of leaves, for each point
constexpr double kFewSamples = 64;   ///< that nobody counts
constexpr double kAsked = 1.1;       ///< of the samples asked for, that are good enough
constexpr int kMostTries = 3;        ///< more, of another step
constexpr double kReach = 3;         ///< of points beside a node, in spacings of its own
constexpr double kMostReach = 6;     ///< steps of its level
constexpr double kDisc = 0.75;       ///< radius of a point that stays one, in spacings
constexpr double kLargestDisc = 1;   ///< steps of its level

struct ScanNode : PatchNode {
    size_t begin = 0, end = 0;   ///< of its points, in order
    std::vector<Patch> patches;  ///< as they are in the file
    std::vector<LeftDisc> left;
    PointBlock up;  ///< samples for its parent
};

enum class Sent : uint8_t {
    child,  ///< a node, and what is around it that its parent needs and nobody else sends
    strip   ///< samples beside another node
};

/// What a node has become before it is written.
struct MadeNode {
    ScanPatches patches;
    std::vector<LeftDisc> left;
    double error = 0;
};

class ScanCell {
  public:
    ScanCell(const WorkCell& cell, const Frame& frame, const std::vector<Subtree>& subtrees,
             const ScanCellSettings& settings, Executor& executor)
        : frame_(frame), subtrees_(subtrees), settings_(settings), executor_(executor), silent_(false) {
        nodes_.push_back(nodeAt(static_cast<uint32_t>(cell.level), cell.key));
    }

    Result<void> takeInput(const std::vector<uint8_t>& bytes) {
        std::vector<ScanPoint> points(bytes.size() / sizeof(ScanPoint));
        if (bytes.size() % sizeof(ScanPoint) != 0) return damaged();
        if (!points.empty()) std::memcpy(points.data(), bytes.data(), bytes.size());
        for (const ScanPoint& p : points) table_.duplicate += isOwn(glm::dvec3(p.x, p.y, p.z)) ? 1 : 0;
        s_ = pointSurface(blockOf(points), settings_.isStopped, executor_, silent_);
        if (isStopped()) return {};
        for (uint32_t i = 0; i < s_.size(); ++i) {
            const glm::dvec3 p = placeOf(i);
            if (!isOwn(p)) continue;
            const Steps at(p);
            table_.lo = order_.empty() ? at : glm::min(table_.lo, at);
            table_.hi = order_.empty() ? at : glm::max(table_.hi, at);
            order_.push_back({keyOfPlace(frame_, p), i});
        }
        table_.elements = order_.size();
        table_.duplicate -= order_.size();
        isMade_ = !order_.empty();
        std::sort(order_.begin(), order_.end());
        nodes_[0].end = order_.size();
        if (isMade_) partition();
        return {};
    }

    Result<void> takeBelow(const std::vector<FromBelow>& below) {
        for (const FromBelow& sender : below) {
            ByteReader from(sender.bytes);
            Sent what{};
            from.get(what);
            if (what == Sent::child) {
                PatchNode head;  // (whole: what derives from it may begin in its last bytes)
                from.get(head);
                ScanNode node;
                static_cast<PatchNode&>(node) = head;
                std::vector<uint8_t> patches;
                from.get(patches);
                from.get(node.left);
                if (!getBlock(from, node.up)) return damaged();
                STIPPLE_ASSIGN(node.patches, decodePatches(patches, "a temporary file"));
                nodes_.push_back(std::move(node));
            }
            if (!getBlock(from, around_) || !from.isWhole()) return damaged();
        }
        // In octant order.
        std::sort(nodes_.begin() + 1, nodes_.end(), [](const ScanNode& a, const ScanNode& b) { return a.key < b.key; });
        nodes_[0].node.firstChild = 1;
        for (size_t c = 1; c < nodes_.size(); ++c) nodes_[0].node.childMask |= octantOf(nodes_[c].node);
        isMade_ = nodes_.size() > 1;
        firstOwn_ = nodes_.size();
        return {};
    }

    CellProduct run(bool isLast) {
        CellProduct out;
        ByteWriter to;
        if (!isMade_) {  // (only others' strips came here)
            table_.put(to);
            out.table = to.bytes();
            return out;
        }
        uint32_t deepest = nodes_[0].node.level;
        if (firstOwn_ == 0)
            for (const ScanNode& n : nodes_) deepest = std::max<uint32_t>(deepest, n.node.level);
        for (uint32_t level = deepest + 1; level-- > nodes_[0].node.level && !isStopped();) makeLevel(level);
        out.chunks = std::move(table_.batch.bytes);
        table_.batch.bytes = {};
        table_.put(to);
        out.table = to.bytes();
        if (!isLast) out.up = goingUp();
        return out;
    }

  private:
    static tl::unexpected<Error> damaged() {
        return fail(ErrorKind::input, "a temporary file is not what was written", "", "build again");
    }
    bool isStopped() const { return settings_.isStopped && settings_.isStopped(); }
    ScanNode nodeAt(uint32_t level, Key key) const {
        ScanNode n;
        static_cast<PatchNode&>(n) = patchNodeAt(frame_, level, key);
        return n;
    }
    glm::dvec3 placeOf(uint32_t i) const { return s_.elements.centre[i] + s_.middle; }
    bool isOwn(const glm::dvec3& p) const {
        const uint32_t shift = frame_.shiftOf(nodes_[0].node.level);
        return keyOfPlace(frame_, p) >> shift == nodes_[0].key >> shift;
    }

    /// An octree of the points, breadth first; children stand side by side.
    void partition() {
        for (size_t i = 0; i < nodes_.size(); ++i) {
            const uint32_t level = nodes_[i].node.level;
            const size_t begin = nodes_[i].begin, end = nodes_[i].end;
            if (level >= frame_.keyLevels || end - begin <= settings_.leafPoints) continue;
            nodes_[i].node.firstChild = static_cast<uint32_t>(nodes_.size());
            const uint32_t shift = frame_.shiftOf(level + 1);
            for (size_t first = begin, last = begin; first < end; first = last) {
                const Key key = order_[first].first >> shift;
                while (last < end && order_[last].first >> shift == key) ++last;
                ScanNode child = nodeAt(level + 1, key << shift);
                child.begin = first;
                child.end = last;
                nodes_[i].node.childMask |= octantOf(child.node);
                nodes_.push_back(std::move(child));
            }
        }
    }

    void makeLevel(uint32_t level) {
        std::vector<size_t> here;
        for (size_t i = 0; i < nodes_.size(); ++i)
            if ((i == 0 || firstOwn_ == 0) && nodes_[i].node.level == level) here.push_back(i);
        std::vector<MadeNode> made(here.size());
        executor_.parallelFor(here.size(), 1, [&](size_t begin, size_t end) {
            for (size_t k = begin; k < end && !isStopped(); ++k) {
                ScanNode& n = nodes_[here[k]];
                made[k] = n.node.isLeaf() ? leaf(n) : inner(n);
                if (level > 0)
                    n.up = samplesFor(made[k].patches, cornerOf(frame_, n.node), scanStep(frame_, level - 1));
                if (!settings_.hasNormals) n.up.normal.clear();
            }
        });
        for (size_t k = 0; k < here.size() && !isStopped(); ++k) write(nodes_[here[k]], made[k]);
    }

    // ---- patches

    /// Of each point of a surface. `reach`: of what is beside.
    std::vector<Lies> liesOf(const PointSurface& s, const Node& n, double reach) const {
        const double edge = frame_.cellSize(n.level);
        const glm::dvec3 lo = cornerOf(frame_, n);
        std::vector<Lies> out(s.size(), Lies::apart);
        for (size_t i = 0; i < s.size(); ++i) {
            const glm::dvec3 p = s.elements.centre[i] + s.middle - lo;
            if (glm::all(glm::greaterThanEqual(p, glm::dvec3(0))) && glm::all(glm::lessThan(p, glm::dvec3(edge))))
                out[i] = Lies::within;
            else if (glm::all(glm::greaterThanEqual(p, glm::dvec3(-reach))) &&
                     glm::all(glm::lessThan(p, glm::dvec3(edge + reach))))
                out[i] = Lies::beside;
        }
        return out;
    }
    double reachOf(const Node& n, std::vector<float> spacings) const {
        const double step = scanStep(frame_, n.level);
        if (spacings.empty()) return kPatchReach * step;
        const auto middle = spacings.begin() + static_cast<ptrdiff_t>(spacings.size() / 2);
        std::nth_element(spacings.begin(), middle, spacings.end());
        return std::clamp(kReach * static_cast<double>(*middle), kPatchReach * step, kMostReach * step);
    }

    /// No more samples than are worth it; where a number is asked for, as many as that, within a tenth.
    ScanPatches patchesOfLeaf(const ScanNode& n, const std::vector<Lies>& lies) const {
        const auto points = static_cast<double>(n.end - n.begin);
        const double aim = settings_.samplesAPoint * points;
        const double most = settings_.isAsked ? kAsked * aim : kMostSamples * points;
        const double least = settings_.isAsked && aim >= kFewSamples ? aim / kAsked : 0;
        ScanSettings how{settings_.coneDegrees, kFinest * scanStep(frame_, n.node.level), settings_.samplesAPoint};
        how.isStopped = settings_.isStopped;
        const std::vector<Segment> segments = segmentsOfScan(s_, lies, how, executor_);
        ScanPatches made;
        for (int tries = 0;; ++tries) {
            const bool isLast = tries == kMostTries;
            if (isLast && !settings_.isAsked) how.mostSamples = most;
            made = patchesOfScan(s_, lies, segments, cornerOf(frame_, n.node), how, executor_);
            const auto samples = static_cast<double>(made.samples());
            if (isLast || samples <= 0 || (samples <= most && samples >= least)) return made;
            how.samplesAPoint *= std::clamp((settings_.isAsked ? aim : 0.9 * most) / samples, 0.25, 4.0);
        }
    }

    MadeNode leaf(const ScanNode& n) const {
        MadeNode out;
        std::vector<float> spacings;
        for (size_t k = n.begin; k < n.end; ++k)
            if (const uint32_t i = order_[k].second; s_.isSurface[i] != 0) spacings.push_back(s_.spacing[i]);
        const double step = scanStep(frame_, n.node.level);
        out.patches = patchesOfLeaf(n, liesOf(s_, n.node, reachOf(n.node, std::move(spacings))));
        for (const uint32_t i : out.patches.left) {
            const double radius = std::min(kDisc * static_cast<double>(s_.spacing[i]), kLargestDisc * step);
            out.left.push_back({placeOf(i), s_.elements.normal[i], toFloat(radius), s_.colour[i]});
        }
        out.error = std::max(out.patches.fromPoints, out.patches.toPoints);
        return out;
    }

    MadeNode inner(const ScanNode& n) const {
        MadeNode out;
        const double step = scanStep(frame_, n.node.level);
        PointBlock points;
        std::vector<ChildPatches> children;
        double error = 0;
        for (const ScanNode& c : childrenOf(n)) {
            for (size_t i = 0; i < c.up.position.size(); ++i) append(points, c.up, i);
            children.push_back({&c.patches, cornerOf(frame_, c.node), frame_.cellSize(c.node.level)});
            out.left.insert(out.left.end(), c.left.begin(), c.left.end());
            error = std::max({error, c.error, c.residual});
        }
        addAround(n.node, points);
        const PointSurface surface = pointSurface(std::move(points), settings_.isStopped, executor_, silent_);
        if (isStopped()) return out;
        ScanSettings how{settings_.coneDegrees, step, 1};
        how.isStopped = settings_.isStopped;
        const glm::dvec3 corner = cornerOf(frame_, n.node);
        const std::vector<Lies> lies = liesOf(surface, n.node, kPatchReach * step);
        out.patches =
            patchesOfScan(surface, lies, segmentsOfScan(surface, lies, how, executor_), corner, how, executor_);
        const LevelSettings level{corner, frame_.cellSize(n.node.level), kFar * step};
        out.error = agreeWithChildren(children, level, out.patches, out.left);
        const size_t most = std::max(kManyDiscs, out.left.size() / 4);
        out.error = error + std::max(out.error, uniteDiscs(out.left, kUnited * step, most));
        return out;
    }
    std::span<const ScanNode> childrenOf(const ScanNode& n) const {
        const auto count = static_cast<size_t>(__builtin_popcount(n.node.childMask));
        return count == 0 ? std::span<const ScanNode>() : std::span(nodes_.data() + n.node.firstChild, count);
    }

    /// What lies around an inner node, about as dense as the samples in it.
    void addAround(const Node& n, PointBlock& points) const {
        const double edge = frame_.cellSize(n.level), step = scanStep(frame_, n.level), reach = kPatchAround * step;
        const glm::dvec3 lo = cornerOf(frame_, n);
        const auto isAround = [&](const glm::dvec3& at) {
            const glm::dvec3 p = at - lo;
            const bool isIn =
                glm::all(glm::greaterThanEqual(p, glm::dvec3(0))) && glm::all(glm::lessThan(p, glm::dvec3(edge)));
            return !isIn && glm::all(glm::greaterThanEqual(p, glm::dvec3(-reach))) &&
                   glm::all(glm::lessThan(p, glm::dvec3(edge + reach)));
        };
        const PointBlock thin = thinned(pointsWhere(isAround), step);
        for (size_t i = 0; i < thin.position.size(); ++i) append(points, thin, i);
    }
    /// Of the points of a subtree those on surfaces, else of the samples of other cells.
    template <typename Use>
    PointBlock pointsWhere(const Use& use) const {
        PointBlock out;
        for (uint32_t i = 0; i < s_.size(); ++i) {
            const glm::dvec3 p = placeOf(i);
            if (s_.isSurface[i] == 0 || !use(p)) continue;
            out.position.push_back(p);
            out.colour.push_back(s_.colour[i]);
            if (settings_.hasNormals) out.normal.push_back(s_.elements.normal[i]);
        }
        for (size_t i = 0; i < around_.position.size(); ++i)
            if (use(around_.position[i])) append(out, around_, i);
        return out;
    }

    // ---- to the file

    void write(ScanNode& n, MadeNode& made) {
        if (n.node.isLeaf()) {
            n.residual = made.patches.fromPoints + settings_.rounding;
            table_.beside = std::max(table_.beside, made.patches.toPoints);
            table_.left += made.left.size();
            table_.discs += made.left.size();
            table_.patches += made.patches.patches.size();
            for (const Patch& p : made.patches.patches) table_.samples += p.samples();
        } else {
            n.error = made.error;
        }
        std::vector<Node> children;
        for (const ScanNode& c : childrenOf(n)) children.push_back(c.node);
        NodePatches out;
        out.patches = std::move(made.patches.patches);
        out.left = std::move(made.left);
        writePatchNode(frame_, children, out, n, table_);
        const auto below = childrenOf(n);
        for (size_t c = 0; c < below.size(); ++c) {  // nobody needs them any more
            ScanNode& child = nodes_[n.node.firstChild + c];
            child.patches = {};
            child.left = {};
            child.up = {};
        }
        n.patches = std::move(out.patches);
        n.left = std::move(out.left);
    }

    // ---- upwards

    std::vector<GoingUp> goingUp() const {
        const PatchNode& own = nodes_[0];
        const uint32_t above = own.node.level - 1u, shift = frame_.shiftOf(above);
        const double edge = frame_.cellSize(above);
        const glm::i64vec3 parent(own.node.cell[0] >> 1, own.node.cell[1] >> 1, own.node.cell[2] >> 1);
        const auto last = static_cast<int64_t>((uint64_t{1} << above) - 1);
        std::vector<GoingUp> out;
        for (int64_t z = -1; z <= 1; ++z)
            for (int64_t y = -1; y <= 1; ++y)
                for (int64_t x = -1; x <= 1; ++x) {
                    const glm::i64vec3 at = parent + glm::i64vec3(x, y, z);
                    if (glm::any(glm::lessThan(at, glm::i64vec3(0))) ||
                        glm::any(glm::greaterThan(at, glm::i64vec3(last))))
                        continue;
                    const glm::dvec3 lo = edge * glm::dvec3(at);
                    const glm::u64vec3 cell(at);
                    const Key key = mortonCode(cell.x, cell.y, cell.z) << shift;
                    if (at == parent)
                        out.push_back({key, child(lo, edge)});
                    else if (std::vector<uint8_t> bytes = strip(lo, edge); !bytes.empty())
                        out.push_back({key, std::move(bytes)});
                }
        return out;
    }

    std::vector<uint8_t> child(const glm::dvec3& lo, double edge) const {
        const ScanNode& own = nodes_[0];
        ByteWriter to;
        to.put(Sent::child);
        to.put(PatchNode(own));
        to.put(encodePatches(own.patches).bytes);
        to.put(own.left);
        putBlock(own.up, to);
        // Of subtrees that are worked on no earlier than the parent: they send nothing before.
        const auto isCarried = [&](const glm::dvec3& p) {
            return isNear(p, lo, edge) && levelOfOwner(subtrees_, keyOfPlace(frame_, p)) < own.node.level;
        };
        putBlock(thinned(pointsWhere(isCarried), scanStep(frame_, own.node.level - 1u)), to);
        return to.bytes();
    }

    std::vector<uint8_t> strip(const glm::dvec3& lo, double edge) const {
        const PointBlock& up = nodes_[0].up;
        PointBlock part;
        for (size_t i = 0; i < up.position.size(); ++i)
            if (isNear(up.position[i], lo, edge)) append(part, up, i);
        if (part.position.empty()) return {};
        ByteWriter to;
        to.put(Sent::strip);
        putBlock(part, to);
        return to.bytes();
    }
    static bool isNear(const glm::dvec3& p, const glm::dvec3& lo, double edge) {
        const glm::dvec3 reach(kScanMargin * edge);
        return glm::all(glm::lessThanEqual(lo - reach, p)) && glm::all(glm::lessThanEqual(p, lo + edge + reach));
    }

    const Frame& frame_;
    const std::vector<Subtree>& subtrees_;
    const ScanCellSettings& settings_;
    Executor& executor_;
    mutable Progress silent_;
    PointSurface s_;                               ///< of a subtree: its points, and those around it
    std::vector<std::pair<Key, uint32_t>> order_;  ///< its own, along the curve
    std::vector<ScanNode> nodes_;                  ///< the first one is the cell's own
    PointBlock around_;                            ///< samples of other cells
    PatchTable table_;
    size_t firstOwn_ = 0;  ///< 0: all nodes are to be made
    bool isMade_ = false;
};

}  // namespace

Result<CellProduct> buildScanCell(const WorkCell& cell, const std::vector<uint8_t>& input,
                                  const std::vector<FromBelow>& below, const Frame& frame,
                                  const std::vector<Subtree>& subtrees, const ScanCellSettings& settings,
                                  Executor& executor) {
    ScanCell work(cell, frame, subtrees, settings, executor);
    if (cell.subtree != WorkCell::kNone) {
        STIPPLE_TRY(work.takeInput(input));
    } else {
        STIPPLE_TRY(work.takeBelow(below));
    }
    return work.run(cell.level == 0);
}

}  // namespace stipple::lod
