// What a device can hold and which of its queues is taken: limits are asked for, and refused with their name.
#include <gtest/gtest.h>

#include <fmt/format.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>

#include "engine/base/file.h"
#include "engine/gpu/gpu_backend.h"
#include "engine/gpu/needs.h"
#include "engine/gpu/pipelines.h"
#include "tests/support/support.h"

namespace stipple::gpu {
namespace {

VkQueueFamilyProperties family(VkQueueFlags flags, uint32_t timestampBits = 64) {
    return {flags, 1, timestampBits, {1, 1, 1}};
}

/// By its name in limitsNeeded().
void setLimit(VkPhysicalDeviceLimits& limits, const std::string& name, uint32_t value) {
    const std::map<std::string, uint32_t*> places{
        {"maxComputeWorkGroupInvocations", &limits.maxComputeWorkGroupInvocations},
        {"maxComputeWorkGroupSize[0]", &limits.maxComputeWorkGroupSize[0]},
        {"maxComputeWorkGroupSize[1]", &limits.maxComputeWorkGroupSize[1]},
        {"maxComputeWorkGroupSize[2]", &limits.maxComputeWorkGroupSize[2]},
        {"maxComputeWorkGroupCount[0]", &limits.maxComputeWorkGroupCount[0]},
        {"maxComputeSharedMemorySize", &limits.maxComputeSharedMemorySize},
        {"maxPushConstantsSize", &limits.maxPushConstantsSize},
        {"maxPerStageDescriptorStorageBuffers", &limits.maxPerStageDescriptorStorageBuffers},
        {"maxDescriptorSetStorageBuffers", &limits.maxDescriptorSetStorageBuffers},
        {"maxPerStageDescriptorUniformBuffers", &limits.maxPerStageDescriptorUniformBuffers},
        {"maxDescriptorSetUniformBuffers", &limits.maxDescriptorSetUniformBuffers},
        {"maxPerStageResources", &limits.maxPerStageResources},
        {"maxUniformBufferRange", &limits.maxUniformBufferRange}};
    *places.at(name) = value;
}

TEST(Device, AQueueForComputeAloneSufficesWithoutAWindow) {
    const auto copies = family(VK_QUEUE_TRANSFER_BIT), computes = family(VK_QUEUE_COMPUTE_BIT),
               all = family(VK_QUEUE_COMPUTE_BIT | VK_QUEUE_GRAPHICS_BIT), timeless = family(VK_QUEUE_COMPUTE_BIT, 0);
    EXPECT_EQ(pickQueueFamily(std::array{copies, computes}, false), 1u);
    EXPECT_EQ(pickQueueFamily(std::array{copies, computes}, true), std::nullopt);
    EXPECT_EQ(pickQueueFamily(std::array{computes, all}, true), 1u);
    EXPECT_EQ(pickQueueFamily(std::array{copies}, false), std::nullopt);
    EXPECT_EQ(pickQueueFamily(std::array{timeless}, false), 0u);
    EXPECT_EQ(pickQueueFamily(std::array{timeless, computes}, false), 1u);
}

TEST(Device, ChunksAreCopiedByWhatDoesNothingElseIfThereIsOne) {
    const auto copies = family(VK_QUEUE_TRANSFER_BIT | VK_QUEUE_SPARSE_BINDING_BIT),
               video = family(VK_QUEUE_TRANSFER_BIT | VK_QUEUE_VIDEO_DECODE_BIT_KHR),
               computes = family(VK_QUEUE_COMPUTE_BIT | VK_QUEUE_TRANSFER_BIT),
               all = family(VK_QUEUE_COMPUTE_BIT | VK_QUEUE_GRAPHICS_BIT | VK_QUEUE_TRANSFER_BIT);
    EXPECT_EQ(pickCopyFamily(std::array{all, copies, computes}, 0), 1u);
    EXPECT_EQ(pickCopyFamily(std::array{all, computes, video, copies}, 1), 3u);
    EXPECT_EQ(pickCopyFamily(std::array{all, computes, video}, 1), 1u);
    EXPECT_EQ(pickCopyFamily(std::array{all}, 0), 0u);
    auto none = copies;
    none.queueCount = 0;
    EXPECT_EQ(pickCopyFamily(std::array{none, all}, 1), 1u);
}

TEST(Device, ABufferBeyondALimitIsRefusedByTheNameOfTheLimit) {
    const DeviceLimits limits{uint64_t{1000} << 20, uint64_t{2000} << 20};
    constexpr VkBufferUsageFlags kBound = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT,
                                 kCopied = VK_BUFFER_USAGE_TRANSFER_DST_BIT;
    const auto bytes = [&](uint64_t megabytes, VkBufferUsageFlags usage) {
        return roomFor(limits, megabytes << 20, usage, "texels", "a card");
    };
    EXPECT_EQ(*bytes(100, kBound), uint64_t{125} << 20);
    EXPECT_EQ(*bytes(900, kBound), uint64_t{1000} << 20);  // no more than may be bound
    EXPECT_EQ(*bytes(1000, kBound), uint64_t{1000} << 20);
    const auto refused = bytes(1001, kBound);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().kind, ErrorKind::device);
    EXPECT_NE(refused.error().line().find("maxStorageBufferRange"), std::string::npos) << refused.error().line();
    EXPECT_NE(refused.error().line().find("1001 MB"), std::string::npos) << refused.error().line();
    EXPECT_TRUE(bytes(1001, kCopied));
    const auto tooLarge = bytes(5000, kCopied);
    ASSERT_FALSE(tooLarge);
    EXPECT_NE(tooLarge.error().line().find("maxBufferSize"), std::string::npos) << tooLarge.error().line();
}

TEST(Device, ThatHasLessThanShadersAndTheirBuffersAskForIsRefusedInOneLine) {
    const auto exactly = [] {  // of all limits at once
        VkPhysicalDeviceLimits limits{};
        for (const LimitNeeded& l : limitsNeeded()) setLimit(limits, l.name, static_cast<uint32_t>(l.needed));
        return limits;
    };
    EXPECT_TRUE(checkLimits(exactly(), "a card"));
    std::map<std::string, uint64_t> needed;
    for (const LimitNeeded& l : limitsNeeded()) {
        needed[l.name] = l.needed;
        if (l.needed == 0) continue;
        VkPhysicalDeviceLimits less = exactly();
        setLimit(less, l.name, static_cast<uint32_t>(l.needed - 1));
        const auto refused = checkLimits(less, "a card");
        ASSERT_FALSE(refused) << l.name;
        EXPECT_EQ(refused.error().kind, ErrorKind::device);
        const std::string line = refused.error().line();
        EXPECT_NE(line.find(fmt::format("{} is {}, and {} is needed", l.name, l.needed - 1, l.needed)),
                  std::string::npos)
            << line;
        EXPECT_NE(line.find("a card"), std::string::npos) << line;
        EXPECT_EQ(line.find('\n'), std::string::npos) << line;
    }
    // What they are of, counted here once more.
    std::array<uint64_t, 3> edge{};
    uint64_t threads = 0, tables = 0;
    for (const Shader& s : shaders()) {
        threads = std::max<uint64_t>(threads, s.group[0] * s.group[1] * s.group[2]);
        for (size_t axis = 0; axis < 3; ++axis) edge.at(axis) = std::max<uint64_t>(edge.at(axis), s.group.at(axis));
        for (const BindingUse& u : s.uses)
            if (isUniform(u.binding)) tables = std::max<uint64_t>(tables, u.stride);
    }
    EXPECT_EQ(needed["maxComputeWorkGroupInvocations"], threads);
    for (size_t axis = 0; axis < 3; ++axis)
        EXPECT_EQ(needed[fmt::format("maxComputeWorkGroupSize[{}]", axis)], edge.at(axis));
    // Corners of a cluster, where they are seen, and whether they are clipped: vec3 (as 16 bytes), ivec2, uint.
    EXPECT_EQ(shaderNamed("rasterise")->sharedBytes, 256u * (16 + 8 + 4));
    EXPECT_EQ(shaderNamed("push")->sharedBytes, 0u);
    EXPECT_GE(needed["maxComputeSharedMemorySize"], shaderNamed("rasterise")->sharedBytes);
    EXPECT_EQ(needed["maxPushConstantsSize"], sizeof(shared::Step));
    EXPECT_EQ(needed["maxPerStageDescriptorStorageBuffers"] + needed["maxPerStageDescriptorUniformBuffers"],
              shared::kBindings);
    EXPECT_EQ(needed["maxUniformBufferRange"], tables);
    // No more than what every Vulkan 1.3 device has, or most: work stays possible on small ones.
    EXPECT_LE(needed["maxComputeWorkGroupInvocations"], 256u);
    EXPECT_LE(needed["maxComputeSharedMemorySize"], 16384u);
    EXPECT_LE(needed["maxPushConstantsSize"], 128u);
    EXPECT_LE(needed["maxPerStageDescriptorStorageBuffers"], 32u);
}

/// Libraries of this process.
std::set<std::string> loaded() {
    std::set<std::string> libraries;
    std::ifstream maps("/proc/self/maps");
    for (std::string line; std::getline(maps, line);)
        if (line.find(".so") != std::string::npos) libraries.insert(line.substr(line.find('/')));
    return libraries;
}

TEST(Device, MayBeMadeAgainAndAgainAndDriversStayLoaded) {
    std::set<std::string> with;
    for (int i = 0; i < 40; ++i) {
        const auto device = Device::create({});
        ASSERT_TRUE(device) << "number " << i << ": " << device.error().line();
        with = loaded();
    }
    EXPECT_FALSE(deviceNames().empty());
    const std::set<std::string> without = loaded();
    for (const std::string& library : with) EXPECT_TRUE(without.contains(library)) << library;
}

TEST(Device, WithoutWhatShadersDoWithinSubgroupsIsRefused) {
    VkPhysicalDeviceSubgroupProperties has{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_PROPERTIES};
    has.supportedStages = VK_SHADER_STAGE_COMPUTE_BIT;
    constexpr VkSubgroupFeatureFlags kAll =
        VK_SUBGROUP_FEATURE_BASIC_BIT | VK_SUBGROUP_FEATURE_ARITHMETIC_BIT | VK_SUBGROUP_FEATURE_BALLOT_BIT;
    has.supportedOperations = kAll;
    EXPECT_TRUE(checkSubgroups(has, "a card"));
    for (const auto& [bit, word] : {std::pair{VK_SUBGROUP_FEATURE_BASIC_BIT, "operations"},
                                    {VK_SUBGROUP_FEATURE_ARITHMETIC_BIT, "arithmetic"},
                                    {VK_SUBGROUP_FEATURE_BALLOT_BIT, "ballots"}}) {
        has.supportedOperations = kAll & ~VkSubgroupFeatureFlags{bit};
        const auto refused = checkSubgroups(has, "a card");
        ASSERT_FALSE(refused) << word;
        EXPECT_NE(refused.error().line().find(word), std::string::npos) << refused.error().line();
    }
    has.supportedOperations = kAll;
    has.supportedStages = VK_SHADER_STAGE_FRAGMENT_BIT;
    EXPECT_FALSE(checkSubgroups(has, "a card"));
}

/// At 4K the pyramid has 221 MB. A device that binds less says so, and goes on with smaller pictures; none is asked for
/// what it does not promise.
TEST(Device, A4KPictureIsDrawnOrRefusedAndValidationIsSilent) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    test::writePly(folder / "a.ply", test::bumpySphere(2'000, 1));
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    auto device = Device::create({});
    ASSERT_TRUE(device) << device.error().line();
    GpuSettings settings;
    settings.validation = true;
    const auto backend = makeGpuBackend(settings);
    ASSERT_TRUE(backend) << backend.error().line();
    const std::vector<render::PlacedStore> placed{{store, {}, {}}};
    const auto state = render::makeFrameState(placed, **backend, *executor, {});
    const auto drawn = render::renderUntilComplete(*state, test::fitView(*store, 3840, 2160), render::FrameSettings{});
    constexpr uint64_t kPyramid = uint64_t{3840} * 2160 * 5 * 4 * 4 / 3;
    if ((*device)->limits.storageRange >= kPyramid + (1 << 20)) {
        ASSERT_TRUE(drawn) << drawn.error().line();
        EXPECT_GT(state->image.rgba.size(), 0u);
    } else {
        ASSERT_FALSE(drawn) << "drawn beyond a limit of " << (*device)->limits.storageRange;
        EXPECT_EQ(drawn.error().kind, ErrorKind::device);
        EXPECT_NE(drawn.error().line().find("maxStorageBufferRange"), std::string::npos) << drawn.error().line();
    }
    const auto small = render::renderUntilComplete(*state, test::fitView(*store, 320, 240), render::FrameSettings{});
    EXPECT_TRUE(small) << small.error().line();
    for (const std::string& message : validationMessages(**backend)) ADD_FAILURE() << message;
}

/// What the driver compiles is kept; a file that is not whole is no file.
TEST(Pipelines, AreKeptFromOneRunToTheNext) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    test::writePly(folder / "a.ply", test::bumpySphere(2'000, 1));
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    GpuSettings settings;
    settings.validation = true;
    settings.cacheFolder = folder / "cache";  // not there yet
    const auto draw = [&] {
        const auto backend = makeGpuBackend(settings);
        EXPECT_TRUE(backend);
        render::Image image = test::renderView(store, **backend, *executor, test::fitView(*store, 160, 120), {});
        for (const std::string& message : validationMessages(**backend)) ADD_FAILURE() << message;
        return image;
    };
    const auto files = [&] {
        std::vector<std::string> found;
        for (const auto& entry : std::filesystem::directory_iterator(settings.cacheFolder))
            found.push_back(entry.path().string());
        return found;
    };
    const render::Image first = draw();
    ASSERT_EQ(files().size(), 1u);
    const std::string file = files().front();
    const auto whole = readWhole(file);
    ASSERT_TRUE(whole);
    ASSERT_GT(whole->size(), sizeof(uint64_t));
    EXPECT_TRUE(draw().rgba == first.rgba);
    EXPECT_EQ(*readWhole(file), *whole) << "nothing new was compiled";
    std::vector<uint8_t> changed = *whole;
    changed.back() ^= 1;
    const std::vector<std::vector<uint8_t>> others{{}, {1, 2, 3}, {whole->begin(), whole->end() - 1}, changed};
    for (const std::vector<uint8_t>& other : others) {
        ASSERT_TRUE(writeWholeFile(file, other.data(), other.size()));
        EXPECT_TRUE(draw().rgba == first.rgba);
        EXPECT_NE(*readWhole(file), other) << "it was not written again";
    }
    // Where none can be written pictures are drawn all the same.
    settings.cacheFolder = file + "/no folder";
    EXPECT_TRUE(draw().rgba == first.rgba);
}

}  // namespace
}  // namespace stipple::gpu
