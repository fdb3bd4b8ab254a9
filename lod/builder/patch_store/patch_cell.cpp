#include "lod/builder/patch_store/patch_cell.h"

#include <algorithm>
#include <cmath>

#include "lod/builder/patch_store/division.h"
#include "lod/primitives/patch.h"
#include "shaders/shared/record.h"

namespace stipple::lod {
namespace {

constexpr double kWanted = 0.1;       ///< error that a simplification may add, in steps of its level
constexpr size_t kMostKept = 65'536;  ///< triangles that go up from a node
constexpr double kLongest = 0.25;     ///< edge of a triangle, in cells
/// Texels along an edge of a cell that inner nodes have at most: more looks would not fit on their way up.
constexpr uint32_t kMostInner = 4;
constexpr uint32_t kMostOfLeaf = 8;
constexpr double kFineEnough = 1.5;  ///< texels of a map, in those of the source

struct SurfaceNode : PatchNode {
    Soup surface;  ///< its triangles; once it is done, what is left of them for its parent
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
        nodes_.push_back({patchNodeAt(frame, static_cast<uint32_t>(cell.level), cell.key), {}});
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
        table_.elements = countOwn();
        table_.duplicate = before - table_.elements;
        SoupPart own(all, nodes_[0].surface), others(all, around_);
        for (size_t t = 0; t < all.indices.size() / 3; ++t) (isOwn(t) ? own : others).add(t);
        const LatticeVertices& v = nodes_[0].surface.vertices;
        for (size_t i = 0; i < v.size(); ++i) {
            table_.lo = i == 0 ? v.at(i) : glm::min(table_.lo, v.at(i));
            table_.hi = i == 0 ? v.at(i) : glm::max(table_.hi, v.at(i));
        }
        if (table_.elements > 0) partition();
        for (SurfaceNode& n : nodes_) n.surfaceError = settings_.rounding;
        aroundError_ = settings_.rounding;
        isMade_ = table_.elements > 0;
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
                nodes_.push_back({head, {}});
                if (!getSoup(from, nodes_.back().surface)) return damaged();
            }
            double error = 0;
            from.get(error);
            aroundError_ = std::max(aroundError_, error);
            if (!getSoup(from, around_)) return damaged();
            looks_.get(from);
            if (!from.isWhole()) return damaged();
        }
        // In octant order.
        std::sort(nodes_.begin() + 1, nodes_.end(),
                  [](const SurfaceNode& a, const SurfaceNode& b) { return a.key < b.key; });
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
            for (const SurfaceNode& n : nodes_) deepest = std::max<uint32_t>(deepest, n.node.level);
        for (uint32_t level = deepest + 1; level-- > nodes_[0].node.level && !isStopped();) makeLevel(level, isLast);
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
    Key keyOfTriangle(const Soup& soup, size_t t) const {
        const glm::u64vec3 p(middleOf(soup, t));
        return frame_.keyOf(p.x, p.y, p.z);
    }
    /// `up`: levels above that of the cell.
    Key levelKey(Key key, uint32_t up) const { return key >> (frame_.shiftOf(nodes_[0].node.level) + 3 * up); }
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
                nodes_.push_back(
                    {patchNodeAt(frame_, level + 1, nodes_[i].key | Key{octant} << frame_.shiftOf(level + 1)),
                     std::move(parts.at(octant))});
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

    bool isStopped() const { return settings_.isStopped && settings_.isStopped(); }
    bool isToBeMade(size_t i) const { return i == 0 || firstOwn_ == 0; }

    void makeLevel(uint32_t level, bool isLast) {
        std::vector<size_t> here;
        for (size_t i = 0; i < nodes_.size(); ++i)
            if (isToBeMade(i) && nodes_[i].node.level == level) here.push_back(i);
        for (const size_t i : here) joinChildren(nodes_[i]);
        if (settings_.maps.any())
            for (const size_t i : here)
                if (nodes_[i].node.isLeaf()) measureTextures(nodes_[i]);
        std::vector<NodePatches> made(here.size());
        executor_.parallelFor(here.size(), 1, [&](size_t begin, size_t end) {
            for (size_t k = begin; k < end; ++k) {
                const SurfaceNode& n = nodes_[here[k]];
                const AroundNode around = aroundOf(here[k]);
                const NodeSettings how{patchStep(frame_, level),
                                       settings_.coneDegrees,
                                       n.node.isLeaf() ? settings_.samplesATriangle : 0.0,
                                       settings_.isAsked,
                                       settings_.looks,
                                       settings_.hasFineNormals,
                                       &looks_,
                                       lookStep(level),
                                       mapsOf(n),
                                       settings_.isStopped};
                if (isStopped()) return;
                made[k] = patchesOfNode(n.surface, around, cornerOf(frame_, n.node), how, executor_);
                made[k].error += std::max(n.surfaceError, around.surfaceError);
            }
        });
        if (isStopped()) return;
        for (size_t k = 0; k < here.size(); ++k) write(nodes_[here[k]], made[k]);
        if (level == nodes_[0].node.level && isLast) return;
        looks_ = looks_.halved();
        if (settings_.looks) looks_.add(looksOfLeaves(here, made), 2 * lookStep(level));
        executor_.parallelFor(here.size(), 1, [&](size_t begin, size_t end) {
            for (size_t k = begin; k < end && !isStopped(); ++k) {
                SurfaceNode& n = nodes_[here[k]];
                n.surfaceError += simplify(n.surface, kWanted * patchStep(frame_, level), kMostKept);
            }
        });
    }

