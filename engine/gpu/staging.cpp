#include "engine/gpu/staging.h"

#include <algorithm>
#include <cstring>

namespace stipple::gpu {

Result<void> Staging::ensure(uint64_t bytes) {
    if (bytes <= buffer_.bytes()) return {};
    constexpr VkBufferUsageFlags kUsage = VK_BUFFER_USAGE_TRANSFER_SRC_BIT;
    STIPPLE_ASSIGN(const uint64_t room, roomFor(device_->limits, bytes, kUsage, "staging", device_->deviceName));
    // At least twice as much as before, so that what lies there is moved seldom; if there is no room, what is needed.
    const uint64_t wanted = std::min(std::max({room, 2 * buffer_.bytes(), uint64_t{1} << 20}), device_->limits.buffer);
    auto larger = Buffer::create(*device_, wanted, kUsage, Memory::host, "staging");
    if (!larger) larger = Buffer::create(*device_, bytes, kUsage, Memory::host, "staging");
    if (!larger) return tl::unexpected(larger.error());
    if (used_ > 0) std::memcpy(larger->mapped(), buffer_.mapped(), used_);
    buffer_ = std::move(*larger);
    return {};
}

Result<void> Staging::add(const lod::Chunk& chunk, VkBuffer page, uint64_t offset) {
    STIPPLE_TRY(ensure(used_ + chunk.sizeBytes()));
    const uint64_t begin = used_;
    chunk.forEachArray([&](const auto& array) {
        const size_t size = array.size() * sizeof(array[0]);
        if (size > 0) std::memcpy(static_cast<char*>(buffer_.mapped()) + used_, array.data(), size);
        used_ += size;
    });
    if (used_ > begin) copies_.push_back({page, {begin, offset, used_ - begin}});
    return {};
}

bool Staging::drop(VkBuffer page, uint64_t offset) {
    const size_t dropped =
        std::erase_if(copies_, [&](const Copy& c) { return c.page == page && c.region.dstOffset == offset; });
    if (copies_.empty()) used_ = 0;
    return dropped > 0;
}

void Staging::recordCopies(VkCommandBuffer commands) const {
    for (const Copy& c : copies_) vkCmdCopyBuffer(commands, buffer_.handle(), c.page, 1, &c.region);
}

void Staging::clear() {
    constexpr uint64_t kMostKept = uint64_t{256} << 20;
    copies_.clear();
    used_ = 0;
    if (buffer_.bytes() > kMostKept) buffer_ = Buffer();  // a whole scene came at once
}

}  // namespace stipple::gpu
