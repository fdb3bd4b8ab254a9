// Where bytes come from: a file, memory, a web server. Readers, stores and the streamer read nothing else.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "engine/base/result.h"

namespace stipple {

/// Positioned reads, from several threads at once.
class ByteSource {
  public:
    virtual ~ByteSource() = default;
    virtual uint64_t sizeBytes() const = 0;
    /// For messages: a path or an address.
    virtual const std::string& path() const = 0;
    /// Another one where the bytes are others, as far as can be told without reading them.
    virtual uint64_t identity() const = 0;
    /// Reads exactly `count` bytes at `offset`; an error names the place if there are not so many.
    virtual Result<void> readAt(uint64_t offset, void* destination, size_t count) const = 0;

  protected:
    ByteSource() = default;
    ByteSource(const ByteSource&) = default;
    ByteSource& operator=(const ByteSource&) = default;
};

/// Bytes that stand in memory, e.g. in a test.
class MemorySource final : public ByteSource {
  public:
    MemorySource(std::string name, std::vector<uint8_t> bytes) : name_(std::move(name)), bytes_(std::move(bytes)) {}
    uint64_t sizeBytes() const override { return bytes_.size(); }
    const std::string& path() const override { return name_; }
    uint64_t identity() const override;
    Result<void> readAt(uint64_t offset, void* destination, size_t count) const override;

  private:
    std::string name_;
    std::vector<uint8_t> bytes_;
};

}  // namespace stipple