    /// Edge of the cells of looks that a level's nodes are shown by: a texel of the densest map.
    double lookStep(uint32_t level) const {
        const uint32_t texels = settings_.maps.texels == 0 ? kMostInner : settings_.maps.texels;
        return patchStep(frame_, level) / (settings_.maps.any() ? std::min(texels, kMostInner) : 1);
    }
    NodeMaps mapsOf(const SurfaceNode& n) const {
        NodeMaps maps;
        if (!settings_.looks) return maps;
        maps.hasLight = settings_.maps.detail.hasLight;
        if (!settings_.maps.any()) return maps;
        maps.most = n.node.isLeaf() ? kMostOfLeaf : kMostInner;
        maps.texels = std::min(settings_.maps.texels, maps.most);
        maps.sourceTexel = n.texels > 0 ? std::sqrt(n.texturedArea / n.texels) : 0;
        maps.hasNormals = settings_.maps.detail.hasNormals;
        maps.hasMaterials = settings_.maps.detail.hasMaterials;
        return maps;
    }
    /// What textures hold of a leaf.
    void measureTextures(SurfaceNode& n) const {
        const Soup& soup = n.surface;
        for (size_t t = 0; t < soup.indices.size() / 3; ++t) {
            std::array<glm::dvec3, 3> place{};
            std::array<glm::dvec2, 3> uv{};
            for (size_t k = 0; k < 3; ++k) {
                const uint32_t v = soup.indices[3 * t + k];
                place.at(k) = glm::dvec3(soup.vertices.at(v));
                uv.at(k) = {soup.vertices.low[v].u, soup.vertices.low[v].v};
            }
            const double density = double{settings_.maps.detail.texels(soup.vertices.low[soup.indices[3 * t]].surface)};
            const glm::dvec2 e = uv[1] - uv[0], f = uv[2] - uv[0];
            const double texels = 0.5 * std::abs(e.x * f.y - e.y * f.x) * density * density;
            if (!(texels > 0) || !std::isfinite(texels)) continue;
            n.texels += texels;
            n.texturedArea += 0.5 * glm::length(glm::cross(place[1] - place[0], place[2] - place[0]));
        }
    }
    /// Of an inner node whose maps are coarser than the source's textures: a texel, which is then wanted no larger than
    /// the error that a view allows. Lattice units.
    double textureError(const SurfaceNode& n) const {
        const NodeMaps maps = mapsOf(n);
        const double step = patchStep(frame_, n.node.level), texel = maps.side(step);
        return texel > kFineEnough * maps.sourceTexel && maps.sourceTexel > 0 ? texel : 0;
    }

    /// What the texels and samples of leaves show, and discs; beside their cells, too, where their triangles reach.
    std::vector<LevelLooks::Seen> looksOfLeaves(const std::vector<size_t>& here,
                                                const std::vector<NodePatches>& made) const {
        std::vector<LevelLooks::Seen> seen;
        for (size_t k = 0; k < here.size(); ++k) {
            const Node& n = nodes_[here[k]].node;
            if (!n.isLeaf()) continue;
            for (const Patch& p : made[k].patches) addSeen(p, cornerOf(frame_, n), seen);
            for (const LeftDisc& d : made[k].left)
                seen.push_back(
                    {d.place, {d.normal, d.colour, d.material, d.light}, double{d.radius} * double{d.radius}});
        }
        return seen;
    }

    void joinChildren(SurfaceNode& n) {
        const auto children = static_cast<uint32_t>(__builtin_popcount(n.node.childMask));
        for (uint32_t c = n.node.firstChild; c < n.node.firstChild + children; ++c) {
            appendSoup(nodes_[c].surface, n.surface);
            nodes_[c].surface = {};
            n.surfaceError = std::max(n.surfaceError, nodes_[c].surfaceError);
            n.error = std::max({n.error, nodes_[c].error, nodes_[c].residual});
            n.texturedArea += nodes_[c].texturedArea;
            n.texels += nodes_[c].texels;
        }
        if (children > 0) uniteByPlace(n.surface);
    }

