// The numbers of a glTF file: buffers from data URIs, files and the binary chunk; compressed buffer views; accessors
// with strides, sparse replacements and normalised integers.
#pragma once

#include <map>
#include <span>

#include "engine/scene/gltf/container.h"
#include "engine/scene/gltf/schema.h"
#include "engine/scene/read_settings.h"

namespace stipple::scene::gltf {

class Buffers {
  public:
    /// `container` must outlive it; its structure and extents must have been checked.
    explicit Buffers(Container& container, ReadSettings settings = {}) : container_(container), settings_(settings) {}
    /// Loads every buffer, the container's own by taking it; an error names the one that is missing. One that is too
    /// short is a fault that matters only where something lies in what is missing.
    Result<void> load(Problems& problems);
    /// The bytes of a buffer view, decompressed if it is compressed.
    Result<std::span<const uint8_t>> view(size_t index);
    /// All values of an accessor, count * components, normalised where it says so.
    Result<std::vector<double>> values(size_t accessor);
    Result<std::vector<uint32_t>> indices(size_t accessor);
    /// False for a buffer that the file leaves out (a placeholder).
    bool hasData(const nlohmann::json& accessor) const;
    /// Counts what will be kept of the file against the memory that reading it may take: before it is taken. `what`
    /// is a sentence's subject.
    Result<void> claim(uint64_t bytes, const std::string& what);
    /// Is there room for so much besides what was claimed?
    Result<void> fits(uint64_t bytes, const std::string& what) const;
    /// The bytes of a buffer that was added behind those of the file.
    void add(std::vector<uint8_t> bytes) { buffers_.push_back(std::move(bytes)); }
    /// The bytes of an image (still encoded).
    Result<std::vector<uint8_t>> image(size_t index);

  private:
    Result<void> decompress(size_t index);
    Result<void> addSparse(const nlohmann::json& accessor, size_t components, std::vector<double>& values);

    Container& container_;
    ReadSettings settings_;
    uint64_t claimedBytes_ = 0;
    std::vector<std::vector<uint8_t>> buffers_;
    std::map<size_t, std::vector<uint8_t>> decompressed_;
};

/// Values against what the accessors promise: bounds, finite numbers, indices in range. Reads everything.
Result<void> checkValues(const Container& container, Buffers& buffers, Problems& problems);
/// Images that are missing, or are no images.
Result<void> checkImageBytes(const Container& container, Buffers& buffers, Problems& problems);

}  // namespace stipple::scene::gltf
