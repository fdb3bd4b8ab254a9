#include "engine/base/paged_array.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <utility>

#include "engine/base/huge_buffer.h"

namespace stipple {

PageCache::PageCache(std::string folder, uint64_t memoryBytes)
    : folder_(std::move(folder)), slots_(std::max<uint64_t>(memoryBytes / kPageBytes, 8)) {}
PageCache::PageCache(PageCache&& other) noexcept
    : folder_(std::move(other.folder_)),
      slots_(std::move(other.slots_)),
      file_(std::exchange(other.file_, -1)),
      fileBytes_(other.fileBytes_),
      isInFile_(std::move(other.isInFile_)),
      error_(std::move(other.error_)) {}
PageCache::~PageCache() {
    if (file_ >= 0) ::close(file_);
}

Result<void> PageCache::status() const {
    if (error_) return tl::unexpected(*error_);
    return {};
}

void PageCache::failed(const char* what) {
    if (!error_)
        error_ = Error{ErrorKind::output, fmt::format("{}: {}", what, std::strerror(errno)), folder_,
                       "name a folder for temporary files with --temp"};
}

void PageCache::truncate(uint64_t pages) {
    for (Slot& slot : slots_)
        if (slot.page != ~uint64_t{0} && slot.page >= pages) slot = {};
    if (isInFile_.size() > pages) isInFile_.resize(pages);
    if (file_ < 0 || fileBytes_ <= pages * kPageBytes) return;
    fileBytes_ = pages * kPageBytes;
    if (::ftruncate(file_, static_cast<off_t>(fileBytes_)) != 0) failed("a temporary file cannot be cut");
}

void PageCache::change(Slot& slot, uint64_t number) {
    if (slot.isDirty && !error_) {
        if (file_ < 0) {
            std::string name = folder_ + "/stipple-pages-XXXXXX";
            file_ = ::mkostemp(name.data(), O_CLOEXEC);
            if (file_ >= 0) ::unlink(name.c_str());
        }
        const auto at = static_cast<off_t>(slot.page * kPageBytes);
        if (file_ < 0 || ::pwrite(file_, slot.bytes.data(), kPageBytes, at) != static_cast<ssize_t>(kPageBytes)) {
            failed("a temporary file cannot be written");
        } else {
            fileBytes_ = std::max(fileBytes_, (slot.page + 1) * kPageBytes);
            if (isInFile_.size() <= slot.page) isInFile_.resize(slot.page + 1);
            isInFile_[slot.page] = true;
        }
    }
    slot.page = number;
    slot.isDirty = false;
    if (number >= isInFile_.size() || !isInFile_[number] || error_) {
        slot.bytes.assign(kPageBytes, 0);
        return;
    }
    slot.bytes.resize(kPageBytes);
    if (::pread(file_, slot.bytes.data(), kPageBytes, static_cast<off_t>(number * kPageBytes)) !=
        static_cast<ssize_t>(kPageBytes)) {
        failed("a temporary file cannot be read");
        slot.bytes.assign(kPageBytes, 0);
    }
}

PagedArray::PagedArray(const std::string& folder, uint64_t memoryBytes, size_t bytes, uint64_t count)
    : bytes_(bytes), perPage_(PageCache::kPageBytes / bytes) {
    if (count > memoryBytes / bytes) {
        pages_.emplace(folder, memoryBytes);
        return;
    }
    if (count * bytes < kHugePage) {
        few_.resize(count * bytes);
        first_ = few_.data();
        return;
    }
    parts_ = (count * bytes + kHugePage - 1) / kHugePage;
    std::vector<uint64_t> sizes(parts_, kHugePage);  // (side by side without a gap: each ends where the next may begin)
    sizes.back() = count * bytes - (parts_ - 1) * kHugePage;
    whole_ = std::make_unique<HugeRegion>(sizes);
    first_ = whole_->part(0).data();
}

void PagedArray::forget(uint64_t count) {
    if (pages_) {
        pages_->truncate((count + perPage_ - 1) / perPage_);
        return;
    }
    const uint64_t kept = std::max<uint64_t>((count * bytes_ + kHugePage - 1) / kHugePage, 1);
    for (; parts_ > kept; --parts_) whole_->release(parts_ - 1);
}

}  // namespace stipple
