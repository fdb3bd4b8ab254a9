// Bytes of several owners side by side on huge pages: what each of them touches for the first time costs a 512th of the
// page faults that it would cost in places of its own, and its part goes back as soon as it is done with.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace stipple {

class HugeRegion {
  public:
    /// Parts of those sizes, bytes; nothing takes memory before it is written. Throws std::bad_alloc.
    explicit HugeRegion(std::span<const uint64_t> sizes);
    ~HugeRegion();
    HugeRegion(const HugeRegion&) = delete;
    HugeRegion& operator=(const HugeRegion&) = delete;

    std::span<uint8_t> part(size_t i) const;
    /// Once for each part, from any thread: pages in which no other part lies go back to the system, and with the last
    /// part the addresses.
    void release(size_t i);

  private:
    struct Range {
        uint64_t begin = 0, end = 0;
    };
    void unmap();
    /// Numbers of the pages that hold a part.
    Range pagesOf(size_t i) const;

    void* mapped_ = nullptr;
    uint64_t mappedBytes_ = 0;
    uint8_t* first_ = nullptr;
    std::vector<uint64_t> ends_;                      ///< of the parts
    std::atomic<size_t> left_{0};                     ///< parts
    std::unique_ptr<std::atomic<uint32_t>[]> users_;  ///< NOLINT(modernize-avoid-c-arrays): of each page, parts
};

}  // namespace stipple
