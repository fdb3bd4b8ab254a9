// Data flow of one frame (mode pullpush):
//
//   records --project--> visibility (64-bit min per pixel) --resolve+pull--> level 0, level 1 --pull--> level 2 ... top
//   image <--shade+push-- level 0 <-- level 1 <--push-- ... top
//
// Work is cut into tiles of kTile columns and a band of rows; within a tile, rows are unpacked to floats that stay in
// cache. Clearing is free: resolve resets each visibility entry it has read.
#include "engine/cpu/cpu_backend.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <thread>
#include <unordered_map>

#include "engine/base/huge_buffer.h"
#include "engine/base/numbers.h"
#include "engine/base/process.h"
#include "engine/base/queue.h"
#include "engine/cpu/pyramid.h"
#include "shaders/shared/splat.h"

namespace stipple::cpu {
namespace {

uint64_t chunkId(streaming::ChunkKey key) { return uint64_t{key.source} << 32 | key.node; }

class CpuBackend final : public render::Backend {
  public:
    CpuBackend(Executor& executor, const Kernels& kernels)
        : executor_(executor), kernels_(kernels), k_(kernels), tables_(makeTables()), pyramid_(executor, k_) {}

    std::string name() const override { return "cpu"; }
    std::string device() const override {
        return std::string("cpu ") + k_.name + ", " + std::to_string(executor_.threads()) + " threads";
    }
    Result<void> upload(streaming::ChunkKey key, const lod::Chunk& chunk) override {
        const lod::Chunk& kept = chunks_[chunkId(key)] = chunk;
        if (!kept.texels.empty()) {
            if (tiles_.size() <= key.source) tiles_.resize(key.source + 1);
            if (tiles_[key.source].size() <= key.node) tiles_[key.source].resize(key.node + 1);
            tiles_[key.source][key.node] = kept.texels.data();
        }
        return {};
    }
    void evict(streaming::ChunkKey key) override {
        if (key.source < tiles_.size() && key.node < tiles_[key.source].size()) tiles_[key.source][key.node] = nullptr;
        chunks_.erase(chunkId(key));
    }
    const std::vector<render::PassTime>& passTimes() const override { return times_; }

    render::BackendResources resources() const override {
        render::BackendResources r;
        r.meshBytes = surfacePixels_ * 4 + meshBlocks_.size() * sizeof(MeshBlock);
        r.emissiveBytes = emissivePixels_ * 4;
        r.strandBytes = strandBlocks_.capacity() * sizeof(StrandBlock) + wide_.capacity() * sizeof(WideStrand);
        for (const auto& tiles : tiles_)
            r.textureTiles += static_cast<uint64_t>(
                std::count_if(tiles.begin(), tiles.end(), [](const uint32_t* t) { return t != nullptr; }));
        return r;
    }

    Result<void> render(const render::RenderRequest& request, render::Image& image) override {
        draws_ = request.draws;
        frame_ = draws_->frame;
        k_ = frame_.orthographic != 0 ? *kernels_.orthographic : kernels_;
        image_ = &image;
        wantAll_ = request.wantDepthAndNormal;
        times_.clear();
        resize();
        bool hasPyramid = false;
        for (const render::Pass pass : request.passes) hasPyramid = hasPyramid || pass == render::Pass::push;
        for (const render::Pass pass : request.passes) {
            const double start = nowSeconds();
            switch (pass) {
                case render::Pass::clear:
                    clear();
                    break;
                case render::Pass::project:
                    project(hasPyramid);
                    break;
                case render::Pass::discs:
                    fillDiscs();
                    break;
                case render::Pass::strands:
                    drawStrands();
                    break;
                case render::Pass::rasterise:
                    rasterise();
                    break;
                case render::Pass::resolve:
                    resolve(hasPyramid);
                    break;
                case render::Pass::pull:
                    pyramid_.pull();
                    break;
                case render::Pass::push:
                    pyramid_.push();
                    break;
                case render::Pass::shade:
                    shade(hasPyramid);
                    break;
            }
            times_.push_back({render::passName(pass), (nowSeconds() - start) * 1e3});
        }
        return {};
    }

