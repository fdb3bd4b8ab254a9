#include "engine/gpu/pages.h"

#include <algorithm>

namespace stipple::gpu {
namespace {
constexpr uint64_t kPageBytes = uint64_t{64} << 20, kAlignment = 256;
}

uint64_t RangeAllocator::allocate(uint64_t bytes) {
    for (auto it = free_.begin(); it != free_.end(); ++it) {
        if (it->second < bytes) continue;
        const auto [offset, size] = *it;
        free_.erase(it);
        if (size > bytes) free_[offset + bytes] = size - bytes;
        return offset;
    }
    return ~uint64_t{0};
}

void RangeAllocator::release(uint64_t offset, uint64_t bytes) {
    auto next = free_.lower_bound(offset);
    if (next != free_.end() && offset + bytes == next->first) {
        bytes += next->second;
        next = free_.erase(next);
    }
    if (next != free_.begin()) {
        const auto before = std::prev(next);
        if (before->first + before->second == offset) {
            before->second += bytes;
            return;
        }
    }
    free_[offset] = bytes;
}

uint64_t RangeAllocator::freeBytes() const {
    uint64_t sum = 0;
    for (const auto& [offset, bytes] : free_) sum += bytes;
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
                                                 false, "records page"));
    pages_.push_back({std::move(buffer), RangeAllocator(size)});
    return Place{static_cast<uint32_t>(pages_.size() - 1), pages_.back().ranges.allocate(bytes), bytes};
}

void PageStore::release(const Place& place) { pages_[place.page].ranges.release(place.offset, place.bytes); }

}  // namespace stipple::gpu
