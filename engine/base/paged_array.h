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
    static constexpr size_t kPageBytes = size_t{1} << 16;
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
    Result<void> status() const { return pages_.status(); }
    uint64_t fileBytes() const { return pages_.fileBytes(); }

  private:
    PageCache pages_;
    size_t bytes_;
    uint64_t perPage_;
};

}  // namespace stipple