  private:
    Visibility visibility() { return {visibility_.data(), runs_.data()}; }
    /// May any of these pixels show something?
    bool isSeen(size_t first, uint32_t n) const {
        bool any = false;
        for (size_t r = first >> Visibility::kRunBits; r <= (first + n - 1) >> Visibility::kRunBits; ++r)
            any = any || runs_[r] != 0;
        return any;
    }

    void resize() {
        const uint32_t w = frame_.width, h = frame_.height;
        image_->width = w;
        image_->height = h;
        const size_t pixels = size_t{w} * h;
        image_->rgba.resize(pixels);
        image_->depth.resize(wantAll_ ? pixels : 0);
        image_->normal.resize(wantAll_ ? pixels * 3 : 0);
        image_->linear.resize(wantAll_ ? pixels * 3 : 0);
        pyramid_.resize(w, h);
        if (visibilityPixels_ == pixels) return;  // it is clear whatever its shape
        visibilityPixels_ = pixels;
        visibility_.assign(pixels, ~uint64_t{0});
        runs_.assign(pixels / Visibility::kRun + 1, 0);
    }

    /// The visibility buffer is already clear (see resolve); what is made here is the block table.
    void clear() {
        blocks_.resize(draws_->blocks.size());
        for (size_t b = 0; b < blocks_.size(); ++b) {
            const shared::DrawBlock& block = draws_->blocks[b];
            const auto found = chunks_.find(chunkId(draws_->keys[block.node]));
            blocks_[b] = {found->second.records.data() + block.first, &draws_->nodes[block.node]};
        }
        strandBlocks_.clear();
        for (const shared::DrawBlock& block : draws_->strandBlocks)
            strandBlocks_.push_back({chunks_.at(chunkId(draws_->strandKeys[block.node])).segments.data() + block.first,
                                     &draws_->strandNodes[block.node]});
        hasStrands_ = !strandBlocks_.empty();
    }

    void drawStrands() {
        wide_.clear();
        executor_.parallelFor(strandBlocks_.size(), 4, [&](size_t begin, size_t end) {
            std::vector<WideStrand> mine;
            const WideSink sink{
                &mine, [](void* to, const WideStrand& s) { static_cast<std::vector<WideStrand>*>(to)->push_back(s); }};
            for (size_t b = begin; b < end; ++b) {
                const uint32_t left = strandBlocks_[b].node->count - draws_->strandBlocks[b].first;
                k_.drawSegments(frame_, strandBlocks_[b], std::min(left, shared::kSegmentsPerBlock),
                                static_cast<uint32_t>(b * shared::kSegmentsPerBlock), sink, visibility());
            }
            if (!mine.empty()) foundWide_.push(std::move(mine));
        });
        for (const auto& some : foundWide_.takeAll()) wide_.insert(wide_.end(), some.begin(), some.end());
        if (!wide_.empty())
            forBands([&](uint32_t first, uint32_t last) {
                k_.fillWide(frame_, wide_.data(), wide_.size(), first, last, visibility());
            });
    }

    /// Does the cell of a node lie within the picture, so that none of its splats is beside it?
    bool isWithin(const shared::DrawNode& node) const {
        for (uint32_t k = 0; k < 8; ++k) {
            const auto along = [&](uint32_t bit) { return (k & bit) != 0 ? 65536.0f : 0.0f; };
            const float x = node.base.x + node.axisX.x * along(1) + node.axisY.x * along(2) + node.axisZ.x * along(4),
                        y = node.base.y + node.axisX.y * along(1) + node.axisY.y * along(2) + node.axisZ.y * along(4),
                        z = node.base.z + node.axisX.z * along(1) + node.axisY.z * along(2) + node.axisZ.z * along(4);
            const float w = shared::lensDepth(shared::frameLens(frame_), z);
            const float px = x * frame_.focal / w + frame_.centre.x, py = y * frame_.focal / w + frame_.centre.y;
            if (!(z > frame_.nearPlane && px >= 0 && py >= 0 && px < static_cast<float>(frame_.width) &&
                  py < static_cast<float>(frame_.height)))
                return false;
        }
        return true;
    }

