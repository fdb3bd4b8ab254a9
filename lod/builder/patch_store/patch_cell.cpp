#include "lod/builder/patch_store/patch_cell.h"

#include <algorithm>
#include <cmath>

#include "engine/base/hash.h"
#include "lod/builder/patch_store/division.h"
#include "lod/builder/patch_store/node_payload.h"
#include "lod/store/patch_bytes.h"

namespace stipple::lod {
namespace {

constexpr double kWanted = 0.1;       ///< error that a simplification may add, in steps of its level
constexpr size_t kMostKept = 65'536;  ///< triangles that go up from a node

struct PatchNode {
    Node node;
    Key key = 0;
    Soup surface;             ///< its triangles; once it is done, what is left of them for its parent
    double surfaceError = 0;  ///< of those, bound of the distance from the source, lattice units
    double residual = 0;      ///< of the leaves below: of their patches from the source
    double error = 0;         ///< of its patches: bound of the distance from those of the leaves
};
/// The same without its triangles, as it goes up.
struct PatchNodeHead {
    Node node;
    Key key = 0;
    double surfaceError = 0, residual = 0, error = 0;
};

enum class Sent : uint8_t {
    child,  ///< a node, and what is around it that its parent needs and nobody else sends
    strip   ///< triangles beside another node
};

class PatchCell {
  public:
    PatchCell(const WorkCell& cell, const Frame& frame, const std::vector<Subtree>& subtrees,
              const PatchCellSettings& settings, Executor& executor)
        : frame_(frame), subtrees_(subtrees), settings_(settings), executor_(executor) {
        nodes_.push_back(nodeAt(static_cast<uint32_t>(cell.level), cell.key));
    }

    Result<void> takeInput(const std::vector<uint8_t>& bytes) {
        Soup all;
        ByteReader from(bytes);
        while (!from.isWhole())
            if (!getSoup(from, all)) return damaged();
        const auto isOwn = [&](size_t t) { return levelKey(keyOfTriangle(all, t), 0) == levelKey(nodes_[0].key, 0); };
        const auto countOwn = [&] {
            uint64_t own = 0;
            for (size_t t = 0; t < all.indices.size() / 3; ++t) own += isOwn(t) ? 1 : 0;
            return own;
        };
        const uint64_t before = countOwn();
        WeldedMesh mesh = weld(all);
        sortTriangles(mesh, all.indices);
        all.vertices = std::move(mesh.vertices);
        table_.triangles = countOwn();
        table_.duplicate = before - table_.triangles;
        SoupPart own(all, nodes_[0].surface), others(all, around_);
        for (size_t t = 0; t < all.indices.size() / 3; ++t) (isOwn(t) ? own : others).add(t);
        const LatticeVertices& v = nodes_[0].surface.vertices;
        for (size_t i = 0; i < v.size(); ++i) {
            table_.lo = i == 0 ? v.at(i) : glm::min(table_.lo, v.at(i));
            table_.hi = i == 0 ? v.at(i) : glm::max(table_.hi, v.at(i));
        }
        if (table_.triangles > 0) partition();
        isMade_ = table_.triangles > 0;
        return {};
    }

