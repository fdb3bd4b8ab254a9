// Chunks on their way to the device: what is dropped does not get there, what lies there survives that more room is
// made, and nothing is written where a frame in flight may read.
#include <gtest/gtest.h>

#include <cstring>

#include "engine/gpu/pages.h"
#include "engine/gpu/staging.h"
#include "engine/gpu/upload.h"
#include "tests/gpu/one_time_commands.h"

namespace stipple::gpu {
namespace {

lod::Chunk chunkOf(size_t records, uint32_t word) {
    lod::Chunk chunk;
    chunk.records.assign(records, shared::PointRecord{word, word + 1, word + 2, word + 3});
    return chunk;
}

TEST(Staging, CopiesWhatWasNotDroppedToItsPlaces) {
    const auto made = Device::create({"", true, {}, {}});
    ASSERT_TRUE(made) << made.error().line();
    const Device& device = **made;
    constexpr uint64_t kPage = uint64_t{1} << 22, kSmall = 1000,
                       kLarge = 100'000;  // records; the latter need more room
    auto page = Buffer::create(device, kPage, VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT,
                               Memory::device, "page");
    auto host = Buffer::create(device, kPage, VK_BUFFER_USAGE_TRANSFER_DST_BIT, Memory::host, "copy");
    ASSERT_TRUE(page);
    ASSERT_TRUE(host);
    Staging staging(device);
    EXPECT_TRUE(staging.isEmpty());
    for (const uint32_t round : {100u, 200u}) {  // the second finds the memory of the first
        ASSERT_TRUE(staging.add(chunkOf(kSmall, round), page->handle(), 0));
        ASSERT_TRUE(staging.add(chunkOf(kSmall, 999), page->handle(), kPage / 2));
        staging.drop(page->handle(), kPage / 2);
        EXPECT_FALSE(staging.isEmpty());
        ASSERT_TRUE(staging.add(chunkOf(kLarge, round + 10), page->handle(), 65536));
        OneTimeCommands commands(device);
        vkCmdFillBuffer(commands.handle(), page->handle(), 0, VK_WHOLE_SIZE, 7);
        VkMemoryBarrier2 between{VK_STRUCTURE_TYPE_MEMORY_BARRIER_2};
        between.srcStageMask = between.dstStageMask = VK_PIPELINE_STAGE_2_TRANSFER_BIT;
        between.srcAccessMask = VK_ACCESS_2_TRANSFER_WRITE_BIT;
        between.dstAccessMask = VK_ACCESS_2_TRANSFER_WRITE_BIT | VK_ACCESS_2_TRANSFER_READ_BIT;
        recordBarriers(commands.handle(), {}, &between);
        staging.recordCopies(commands.handle());
        recordBarriers(commands.handle(), {}, &between);
        const VkBufferCopy all{0, 0, kPage};
        vkCmdCopyBuffer(commands.handle(), page->handle(), host->handle(), 1, &all);
        commands.run();
        const auto* const words = static_cast<const uint32_t*>(host->mapped());
        const auto holds = [&](uint64_t offset, uint64_t records, uint32_t word) {
            for (uint64_t i = 0; i < 4 * records; ++i)
                if (words[offset / 4 + i] != word + i % 4) return false;
            return true;
        };
        EXPECT_TRUE(holds(0, kSmall, round));
        EXPECT_TRUE(holds(65536, kLarge, round + 10));
        EXPECT_EQ(words[4 * kSmall], 7u) << "behind the first";
        EXPECT_EQ(words[kPage / 8], 7u) << "what was dropped";
        staging.clear();
        EXPECT_TRUE(staging.isEmpty());
    }
    ASSERT_TRUE(staging.add(chunkOf(1, 1), page->handle(), 0));
    staging.drop(page->handle(), 0);
    EXPECT_TRUE(staging.isEmpty());
    for (const std::string& message : device.messages()) ADD_FAILURE() << message;
}

TEST(Pages, AreNotWrittenAgainBeforeTheLastFrameThatReadThemIsDone) {
    const auto made = Device::create({"", true, {}, {}});
    ASSERT_TRUE(made) << made.error().line();
    PageStore pages(**made);
    constexpr uint64_t kHalf = uint64_t{32} << 20;  // of a page
    const auto first = pages.allocate(kHalf), second = pages.allocate(kHalf);
    ASSERT_TRUE(first && second);
    EXPECT_EQ(pages.buffer(*first), pages.buffer(*second));
    EXPECT_FALSE(pages.hasReleased());
    pages.release(*first, 4);
    pages.release(*second, 5);
    pages.reclaim(3);
    const auto elsewhere = pages.allocate(kHalf);  // frame 4 may read the first, and frame 5 both
    ASSERT_TRUE(elsewhere);
    EXPECT_NE(pages.buffer(*elsewhere), pages.buffer(*first));
    pages.reclaim(4);
    const auto again = pages.allocate(kHalf);
    ASSERT_TRUE(again);
    EXPECT_EQ(pages.address(*again), pages.address(*first));
    EXPECT_TRUE(pages.hasReleased());
    pages.reclaim(5);
    EXPECT_FALSE(pages.hasReleased());
    const auto last = pages.allocate(kHalf);
    ASSERT_TRUE(last);
    EXPECT_EQ(pages.address(*last), pages.address(*second));
    for (const std::string& message : (*made)->messages()) ADD_FAILURE() << message;
}

TEST(Upload, IsThereWhenItsSemaphoreSaysSo) {
    const auto made = Device::create({"", true, {}, {}});
    ASSERT_TRUE(made) << made.error().line();
    const Device& device = **made;
    constexpr uint64_t kRecords = 50'000, kBytes = kRecords * sizeof(shared::PointRecord);
    auto page = Buffer::create(device, kBytes, VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT,
                               Memory::device, "page", Queues::passesAndCopies);
    ASSERT_TRUE(page);
    auto host = Buffer::create(device, kBytes, VK_BUFFER_USAGE_TRANSFER_DST_BIT, Memory::host, "copy");
    ASSERT_TRUE(host);
    auto copies = Copies::create(device);
    ASSERT_TRUE(copies) << copies.error().line();
    auto upload = Upload::create(device, **copies);
    ASSERT_TRUE(upload) << upload.error().line();
    Staging staging(device);
    ASSERT_TRUE((*upload)->submit(staging));
    EXPECT_EQ((*copies)->sent().value, 0u) << "nothing to copy";
    EXPECT_EQ((*upload)->milliseconds(), std::nullopt);
    for (const uint32_t round : {1u, 2u}) {
        ASSERT_TRUE(staging.add(chunkOf(kRecords, 10 * round), page->handle(), 0));
        ASSERT_TRUE((*upload)->submit(staging));
        EXPECT_TRUE(staging.isEmpty());
        SemaphoreValue sent = (*copies)->sent();
        EXPECT_EQ(sent.value, round);
        sent.stages = VK_PIPELINE_STAGE_2_TRANSFER_BIT;
        OneTimeCommands commands(device);
        const VkBufferCopy region{0, 0, kBytes};
        vkCmdCopyBuffer(commands.handle(), page->handle(), host->handle(), 1, &region);
        commands.run(sent);
        const auto* const words = static_cast<const uint32_t*>(host->mapped());
        EXPECT_EQ(words[0], 10 * round);
        EXPECT_EQ(words[4 * kRecords - 1], 10 * round + 3);
        EXPECT_EQ((*upload)->milliseconds().has_value(), device.copiesTellTimes);
    }
    for (const std::string& message : device.messages()) ADD_FAILURE() << message;
}

}  // namespace
}  // namespace stipple::gpu