    void project(bool hasPyramid) {
        besideToo_.resize(draws_->nodes.size());
        for (size_t n = 0; n < besideToo_.size(); ++n)
            besideToo_[n] =
                hasPyramid && ((draws_->nodes[n].octantMask & shared::kNodeWide) != 0 || !isWithin(draws_->nodes[n]));
        executor_.parallelFor(blocks_.size(), 32, [&](size_t begin, size_t end) {
            alignas(64) std::array<uint32_t, shared::kRecordsPerBlock> pixel, depth;
            std::vector<shared::WideDisc> mine;
            for (size_t b = begin; b < end; ++b) {
                const uint32_t count =
                    std::min(shared::kRecordsPerBlock, blocks_[b].node->count - draws_->blocks[b].first);
                k_.projectBlock(frame_, *blocks_[b].node, blocks_[b].records, count,
                                besideToo_[draws_->blocks[b].node] != 0, pixel.data(), depth.data());
                constexpr uint32_t kAhead = 48;  // the pixels are scattered over 16 MB: ask for them in time
                for (uint32_t i = 0; i < count; ++i) {
                    if (i + kAhead < count && pixel[i + kAhead] < kWidePixel)
                        __builtin_prefetch(&visibility_[pixel[i + kAhead]], 1);
                    if (pixel[i] >= kWidePixel) {
                        if (pixel[i] == ~0u) continue;
                        const auto id = static_cast<uint32_t>(b) * shared::kRecordsPerBlock + i;
                        const shared::WideDisc d = shared::wideDisc(*blocks_[b].node, blocks_[b].records[i],
                                                                    frame_.supportScale, id, shared::frameLens(frame_));
                        if (shared::reachesPicture(d, frame_) > 0.5f) mine.push_back(d);
                        continue;
                    }
                    const uint64_t key = uint64_t{depth[i]} << 32 | (b * shared::kRecordsPerBlock + i);
                    const std::atomic_ref<uint8_t> run(runs_[pixel[i] >> Visibility::kRunBits]);
                    if (run.load(std::memory_order_relaxed) == 0) run.store(1, std::memory_order_relaxed);
                    const std::atomic_ref<uint64_t> entry(visibility_[pixel[i]]);
                    uint64_t old = entry.load(std::memory_order_relaxed);
                    while (key < old && !entry.compare_exchange_weak(old, key, std::memory_order_relaxed)) {
                    }
                }
            }
            if (!mine.empty()) foundDiscs_.push(std::move(mine));
        });
        discs_.clear();
        for (const auto& some : foundDiscs_.takeAll()) discs_.insert(discs_.end(), some.begin(), some.end());
        // Sums are rounded: their order must not be that of the threads.
        std::sort(discs_.begin(), discs_.end(), [](const auto& a, const auto& b) { return a.id < b.id; });
        discBoxes_.clear();
        for (const shared::WideDisc& d : discs_) discBoxes_.push_back(shared::discBox(d, frame_));
    }

    void fillDiscs() {
        if (!discs_.empty())
            forBands([&](uint32_t first, uint32_t last) {
                k_.fillDiscs(frame_, discs_.data(), discBoxes_.data(), discs_.size(), first, last, visibility());
            });
    }

