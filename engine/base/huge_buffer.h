// A large array on huge pages where the system grants them: per-pixel buffers are written all over, and with 4 KiB
// pages a third of the projection's time goes into page table walks.
#pragma once

#include <sys/mman.h>

#include <cstdint>
#include <cstdlib>
#include <memory>
#include <new>
#include <vector>

namespace stipple {

/// `bytes` and what is left of the last page; to be given back by std::free.
inline void* allocateHuge(size_t bytes) {
    constexpr size_t kHuge = size_t{2} << 20;
    const size_t whole = (bytes + kHuge - 1) / kHuge * kHuge;
    void* const data = std::aligned_alloc(kHuge, whole);
    if (data == nullptr) throw std::bad_alloc();
    ::madvise(data, whole, MADV_HUGEPAGE);
    return data;
}

template <typename T>
class HugeBuffer {
  public:
    /// `count` entries, all `value`.
    void assign(size_t count, T value) {
        data_.reset(static_cast<T*>(allocateHuge(count * sizeof(T))));
        std::uninitialized_fill_n(data_.get(), count, value);
    }
    T* data() { return data_.get(); }
    T& operator[](size_t i) { return data_.get()[i]; }

  private:
    struct Free {
        void operator()(T* p) const { std::free(p); }
    };
    std::unique_ptr<T, Free> data_;
};

/// Of vectors of which most are large: what is smaller than a page lies where it would anyway.
template <typename T>
struct HugeAllocator {
    using value_type = T;
    HugeAllocator() = default;
    template <typename U>
    HugeAllocator(const HugeAllocator<U>&) {}  // NOLINT(google-explicit-constructor): as allocators are
    T* allocate(size_t count) {
        if (isLarge(count)) return static_cast<T*>(allocateHuge(count * sizeof(T)));
        return std::allocator<T>().allocate(count);
    }
    void deallocate(T* data, size_t count) {
        if (isLarge(count)) return std::free(data);
        std::allocator<T>().deallocate(data, count);
    }
    bool operator==(const HugeAllocator&) const { return true; }

  private:
    static bool isLarge(size_t count) { return count * sizeof(T) >= size_t{1} << 20; }
};
template <typename T>
using HugeVector = std::vector<T, HugeAllocator<T>>;

/// Resizes what is handed over as a vector; where it has to grow, into huge pages as far as they fit into it.
template <typename T>
void resizeHuge(std::vector<T>& of, size_t count) {
    constexpr uintptr_t kHuge = uintptr_t{2} << 20;
    if (count > of.capacity()) {
        of = {};
        of.reserve(count);
        const auto first = reinterpret_cast<uintptr_t>(of.data());
        const uintptr_t begin = (first + kHuge - 1) / kHuge * kHuge, end = (first + count * sizeof(T)) / kHuge * kHuge;
        if (begin < end) ::madvise(reinterpret_cast<void*>(begin), end - begin, MADV_HUGEPAGE);
    }
    of.resize(count);
}

}  // namespace stipple
