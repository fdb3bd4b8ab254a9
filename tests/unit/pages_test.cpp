// Node tables in pages: what is read as it is needed is what is read at once; pictures hang on neither; pages that
// somebody damaged or wrote on purpose are refused by name, and their parents are drawn.
#include <gtest/gtest.h>

#include <zstd.h>

#include <atomic>
#include <cstring>

#include "engine/base/hash.h"
#include "engine/base/rng.h"
#include "engine/cpu/cpu_backend.h"
#include "lod/primitives/kinds.h"
#include "lod/store/pages.h"
#include "tests/support/crafted_store.h"
#include "tests/support/mixed_store.h"
#include "tests/support/store_hash.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using lod::Tables;
using test::withPages;
using namespace lod::layout;
using StorePtr = std::shared_ptr<const lod::Store>;

/// Counts what is read.
class CountingSource final : public ByteSource {
  public:
    explicit CountingSource(std::shared_ptr<const ByteSource> of) : of_(std::move(of)) {}
    uint64_t sizeBytes() const override { return of_->sizeBytes(); }
    const std::string& path() const override { return of_->path(); }
    uint64_t identity() const override { return of_->identity(); }
    Result<void> readAt(uint64_t offset, void* to, size_t count) const override {
        bytes += count;
        return of_->readAt(offset, to, count);
    }
    mutable std::atomic<uint64_t> bytes{0};

  private:
    std::shared_ptr<const ByteSource> of_;
};