    void rasterise() {
        meshBlocks_.clear();
        textureSets_.clear();
        for (const render::MeshTextures& t : draws_->meshTextures) {
            if (t.tiles > 0) {  // tiles that never came are null
                if (tiles_.size() <= t.source) tiles_.resize(t.source + 1);
                if (tiles_[t.source].size() < t.firstChunk + t.tiles) tiles_[t.source].resize(t.firstChunk + t.tiles);
            }
            textureSets_.push_back({t.infos.data(), t.tiles > 0 ? tiles_[t.source].data() + t.firstChunk : nullptr});
        }
        for (const render::MeshDraw& draw : draws_->meshDraws) {
            const lod::Chunk& chunk = chunks_.at(chunkId(draw.key));
            for (uint32_t c = 0; c < draw.clusters; ++c) {
                const shared::MeshCluster& cluster = chunk.clusters[draw.firstCluster + c];
                meshBlocks_.push_back({chunk.vertices.data() + cluster.firstVertex,
                                       chunk.triangles.data() + cluster.firstTriangle, &draws_->meshes[draw.mesh],
                                       &textureSets_[draw.mesh], cluster.counts, draw.level, draw.errorPixels});
            }
        }
        large_.clear();
        executor_.parallelFor(meshBlocks_.size(), 8, [&](size_t begin, size_t end) {
            std::vector<LargeTriangle> mine;
            const LargeSink sink{&mine, [](void* to, const LargeTriangle& t) {
                                     static_cast<std::vector<LargeTriangle>*>(to)->push_back(t);
                                 }};
            for (size_t b = begin; b < end; ++b)
                k_.rasterCluster(frame_, draws_->materials.data(), meshBlocks_[b], static_cast<uint32_t>(b * 256), sink,
                                 visibility());
            if (!mine.empty()) found_.push(std::move(mine));
        });
        for (const auto& some : found_.takeAll()) large_.insert(large_.end(), some.begin(), some.end());
        if (large_.empty()) return;
        forBands([&](uint32_t first, uint32_t last) {
            k_.rasterLarge(frame_, large_.data(), large_.size(), first, last, visibility());
        });
    }

    /// Rows of the image for all threads: what covers much of it must not be the work of one.
    template <typename Use>
    void forBands(const Use& use) {
        constexpr uint32_t kRows = 16;
        executor_.parallelFor((frame_.height + kRows - 1) / kRows, 1, [&](size_t begin, size_t end) {
            const auto first = static_cast<uint32_t>(begin) * kRows, last = static_cast<uint32_t>(end) * kRows - 1;
            use(first, std::min(last, frame_.height - 1));
        });
    }

    /// Planes that only triangles need, and only those with a shining material.
    void preparePlanes(size_t pixels) {
        const auto fit = [&](HugeBuffer<uint32_t>& plane, size_t& size, bool isNeeded) {
            if (isNeeded && size != pixels) {
                plane.assign(pixels, 0);
                size = pixels;
            }
        };
        hasTriangles_ = !draws_->meshDraws.empty();
        hasEmissive_ = false;
        for (const shared::SurfaceMaterial& m : draws_->materials)
            hasEmissive_ = hasEmissive_ || (hasTriangles_ && m.emissive.x + m.emissive.y + m.emissive.z > 0);
        fit(surface_, surfacePixels_, hasTriangles_);
        fit(emissive_, emissivePixels_, hasEmissive_);
    }
    SurfacePlanes planesAt(size_t pixel) {
        return {hasTriangles_ ? surface_.data() + pixel : nullptr, hasEmissive_ ? emissive_.data() + pixel : nullptr};
    }

