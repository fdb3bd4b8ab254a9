// Where bytes come from: a file now, a web server later.
#pragma once

#include <memory>

#include "engine/base/file.h"

namespace stipple::streaming {

/// Positioned reads; safe from several threads.
class ByteSource {
  public:
    virtual ~ByteSource() = default;
    virtual Result<void> read(uint64_t offset, void* destination, size_t count) const = 0;
};

std::unique_ptr<ByteSource> makeFileSource(std::shared_ptr<const InputFile> file);

}  // namespace stipple::streaming
