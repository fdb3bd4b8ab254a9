#include "engine/gpu/shadow_buffers.h"

#include <cstring>
#include <vector>

#include "engine/base/check.h"

namespace stipple::gpu {
namespace {

template <typename T>
Result<Buffer> bufferOf(const Device& device, const std::vector<T>& values, const char* name) {
    constexpr VkBufferUsageFlags kRead = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;
    const uint64_t bytes = values.size() * sizeof(T);
    STIPPLE_ASSIGN(const uint64_t room, roomFor(device.limits, bytes, kRead, name, device.deviceName));
    STIPPLE_ASSIGN(Buffer buffer, Buffer::create(device, room, kRead, Memory::table, name));
    std::memcpy(buffer.mapped(), values.data(), bytes);
    return buffer;
}

}  // namespace

Result<ShadowBuffers::Map> ShadowBuffers::copy(const Device& device,
                                               const std::shared_ptr<const render::ShadowTexels>& texels) {
    Map map;
    map.of = texels;
    STIPPLE_ASSIGN(map.depths, bufferOf(device, texels->depth, "depths of a shadow map"));
    if (!texels->through.empty()) {
        STIPPLE_ASSIGN(map.through, bufferOf(device, texels->through, "leaves of a shadow map"));
    }
    return map;
}

Result<shared::ShadowTable> ShadowBuffers::prepare(const Device& device, const render::DrawList& draws) {
    shared::ShadowTable table{};
    STIPPLE_CHECK(draws.shadows.size() <= shared::kMostShadowMaps, "more shadow maps than the table has room for");
    std::map<const render::ShadowTexels*, Map> now;
    for (const shared::ShadowMap& map : draws.shadows) {
        const render::ShadowMapOf& of = draws.shadowMaps->maps[table.count];
        const render::ShadowTexels* const key = of.texels.get();
        if (const auto before = maps_.find(key); before != maps_.end()) now.insert(maps_.extract(before));
        if (now.find(key) == now.end()) {
            STIPPLE_ASSIGN(Map made, copy(device, of.texels));
            now[key] = std::move(made);
        }
        const VkDeviceAddress depths = now[key].depths.address(), through = now[key].through.address();
        table.maps[table.count] = map;
        table.maps[table.count].first = 0;
        table.texels[table.count] = {static_cast<uint32_t>(depths), static_cast<uint32_t>(depths >> 32),
                                     static_cast<uint32_t>(through), static_cast<uint32_t>(through >> 32)};
        table.lights[map.slot] = of.of.light;
        ++table.count;
    }
    table.slots = draws.shadowSlots;
    maps_ = std::move(now);
    return table;
}

uint64_t ShadowBuffers::bytes() const {
    uint64_t sum = 0;
    for (const auto& [key, map] : maps_) sum += map.depths.bytes() + map.through.bytes();
    return sum;
}

}  // namespace stipple::gpu
