// An array of records in memory, or of which a bounded number of pages is there and the rest in a file without a name.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/base/huge_region.h"
#include "engine/base/result.h"

namespace stipple {

/// Pages of bytes that come and go; a page that was never written is zeros. Not for several threads.
class PageCache {
  public:
    static constexpr size_t kPageBytes = size_t{1} << 12;
    /// In `folder`; no file at all as long as everything fits in `memoryBytes`. The file vanishes with the process.
    PageCache(std::string folder, uint64_t memoryBytes);
    PageCache(PageCache&& other) noexcept;
    PageCache& operator=(PageCache&&) = delete;
    ~PageCache();
    /// Valid until the next call.
    uint8_t* page(uint64_t number, bool isWritten) {
        Slot& slot = slots_[number % slots_.size()];
        if (slot.page != number) [[unlikely]]
            change(slot, number);
        slot.isDirty = slot.isDirty || isWritten;
        return slot.bytes.data();
    }
    /// The first thing that went wrong (a full disk); pages are zeros from then on.
    Result<void> status() const;
    uint64_t fileBytes() const { return fileBytes_; }
    /// Pages from there on are not needed any more.
    void truncate(uint64_t pages);

  private:
    struct Slot {
        uint64_t page = ~uint64_t{0};
        bool isDirty = false;
        std::vector<uint8_t> bytes;
    };
    void change(Slot& slot, uint64_t number);
    void failed(const char* what);

    std::string folder_;
    std::vector<Slot> slots_;
    int file_ = -1;
    uint64_t fileBytes_ = 0;
    std::vector<bool> isInFile_;
    std::optional<Error> error_;
};

/// `count` records of `bytes` bytes each: side by side in memory where that suffices, in pages otherwise.
class PagedArray {
  public:
    PagedArray(const std::string& folder, uint64_t memoryBytes, size_t bytes, uint64_t count);
    /// Valid until the next call. Of what was never written: zeros.
    const uint8_t* read(uint64_t i) { return at(i, false); }
    uint8_t* write(uint64_t i) { return at(i, true); }
    /// Makes the first `count` records `bytes` bytes long, no more than before, and forgets the rest.
    template <typename Convert>
    void narrow(uint64_t count, size_t bytes, const Convert& convert) {
        // In place: where a record goes lies before where the next one is.
        std::vector<uint8_t> before(bytes_), after(bytes);
        const uint64_t perPage = PageCache::kPageBytes / bytes;
        for (uint64_t i = 0; i < count; ++i) {
            std::memcpy(before.data(), read(i), bytes_);
            convert(before.data(), after.data());
            uint8_t* const to = pages_ ? pages_->page(i / perPage, true) + i % perPage * bytes : first_ + i * bytes;
            std::memcpy(to, after.data(), bytes);
        }
        bytes_ = bytes;
        perPage_ = perPage;
        forget(count);
    }
    Result<void> status() const { return pages_ ? pages_->status() : Result<void>(); }
    uint64_t fileBytes() const { return pages_ ? pages_->fileBytes() : 0; }

  private:
    uint8_t* at(uint64_t i, bool isWritten) {
        return pages_ ? pages_->page(i / perPage_, isWritten) + i % perPage_ * bytes_ : first_ + i * bytes_;
    }
    /// All but the first `count`.
    void forget(uint64_t count);

    std::vector<uint8_t> few_;           ///< less than a huge page of them
    std::unique_ptr<HugeRegion> whole_;  ///< more, by parts of a huge page
    uint8_t* first_ = nullptr;           ///< of either
    std::optional<PageCache> pages_;     ///< or in these
    size_t bytes_;
    uint64_t perPage_, parts_ = 0;
};

}  // namespace stipple
