#include "lod/builder/octree/inputs.h"

#include <fmt/format.h>

#include <algorithm>

#include "engine/base/queue.h"

namespace stipple::lod {

std::unique_ptr<Spill> CellInputs::spillOf(size_t subtree, uint32_t generation) const {
    return workspace_.spill(generation == 0 ? fmt::format("in-{}", subtree)
                                            : fmt::format("in-{}.{}", subtree, generation));
}

void CellInputs::plan(std::vector<Subtree> subtrees) {
    subtrees_ = std::move(subtrees);
    inputs_.resize(subtrees_.size());
    for (size_t a = 0; a < subtrees_.size(); ++a) inputs_[a].spill = spillOf(a, 0);
}

Result<void> CellInputs::append(size_t subtree, const std::vector<uint8_t>& bytes, uint64_t units, bool isSpread) {
    Input& input = inputs_[subtree];
    STIPPLE_TRY(input.spill->append(bytes));
    input.units += units;
    if (isSpread) input.spreadBytes += bytes.size();
    return {};
}

bool CellInputs::isSpread(size_t subtree) const {
    constexpr uint64_t kWorthIt = uint64_t{64} << 10;
    const Input& input = inputs_[subtree];
    return input.spreadBytes >= std::max(kWorthIt, (input.spill->bytes() - input.spreadBytes) / 2);
}

Result<std::vector<uint8_t>> CellInputs::all(size_t subtree) const {
    return inputs_[subtree].spill->part(0, inputs_[subtree].spill->bytes());
}

Result<void> CellInputs::replace(size_t subtree, const std::vector<uint8_t>& bytes, uint64_t units) {
    Input& input = inputs_[subtree];
    std::unique_ptr<Spill> fresh = spillOf(subtree, input.generation + 1);
    STIPPLE_TRY(fresh->append(bytes));
    STIPPLE_TRY(fresh->seal());
    old_.push_back(std::exchange(input.spill, std::move(fresh)));
    ++input.generation;
    input.units = units;
    input.spreadBytes = 0;
    return {};
}

void CellInputs::dropOld() {
    for (const auto& spill : old_) spill->remove();
    old_.clear();
}

Result<void> CellInputs::seal(Executor& executor) {
    CompletionQueue<Error> errors;
    executor.parallelFor(inputs_.size(), 1, [&](size_t begin, size_t end) {
        for (size_t a = begin; a < end; ++a)
            if (!workspace_.isOwn(a))
                continue;
            else if (const auto sealed = inputs_[a].spill->seal(); !sealed)
                errors.push(sealed.error());
    });
    if (const auto found = errors.takeAll(); !found.empty()) return tl::unexpected(found.front());
    return {};
}

void CellInputs::save(ByteWriter& to) const {
    for (size_t a = 0; a < inputs_.size(); ++a) {
        if (!workspace_.isOwn(a)) continue;
        const Input& input = inputs_[a];
        to.put(uint64_t{a});
        to.put(input.generation);
        to.put(input.units);
        to.put(input.spreadBytes);
        to.put(input.spill->segments());
    }
}

bool CellInputs::load(const std::vector<uint8_t>& saved) {
    ByteReader from(saved);
    while (!from.isWhole()) {
        uint64_t subtree = 0;
        from.get(subtree);
        if (from.isBroken() || subtree >= inputs_.size()) return false;
        Input& input = inputs_[subtree];
        std::vector<Spill::Segment> segments;
        from.get(input.generation);
        from.get(input.units);
        from.get(input.spreadBytes);
        from.get(segments);
        if (from.isBroken()) return false;
        if (input.generation > 0) spillOf(subtree, input.generation - 1)->remove();
        input.spill = spillOf(subtree, input.generation);
        input.spill->restore(std::move(segments));
    }
    return true;
}

uint64_t CellInputs::bytes() const {
    uint64_t sum = 0;
    for (const Input& input : inputs_) sum += input.spill ? input.spill->bytes() : 0;
    for (const auto& spill : old_) sum += spill->bytes();
    return sum;
}

uint64_t CellInputs::remove(size_t subtree) {
    const std::unique_ptr<Spill> used = std::move(inputs_[subtree].spill);
    const uint64_t bytes = used->bytes();
    used->remove();
    return bytes;
}

}  // namespace stipple::lod