class StorePages : public testing::Test {
  protected:
    void SetUp() override {
        test::writePly(folder_ / "a.ply", test::bumpySphere(20'000, 1));
        points_ = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_, 128);
        paged_ = withPages(*points_, folder_ / "paged.stipple", 3);
    }
    static StorePtr opened(const std::string& path, Tables tables) {
        auto store = lod::openStore(path, tables);
        EXPECT_TRUE(store) << store.error().line();
        return std::make_shared<const lod::Store>(std::move(*store));
    }
    static size_t known(const lod::Store& store) {
        size_t count = 0;
        for (uint32_t p = 0; p < store.hierarchy.known.count(); ++p) count += store.hierarchy.known.isThere(p) ? 1 : 0;
        return count;
    }
    /// Complete, with depth and normals.
    render::Image picture(const StorePtr& store, const lod::View& view, const render::FrameSettings& settings,
                          uint64_t residentBytes = uint64_t{1} << 30) {
        streaming::StreamSettings stream;
        stream.residentBytes = residentBytes;
        const auto backend = cpu::makeCpuBackend(*executor_);
        auto state = render::makeFrameState({store}, *backend, *executor_, stream);
        const auto done = render::renderUntilComplete(*state, view, settings);
        EXPECT_TRUE(done);
        render::Image image = state->image;
        state->streamer.reset();
        return image;
    }
    static void expectSame(const render::Image& a, const render::Image& b) {
        EXPECT_TRUE(a.rgba == b.rgba);
        EXPECT_TRUE(a.depth == b.depth);
        EXPECT_TRUE(a.normal == b.normal);
    }
    /// Towards a spot on the near side, from close by.
    lod::View closeView() const {
        lod::View view = test::fitView(*points_, 200, 150);
        view.eye *= 0.45;
        view.focalPixels *= 3;
        return view;
    }
    test::TempFolder folder_;
    std::unique_ptr<Executor> executor_ = makeSerialExecutor();
    StorePtr points_;
    std::string paged_;
};

TEST_F(StorePages, HoldWhatOneTableHolds) {
    for (const uint32_t log2 : {0u, 2u, 5u, 20u}) {
        const StorePtr store = opened(withPages(*points_, folder_ / "b.stipple", log2), Tables::whole);
        EXPECT_EQ(test::hashTable(*store), test::hashTable(*points_)) << log2;
        EXPECT_EQ(test::hashRecords(*store), test::hashRecords(*points_)) << log2;
        EXPECT_TRUE(lod::verifyStore(*store, *executor_));
    }
    EXPECT_EQ(opened(withPages(*points_, folder_ / "c.stipple", lod::kLog2PageNodes), Tables::whole)->contentHash,
              points_->contentHash);
}

TEST_F(StorePages, AreReadInAnyOrder) {
    Rng rng(7);
    for (int round = 0; round < 5; ++round) {
        const StorePtr store = opened(paged_, Tables::asNeeded);
        ASSERT_NE(store->pages, nullptr);
        const size_t pages = store->pages->count();
        ASSERT_GT(pages, 20u);
        EXPECT_EQ(known(*store), 1u);
        EXPECT_NE(test::hashTable(*store), test::hashTable(*points_)) << "the control: what is not there is not there";
        while (known(*store) < pages) {
            const auto page = static_cast<uint32_t>(rng.next() % pages);
            ASSERT_TRUE(store->pages->load(store->hierarchy, page));
            EXPECT_TRUE(store->hierarchy.known.isThere(page));
        }
        EXPECT_EQ(test::hashTable(*store), test::hashTable(*points_));
        EXPECT_TRUE(lod::verifyStore(*store, *executor_));
    }
}

TEST_F(StorePages, OpeningReadsTheFirstAlone) {
    const auto bytes = readWhole(paged_);
    ASSERT_TRUE(bytes);
    const auto memory = std::make_shared<const MemorySource>("in memory", *bytes);
    const auto needed = std::make_shared<const CountingSource>(memory),
               all = std::make_shared<const CountingSource>(memory);
    ASSERT_TRUE(lod::openStore(needed, Tables::asNeeded));
    ASSERT_TRUE(lod::openStore(all, Tables::whole));
    uint64_t pages = 0;
    const StorePtr store = opened(paged_, Tables::asNeeded);
    for (uint32_t p = 1; p < store->pages->count(); ++p) pages += store->pages->bytesOf(p);
    EXPECT_EQ(all->bytes - needed->bytes, pages);
    EXPECT_GT(pages, needed->bytes / 2);
}

TEST_F(StorePages, ThePictureHangsOnWhatIsNeededAndNotOnWhatIsThere) {
    const lod::View close = closeView(), whole = test::fitView(*points_, 200, 150);
    for (const double tau : {0.3, 4.0})
        for (const uint64_t budget : {std::numeric_limits<uint64_t>::max(), uint64_t{3000}})
            for (const uint64_t memory : {uint64_t{1} << 30, uint64_t{200'000}})
                for (const lod::View& view : {close, whole}) {
                    render::FrameSettings s;
                    s.wantDepthAndNormal = true;
                    s.budgets = {tau, budget};
                    const StorePtr store = opened(paged_, Tables::asNeeded);
                    expectSame(picture(store, view, s, memory), picture(points_, view, s, memory));
                    if (view.eye == close.eye) EXPECT_LT(known(*store), store->pages->count() * 3 / 4);
                    // From what another view left known, too.
                    expectSame(picture(store, whole, s, memory), picture(points_, whole, s, memory));
                    expectSame(picture(store, view, s, memory), picture(points_, view, s, memory));
                }
}

TEST_F(StorePages, FramesThatDoNotWaitAreClosedAndBecomeWhole) {
    const StorePtr store = opened(paged_, Tables::asNeeded);
    const lod::View view = closeView();
    render::FrameSettings s;
    s.wantDepthAndNormal = true;
    s.budgets.errorPixels = 0.5;
    const render::Image complete = picture(points_, view, s);
    const auto covered = [](const render::Image& image) {
        return std::count_if(image.rgba.begin(), image.rgba.end(), [](uint32_t c) { return c >> 24 != 0; });
    };
    const auto backend = cpu::makeCpuBackend(*executor_);
    auto state = render::makeFrameState({store}, *backend, *executor_, {});
    size_t before = 0, frames = 0, grew = 0;
    for (; frames < 60; ++frames) {
        ASSERT_TRUE(render::renderFrame(*state, view, s));
        state->streamer->wait();
        grew += known(*store) > before ? 1 : 0;
        before = known(*store);
        // A coarser ancestor stands for what is not known yet.
        if (frames > 2) EXPECT_GT(covered(state->image), covered(complete) * 95 / 100) << frames;
        if (state->cut.wanted.empty()) break;
        EXPECT_GT(state->counters.nodesMissing, 0u);
    }
    EXPECT_LT(frames, 40u);
    EXPECT_GT(grew, 2u) << "pages come level by level";
    EXPECT_EQ(state->counters.nodesMissing, 0u);
    EXPECT_TRUE(state->streamer->isIdle());
    EXPECT_EQ(state->streamer->counters().pages + 1, known(*store)) << "with those of the parents";
    expectSame(state->image, complete);
    state->streamer.reset();
}

/// The root alone has more records than may be drawn, what the view shows in detail has fewer: that is asked for,
/// though all that can be drawn meanwhile is a part of the root.
TEST_F(StorePages, ABudgetBelowTheRootDoesNotStall) {
    const lod::View view = closeView();
    render::FrameSettings s;
    s.wantDepthAndNormal = true;
    s.budgets = {0.3, 3000};
    const render::Image complete = picture(points_, view, s);
    for (const StorePtr& store : {points_, opened(paged_, Tables::asNeeded)}) {
        ASSERT_GT(store->hierarchy.nodes[0].records, 3000u);
        const auto backend = cpu::makeCpuBackend(*executor_);
        auto state = render::makeFrameState({store}, *backend, *executor_, {});
        for (int frame = 0; frame < 40; ++frame) {
            ASSERT_TRUE(render::renderFrame(*state, view, s));
            state->streamer->wait();
            EXPECT_LE(state->counters.recordsDrawn, 3000u);
        }
        EXPECT_TRUE(state->cut.wanted.empty());
        EXPECT_FALSE(state->cut.truncated);
        expectSame(state->image, complete);
        state->streamer.reset();
    }
}

TEST_F(StorePages, OfSeveralPayloadsAreTheSame) {
    test::writeMixedStore(folder_ / "mixed.stipple");
    const StorePtr mixed = opened(folder_ / "mixed.stipple", Tables::whole);
    const std::string path = withPages(*mixed, folder_ / "m.stipple", 0);
    const StorePtr needed = opened(path, Tables::asNeeded);
    ASSERT_NE(needed->pages, nullptr);
    EXPECT_TRUE(needed->hierarchy.isMixed);
    render::FrameSettings s;
    s.wantDepthAndNormal = true;
    s.budgets.errorPixels = 0.5;
    const lod::View view = test::fitView(*mixed, 160, 120);
    expectSame(picture(needed, view, s), picture(mixed, view, s));
    EXPECT_EQ(test::hashTable(*opened(path, Tables::whole)), test::hashTable(*mixed));
    ASSERT_TRUE(lod::readWholeTable(*needed));
    EXPECT_EQ(test::hashTable(*needed), test::hashTable(*mixed));
}

/// Of every kind: graphs and stochastic points, which are walked along whole, have all pages at once.
TEST_F(StorePages, StoresOfEveryKindOpenBothWays) {
    for (const std::string& path : test::smallStores(folder_.path())) {
        const StorePtr store = opened(path, Tables::whole);
        const std::string again = withPages(*store, folder_ / "again.stipple", 1);
        const StorePtr whole = opened(again, Tables::whole), needed = opened(again, Tables::asNeeded);
        EXPECT_EQ(test::hashTable(*whole), test::hashTable(*store)) << path;
        EXPECT_EQ(needed->pages == nullptr, store->hierarchy.isGraph || store->hierarchy.isStochastic) << path;
        ASSERT_TRUE(lod::readWholeTable(*needed)) << path;
        EXPECT_EQ(test::hashTable(*needed), test::hashTable(*store)) << path;
        EXPECT_EQ(test::hashRecords(*needed), test::hashRecords(*store)) << path;
    }
}

TEST_F(StorePages, MayBeReadByManyWhileOthersLook) {
    const auto many = makeTbbExecutor(4);
    for (int round = 0; round < (test::isThorough() ? 50 : 8); ++round) {
        const StorePtr store = opened(paged_, Tables::asNeeded);
        const lod::View view = closeView();
        const uint64_t expected = test::hashTable(*points_);
        const std::vector<const lod::Hierarchy*> hierarchies{&store->hierarchy};
        const std::vector<lod::Instance> instances(1);
        std::atomic<int> failed{0};
        many->parallelFor(12, 1, [&](size_t begin, size_t end) {
            for (size_t k = begin; k < end; ++k) {
                lod::CutScratch scratch;
                lod::Cut cut;
                const std::vector<std::vector<uint8_t>> drawable{
                    std::vector<uint8_t>(store->hierarchy.chunks(), uint8_t{1})};
                for (uint32_t p = 0; p < store->pages->count(); ++p) {
                    const auto page = static_cast<uint32_t>((p * 7 + k * 5) % store->pages->count());
                    if (k % 3 == 0) {
                        lod::selectCut({hierarchies, instances, {}}, {drawable}, view, {0.3}, scratch, cut);
                    } else if (!store->pages->load(store->hierarchy, page)) {
                        ++failed;
                    }
                }
            }
        });
        EXPECT_EQ(failed, 0);
        EXPECT_EQ(test::hashTable(*store), expected);
    }
}

/// Takes a file apart as far as its pages, and puts it together with every hash right.
struct CraftedPages {
    Head head{};
    TableHead table{};
    std::vector<NameOnDisk> names;
    std::vector<PageOnDisk> pages;
    std::vector<std::vector<uint8_t>> raw;  ///< of each page
    std::string body, description, mesh;    ///< the last two compressed

    static std::string unpacked(const std::string& file, const Section& s) {
        std::string out(s.rawBytes, '\0');
        EXPECT_EQ(ZSTD_decompress(out.data(), out.size(), file.data() + s.offset, s.bytes), out.size());
        return out;
    }
    explicit CraftedPages(const std::string& path) {
        const std::string file = test::slurp(path);
        std::memcpy(&head, file.data(), sizeof(head));
        const std::string directory = unpacked(file, head.nodes);
        std::memcpy(&table, directory.data(), sizeof(table));
        names.resize(table.kinds + table.codecs);
        std::memcpy(names.data(), directory.data() + sizeof(table), names.size() * sizeof(NameOnDisk));
        pages.resize(table.pages);
        std::memcpy(pages.data(), directory.data() + sizeof(table) + names.size() * sizeof(NameOnDisk),
                    pages.size() * sizeof(PageOnDisk));
        for (const PageOnDisk& p : pages) {
            const std::string page = unpacked(file, p.section);
            raw.emplace_back(page.begin(), page.end());
        }
        body = file.substr(sizeof(Head), pages[0].section.offset - sizeof(Head));
        description = file.substr(head.description.offset, head.description.bytes);
        mesh = file.substr(head.mesh.offset, head.mesh.bytes);
    }
    static Section packed(std::string& out, const void* from, size_t count) {
        std::string bytes(ZSTD_compressBound(count), '\0');
        bytes.resize(ZSTD_compress(bytes.data(), bytes.size(), from, count, 1));
        const Section s{out.size(), bytes.size(), count, hashBytes(bytes.data(), bytes.size())};
        out += bytes;
        return s;
    }
    /// `keepsSections`: what a test changed of them stays.
    void write(const std::string& path, bool keepsSections = false) const {
        std::string out(sizeof(Head), '\0');
        out += body;
        std::vector<PageOnDisk> placed = pages;
        for (size_t p = 0; p < raw.size(); ++p) {
            const Section s = packed(out, raw[p].data(), raw[p].size());
            if (!keepsSections) placed[p].section = s;
        }
        Head h = head;
        std::string directory(reinterpret_cast<const char*>(&table), sizeof(table));
        directory.append(reinterpret_cast<const char*>(names.data()), names.size() * sizeof(NameOnDisk));
        directory.append(reinterpret_cast<const char*>(placed.data()), placed.size() * sizeof(PageOnDisk));
        h.nodes = packed(out, directory.data(), directory.size());
        h.description.offset = out.size();
        out += description;
        h.mesh.offset = out.size();
        out += mesh;
        h.fileBytes = out.size() + sizeof(Foot);
        h.hash = hashBytes(&h, offsetof(Head, hash));
        const Foot foot{h.hash, kFootMagic};
        out.append(reinterpret_cast<const char*>(&foot), sizeof(foot));
        std::memcpy(out.data(), &h, sizeof(h));
        test::spit(path, out);
    }
};

TEST_F(StorePages, ADamagedOneIsSaidAndItsParentDrawn) {
    std::string file = test::slurp(paged_);
    const CraftedPages crafted(paged_);
    const size_t last = crafted.pages.size() - 1;
    file[crafted.pages[last].section.offset + 20] ^= 1;
    const std::string path = folder_ / "damaged.stipple";
    test::spit(path, file);
    const auto whole = lod::openStore(path);
    ASSERT_FALSE(whole);
    EXPECT_NE(whole.error().line().find("page " + std::to_string(last) + " of the nodes"), std::string::npos)
        << whole.error().line();
    const StorePtr store = opened(path, Tables::asNeeded);
    EXPECT_FALSE(lod::readWholeTable(*store));
    // Wherever the nodes of that page are: from above every leaf there is.
    const auto backend = cpu::makeCpuBackend(*executor_);
    auto state = render::makeFrameState({store}, *backend, *executor_, {});
    render::FrameSettings s;
    s.budgets.errorPixels = 1e-3;
    const lod::View view = test::fitView(*points_, 200, 150);
    lod::View behind = view;
    behind.eye = -view.eye;
    behind.forward = -view.forward;
    behind.right = -view.right;
    size_t incomplete = 0;
    for (const lod::View& v : {view, behind}) {
        const auto done = render::renderUntilComplete(*state, v, s);
        ASSERT_TRUE(done) << done.error().line();
        incomplete += *done ? 0 : 1;
        EXPECT_GT(
            std::count_if(state->image.rgba.begin(), state->image.rgba.end(), [](uint32_t c) { return c >> 24 != 0; }),
            5000);
    }
    EXPECT_GE(incomplete, 1u);
    EXPECT_NE(state->streamer->lastFailure().find("page " + std::to_string(last)), std::string::npos)
        << state->streamer->lastFailure();
    state->streamer.reset();
}

TEST_F(StorePages, WhatIsOnlyWrittenAgainIsFine) {
    CraftedPages(paged_).write(folder_ / "again.stipple");
    EXPECT_EQ(test::hashTable(*opened(folder_ / "again.stipple", Tables::whole)), test::hashTable(*points_));
}

TEST_F(StorePages, DirectoriesThatLieAreRefusedBeforeMemoryIsTaken) {
    const std::string path = folder_ / "lies.stipple";
    const auto expectRefused = [&](const CraftedPages& c, bool keepsSections = false) {
        c.write(path, keepsSections);
        for (const Tables tables : {Tables::whole, Tables::asNeeded}) {
            const auto store = lod::openStore(path, tables);
            ASSERT_FALSE(store);
            EXPECT_NE(store.error().line().find("possible"), std::string::npos) << store.error().line();
        }
    };
    for (uint64_t Places::*field : {&Places::nodes, &Places::further, &Places::streams, &Places::steps, &Places::groups,
                                    &Places::runs, &Places::parents, &Places::groupTextures, &Places::children}) {
        for (const uint64_t odd : {uint64_t{1} << 40, ~uint64_t{0}, uint64_t{1} << 63}) {
            CraftedPages c(paged_);
            c.table.total.*field = odd;
            expectRefused(c);
            c = CraftedPages(paged_);
            c.pages[2].first.*field = odd;
            expectRefused(c);
        }
        CraftedPages c(paged_);
        c.pages[0].first.*field += 1;
        expectRefused(c);
    }
    // The parents of page 1's nodes would be in a page whose own parents are in page 1.
    CraftedPages c(paged_);
    for (size_t p = 1; p + 1 < c.pages.size(); ++p) c.pages[p].first.children = 1;
    expectRefused(c);
    c = CraftedPages(paged_);
    c.table.log2Nodes = 31;
    expectRefused(c);
    c = CraftedPages(paged_);
    c.table.flags = 8;
    expectRefused(c);
    c = CraftedPages(paged_);
    c.write(path);
    c = CraftedPages(path);
    c.pages[3].section = c.pages[2].section;  // bytes of two pages
    expectRefused(c, true);
    c = CraftedPages(path);
    c.pages[3].section.rawBytes = uint64_t{1} << 62;
    expectRefused(c, true);
}

/// Every page builds on the one before: what is read for the last is as deep as there are pages.
TEST_F(StorePages, AChainOfManyIsReadWithoutDepth) {
    CraftedPages c(withPages(*points_, folder_ / "ones.stipple", 0));
    constexpr uint64_t kPages = 200'000;
    const uint64_t children = c.pages[1].first.children;  // of the root, and itself
    std::vector<uint8_t> link = c.raw[1], end = link;
    NodeOnDisk node{};
    std::memcpy(&node, link.data() + sizeof(PageHead), sizeof(node));
    node.childMask = 1;
    std::memcpy(link.data() + sizeof(PageHead), &node, sizeof(node));
    node.childMask = 0;
    std::memcpy(end.data() + sizeof(PageHead), &node, sizeof(node));
    const Places one = c.pages[1].first, two = c.pages[2].first;
    c.pages.resize(1);
    c.raw.resize(1);
    Places at = one;
    for (uint64_t p = 1; p < kPages; ++p) {
        c.pages.push_back({{}, at});
        c.raw.push_back(p + children < kPages + 1 ? link : end);
        for (uint64_t Places::*field : {&Places::nodes, &Places::further, &Places::streams, &Places::steps})
            at.*field += two.*field - one.*field;
        at.children = std::min(at.children + 1, kPages);
    }
    c.table.total = at;
    c.table.pages = c.head.nodeCount = kPages;
    c.write(folder_ / "chain.stipple");
    const StorePtr store = opened(folder_ / "chain.stipple", Tables::asNeeded);
    const auto last = store->pages->load(store->hierarchy, kPages - 1);
    ASSERT_FALSE(last) << "no octree is as deep";
    EXPECT_EQ(last.error().kind, ErrorKind::input);
    EXPECT_TRUE(last.error().line().find("possible") != std::string::npos) << last.error().line();
}

/// Any bytes of pages and of their directory, seeded: refused, or drawn without harm.
TEST_F(StorePages, AnyChangedFieldIsRefusedOrDrawn) {
    test::writeMixedStore(folder_ / "mixed.stipple");
    const std::string mixed = withPages(*opened(folder_ / "mixed.stipple", Tables::whole), folder_ / "m.stipple", 0);
    Rng rng(11);
    const std::string path = folder_ / "odd.stipple";
    int refused = 0, drawn = 0, found = 0;
    for (int i = 0; i < (test::isThorough() ? 4000 : 300); ++i) {
        CraftedPages c(i % 2 == 0 ? paged_ : mixed);
        uint8_t* at = reinterpret_cast<uint8_t*>(&c.table) + 24;
        size_t size = sizeof(c.table) - 24;
        if (const uint64_t where = rng.next() % 4; where > 0) {
            const size_t p = rng.next() % c.pages.size();
            at = where == 1 ? reinterpret_cast<uint8_t*>(&c.pages[p].first) : c.raw[p].data();
            size = where == 1 ? sizeof(Places) : c.raw[p].size();
        }
        const size_t width = std::min<size_t>(size_t{1} << rng.next() % 4, size);
        const uint64_t odd = rng.next() % 2 ? rng.next() : uint64_t{1} << rng.next() % 64;
        std::memcpy(at + rng.next() % (size / width) * width, &odd, width);
        c.write(path);
        auto store = lod::openStore(path, Tables::asNeeded);
        if (!store) {
            ++refused;
            EXPECT_EQ(store.error().kind, ErrorKind::input);
            continue;
        }
        const auto shared = std::make_shared<const lod::Store>(std::move(*store));
        const auto backend = cpu::makeCpuBackend(*executor_);
        auto state = render::makeFrameState({shared}, *backend, *executor_, {});
        render::FrameSettings s;
        s.budgets.errorPixels = 0.5;
        const auto done = render::renderUntilComplete(*state, test::fitView(*points_, 60, 40), s);
        EXPECT_TRUE(done) << done.error().line();
        state->streamer.reset();
        ++drawn;
        if (!lod::readWholeTable(*shared) || !lod::verifyStore(*shared, *executor_)) ++found;
    }
    EXPECT_GT(refused, 20);
    EXPECT_GT(drawn, 60);
    EXPECT_GT(found, drawn / 2);
}

}  // namespace
}  // namespace stipple
