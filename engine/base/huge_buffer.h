// Large arrays on huge pages where the system grants them: per-pixel buffers are written all over, and with 4 KiB
// pages a third of the projection's time goes into page table walks.
#pragma once

#include <sys/mman.h>

#include <cstdint>
#include <cstdlib>
#include <memory>
#include <new>
#include <vector>

namespace stipple {

inline constexpr size_t kHugePage = size_t{2} << 20;  ///< bytes

template <typename T>
class HugeBuffer {
  public:
    /// `count` entries, all `value`.
    void assign(size_t count, T value) {
        const size_t bytes = (count * sizeof(T) + kHugePage - 1) / kHugePage * kHugePage;
        data_.reset(static_cast<T*>(std::aligned_alloc(kHugePage, bytes)));
        if (!data_) throw std::bad_alloc();
        ::madvise(data_.get(), bytes, MADV_HUGEPAGE);
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

/// Resizes a vector, on huge pages as far as they fit into it; what it held is only kept where there was room.
template <typename T>
void resizeHuge(std::vector<T>& of, size_t count) {
    if (count > of.capacity()) {
        of = {};
        of.reserve(count);
        const auto first = reinterpret_cast<uintptr_t>(of.data());
        const uintptr_t begin = (first + kHugePage - 1) / kHugePage * kHugePage,
                        end = (first + count * sizeof(T)) / kHugePage * kHugePage;
        if (begin < end) ::madvise(reinterpret_cast<char*>(of.data()) + (begin - first), end - begin, MADV_HUGEPAGE);
    }
    of.resize(count);
}

}  // namespace stipple
