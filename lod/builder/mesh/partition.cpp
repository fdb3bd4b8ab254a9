#include "lod/builder/mesh/partition.h"

#include <algorithm>
#include <limits>

namespace stipple::lod {
namespace {

constexpr int32_t kNever = std::numeric_limits<int32_t>::min();
constexpr int kPasses = 4;            ///< of borders that are moved
constexpr size_t kMostUseless = 15;   ///< moves in a row that do not help
constexpr uint32_t kAllTried = 4096;  ///< above it a set is halved where it lies: each move looks at all of it

/// A set of vertices, numbered as they lie in it, in two halves.
class Halves {
  public:
    /// `numberOf`: of all vertices ~0, and so afterwards.
    Halves(const ClusterGraph& graph, const std::vector<uint32_t>& set, std::vector<uint32_t>& numberOf)
        : count_(static_cast<uint32_t>(set.size())) {
        for (uint32_t i = 0; i < count_; ++i) numberOf[set[i]] = i;
        for (const uint32_t v : set) {
            for (uint32_t e = graph.start[v]; e < graph.start[v + 1]; ++e) {
                const uint32_t n = numberOf[graph.neighbour[e]];
                if (n == ~0u) continue;
                within_.neighbour.push_back(n);
                within_.weight.push_back(graph.weight[e]);
            }
            within_.start.push_back(static_cast<uint32_t>(within_.neighbour.size()));
        }
        for (const uint32_t v : set) numberOf[v] = ~0u;
    }

    /// The first `target` of the set as they lie, or what grows from a vertex at an end of it, until the best is found.
    /// `least`, `most`: vertices of the first half. Which half each vertex is in, 0 or 1.
    std::vector<uint8_t> best(uint32_t target, uint32_t least, uint32_t most) {
        side_.assign(count_, 1);
        std::fill_n(side_.begin(), target, uint8_t{0});
        if (count_ > kAllTried) return side_;
        int64_t shortest = moveBorder(least, most);
        std::vector<uint8_t> best = side_;
        uint32_t from = 0;
        for (int k = 0; k < 2; ++k) {
            from = farthestFrom(from);
            growFrom(from, target);
            const int64_t cut = moveBorder(least, most);
            if (cut < shortest) best = side_;
            shortest = std::min(shortest, cut);
        }
        return best;
    }

  private:
    template <typename Use>
    void forNeighbours(uint32_t v, const Use& use) const {
        for (uint32_t e = within_.start[v]; e < within_.start[v + 1]; ++e) use(within_.neighbour[e], within_.weight[e]);
    }

    int64_t cut() const {
        int64_t twice = 0;
        for (uint32_t v = 0; v < count_; ++v)
            forNeighbours(v, [&](uint32_t n, int32_t weight) { twice += side_[v] != side_[n] ? weight : 0; });
        return twice / 2;
    }

    /// The last that is reached, if any is.
    uint32_t farthestFrom(uint32_t v) const {
        std::vector<uint32_t> reached{v};
        std::vector<bool> isReached(count_);
        isReached[v] = true;
        for (size_t i = 0; i < reached.size(); ++i)
            forNeighbours(reached[i], [&](uint32_t n, int32_t) {
                if (!isReached[n]) reached.push_back(n);
                isReached[n] = true;
            });
        return reached.back();
    }

    /// The first half: always with the one beside it that adds least to the border.
    void growFrom(uint32_t v, uint32_t target) {
        side_.assign(count_, 1);
        gain_.assign(count_, kNever);
        for (uint32_t grown = 1;; ++grown) {
            side_[v] = 0;
            gain_[v] = kNever;
            if (grown == target) return;
            forNeighbours(v, [&](uint32_t n, int32_t weight) {
                if (side_[n] == 0) return;
                if (gain_[n] == kNever) {
                    gain_[n] = 0;
                    forNeighbours(n, [&](uint32_t, int32_t all) { gain_[n] -= all; });
                }
                gain_[n] += 2 * weight;
            });
            const auto next = std::max_element(gain_.begin(), gain_.end());
            v = *next != kNever ? static_cast<uint32_t>(next - gain_.begin()) : firstOutside();
        }
    }
    uint32_t firstOutside() const {
        return static_cast<uint32_t>(std::find(side_.begin(), side_.end(), 1) - side_.begin());
    }

    void findGains() {
        gain_.assign(count_, 0);
        for (uint32_t v = 0; v < count_; ++v)
            forNeighbours(v, [&](uint32_t n, int32_t weight) { gain_[v] += side_[n] != side_[v] ? weight : -weight; });
    }

    /// Of those that may move the one that helps most, or ~0.
    uint32_t bestMove(bool mayLeaveFirst, bool mayLeaveSecond) const {
        uint32_t best = ~0u;
        int32_t most = kNever;
        for (uint32_t v = 0; v < count_; ++v) {
            const bool may = isMoved_[v] == 0 && (side_[v] == 0 ? mayLeaveFirst : mayLeaveSecond);
            if (!may || gain_[v] <= most) continue;
            most = gain_[v];
            best = v;
        }
        return best;
    }