    /// Level 0 from the visibility buffer; with a pyramid, level 1 on the way.
    void resolve(bool hasPyramid) {
        Level& fine = pyramid_.level(0);
        Level* coarse = hasPyramid && pyramid_.levels() > 1 ? &pyramid_.level(1) : nullptr;
        pyramid_.beginFrame(frame_, hasStrands_);
        const Planes finePlanes = fine.planes();
        preparePlanes(size_t{fine.width} * fine.height);
        const ResolveInput input{blocks_.data(),       meshBlocks_.data(), draws_->materials.data(),
                                 strandBlocks_.data(), discs_.data(),      discBoxes_.data(),
                                 discs_.size()};
        std::atomic<float> largestRadius{0};
        pyramid_.forTiles(fine, [&](uint32_t x0, uint32_t n, uint32_t row0, uint32_t row1) {
            TexelRow upper{}, lower{}, out{};  // what is empty is multiplied by 0, so it must be finite
            upper.hasTubes = lower.hasTubes = out.hasTubes = hasStrands_;
            float largest = 0;
            for (uint32_t y = row0; y < row1; y += 2) {
                bool any = false;
                for (TexelRow* row : {&upper, &lower}) {
                    const uint32_t yy = y + (row == &lower ? 1 : 0);
                    row->depth[kPad + n] = 0;  // beyond the right edge of an odd width
                    const size_t at = size_t{yy} * fine.width + x0;
                    if (yy >= row1 || !isSeen(at, n)) {
                        row->hasTubes = false;
                        std::fill_n(row->depth + kPad, n, 0.0f);
                        if (hasStrands_) Pyramid::clearTubes(*row);
                        if (yy < row1) fine.empty(yy, x0, n);
                        continue;
                    }
                    row->hasTubes = hasStrands_;  // may have; the kernel says whether it does
                    const bool has = k_.resolveRow(frame_, tables_, input, visibility_.data() + at, x0, yy, n, *row,
                                                   largest, planesAt(at));
                    if (has) {
                        fine.hold(yy, x0, n);
                        k_.packRow(*row, n, finePlanes.at(at));
                    } else {
                        fine.empty(yy, x0, n);
                    }
                    any = any || has;
                }
                if (!coarse) continue;
                pyramid_.pullPair(upper, lower, any, (n + 1) / 2, 1.0f, *coarse, x0 / 2, y / 2, out);
            }
            float seen = largestRadius.load(std::memory_order_relaxed);
            while (largest > seen && !largestRadius.compare_exchange_weak(seen, largest, std::memory_order_relaxed)) {
            }
        });
        std::fill(runs_.begin(), runs_.end(), uint8_t{0});  // resolveRow has cleared what they stood for
        pyramid_.setLargestRadius(largestRadius.load());
    }

    /// The last push (into level 0) and the shading of its result, or the shading alone.
    void shade(bool hasPyramid) {
        Level& fine = pyramid_.level(0);
        const Planes planes = fine.planes();
        const LightInput light{draws_->lights.data(),
                               draws_->environment ? draws_->environment->table.data() : nullptr};
        const ShadedRow empty = emptyRow();
        const auto shadeRow = [&](uint32_t x0, uint32_t n, uint32_t y, TexelRow& own, TexelRow& row, bool any) {
            const size_t at = size_t{y} * fine.width + x0;
            const ShadeOutput out{image_->rgba.data() + at, wantAll_ ? image_->depth.data() + at : nullptr,
                                  wantAll_ ? image_->normal.data() + 3 * at : nullptr,
                                  wantAll_ ? image_->linear.data() + 3 * at : nullptr};
            if (!any) return empty.copyTo(out, n);
            if (row.hasTubes) k_.finishRow(frame_.focal, n, row);
            if (own.hasTubes && &own != &row) k_.finishRow(frame_.focal, n, own);
            // Of a row without winners the planes are those of an older frame.
            const SurfacePlanes planesHere = fine.mayHold(y, x0, n) ? planesAt(at) : SurfacePlanes{};
            thread_local SurfaceRow surface{};
            const bool isLit = frame_.debugView == shared::kDebugNone &&
                               (planesHere.surface != nullptr || (frame_.shade & shared::kShadeLit) != 0);
            const bool showsNormals = wantAll_ || frame_.debugView == shared::kDebugNormals;
            k_.surfaceRow(frame_, own, row, planesHere,
                          {wantAll_ || (isLit && frame_.lightCount > 0), isLit || showsNormals, isLit,
                           frame_.debugView == shared::kDebugHoles},
                          x0, y, n, surface);
            if (isLit) k_.lightRow(frame_, light, x0, y, n, surface);
            k_.outputRow(frame_, tables_, n, surface, out);
        };
        pyramid_.forTiles(fine, [&](uint32_t x0, uint32_t n, uint32_t row0, uint32_t row1) {
            if (hasPyramid && pyramid_.isUsed()) {
                pyramid_.pushTile(
                    fine, pyramid_.level(1), 1.0f, x0, n, row0, row1,
                    [&](uint32_t y, TexelRow& own, TexelRow& row, bool any) { shadeRow(x0, n, y, own, row, any); });
                return;
            }
            thread_local TexelRow row{};
            row.hasTubes = hasStrands_;
            for (uint32_t y = row0; y < row1; ++y) {
                const bool any = pyramid_.loadRow(fine, planes, y, x0, n, kPad, row);
                shadeRow(x0, n, y, row, row, any);
            }
        });
    }

