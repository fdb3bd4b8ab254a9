// Frames whose pictures stay on the device that draws them, for a window to show from there.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "engine/gpu/gpu_backend.h"
#include "tests/gpu/one_time_commands.h"
#include "tests/support/support.h"

namespace stipple::gpu {
namespace {

/// The pixels of a picture that stays on its device, copied by hand.
std::vector<uint32_t> copied(const DevicePicture& picture) {
    const Device& device = *picture.device;
    const uint64_t bytes = uint64_t{picture.width} * picture.height * 4;
    auto host = Buffer::create(device, bytes, VK_BUFFER_USAGE_TRANSFER_DST_BIT, Memory::host, "copy");
    EXPECT_TRUE(host);
    OneTimeCommands commands(device);
    const auto drawn =
        bufferBarrier(picture.pixels, {VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT, VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT},
                      {VK_PIPELINE_STAGE_2_TRANSFER_BIT, VK_ACCESS_2_TRANSFER_READ_BIT});
    recordBarriers(commands.handle(), {&drawn, 1});
    const VkBufferCopy region{0, 0, bytes};
    vkCmdCopyBuffer(commands.handle(), picture.pixels, host->handle(), 1, &region);
    commands.run();
    const auto* from = static_cast<const uint32_t*>(host->mapped());
    return {from, from + bytes / 4};
}

/// A ball of points, and a backend on a device under validation.
class OnDevice : public testing::Test {
  protected:
    void begin(size_t points, uint32_t recordsOfChunk) {
        test::writePly(folder_ / "a.ply", test::bumpySphere(points, 1));
        store_ = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_, recordsOfChunk);
        auto made = Device::create({"", true, {}, {}});
        ASSERT_TRUE(made) << made.error().line();
        device_ = std::move(*made);
        auto backend = makeGpuBackendOn(device_);
        ASSERT_TRUE(backend) << backend.error().line();
        backend_ = std::move(*backend);
    }
    void TearDown() override {
        for (const std::string& message : device_ ? device_->messages() : std::vector<std::string>{})
            ADD_FAILURE() << message;
    }
    const test::TempFolder folder_;
    const std::unique_ptr<Executor> executor_ = makeTbbExecutor(0);
    std::shared_ptr<const lod::Store> store_;
    std::shared_ptr<Device> device_;
    std::unique_ptr<render::Backend> backend_;
};

TEST_F(OnDevice, PicturesAreTheSameAndAreNotCopied) {
    begin(30'000, 1024);
    ASSERT_NE(backend_, nullptr);
    render::Backend& gpu = *backend_;
    auto state = render::makeFrameState({store_}, gpu, *executor_, {});
    const lod::View near = test::fitView(*store_, 320, 240);
    lod::View aside = near;
    aside.eye += 0.3 * near.right;
    const auto isCopied = [&] {
        return std::any_of(gpu.passTimes().begin(), gpu.passTimes().end(),
                           [](const render::PassTime& p) { return p.name == "readback"; });
    };
    std::map<const lod::View*, std::vector<uint32_t>> read;
    for (const lod::View* view : std::initializer_list<const lod::View*>{&near, &aside}) {
        ASSERT_TRUE(render::renderUntilComplete(*state, *view, {}));
        EXPECT_FALSE(state->onDevice);
        EXPECT_TRUE(isCopied());
        read[view] = state->image.rgba;
    }
    render::FrameSettings stays;
    stays.staysOnDevice = true;
    for (const lod::View* view : std::initializer_list<const lod::View*>{&near, &aside, &near, &near, &aside}) {
        ASSERT_TRUE(render::renderResident(*state, *view, stays));
        ASSERT_TRUE(state->onDevice);
        const auto picture = pictureOf(gpu, *state->onDevice);
        ASSERT_TRUE(picture);
        EXPECT_TRUE(copied(*picture) == read[view]);
        ASSERT_TRUE(gpu.finish(*state->onDevice));
        EXPECT_FALSE(gpu.passTimes().empty());
        EXPECT_FALSE(isCopied());
        render::Image image;
        EXPECT_FALSE(gpu.read(*state->onDevice, image)) << "there is nothing to read";
    }
    // A frame that is read in between leaves the last one that stays.
    const render::Ticket last = *state->onDevice;
    ASSERT_TRUE(render::renderResident(*state, near, {}));
    EXPECT_TRUE(state->image.rgba == read[&near]);
    ASSERT_TRUE(pictureOf(gpu, last));
    EXPECT_TRUE(copied(*pictureOf(gpu, last)) == read[&aside]);
    // Other sizes, and frames that nobody waits for.
    for (int k = 0; k < 6; ++k)
        ASSERT_TRUE(render::renderResident(*state, test::fitView(*store_, 200 + 90 * k % 400, 150), stays));
    EXPECT_FALSE(pictureOf(gpu, last)) << "too old";
    ASSERT_TRUE(gpu.finish(*state->onDevice));
}

// Two views that have no room beside each other: what one lets go makes room for the other's, while frames are on their
// way. (That no place is written while one of these may read it: Pages.AreNotWrittenAgain...)
TEST_F(OnDevice, WhatComesAndGoesIsThereInTime) {
    begin(120'000, 512);
    ASSERT_NE(backend_, nullptr);
    render::Backend& gpu = *backend_;
    lod::View views[2] = {test::fitView(*store_, 240, 180), test::fitView(*store_, 240, 180)};
    for (lod::View& v : views) v.focalPixels *= 5;
    views[0].eye += 0.25 * views[0].right;
    views[1].eye -= 0.25 * views[1].right;
    render::FrameSettings stays;
    stays.budgets.errorPixels = 0.5;
    render::FrameSettings isRead = stays;
    stays.staysOnDevice = true;
    uint64_t most = 0;
    std::vector<uint32_t> expected[2];
    for (size_t v = 0; v < 2; ++v) {
        auto alone = render::makeFrameState({store_}, gpu, *executor_, {});
        ASSERT_TRUE(render::renderUntilComplete(*alone, views[v], isRead).value_or(false));
        expected[v] = alone->image.rgba;
        most = std::max(most, alone->streamer->counters().residentBytes);
    }
    streaming::StreamSettings tight;
    tight.residentBytes = most + most / 8;
    auto state = render::makeFrameState({store_}, gpu, *executor_, tight);
    for (size_t turn = 0; turn < 16; ++turn) {
        const size_t v = turn % 2;
        // Frames of what is there, one after another, before the last is waited for.
        for (int k = 0; k < 3; ++k) ASSERT_TRUE(render::renderFrame(*state, views[v], stays));
        ASSERT_TRUE(render::renderUntilComplete(*state, views[v], stays).value_or(false));
        const auto picture = pictureOf(gpu, *state->onDevice);
        ASSERT_TRUE(picture);
        EXPECT_TRUE(copied(*picture) == expected[v]) << turn;
    }
    EXPECT_GT(state->streamer->counters().evictions, 30u);
}

}  // namespace
}  // namespace stipple::gpu
