#include "engine/gpu/pages.h"

#include <algorithm>

#include "engine/base/check.h"

namespace stipple::gpu {
namespace {
constexpr uint64_t kPageBytes = uint64_t{64} << 20, kAlignment = 256;
}

uint64_t RangeAllocator::allocate(uint64_t bytes) {
    const auto fits = [&](const Range& r) { return r.bytes >= bytes; };
    const auto range = std::find_if(free_.begin(), free_.end(), fits);
    if (range == free_.end()) return ~uint64_t{0};
    const uint64_t offset = range->offset;
    range->offset += bytes;
    range->bytes -= bytes;
    if (range->bytes == 0) free_.erase(range);
    return offset;
}

void RangeAllocator::release(uint64_t offset, uint64_t bytes) {
    const auto isBefore = [](const Range& r, uint64_t place) { return r.offset < place; };
    const auto after = std::lower_bound(free_.begin(), free_.end(), offset, isBefore);
    const bool joinsAfter = after != free_.end() && offset + bytes == after->offset;
    const bool joinsBefore = after != free_.begin() && std::prev(after)->offset + std::prev(after)->bytes == offset;
    if (joinsBefore && joinsAfter) {
        std::prev(after)->bytes += bytes + after->bytes;
        free_.erase(after);
    } else if (joinsBefore) {
        std::prev(after)->bytes += bytes;
    } else if (joinsAfter) {
        *after = {offset, bytes + after->bytes};
    } else {
        free_.insert(after, {offset, bytes});
    }
}

uint64_t RangeAllocator::freeBytes() const {
    uint64_t sum = 0;
    for (const Range& range : free_) sum += range.bytes;
    return sum;
}

Result<PageStore::Place> PageStore::allocate(uint64_t bytes) {
    bytes = (bytes + kAlignment - 1) / kAlignment * kAlignment;
    for (uint32_t p = 0; p < pages_.size(); ++p)
        if (const uint64_t offset = pages_[p].ranges.allocate(bytes); offset != ~uint64_t{0})
            return Place{p, offset, bytes};
    const uint64_t size = std::max(bytes, kPageBytes);
    STIPPLE_ASSIGN(Buffer buffer, Buffer::create(device_, size,
                                                 VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT |
                                                     VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT,
                                                 Memory::device, "records page", Queues::passesAndCopies));
    pages_.push_back({std::move(buffer), RangeAllocator(size)});
    return Place{static_cast<uint32_t>(pages_.size() - 1), pages_.back().ranges.allocate(bytes), bytes};
}

void PageStore::release(const Place& place, uint64_t lastReader) {
    STIPPLE_CHECK(released_.empty() || released_.back().lastReader <= lastReader, "places are released out of order");
    released_.push_back({place, lastReader});
}

void PageStore::reclaim(uint64_t lastDone) {
    auto end = released_.begin();
    for (; end != released_.end() && end->lastReader <= lastDone; ++end) free(end->place);
    released_.erase(released_.begin(), end);
}

}  // namespace stipple::gpu