    Result<void> takeBelow(const std::vector<FromBelow>& below) {
        for (const FromBelow& sender : below) {
            ByteReader from(sender.bytes);
            Sent what{};
            from.get(what);
            if (what == Sent::child) {
                PatchNodeHead head;
                from.get(head);
                PatchNode node{head.node, head.key, {}, head.surfaceError, head.residual, head.error};
                if (!getSoup(from, node.surface)) return damaged();
                nodes_.push_back(std::move(node));
            }
            if (!getSoup(from, around_) || !from.isWhole()) return damaged();
        }
        // In octant order.
        std::sort(nodes_.begin() + 1, nodes_.end(),
                  [](const PatchNode& a, const PatchNode& b) { return a.key < b.key; });
        nodes_[0].node.firstChild = 1;
        for (size_t c = 1; c < nodes_.size(); ++c) nodes_[0].node.childMask |= octantOf(nodes_[c].node);
        isMade_ = nodes_.size() > 1;
        firstOwn_ = nodes_.size();
        uniteAround();
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
            for (const PatchNode& n : nodes_) deepest = std::max<uint32_t>(deepest, n.node.level);
        for (uint32_t level = deepest + 1; level-- > nodes_[0].node.level;) makeLevel(level, isLast);
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
    static uint8_t octantOf(const Node& n) {
        return static_cast<uint8_t>(1u << ((n.cell[0] & 1u) | (n.cell[1] & 1u) << 1 | (n.cell[2] & 1u) << 2));
    }
    Key keyOfTriangle(const Soup& soup, size_t t) const {
        const glm::u64vec3 p(middleOf(soup, t));
        return frame_.keyOf(p.x, p.y, p.z);
    }
    /// `up`: levels above that of the cell.
    Key levelKey(Key key, uint32_t up) const { return key >> (frame_.shiftOf(nodes_[0].node.level) + 3 * up); }
    glm::dvec3 cornerOf(const Node& n) const {
        return glm::dvec3(n.cell[0], n.cell[1], n.cell[2]) * frame_.cellSize(n.level);
    }

    PatchNode nodeAt(uint32_t level, Key key) const {
        PatchNode n;
        n.key = key;
        n.node.level = static_cast<uint8_t>(level);
        const Key cell = key >> frame_.shiftOf(level);
        n.node.cell = {compactBits(cell), compactBits(cell >> 1), compactBits(cell >> 2)};
        return n;
    }

    /// An octree of the triangles' middles, breadth first.
    void partition() {
        for (size_t i = 0; i < nodes_.size(); ++i) {
            const uint32_t level = nodes_[i].node.level;
            const size_t triangles = nodes_[i].surface.indices.size() / 3;
            if (level >= frame_.keyLevels || triangles <= settings_.leafTriangles) continue;
            const Soup all = std::move(nodes_[i].surface);
            nodes_[i].surface = {};
            std::array<Soup, 8> parts;
            std::vector<SoupPart> to;
            for (Soup& part : parts) to.emplace_back(all, part);
            for (size_t t = 0; t < triangles; ++t)
                to[static_cast<size_t>(keyOfTriangle(all, t) >> frame_.shiftOf(level + 1) & 7u)].add(t);
            nodes_[i].node.firstChild = static_cast<uint32_t>(nodes_.size());
            for (uint64_t octant = 0; octant < 8; ++octant) {
                if (parts.at(octant).indices.empty()) continue;
                nodes_[i].node.childMask |= static_cast<uint8_t>(1u << octant);
                PatchNode child = nodeAt(level + 1, nodes_[i].key | Key{octant} << frame_.shiftOf(level + 1));
                child.surface = std::move(parts.at(octant));
                nodes_.push_back(std::move(child));
            }
        }
    }

    /// What is around came several times.
    void uniteAround() {
        if (around_.indices.empty()) return;
        WeldedMesh mesh = weld(around_);
        sortTriangles(mesh, around_.indices);
        around_.vertices = std::move(mesh.vertices);
    }

    bool isToBeMade(size_t i) const { return i == 0 || firstOwn_ == 0; }

    void makeLevel(uint32_t level, bool isLast) {
        std::vector<size_t> here;
        for (size_t i = 0; i < nodes_.size(); ++i)
            if (isToBeMade(i) && nodes_[i].node.level == level) here.push_back(i);
        for (const size_t i : here) joinChildren(nodes_[i]);
        std::vector<NodePatches> made(here.size());
        executor_.parallelFor(here.size(), 1, [&](size_t begin, size_t end) {
            for (size_t k = begin; k < end; ++k) {
                const PatchNode& n = nodes_[here[k]];
                const NodeSettings how{patchStep(frame_, level), settings_.coneDegrees,
                                       n.node.isLeaf() ? settings_.samplesATriangle : 0.0};
                made[k] = patchesOfNode(n.surface, aroundOf(here[k]), cornerOf(n.node), how, executor_);
            }
        });
        for (size_t k = 0; k < here.size(); ++k) write(nodes_[here[k]], made[k]);
        if (level == nodes_[0].node.level && isLast) return;
        executor_.parallelFor(here.size(), 1, [&](size_t begin, size_t end) {
            for (size_t k = begin; k < end; ++k) {
                PatchNode& n = nodes_[here[k]];
                n.surfaceError += simplify(n.surface, kWanted * patchStep(frame_, level), kMostKept);
            }
        });
    }

    void joinChildren(PatchNode& n) {
        const auto children = static_cast<uint32_t>(__builtin_popcount(n.node.childMask));
        for (uint32_t c = n.node.firstChild; c < n.node.firstChild + children; ++c) {
            appendSoup(nodes_[c].surface, n.surface);
            nodes_[c].surface = {};
            n.surfaceError = std::max(n.surfaceError, nodes_[c].surfaceError);
            n.residual = std::max(n.residual, nodes_[c].residual);
            n.error = std::max(n.error, nodes_[c].error);
        }
        if (children > 0) uniteByPlace(n.surface);
    }

    /// Of nodes that are done or wait, and of other cells.
    AroundNode aroundOf(size_t i) const {
        AroundNode out;
        const Node& n = nodes_[i].node;
        const double cell = frame_.cellSize(n.level);
        const glm::dvec3 lo = cornerOf(n);
        for (size_t k = 0; k < nodes_.size(); ++k) {
            const PatchNode& other = nodes_[k];
            if (k == i || other.surface.indices.empty() || !isNear(other.node, lo, cell)) continue;
            out.add(other.surface, lo, cell);
        }
        out.add(around_, lo, cell);
        return out;
    }
    /// (What was simplified may lie a little beside its cell.)
    bool isNear(const Node& other, const glm::dvec3& lo, double cell) const {
        const double edge = frame_.cellSize(other.level), reach = kPatchMargin * cell + 0.5 * edge;
        const glm::dvec3 from = cornerOf(other) - reach, to = cornerOf(other) + edge + reach;
        return glm::all(glm::lessThanEqual(from, lo + cell)) && glm::all(glm::lessThanEqual(lo, to));
    }

    // ---- to the file

    void write(PatchNode& n, NodePatches& made) {
        Node& out = n.node;
        const glm::dvec3 corner = cornerOf(out);
        // Of the leaves from each other: by way of the source.
        if (out.isLeaf()) {
            n.residual = made.error;
            table_.left += made.trianglesLeft;
            for (const Patch& p : made.patches) table_.samples += p.samples();
            table_.discs += made.left.size();
        } else {
            n.error = std::max(n.error, n.surfaceError + made.error + n.residual);
        }
        uint32_t code = frame_.errors.encodeUp(out.isLeaf() ? 0.0 : n.error);
        DiscPayload discs;
        if (!made.left.empty()) {
            std::vector<LeftDisc> asMade = made.left;
            discs = encodeDiscs(made.left, frame_, out, code);
            if (out.isLeaf()) {
                n.residual += discs.moved;
            } else if (discs.moved > 0) {  // their error is told in them
                n.error += discs.moved;
                code = frame_.errors.encodeUp(n.error);
                discs = encodeDiscs(asMade, frame_, out, code);
            }
        }
        if (out.isLeaf()) table_.residual = std::max(table_.residual, n.residual);
        out.errorCode = static_cast<uint8_t>(code);
        makeSphere(n, made, corner);
        appendPayloads(n, encodePatches(made.patches).bytes, blocksIn(made.patches), discs.bytes,
                       static_cast<uint32_t>(made.left.size()));
    }

    void makeSphere(PatchNode& n, const NodePatches& made, const glm::dvec3& corner) const {
        Node& out = n.node;
        glm::dvec3 lo(1e300), hi(-1e300);
        const auto children = static_cast<uint32_t>(__builtin_popcount(out.childMask));
        for (uint32_t c = out.firstChild; c < out.firstChild + children; ++c) {
            lo = glm::min(lo, nodes_[c].node.centre - nodes_[c].node.radius);
            hi = glm::max(hi, nodes_[c].node.centre + nodes_[c].node.radius);
        }
        addSamples(made.patches, corner, lo, hi);
        for (const LeftDisc& d : made.left) {
            lo = glm::min(lo, d.place - double{d.radius});
            hi = glm::max(hi, d.place + double{d.radius});
        }
        out.centre = 0.5 * (lo + hi);
        out.radius = farthestSample(made.patches, corner, out.centre);
        for (uint32_t c = out.firstChild; c < out.firstChild + children; ++c)
            out.radius = std::max(out.radius, glm::length(nodes_[c].node.centre - out.centre) + nodes_[c].node.radius);
        for (const LeftDisc& d : made.left)
            out.radius = std::max(out.radius, glm::distance(d.place, out.centre) + double{d.radius});
        out.radius *= 1 + 1e-6;
    }

    /// A node's payloads; the patches', if there are any, are the node's own.
    void appendPayloads(const PatchNode& n, const std::vector<uint8_t>& patches, uint32_t blocks,
                        const std::vector<uint8_t>& discs, uint32_t records) {
        NodeBatch& batch = table_.batch;
        NodeBatch::Written w;
        w.node = n.node;
        w.key = n.key;
        w.node.records = blocks > 0 ? blocks : records;
        w.node.chunkOffset = batch.bytes.size();
        w.node.attributeHash = hashBytes(nullptr, 0);
        if (blocks > 0) {
            w.node.chunkBytes = static_cast<uint32_t>(patches.size());
            w.node.chunkHash = hashBytes(patches.data(), patches.size());
            batch.bytes.insert(batch.bytes.end(), patches.begin(), patches.end());
        }
        if (records > 0) {
            table_.points.push_back({static_cast<uint32_t>(batch.nodes.size()), blocks == 0 ? 1u : 0u, records,
                                     static_cast<uint32_t>(discs.size()), batch.bytes.size(),
                                     hashBytes(discs.data(), discs.size())});
            batch.bytes.insert(batch.bytes.end(), discs.begin(), discs.end());
        }
        batch.nodes.push_back(w);
    }

    // ---- upwards

    std::vector<GoingUp> goingUp() const {
        const PatchNode& own = nodes_[0];
        const uint32_t above = own.node.level - 1u, shift = frame_.shiftOf(above);
        const double cell = frame_.cellSize(above);
        const std::array<int64_t, 3> parent{static_cast<int64_t>(own.node.cell[0] >> 1),
                                            static_cast<int64_t>(own.node.cell[1] >> 1),
                                            static_cast<int64_t>(own.node.cell[2] >> 1)};
        std::vector<GoingUp> out;
        const auto last = static_cast<int64_t>((uint64_t{1} << above) - 1);
        for (int64_t z = -1; z <= 1; ++z)
            for (int64_t y = -1; y <= 1; ++y)
                for (int64_t x = -1; x <= 1; ++x) {
                    const std::array<int64_t, 3> at{parent[0] + x, parent[1] + y, parent[2] + z};
                    bool isThere = true;
                    for (const int64_t c : at) isThere = isThere && c >= 0 && c <= last;
                    if (!isThere) continue;
                    const glm::dvec3 lo = cell * glm::dvec3(static_cast<double>(at[0]), static_cast<double>(at[1]),
                                                            static_cast<double>(at[2]));
                    const Key key = mortonCode(static_cast<uint64_t>(at[0]), static_cast<uint64_t>(at[1]),
                                               static_cast<uint64_t>(at[2]))
                                    << shift;
                    if (x == 0 && y == 0 && z == 0) {
                        out.push_back({key, child(lo, cell)});
                    } else if (std::vector<uint8_t> bytes = strip(lo, cell); !bytes.empty()) {
                        out.push_back({key, std::move(bytes)});
                    }
                }
        return out;
    }

    std::vector<uint8_t> child(const glm::dvec3& lo, double cell) const {
        const PatchNode& own = nodes_[0];
        ByteWriter to;
        to.put(Sent::child);
        to.put(PatchNodeHead{own.node, own.key, own.surfaceError, own.residual, own.error});
        putSoup(own.surface, to);
        // Of subtrees that are worked on no earlier than the parent: they send nothing before.
        Soup carried;
        SoupPart part(around_, carried);
        for (size_t t = 0; t < around_.indices.size() / 3; ++t)
            if (isWithin(around_, t, lo, cell) && levelOfOwner(keyOfTriangle(around_, t)) < own.node.level) part.add(t);
        putSoup(carried, to);
        return to.bytes();
    }

    std::vector<uint8_t> strip(const glm::dvec3& lo, double cell) const {
        const Soup& own = nodes_[0].surface;
        Soup out;
        SoupPart part(own, out);
        for (size_t t = 0; t < own.indices.size() / 3; ++t)
            if (isWithin(own, t, lo, cell)) part.add(t);
        if (out.indices.empty()) return {};
        ByteWriter to;
        to.put(Sent::strip);
        putSoup(out, to);
        return to.bytes();
    }

    static bool isWithin(const Soup& soup, size_t t, const glm::dvec3& lo, double cell) {
        const glm::dvec3 p(middleOf(soup, t)), reach(kPatchMargin * cell);
        return glm::all(glm::lessThanEqual(lo - reach, p)) && glm::all(glm::lessThanEqual(p, lo + cell + reach));
    }

    uint32_t levelOfOwner(Key key) const {
        const auto next = std::upper_bound(subtrees_.begin(), subtrees_.end(), key,
                                           [](Key k, const Subtree& a) { return k < a.key; });
        return next == subtrees_.begin() ? 0 : (next - 1)->level;
    }

    const Frame& frame_;
    const std::vector<Subtree>& subtrees_;
    const PatchCellSettings& settings_;
    Executor& executor_;
    std::vector<PatchNode> nodes_;  ///< the first one is the cell's own
    Soup around_;                   ///< triangles of other cells
    PatchTable table_;
    size_t firstOwn_ = 0;  ///< 0: all nodes are to be made
    bool isMade_ = false;
};

}  // namespace

Result<CellProduct> buildPatchCell(const WorkCell& cell, const std::vector<uint8_t>& input,
                                   const std::vector<FromBelow>& below, const Frame& frame,
                                   const std::vector<Subtree>& subtrees, const PatchCellSettings& settings,
                                   Executor& executor) {
    PatchCell work(cell, frame, subtrees, settings, executor);
    if (cell.subtree != WorkCell::kNone) {
        STIPPLE_TRY(work.takeInput(input));
    } else {
        STIPPLE_TRY(work.takeBelow(below));
    }
    return work.run(cell.level == 0);
}

void PatchTable::put(ByteWriter& to) const {
    to.put(batch.nodes);
    to.put(points);
    to.put(triangles);
    to.put(duplicate);
    to.put(left);
    to.put(samples);
    to.put(discs);
    to.put(residual);
    to.put(lo);
    to.put(hi);
}
bool PatchTable::get(ByteReader& from) {
    from.get(batch.nodes);
    from.get(points);
    from.get(triangles);
    from.get(duplicate);
    from.get(left);
    from.get(samples);
    from.get(discs);
    from.get(residual);
    from.get(lo);
    from.get(hi);
    return from.isWhole();
}

}  // namespace stipple::lod
