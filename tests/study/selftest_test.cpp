// stipple selftest: its cases, and that it can fail.
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "apps/study/selftest/selftest.h"
#include "engine/cpu/cpu_backend.h"
#include "engine/reference/reference.h"
#include "tests/support/program.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

/// Draws like the cpu backend, but each picture as `spoil` leaves it.
class SpoiltBackend : public render::DrawsAtOnce {
  public:
    SpoiltBackend(std::unique_ptr<render::Backend> inner, std::function<void(render::Image&)> spoil)
        : inner_(std::move(inner)), spoil_(std::move(spoil)) {}
    std::string name() const override { return inner_->name(); }
    std::string device() const override { return inner_->device(); }
    Result<void> upload(streaming::ChunkKey key, lod::Chunk chunk) override {
        return inner_->upload(key, std::move(chunk));
    }
    void evict(streaming::ChunkKey key) override { inner_->evict(key); }

  protected:
    void draw(const render::RenderRequest& request, render::Image& image) override {
        EXPECT_TRUE(inner_->render(request, image));
        spoil_(image);
    }

  private:
    std::unique_ptr<render::Backend> inner_;
    std::function<void(render::Image&)> spoil_;
};

TEST(SelfTest, PassesOnTheCpuAndSaysWhatItMeasured) {
    const test::TempFolder folder;
    const auto ran = test::runProgram(folder, "selftest --device cpu --json --quiet");
    ASSERT_EQ(ran.code, 0) << ran.out << ran.err;
    const auto json = nlohmann::json::parse(ran.out);
    EXPECT_EQ(json["schema"], "stipple.selftest/2");
    EXPECT_EQ(json["failed"], 0);
    std::set<int> cases;
    for (const auto& check : json["checks"]) {
        EXPECT_TRUE(check["passed"].get<bool>()) << check;
        for (const auto& c : check["cases"]) cases.insert(c.get<int>());
    }
    EXPECT_EQ(json["checks"].size(), 8u);
    EXPECT_GE(cases.size(), 15u);
}

TEST(SelfTest, ADeviceThatIsNotThereIsAnError) {
    const test::TempFolder folder;
    const auto ran = test::runProgram(folder, "selftest --device abacus");
    EXPECT_NE(ran.code, 0);
    EXPECT_NE(ran.err.find("abacus"), std::string::npos);
}

TEST(SelfTest, FailsWherePicturesAreSpoilt) {
    const auto executor = makeTbbExecutor(2);
    const auto failures = [&](const std::function<void(render::Image&)>& spoil) {
        const test::TempFolder folder;
        const study::Host host{*executor,
                               [&](const std::string&) -> Result<std::unique_ptr<render::Backend>> {
                                   return std::make_unique<SpoiltBackend>(cpu::makeCpuBackend(*executor), spoil);
                               },
                               [](const std::string&, uint64_t, uint64_t) -> Result<void> { return {}; }};
        const auto report = study::runSelfTest({{"cpu"}, false, folder.path(), 2}, host);
        EXPECT_TRUE(report);
        std::set<std::string> names;
        for (const study::SelfCheck& c : report->checks)
            if (!c.isPassed()) names.insert(c.name);
        return names;
    };
    EXPECT_TRUE(failures([](render::Image&) {}).empty());
    // A hole in the middle of each picture.
    const auto withHole = failures([](render::Image& image) {
        const size_t middle = image.width / 2 + size_t{image.width} * (image.height / 2);
        image.rgba[middle] = 0;
        if (!image.depth.empty()) image.depth[middle] = 0;
    });
    EXPECT_TRUE(withHole.count("a closed surface from 60 places"));
    EXPECT_TRUE(withHole.count("a surface from nearer than its spacing"));
    EXPECT_TRUE(withHole.count("one colour at any size of pictures"));
    // Colours that are 6 of 255 off, and depths by a seventh.
    const auto wrong = failures([](render::Image& image) {
        for (uint32_t& c : image.rgba)
            if ((c & 0xffu) > 6) c -= 6;
        for (float& z : image.depth) z *= 1.15f;
    });
    EXPECT_TRUE(wrong.count("pictures against the fp64 restatement"));
    EXPECT_TRUE(wrong.count("depth of a plane seen at 4 degrees"));
    EXPECT_TRUE(wrong.count("4,000 discs at one place"));
}

}  // namespace
}  // namespace stipple
