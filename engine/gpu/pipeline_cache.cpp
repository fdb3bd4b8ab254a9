#include "engine/gpu/pipeline_cache.h"

#include <cstring>
#include <filesystem>
#include <new>

#include "engine/base/file.h"
#include "engine/base/hash.h"
#include "engine/gpu/shader_table.h"

namespace stipple::gpu {
namespace {

constexpr uint64_t kMostBytes = uint64_t{256} << 20;  // of a file: more than any driver makes of these shaders

std::string fileNameOf(const Device& device) {
    VkPhysicalDeviceProperties properties{};
    vkGetPhysicalDeviceProperties(device.physical, &properties);
    uint64_t key = hashBytes(properties.pipelineCacheUUID, sizeof properties.pipelineCacheUUID,
                             uint64_t{properties.vendorID} << 32 | properties.deviceID);
    key ^= properties.driverVersion;
    for (const Shader& s : shaders()) key = hashBytes(s.code.data(), s.code.size_bytes(), key);
    return hexDigits(key) + ".bin";
}

}  // namespace

/// The driver's bytes; none where the file is not what was written.
std::vector<uint8_t> PipelineCache::read() const {
    const auto file = InputFile::open(path_);
    uint64_t hash = 0;
    if (!file || file->sizeBytes() <= sizeof hash || file->sizeBytes() > kMostBytes) return {};
    std::vector<uint8_t> bytes(file->sizeBytes() - sizeof hash);
    if (!file->readAt(0, &hash, sizeof hash) || !file->readAt(sizeof hash, bytes.data(), bytes.size())) return {};
    return hash == hashBytes(bytes.data(), bytes.size()) ? bytes : std::vector<uint8_t>{};
}

PipelineCache::PipelineCache(const Device& device, const std::string& folder) : device_(device) {
    std::vector<uint8_t> known;
    if (!folder.empty()) {
        path_ = folder + "/" + fileNameOf(device);
        std::error_code ignored;
        if (std::filesystem::exists(path_, ignored)) known = read();
    }
    for (;; known.clear()) {
        VkPipelineCacheCreateInfo info{VK_STRUCTURE_TYPE_PIPELINE_CACHE_CREATE_INFO};
        info.initialDataSize = known.size();
        info.pInitialData = known.data();
        if (vkCreatePipelineCache(device.device, &info, nullptr, &handle_) == VK_SUCCESS) break;
        handle_ = VK_NULL_HANDLE;
        if (known.empty()) break;
    }
    bytesRead_ = known.size();
}

PipelineCache::~PipelineCache() {
    if (handle_ == VK_NULL_HANDLE) return;
    if (!path_.empty()) write();
    vkDestroyPipelineCache(device_.device, handle_, nullptr);
}

void PipelineCache::write() const {
    size_t bytes = 0;
    if (vkGetPipelineCacheData(device_.device, handle_, &bytes, nullptr) != VK_SUCCESS || bytes == bytesRead_) return;
    if (bytes + sizeof(uint64_t) > kMostBytes) return;
    try {
        std::vector<uint8_t> file(sizeof(uint64_t) + bytes);
        if (vkGetPipelineCacheData(device_.device, handle_, &bytes, file.data() + sizeof(uint64_t)) != VK_SUCCESS)
            return;
        file.resize(sizeof(uint64_t) + bytes);
        const uint64_t hash = hashBytes(file.data() + sizeof hash, bytes);
        std::memcpy(file.data(), &hash, sizeof hash);
        std::error_code ignored;
        std::filesystem::create_directories(std::filesystem::path(path_).parent_path(), ignored);
        // Nothing is lost where it cannot be written: the next run compiles what it calls for.
        (void)writeWholeFile(path_, file.data(), file.size());
    } catch (const std::bad_alloc&) {  // nor where there is no memory for it
    }
}

}  // namespace stipple::gpu
