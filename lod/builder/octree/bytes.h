// Plain values as bytes and back, for what an interrupted build leaves to the next run of the same program.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <type_traits>
#include <vector>

namespace stipple::lod {

class ByteWriter {
  public:
    template <typename T>
    void put(const T& value) {
        static_assert(std::is_trivially_copyable_v<T>);
        append(&value, sizeof(T));
    }
    template <typename T>
    void put(const std::vector<T>& values) {
        put(uint64_t{values.size()});
        if constexpr (std::is_trivially_copyable_v<T>) {
            append(values.data(), values.size() * sizeof(T));
        } else {
            for (const T& v : values) put(v);
        }
    }
    void put(const std::string& text) { put(std::vector<char>(text.begin(), text.end())); }
    const std::vector<uint8_t>& bytes() const { return bytes_; }

  private:
    void append(const void* from, size_t count) {
        const size_t at = bytes_.size();
        bytes_.resize(at + count);
        if (count > 0) std::memcpy(bytes_.data() + at, from, count);
    }
    std::vector<uint8_t> bytes_;
};

/// Of bytes whose hash was checked. What lies beyond the end reads as zeros, and isWhole() tells.
class ByteReader {
  public:
    explicit ByteReader(const std::vector<uint8_t>& bytes) : bytes_(bytes) {}
    template <typename T>
    void get(T& value) {
        static_assert(std::is_trivially_copyable_v<T>);
        if (!has(sizeof(T))) return;
        std::memcpy(static_cast<void*>(&value), bytes_.data() + at_, sizeof(T));
        at_ += sizeof(T);
    }
    template <typename T>
    void get(std::vector<T>& values) {
        uint64_t count = 0;
        get(count);
        if constexpr (std::is_trivially_copyable_v<T>) {
            if (count > bytes_.size() || !has(count * sizeof(T))) return;
            values.resize(count);
            if (count > 0) std::memcpy(static_cast<void*>(values.data()), bytes_.data() + at_, count * sizeof(T));
            at_ += count * sizeof(T);
        } else {
            if (!has(count)) return;
            values.resize(count);
            for (T& v : values) get(v);
        }
    }
    void get(std::string& text) {
        std::vector<char> letters;
        get(letters);
        text.assign(letters.begin(), letters.end());
    }
    /// Everything was read, and it was all there.
    bool isWhole() const { return !isBroken_ && at_ == bytes_.size(); }
    bool isBroken() const { return isBroken_; }

  private:
    bool has(uint64_t count) {
        isBroken_ = isBroken_ || count > bytes_.size() - at_;
        return !isBroken_;
    }
    const std::vector<uint8_t>& bytes_;
    size_t at_ = 0;
    bool isBroken_ = false;
};

}  // namespace stipple::lod
