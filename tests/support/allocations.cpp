#include "tests/support/allocations.h"

#include <atomic>
#include <cstdlib>
#include <new>

namespace {
std::atomic<uint64_t> all{0};
thread_local uint64_t own = 0;
}  // namespace

void* operator new(size_t bytes) {
    ++all;
    ++own;
    if (void* p = std::malloc(bytes)) return p;
    throw std::bad_alloc();
}
void operator delete(void* p) noexcept { std::free(p); }
void operator delete(void* p, size_t) noexcept { std::free(p); }

namespace stipple::test {

uint64_t allocations() { return all; }
uint64_t ownAllocations() { return own; }

}  // namespace stipple::test