    /// Of nodes that are done or wait, and of other cells.
    AroundNode aroundOf(size_t i) const {
        AroundNode out;
        const Node& n = nodes_[i].node;
        const double cell = frame_.cellSize(n.level);
        const glm::dvec3 lo = cornerOf(frame_, n);
        for (size_t k = 0; k < nodes_.size(); ++k) {
            const SurfaceNode& other = nodes_[k];
            if (k == i || other.surface.indices.empty() || !isNear(other.node, lo, cell)) continue;
            out.add(other.surface, other.surfaceError, lo, cell);
        }
        out.add(around_, aroundError_, lo, cell);
        return out;
    }
    /// (What was simplified may lie a little beside its cell.)
    bool isNear(const Node& other, const glm::dvec3& lo, double cell) const {
        const double edge = frame_.cellSize(other.level), reach = kPatchMargin * cell + 0.5 * edge;
        const glm::dvec3 from = cornerOf(frame_, other) - reach, to = cornerOf(frame_, other) + edge + reach;
        return glm::all(glm::lessThanEqual(from, lo + cell)) && glm::all(glm::lessThanEqual(lo, to));
    }

    // ---- to the file

    void write(SurfaceNode& n, NodePatches& made) {
        const Node& out = n.node;
        (out.isLeaf() ? n.residual : n.error) = std::max(n.error, made.error);
        if (!out.isLeaf()) n.error = std::max(n.error, textureError(n));
        if (out.isLeaf()) {
            table_.left += made.trianglesLeft;
            table_.patches += made.patches.size();
            for (const Patch& p : made.patches) table_.samples += p.samples();
            table_.discs += made.left.size();
        }
        writePatchNode(frame_, children(n.node), made, n, table_);
    }
    /// Nodes stand side by side.
    std::vector<Node> children(const Node& n) const {
        std::vector<Node> out;
        for (uint32_t c = 0; c < static_cast<uint32_t>(__builtin_popcount(n.childMask)); ++c)
            out.push_back(nodes_[n.firstChild + c].node);
        return out;
    }

    // ---- upwards

    std::vector<GoingUp> goingUp() const {
        const SurfaceNode& own = nodes_[0];
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
        const SurfaceNode& own = nodes_[0];
        ByteWriter to;
        to.put(Sent::child);
        to.put(PatchNode(own));
        putSoup(own.surface, to);
        // Of subtrees that are worked on no earlier than the parent: they send nothing before.
        Soup carried;
        SoupPart part(around_, carried);
        for (size_t t = 0; t < around_.indices.size() / 3; ++t)
            if (isWithin(around_, t, lo, cell) && levelOfOwner(subtrees_, keyOfTriangle(around_, t)) < own.node.level)
                part.add(t);
        to.put(aroundError_);
        putSoup(carried, to);
        looks_.put(to);
        return to.bytes();
    }

    std::vector<uint8_t> strip(const glm::dvec3& lo, double cell) const {
        const Soup& own = nodes_[0].surface;
        Soup out;
        SoupPart part(own, out);
        for (size_t t = 0; t < own.indices.size() / 3; ++t)
            if (isWithin(own, t, lo, cell)) part.add(t);
        // Looks reach as far as triangles do whose middles are near.
        const Node& n = nodes_[0].node;
        const glm::dvec3 corner = cornerOf(frame_, n), reach((kPatchMargin + kLongest) * cell);
        const LevelLooks looks =
            looks_.within(glm::max(corner, lo - reach), glm::min(corner + frame_.cellSize(n.level), lo + cell + reach),
                          2 * lookStep(n.level));
        if (out.indices.empty() && looks.isEmpty()) return {};
        ByteWriter to;
        to.put(Sent::strip);
        to.put(nodes_[0].surfaceError);
        putSoup(out, to);
        looks.put(to);
        return to.bytes();
    }

    static bool isWithin(const Soup& soup, size_t t, const glm::dvec3& lo, double cell) {
        const glm::dvec3 p(middleOf(soup, t)), reach(kPatchMargin * cell);
        return glm::all(glm::lessThanEqual(lo - reach, p)) && glm::all(glm::lessThanEqual(p, lo + cell + reach));
    }

    const Frame& frame_;
    const std::vector<Subtree>& subtrees_;
    const PatchCellSettings& settings_;
    Executor& executor_;
    std::vector<SurfaceNode> nodes_;  ///< the first one is the cell's own
    Soup around_;                     ///< triangles of other cells
    double aroundError_ = 0;          ///< of those: bound of the distance from the source
    LevelLooks looks_;                ///< of the level that is made, or is made next; at the end of that above the cell
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

}  // namespace stipple::lod
