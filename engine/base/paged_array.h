// An array of records of which a bounded number of pages is in memory, the rest in a file without a name.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <vector>

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

/// Records of `bytes` bytes each.
class PagedArray {
  public:
    PagedArray(std::string folder, uint64_t memoryBytes, size_t bytes)
        : pages_(std::move(folder), memoryBytes), bytes_(bytes), perPage_(PageCache::kPageBytes / bytes) {}
    /// Of what was never written: zeros.
    void get(uint64_t i, void* to) {
        std::memcpy(to, pages_.page(i / perPage_, false) + i % perPage_ * bytes_, bytes_);
    }
    void set(uint64_t i, const void* from) {
        std::memcpy(pages_.page(i / perPage_, true) + i % perPage_ * bytes_, from, bytes_);
    }
    /// Makes the first `count` records `bytes` bytes long, no more than before, and forgets the rest.
    template <typename Convert>
    void narrow(uint64_t count, size_t bytes, const Convert& convert) {
        // In place: where a record goes lies before where the next one is.
        std::vector<uint8_t> before(bytes_), after(bytes);
        const uint64_t perPage = PageCache::kPageBytes / bytes;
        for (uint64_t i = 0; i < count; ++i) {
            get(i, before.data());
            convert(before.data(), after.data());
            std::memcpy(pages_.page(i / perPage, true) + i % perPage * bytes, after.data(), bytes);
        }
        bytes_ = bytes;
        perPage_ = perPage;
        pages_.truncate((count + perPage - 1) / perPage);
    }
    Result<void> status() const { return pages_.status(); }
    uint64_t fileBytes() const { return pages_.fileBytes(); }

  private:
    PageCache pages_;
    size_t bytes_;
    uint64_t perPage_;
};

}  // namespace stipple
