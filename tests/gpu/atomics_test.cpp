// What shaders do before an atomic operation, as their SPIR-V has it: it is the slow part of most passes, and no
// picture shows whether it was needed.
#include <gtest/gtest.h>

#include <map>
#include <set>
#include <string>

#include "engine/gpu/shader_table.h"

namespace stipple::gpu {
namespace {

// Numbers of instructions (SPIR-V specification, section 3).
enum Op : uint32_t {
    kExtInst = 12,
    kConstant = 43,
    kVariable = 59,
    kLoad = 61,
    kAccessChain = 65,
    kInBoundsAccessChain = 66,
    kDecorate = 71,
    kCompositeExtract = 81,
    kAtomicIIncrement = 232,
    kAtomicIAdd = 234,
    kAtomicSMin = 236,
    kAtomicOr = 241,
    kPhi = 245,
    kLabel = 248,
    kBranchConditional = 250
};
constexpr uint32_t kBindingDecoration = 33;

/// An atomic minimum, maximum, or or of a buffer.
struct Offer {
    uint32_t binding, block;
};

class Code {
  public:
    explicit Code(std::span<const uint32_t> words) {
        uint32_t block = 0;
        for (size_t at = 5; at < words.size(); at += words[at] >> 16)
            take(words[at] & 0xffffu, words.subspan(at + 1, (words[at] >> 16) - 1), block);
    }
    const std::vector<Offer>& offers() const { return offers_; }
    /// Bindings to whose counts threads add, and whether each adds for itself alone.
    const std::multimap<uint32_t, bool>& added() const { return added_; }
    /// Is its block entered only where a value of the same buffer was looked at?
    bool isReadBefore(const Offer& offer) const {
        const auto condition = conditions_.find(offer.block);
        std::set<uint32_t> seen;
        return condition != conditions_.end() && comesFrom(condition->second, offer.binding, seen);
    }

  private:
    using Words = std::span<const uint32_t>;
    void take(uint32_t op, Words w, uint32_t& block) {
        if (op == kLabel) block = w[0];
        if (op == kDecorate && w[1] == kBindingDecoration) bindings_[w[0]] = w[2];
        if (op == kVariable && bindings_.contains(w[1])) rooted_[w[1]] = bindings_[w[1]];
        if (op == kBranchConditional) conditions_[w[1]] = conditions_[w[2]] = w[0];
        if ((op == kAccessChain || op == kInBoundsAccessChain) && rooted_.contains(w[2])) rooted_[w[1]] = rooted_[w[2]];
        if (op == kLoad && rooted_.contains(w[2])) loads_[w[1]] = rooted_[w[2]];
        if (op >= kAtomicSMin && op <= kAtomicOr && rooted_.contains(w[2])) offers_.push_back({rooted_[w[2]], block});
        if (op == kConstant) constants_.insert(w[1]);
        if (op == kAtomicIIncrement && rooted_.contains(w[2])) added_.emplace(rooted_[w[2]], true);
        if (op == kAtomicIAdd && rooted_.contains(w[2])) added_.emplace(rooted_[w[2]], constants_.contains(w[5]));
        if (w.size() < 3 || op == kDecorate || op == kVariable || op == kLoad || op == kConstant) return;
        // What a value is made of; literals among the operands of other instructions do no harm.
        std::vector<uint32_t>& parts = parts_[w[1]];
        if (op == kCompositeExtract)
            parts = {w[2]};
        else if (op == kExtInst)
            parts.assign(w.begin() + 4, w.end());
        else
            for (size_t i = 2; i < w.size(); i += op == kPhi ? 2 : 1) parts.push_back(w[i]);
    }
    bool comesFrom(uint32_t value, uint32_t binding, std::set<uint32_t>& seen) const {
        if (!seen.insert(value).second) return false;
        if (const auto load = loads_.find(value); load != loads_.end()) return load->second == binding;
        const auto parts = parts_.find(value);
        if (parts == parts_.end()) return false;
        for (const uint32_t part : parts->second)
            if (comesFrom(part, binding, seen)) return true;
        return false;
    }

    std::map<uint32_t, uint32_t> bindings_, rooted_, loads_, conditions_;  ///< conditions: by the block they lead to
    std::map<uint32_t, std::vector<uint32_t>> parts_;
    std::vector<Offer> offers_;
    std::set<uint32_t> constants_;
    std::multimap<uint32_t, bool> added_;
};

TEST(Atomics, ReadBeforeTheyOffer) {
    size_t offers = 0;
    for (const Shader& shader : shaders()) {
        const Code code(shader.code);
        for (const Offer& offer : code.offers()) {
            ++offers;
            EXPECT_TRUE(code.isReadBefore(offer))
                << shader.name << " offers to binding " << offer.binding << " what may have lost already";
        }
    }
    EXPECT_GT(offers, 20u);
}

TEST(Atomics, OfListsAreOneASubgroup) {
    std::map<uint32_t, size_t> lists;
    for (const Shader& shader : shaders()) {
        const Code code(shader.code);
        for (const uint32_t list : {shared::kDiscsBinding, shared::kLargeBinding, shared::kWideBinding}) {
            const auto [first, last] = code.added().equal_range(list);
            for (auto add = first; add != last; ++add, ++lists[list])
                EXPECT_FALSE(add->second) << shader.name << ": each thread adds to the length of list " << list;
        }
    }
    EXPECT_EQ(lists.size(), 3u);
}

}  // namespace
}  // namespace stipple::gpu
