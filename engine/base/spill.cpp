#include "engine/base/spill.h"

#include <unistd.h>

#include <cstring>
#include <utility>

#include "engine/base/check.h"
#include "engine/base/file.h"
#include "engine/base/hash.h"

namespace stipple {

Result<void> Spill::append(std::span<const uint8_t> bytes) {
    if (region_ != nullptr) {
        const uint64_t at = bytes_.fetch_add(bytes.size());
        const std::span<uint8_t> room = region_->part(part_);
        if (bytes.size() > room.size() || at > room.size() - bytes.size()) {
            bytes_ -= bytes.size();
            return fail(ErrorKind::input, "changed while it was read", "", "build again when it is complete");
        }
        std::memcpy(room.data() + at, bytes.data(), bytes.size());
        return {};
    }
    const std::lock_guard lock(mutex_);
    if (path_.empty()) {
        memory_.insert(memory_.end(), bytes.begin(), bytes.end());
    } else {
        STIPPLE_TRY(writeFileAt(path_, bytes_, bytes.data(), bytes.size()));
    }
    bytes_ += bytes.size();
    return {};
}

Result<std::vector<uint8_t>> Spill::part(uint64_t offset, uint64_t count) const {
    if (path_.empty()) {
        const std::span<const uint8_t> all =
            region_ != nullptr ? std::span<const uint8_t>(region_->part(part_)) : memory_;
        STIPPLE_CHECK(offset <= all.size() && count <= all.size() - offset, "a part of what is there");
        const std::span<const uint8_t> wanted = all.subspan(offset, count);
        return std::vector<uint8_t>(wanted.begin(), wanted.end());
    }
    std::vector<uint8_t> bytes(count);
    if (count == 0) return bytes;
    STIPPLE_ASSIGN(const InputFile file, InputFile::open(path_));
    STIPPLE_TRY(file.readAt(offset, bytes.data(), bytes.size()));
    return bytes;
}

Result<std::vector<uint8_t>> Spill::take() {
    if (region_ != nullptr) {
        Result<std::vector<uint8_t>> bytes = part(0, bytes_);
        release();
        return bytes;
    }
    if (path_.empty()) return std::exchange(memory_, {});
    STIPPLE_ASSIGN(std::vector<uint8_t> bytes, part(0, bytes_));
    uint64_t at = 0;
    for (const Segment& s : segments_) {
        if (hashBytes(bytes.data() + at, s.bytes) != s.hash)
            return fail(ErrorKind::input, "is not what was written", path_, "begin anew with --restart");
        at += s.bytes;
    }
    return bytes;
}

Result<std::span<const uint8_t>> Spill::look(std::vector<uint8_t>& held) {
    if (region_ != nullptr) return std::span<const uint8_t>(region_->part(part_)).first(bytes_);
    STIPPLE_ASSIGN(held, take());
    return std::span<const uint8_t>(held);
}

void Spill::release() {
    if (region_ != nullptr) std::exchange(region_, nullptr)->release(part_);
}

Result<void> Spill::seal() {
    const uint64_t fresh = bytes_ - sealedBytes_;
    if (path_.empty() || fresh == 0) return {};
    STIPPLE_ASSIGN(const std::vector<uint8_t> bytes, part(sealedBytes_, fresh));
    segments_.push_back({fresh, hashBytes(bytes.data(), fresh)});
    sealedBytes_ = bytes_;
    return {};
}

void Spill::restore(std::vector<Segment> segments) {
    segments_ = std::move(segments);
    sealedBytes_ = 0;
    for (const Segment& s : segments_) sealedBytes_ += s.bytes;
    bytes_ = sealedBytes_;
}

void Spill::remove() {
    if (!path_.empty()) ::unlink(path_.c_str());
}

}  // namespace stipple
