// What a device can hold and which of its queues is taken: limits are asked for, and refused with their name.
#include <gtest/gtest.h>

#include <array>
#include <filesystem>

#include "engine/base/file.h"
#include "engine/gpu/gpu_backend.h"
#include "tests/support/support.h"

namespace stipple::gpu {
namespace {

VkQueueFamilyProperties family(VkQueueFlags flags, uint32_t timestampBits = 64) {
    return {flags, 1, timestampBits, {1, 1, 1}};
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
