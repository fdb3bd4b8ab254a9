#include "engine/base/huge_region.h"

#include <sys/mman.h>

#include <algorithm>
#include <new>
#include <utility>

#include "engine/base/huge_buffer.h"

namespace stipple {
namespace {

constexpr uint64_t kLine = 64;

uint64_t roundedUp(uint64_t value, uint64_t to) { return (value + to - 1) / to * to; }

}  // namespace

HugeRegion::HugeRegion(std::span<const uint64_t> sizes) {
    uint64_t bytes = 0;
    for (const uint64_t size : sizes) ends_.push_back(bytes = roundedUp(bytes, kLine) + size);
    left_ = sizes.size();
    if (bytes == 0) return;
    users_ = std::make_unique<std::atomic<uint32_t>[]>(roundedUp(bytes, kHugePage) /
                                                       kHugePage);  // NOLINT(modernize-avoid-c-arrays)
    mappedBytes_ = bytes + kHugePage;                               // to begin where a huge page may
    mapped_ = ::mmap(nullptr, mappedBytes_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (mapped_ == MAP_FAILED) {
        mapped_ = nullptr;
        throw std::bad_alloc();
    }
    const auto at = reinterpret_cast<uintptr_t>(mapped_);
    first_ = static_cast<uint8_t*>(mapped_) + (roundedUp(at, kHugePage) - at);
    // (The last, which is not full, has small ones, or it would take memory that nobody asked for.)
    ::madvise(first_, bytes / kHugePage * kHugePage, MADV_HUGEPAGE);
    for (size_t i = 0; i < sizes.size(); ++i)
        for (uint64_t page = pagesOf(i).begin; page < pagesOf(i).end; ++page) ++users_[page];
}

HugeRegion::~HugeRegion() { unmap(); }

void HugeRegion::unmap() {
    if (mapped_ != nullptr) ::munmap(std::exchange(mapped_, nullptr), mappedBytes_);
}

std::span<uint8_t> HugeRegion::part(size_t i) const {
    const uint64_t begin = i == 0 ? 0 : roundedUp(ends_[i - 1], kLine);
    return {first_ + begin, first_ + ends_[i]};
}

HugeRegion::Range HugeRegion::pagesOf(size_t i) const {
    const std::span<uint8_t> bytes = part(i);
    if (bytes.empty()) return {};
    const auto begin = static_cast<uint64_t>(bytes.data() - first_);
    return {begin / kHugePage, (begin + bytes.size() - 1) / kHugePage + 1};
}

void HugeRegion::release(size_t i) {
    const Range pages = pagesOf(i);
    const uint64_t bytes = roundedUp(ends_.back(), 4096);
    for (uint64_t page = pages.begin; page < pages.end; ++page)
        if (--users_[page] == 0)
            ::madvise(first_ + page * kHugePage, std::min<uint64_t>(kHugePage, bytes - page * kHugePage),
                      MADV_DONTNEED);
    // (Others have left their pages alone before they count.)
    if (--left_ == 0) unmap();
}

}  // namespace stipple
