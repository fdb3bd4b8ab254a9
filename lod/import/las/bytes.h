// Where compressed bytes come from: a file, a buffer, or anything that can read at an offset. CodeStream hands them to
// an arithmetic decoder through a small window, so that a chunk of any size needs little memory.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <functional>
#include <vector>

#include "engine/base/result.h"

namespace stipple::las {

/// Reads exactly `count` bytes at `offset`, which lie inside `size`. Safe from several threads if the callback is.
struct Bytes {
    uint64_t size = 0;
    std::function<Result<void>(uint64_t offset, void* to, size_t count)> readAt;

    /// A view of memory, which must outlive it.
    static Bytes ofMemory(const uint8_t* data, size_t count) {
        return {count, [data](uint64_t offset, void* to, size_t n) -> Result<void> {
                    if (n > 0) std::memcpy(to, data + offset, n);
                    return {};
                }};
    }
};

/// The bytes [begin, end) of one arithmetic stream. A decoder calls ensure() once per point and then reads ahead of
/// `next` without looking: there are always `reach` readable bytes, zeros beyond the end of the stream.
class CodeStream {
  public:
    const uint8_t* next = nullptr;

    /// `reach`: the most bytes that one point can take.
    Result<void> open(const Bytes& in, uint64_t begin, uint64_t end, size_t reach) {
        in_ = &in;
        fileNext_ = begin;
        fileEnd_ = end;
        reach_ = reach;
        const auto window = static_cast<size_t>(std::min<uint64_t>(end - begin, kWindow));
        buffer_.resize(window + 2 * reach);  // what is kept of the last window, and zeros beyond the end
        next = valid_ = buffer_.data();
        limit_ = next;
        return fill();
    }
    Result<void> ensure() {
        if (next <= limit_) return {};
        return fill();
    }
    /// Bytes were used that the stream does not have.
    bool overrun() const { return fileNext_ == fileEnd_ && next > valid_; }
    /// Offset of `next` in the file.
    uint64_t position() const { return fileNext_ - static_cast<uint64_t>(valid_ - next); }

  private:
    static constexpr uint64_t kWindow = 64 << 10;

    Result<void> fill() {
        if (fileNext_ == fileEnd_) {
            if (next > valid_) return fail(ErrorKind::input, "the compressed bytes end before the points do");
            std::memset(buffer_.data() + (valid_ - buffer_.data()), 0, reach_);  // what may be read ahead
            limit_ = valid_;
            return {};
        }
        const auto kept = static_cast<size_t>(valid_ - next);
        std::memmove(buffer_.data(), next, kept);
        const auto room = buffer_.size() - reach_ - kept;
        const auto count = static_cast<size_t>(std::min<uint64_t>(fileEnd_ - fileNext_, room));
        STIPPLE_TRY(in_->readAt(fileNext_, buffer_.data() + kept, count));
        fileNext_ += count;
        next = buffer_.data();
        valid_ = next + kept + count;
        if (fileNext_ == fileEnd_) return fill();
        limit_ = valid_ - reach_;
        return {};
    }

    const Bytes* in_ = nullptr;
    std::vector<uint8_t> buffer_;
    const uint8_t *valid_ = nullptr, *limit_ = nullptr;
    uint64_t fileNext_ = 0, fileEnd_ = 0;
    size_t reach_ = 0;
};

}  // namespace stipple::las
