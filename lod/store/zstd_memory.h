// zstd says with a code of its own that there was no memory: that is not a damaged file.
#pragma once

#include <zstd.h>
#include <zstd_errors.h>

#include <memory>
#include <new>

namespace stipple::lod {

/// Of reading: throws std::bad_alloc where memory was missing; other errors stay for the caller.
inline size_t unlessOutOfMemory(size_t got) {
    if (ZSTD_isError(got) && ZSTD_getErrorCode(got) == ZSTD_error_memory_allocation) throw std::bad_alloc();
    return got;
}
/// Of writing, into enough room: only memory can be missing.
inline size_t written(size_t got) {
    if (ZSTD_isError(got)) throw std::bad_alloc();
    return got;
}

/// One a thread, made when there is memory for it.
template <typename Context>
Context& zstdContext(Context* (*create)(), size_t (*destroy)(Context*)) {
    thread_local std::unique_ptr<Context, size_t (*)(Context*)> context(nullptr, destroy);
    if (!context) context.reset(create());
    if (!context) throw std::bad_alloc();
    return *context;
}

}  // namespace stipple::lod