    void move(uint32_t v) {
        side_[v] ^= 1;
        isMoved_[v] = 1;
        forNeighbours(v,
                      [&](uint32_t n, int32_t weight) { gain_[n] += side_[n] != side_[v] ? 2 * weight : -2 * weight; });
    }

    /// Moves vertices to the other half, each once a pass, also where that does not help at first, and takes back what
    /// did not. Returns what the border weighs.
    int64_t moveBorder(uint32_t least, uint32_t most) {
        // On the way the halves may be larger and smaller by one, or those of exact sizes would never change.
        const uint32_t fewest = std::max(least, 2u) - 1, largest = std::min(most + 1, count_ - 1);
        int64_t best = cut();
        for (int pass = 0; pass < kPasses; ++pass) {
            findGains();
            isMoved_.assign(count_, 0);
            auto first = static_cast<uint32_t>(std::count(side_.begin(), side_.end(), 0));
            std::vector<uint32_t> moves;
            const int64_t before = best;
            int64_t now = best;
            size_t kept = 0;
            while (moves.size() <= kept + kMostUseless) {
                const uint32_t v = bestMove(first > fewest, first < largest);
                if (v == ~0u) break;
                now -= gain_[v];
                first = side_[v] == 0 ? first - 1 : first + 1;
                move(v);
                moves.push_back(v);
                if (now >= best || first < least || first > most) continue;
                best = now;
                kept = moves.size();
            }
            for (size_t k = kept; k < moves.size(); ++k) side_[moves[k]] ^= 1;
            if (best == before) break;
        }
        return best;
    }

    uint32_t count_;
    ClusterGraph within_;
    std::vector<uint8_t> side_, isMoved_;
    std::vector<int32_t> gain_;  ///< by how much the border would be shorter, were the vertex in the other half
};

class Partition {
  public:
    Partition(const ClusterGraph& graph, uint32_t size) : graph_(graph), size_(size), numberOf_(graph.count(), ~0u) {
        std::vector<uint32_t> all(graph.count());
        for (uint32_t v = 0; v < all.size(); ++v) all[v] = v;
        part_.resize(all.size());
        parts_ = (graph.count() + size - 1) / size;
        halve(all, parts_, 0);
        moveToNeighbours();
    }
    std::vector<uint32_t> take() { return std::move(part_); }

  private:
    void halve(const std::vector<uint32_t>& set, uint32_t parts, uint32_t firstPart) {
        if (parts <= 1) {
            for (const uint32_t v : set) part_[v] = firstPart;
            return;
        }
        const auto count = static_cast<uint32_t>(set.size());
        const uint32_t left = parts / 2, right = parts - left;
        const auto target = static_cast<uint32_t>(uint64_t{count} * left / parts);
        const auto leastOf = [&](uint32_t n) { return (n * size_ * 6 + 7) / 8; };
        const auto mostOf = [&](uint32_t n) { return n * size_ * 9 / 8; };
        const uint32_t least = std::max({left, leastOf(left), count - std::min(count, mostOf(right))}),
                       most = std::min({count - right, mostOf(left), count - std::min(count, leastOf(right))});
        const std::vector<uint8_t> side =
            Halves(graph_, set, numberOf_).best(target, std::min(least, target), std::max(most, target));
        std::vector<uint32_t> halves[2];
        for (uint32_t i = 0; i < count; ++i) halves[side[i]].push_back(set[i]);
        halve(halves[0], left, firstPart);
        halve(halves[1], right, firstPart + left);
    }

    void moveToNeighbours() {
        std::vector<uint32_t> count(parts_);
        for (const uint32_t p : part_) ++count[p];
        std::vector<int32_t> shared(parts_);
        bool isMoved = true;
        for (int pass = 0; pass < kPasses && isMoved; ++pass) {
            isMoved = false;
            for (uint32_t v = 0; v < graph_.count(); ++v) {
                const uint32_t own = part_[v];
                if ((count[own] - 1) * 8 < size_ * 5) continue;
                const auto first = graph_.start[v], last = graph_.start[v + 1];
                for (uint32_t e = first; e < last; ++e) shared[part_[graph_.neighbour[e]]] += graph_.weight[e];
                uint32_t to = own;
                for (uint32_t e = first; e < last; ++e) {
                    const uint32_t p = part_[graph_.neighbour[e]];
                    if (p != own && (count[p] + 1) * 4 <= size_ * 5 && shared[p] > shared[to]) to = p;
                }
                for (uint32_t e = first; e < last; ++e) shared[part_[graph_.neighbour[e]]] = 0;
                if (to == own) continue;
                --count[own];
                ++count[to];
                part_[v] = to;
                isMoved = true;
            }
        }
    }

    const ClusterGraph& graph_;
    uint32_t size_, parts_ = 0;
    std::vector<uint32_t> numberOf_, part_;
};

}  // namespace

std::vector<uint32_t> partition(const ClusterGraph& graph, uint32_t size) { return Partition(graph, size).take(); }

}  // namespace stipple::lod
