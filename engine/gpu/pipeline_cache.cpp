#include "engine/gpu/pipeline_cache.h"

#include <cstring>
#include <filesystem>

#include "engine/base/file.h"
#include "engine/base/hash.h"

namespace stipple::gpu {
namespace {

/// A device, and the driver that compiles for it.
std::string fileNameOf(const Device& device) {
    VkPhysicalDeviceProperties properties{};
    vkGetPhysicalDeviceProperties(device.physical, &properties);
    const uint64_t key = hashBytes(properties.pipelineCacheUUID, sizeof properties.pipelineCacheUUID,
                                   uint64_t{properties.vendorID} << 32 | properties.deviceID);
    return hexDigits(key ^ properties.driverVersion) + ".bin";
}

/// The driver's bytes; none where the file is not what was written.
std::vector<uint8_t> readPipelines(const std::string& path) {
    auto bytes = readWhole(path);
    uint64_t hash = 0;
    if (!bytes || bytes->size() <= sizeof hash) return {};
    std::memcpy(&hash, bytes->data(), sizeof hash);
    bytes->erase(bytes->begin(), bytes->begin() + sizeof hash);
    return hash == hashBytes(bytes->data(), bytes->size()) ? std::move(*bytes) : std::vector<uint8_t>{};
}

}  // namespace

Result<std::unique_ptr<PipelineCache>> PipelineCache::create(const Device& device, const std::string& folder) {
    std::unique_ptr<PipelineCache> cache(new PipelineCache(device));
    std::vector<uint8_t> known;
    if (!folder.empty()) {
        cache->path_ = folder + "/" + fileNameOf(device);
        std::error_code ignored;
        if (std::filesystem::exists(cache->path_, ignored)) known = readPipelines(cache->path_);
    }
    VkPipelineCacheCreateInfo info{VK_STRUCTURE_TYPE_PIPELINE_CACHE_CREATE_INFO};
    info.initialDataSize = known.size();
    info.pInitialData = known.data();
    if (const VkResult r = vkCreatePipelineCache(device.device, &info, nullptr, &cache->handle_); r != VK_SUCCESS)
        return vulkanError(r, "no pipeline cache");
    cache->bytesRead_ = known.size();
    return cache;
}

PipelineCache::~PipelineCache() {
    if (!path_.empty()) write();
    vkDestroyPipelineCache(device_.device, handle_, nullptr);
}

void PipelineCache::write() const {
    size_t bytes = 0;
    if (vkGetPipelineCacheData(device_.device, handle_, &bytes, nullptr) != VK_SUCCESS || bytes <= bytesRead_) return;
    std::vector<uint8_t> file(sizeof(uint64_t) + bytes);
    if (vkGetPipelineCacheData(device_.device, handle_, &bytes, file.data() + sizeof(uint64_t)) != VK_SUCCESS) return;
    file.resize(sizeof(uint64_t) + bytes);
    const uint64_t hash = hashBytes(file.data() + sizeof hash, bytes);
    std::memcpy(file.data(), &hash, sizeof hash);
    std::error_code ignored;
    std::filesystem::create_directories(std::filesystem::path(path_).parent_path(), ignored);
    // Nothing is lost where it cannot be written: the next run compiles what it calls for.
    [[maybe_unused]] const Result<void> written = writeWholeFile(path_, file.data(), file.size());
}

}  // namespace stipple::gpu
