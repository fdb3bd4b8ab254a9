// An array of plain values of which a bounded number of pages is in memory, the rest in a file without a name.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <type_traits>
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

template <typename T>
class PagedArray {
    static_assert(std::is_trivially_copyable_v<T> && sizeof(T) <= PageCache::kPageBytes);

  public:
    PagedArray(std::string folder, uint64_t memoryBytes) : pages_(std::move(folder), memoryBytes) {}
    /// Of what was never written: zeros.
    T get(uint64_t i) {
        T value;
        std::memcpy(&value, pages_.page(i / kPerPage, false) + i % kPerPage * sizeof(T), sizeof(T));
        return value;
    }
    void set(uint64_t i, const T& value) {
        std::memcpy(pages_.page(i / kPerPage, true) + i % kPerPage * sizeof(T), &value, sizeof(T));
    }
    Result<void> status() const { return pages_.status(); }
    uint64_t fileBytes() const { return pages_.fileBytes(); }

  private:
    static constexpr uint64_t kPerPage = PageCache::kPageBytes / sizeof(T);
    PageCache pages_;
};

}  // namespace stipple
