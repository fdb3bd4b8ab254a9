// Reading forward through bytes in blocks, with a look ahead.
#pragma once

#include <algorithm>
#include <cstring>
#include <memory>
#include <vector>

#include "engine/base/byte_source.h"

namespace stipple {

class Cursor {
  public:
    Cursor(std::shared_ptr<const ByteSource> file, uint64_t offset, size_t blockBytes = size_t{4} << 20)
        : file_(std::move(file)), end_(file_->sizeBytes()), offset_(offset), blockBytes_(blockBytes) {}
    /// Over bytes that are at hand.
    explicit Cursor(std::vector<uint8_t> bytes)
        : end_(bytes.size()), offset_(bytes.size()), buffer_(std::move(bytes)) {}

    uint64_t remaining() const { return end_ - offset_ + (buffer_.size() - used_); }
    uint64_t offset() const { return offset_ - (buffer_.size() - used_); }
    /// Makes at least `count` bytes (or all that are left) available; returns a pointer to them.
    Result<const uint8_t*> peek(size_t count, size_t& available) {
        if (buffer_.size() - used_ < count && offset_ < end_) {
            buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(used_));
            used_ = 0;
            const size_t want = std::max(count, blockBytes_) - buffer_.size();
            const auto get = static_cast<size_t>(std::min<uint64_t>(want, end_ - offset_));
            const size_t old = buffer_.size();
            buffer_.resize(old + get);
            STIPPLE_TRY(file_->readAt(offset_, buffer_.data() + old, get));
            offset_ += get;
        }
        available = buffer_.size() - used_;
        return buffer_.data() + used_;
    }
    void skip(size_t count) { used_ += count; }
    /// Copies the next sizeof(T) bytes; false if there are not as many.
    template <typename T>
    Result<bool> take(T& value) {
        size_t available = 0;
        STIPPLE_ASSIGN(const uint8_t* bytes, peek(sizeof(T), available));
        if (available < sizeof(T)) return false;
        std::memcpy(&value, bytes, sizeof(T));
        skip(sizeof(T));
        return true;
    }
    /// Steps over bytes without reading them; at most those that remain.
    void skipFar(uint64_t count) {
        const uint64_t here = std::min<uint64_t>(count, buffer_.size() - used_);
        used_ += static_cast<size_t>(here);
        offset_ += std::min(count - here, end_ - offset_);
    }

  private:
    std::shared_ptr<const ByteSource> file_;
    uint64_t end_, offset_;
    size_t blockBytes_ = 0, used_ = 0;
    std::vector<uint8_t> buffer_;
};

}  // namespace stipple
