#include "engine/base/huge_region.h"

#include <sys/mman.h>

#include <algorithm>
#include <new>

namespace stipple {
namespace {

constexpr uint64_t kHuge = uint64_t{2} << 20, kLine = 64;

uint64_t roundedUp(uint64_t value, uint64_t to) { return (value + to - 1) / to * to; }

}  // namespace

HugeRegion::HugeRegion(std::span<const uint64_t> sizes) {
    uint64_t bytes = 0;
    for (const uint64_t size : sizes) ends_.push_back(bytes = roundedUp(bytes, kLine) + size);
    if (bytes == 0) return;
    mappedBytes_ = bytes + kHuge;  // to begin where a huge page may
    mapped_ = ::mmap(nullptr, mappedBytes_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (mapped_ == MAP_FAILED) throw std::bad_alloc();
    const auto at = reinterpret_cast<uintptr_t>(mapped_);
    first_ = static_cast<uint8_t*>(mapped_) + (roundedUp(at, kHuge) - at);
    // (The last, which is not full, has small ones, or it would take memory that nobody asked for.)
    ::madvise(first_, bytes / kHuge * kHuge, MADV_HUGEPAGE);
    const uint64_t pages = roundedUp(bytes, kHuge) / kHuge;
    users_ = std::make_unique<std::atomic<uint32_t>[]>(pages);  // NOLINT(modernize-avoid-c-arrays)
    for (size_t i = 0; i < sizes.size(); ++i)
        for (uint64_t page = pagesOf(i).begin; page < pagesOf(i).end; ++page) ++users_[page];
}

HugeRegion::~HugeRegion() {
    if (mapped_ != nullptr) ::munmap(mapped_, mappedBytes_);
}

std::span<uint8_t> HugeRegion::part(size_t i) const {
    const uint64_t begin = i == 0 ? 0 : roundedUp(ends_[i - 1], kLine);
    return {first_ + begin, first_ + ends_[i]};
}

HugeRegion::Range HugeRegion::pagesOf(size_t i) const {
    const std::span<uint8_t> bytes = part(i);
    if (bytes.empty()) return {};
    const auto begin = static_cast<uint64_t>(bytes.data() - first_);
    return {begin / kHuge, (begin + bytes.size() - 1) / kHuge + 1};
}

void HugeRegion::release(size_t i) {
    const Range pages = pagesOf(i);
    for (uint64_t page = pages.begin; page < pages.end; ++page)
        if (--users_[page] == 0)
            ::madvise(first_ + page * kHuge, std::min(kHuge, roundedUp(ends_.back(), 4096) - page * kHuge),
                      MADV_DONTNEED);
}

}  // namespace stipple