    /// What an empty row of a tile looks like.
    struct ShadedRow {
        std::array<uint32_t, kTile> rgba{};
        std::array<float, size_t{3} * kTile> linear{};
        void copyTo(const ShadeOutput& out, uint32_t n) const {
            std::copy_n(rgba.begin(), n, out.rgba);
            if (out.depth) std::fill_n(out.depth, n, 0.0f);
            if (out.normal) std::fill_n(out.normal, 3 * n, 0.0f);
            if (out.linear) std::copy_n(linear.begin(), 3 * n, out.linear);
        }
    };
    ShadedRow emptyRow() {
        ShadedRow shaded;
        static const SurfaceRow kNothing{};
        k_.outputRow(frame_, tables_, kTile, kNothing, {shaded.rgba.data(), nullptr, nullptr, shaded.linear.data()});
        return shaded;
    }

    Executor& executor_;
    const Kernels& kernels_;
    Kernels k_;  ///< of the frame's kind of view
    Tables tables_;
    std::unordered_map<uint64_t, lod::Chunk> chunks_;
    HugeBuffer<uint64_t> visibility_;
    std::vector<uint8_t> runs_;  ///< of `visibility_`
    size_t visibilityPixels_ = 0;
    Pyramid pyramid_;
    std::vector<MeshBlock> meshBlocks_;
    std::vector<LargeTriangle> large_;
    CompletionQueue<std::vector<LargeTriangle>> found_;
    std::vector<TextureSet> textureSets_;
    std::vector<std::vector<const uint32_t*>> tiles_;  ///< by source and chunk; null: not resident
    HugeBuffer<uint32_t> surface_, emissive_;
    size_t surfacePixels_ = 0, emissivePixels_ = 0;
    bool hasTriangles_ = false, hasEmissive_ = false, hasStrands_ = false;
    std::vector<StrandBlock> strandBlocks_;
    std::vector<WideStrand> wide_;
    CompletionQueue<std::vector<WideStrand>> foundWide_;
    std::vector<BlockSource> blocks_;
    std::vector<shared::WideDisc> discs_;
    std::vector<shared::DiscBox> discBoxes_;  ///< of each
    CompletionQueue<std::vector<shared::WideDisc>> foundDiscs_;
    std::vector<uint8_t> besideToo_;  ///< of each node
    std::vector<render::PassTime> times_;
    const render::DrawList* draws_ = nullptr;
    shared::FrameConstants frame_{};
    render::Image* image_ = nullptr;
    bool wantAll_ = false;
};

}  // namespace

std::unique_ptr<render::Backend> makeCpuBackend(Executor& executor, const Kernels* kernels) {
    return std::make_unique<CpuBackend>(executor, kernels ? *kernels : bestKernels());
}

}  // namespace stipple::cpu
