// Chunks that are filled on the device hold what the host makes of the same formula, and are drawn like uploaded ones.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/gpu/gpu_backend.h"
#include "engine/render/frame_passes.h"
#include "tests/bench/ground_fill.h"

namespace stipple::gpu {
namespace {

constexpr uint32_t kCount = 5000, kCode = 100;  // records of a tile, not a multiple of a workgroup's

std::unique_ptr<render::Backend> makeBackend() {
    GpuSettings settings;
    settings.validation = true;
    auto backend = makeGpuBackend(settings);
    EXPECT_TRUE(backend) << backend.error().line();
    return std::move(*backend);
}
lod::Chunk tileOfHost(uint32_t number) {
    lod::Chunk chunk;
    for (uint32_t i = 0; i < kCount; ++i) chunk.records.push_back(shared::groundRecord(number, i, kCode));
    return chunk;
}
/// One tile from above.
render::Image drawn(render::Backend& backend, uint32_t number) {
    render::DrawList list;
    lod::View view;
    view.width = view.height = 64;
    view.focalPixels = 64;
    view.eye = {0.5, 0.5, 1.5};
    view.forward = {0, 0, -1};
    view.right = {1, 0, 0};
    view.down = {0, -1, 0};
    view.nearPlane = 1e-3;
    render::makeDrawList({}, {}, {}, view, {}, list);
    shared::DrawNode node{};
    const glm::dmat3 camera = glm::transpose(glm::dmat3(view.right, view.down, view.forward));
    node.axisX = glm::vec3(camera[0] / 65536.0);
    node.axisY = glm::vec3(camera[1] / 65536.0);
    node.axisZ = glm::vec3(camera[2] / 65536.0);
    node.base = glm::vec3(camera * -view.eye);
    node.edge = 1;
    node.errorCode = 255;
    node.count = kCount;
    node.material = shared::kPlainPoint;
    node.octantMask = shared::kNodeTurned;
    render::DrawBatch& batch = list.of(lod::Kind::points);
    for (uint32_t first = 0; first < kCount; first += shared::kRecordsPerBlock) batch.blocks.push_back({0, first});
    batch.nodes.push_back(node);
    batch.keys.push_back({0, number});
    for (uint32_t k = shared::kKindPoints + 1; k < shared::kKindNothing; ++k)
        list.frame.firstBlock.of[k] = static_cast<uint32_t>(batch.blocks.size());
    render::RenderRequest request;
    request.draws = &list;
    request.mode = render::Mode::points;
    request.passes = render::passesOf(request.mode, render::contentOf(list), list.effects);
    render::Image image;
    EXPECT_TRUE(backend.render(request, image));
    return image;
}

TEST(Ground, IsWhatTheHostMakes) {
    const auto backend = makeBackend();
    std::vector<GroundTile> tiles;
    const Device* device = nullptr;
    for (const uint32_t number : {0u, 1u, 15'258u, 0xffffffffu}) {
        const auto place = reserve(*backend, {0, number}, kCount * sizeof(shared::PointRecord));
        ASSERT_TRUE(place) << place.error().line();
        tiles.push_back({number, place->address});
        device = place->device;
    }
    const auto fill = GroundFill::create(*device);
    ASSERT_TRUE(fill) << fill.error().line();
    ASSERT_TRUE((*fill)->fill(tiles, kCount, kCode));
    for (const uint32_t samples : {kCount, kCount / 7, 1u})
        EXPECT_EQ(*(*fill)->differing(tiles, kCount, kCode, samples), 0u) << samples;
    EXPECT_EQ(*(*fill)->differing(tiles, kCount, kCode + 1, kCount), tiles.size() * kCount) << "of others";
    std::swap(tiles[1].address, tiles[2].address);
    EXPECT_EQ(*(*fill)->differing(tiles, kCount, kCode, kCount), 2u * kCount) << "of tiles that lie elsewhere";
    // Drawn like those that came from the host.
    for (const uint32_t number : {1u, 15'258u}) {
        const auto uploaded = makeBackend();
        ASSERT_TRUE(uploaded->upload({0, number}, tileOfHost(number)));
        const render::Image a = drawn(*backend, number), b = drawn(*uploaded, number);
        EXPECT_TRUE(a.rgba == b.rgba) << number;
        EXPECT_GT(std::count_if(a.rgba.begin(), a.rgba.end(), [&](uint32_t p) { return p != a.rgba[0]; }), 1000);
        for (const std::string& message : validationMessages(*uploaded)) ADD_FAILURE() << message;
    }
    EXPECT_TRUE(drawn(*backend, 1).rgba != drawn(*backend, 15'258).rgba);
    for (const std::string& message : validationMessages(*backend)) ADD_FAILURE() << message;
}

/// Hills as sines have them, normals across them, places spread evenly.
TEST(Ground, IsHillyAndSpreadEvenly) {
    constexpr double kTurn = 6.283185307179586, kHill = 0.08;
    constexpr uint32_t kRecords = 65'536;
    std::vector<uint32_t> cells(256);
    for (uint32_t i = 0; i < kRecords; ++i) {
        const shared::PointRecord r = shared::groundRecord(3, i, kCode);
        const double u = kTurn * shared::recordX(r) / 65536, v = kTurn * shared::recordY(r) / 65536;
        EXPECT_NEAR(shared::recordZ(r) / 65536.0, 0.5 + kHill * std::sin(u) * std::cos(v), 5e-4);
        const glm::dvec3 slope(-kHill * kTurn * std::cos(u) * std::cos(v), kHill * kTurn * std::sin(u) * std::sin(v),
                               1);
        EXPECT_GT(glm::dot(glm::dvec3(shared::octDecode(r.normal)), glm::normalize(slope)), 0.99999);
        EXPECT_EQ(shared::recordRadiusCode(r), kCode);
        EXPECT_EQ(shared::recordErrorCode(r), 0u);
        ++cells[shared::recordX(r) >> 12 | shared::recordY(r) >> 12 << 4];
    }
    for (const uint32_t cell : cells) EXPECT_NEAR(cell, 256, 5 * 16);
}

}  // namespace
}  // namespace stipple::gpu
