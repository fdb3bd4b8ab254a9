// Data flow of one frame (mode pullpush):
//
//   records --project--> visibility (64-bit min per pixel) --resolve+pull--> level 0, level 1 --pull--> level 2 ... top
//   image <--output+light+surface+push-- level 0 <-- level 1 <--push-- ... top
//
// Mode surface: a frame of that kind of nothing but discs that would show as facets, if there are any, up to the last
// push; then all discs by tiles into visibility, resolved beside level 0; in the last run of rows both meet
// (passes/smooth.cpp).
//
// Work is cut into tiles of kTile columns and a band of rows; within a tile, rows are unpacked to floats that stay in
// cache. Clearing is free: resolve resets each visibility entry it has read.
#include "engine/cpu/cpu_backend.h"

#include <algorithm>
#include <string>

#include "engine/base/process.h"
#include "engine/cpu/passes/passes.h"

namespace stipple::cpu {
namespace {

class CpuBackend final : public render::DrawsAtOnce {
  public:
    CpuBackend(Executor& executor, const Kernels& kernels, uint64_t mostTileEntries)
        : frame_(executor, kernels, chunks_) {
        frame_.mostTileEntries = mostTileEntries;
    }

    std::string name() const override { return "cpu"; }
    std::string device() const override {
        return std::string("cpu ") + frame_.k.name + ", " + std::to_string(frame_.executor.threads()) + " threads";
    }
    Result<void> upload(streaming::ChunkKey key, lod::Chunk chunk) override {
        const lod::Chunk& kept = chunks_.chunks.add(key) = std::move(chunk);
        if (!kept.texels.empty()) {
            if (chunks_.tiles.size() <= key.source) chunks_.tiles.resize(key.source + 1);
            auto& tiles = chunks_.tiles[key.source];
            if (tiles.size() <= key.chunk) tiles.resize(key.chunk + 1);
            tiles[key.chunk] = kept.texels.data();
        }
        return {};
    }
    void evict(streaming::ChunkKey key) override {
        if (key.source < chunks_.tiles.size() && key.chunk < chunks_.tiles[key.source].size())
            chunks_.tiles[key.source][key.chunk] = nullptr;
        chunks_.chunks.drop(key, [](lod::Chunk& chunk) { chunk = {}; });
    }

    render::BackendResources resources() const override {
        render::BackendResources r;
        r.meshBytes = frame_.surfacePixels * 4 + frame_.meshBlocks.size() * sizeof(MeshBlock);
        r.emissiveBytes = frame_.emissivePixels * 4;
        r.curveBytes =
            frame_.curveBlocks.capacity() * sizeof(CurveBlock) + frame_.wide.capacity() * sizeof(FilledCurve);
        r.effects.resize(render::effects().size());
        for (size_t e = 0; e < r.effects.size(); ++e) {
            r.effects[e].bytes = frame_.effectRoom.bytesOf(e) + (keptFor_.has(e) ? frame_.kept.bytes() : 0);
            r.effectBytes += frame_.effectRoom.bytesOf(e);
        }
        r.effectBytes += frame_.kept.bytes();
        for (const auto& tiles : chunks_.tiles)
            r.textureTiles += static_cast<uint64_t>(
                std::count_if(tiles.begin(), tiles.end(), [](const uint32_t* t) { return t != nullptr; }));
        return r;
    }

    render::HiddenCounts hidden() const override { return frame_.hidden.counts(); }
    const std::vector<uint32_t>* hiddenNodes() const override { return frame_.hidden.whole(); }

  private:
    void draw(const render::RenderRequest& request, render::Image& image) override {
        frame_.draws = request.draws;
        frame_.mode = &render::reconstructionOf(request.mode);
        frame_.constants = request.draws->frame;
        frame_.k = frame_.constants.orthographic != 0 ? *frame_.kernels.orthographic : frame_.kernels;
        frame_.image = &image;
        frame_.wantAll = request.wantDepthAndNormal;
        frame_.wantsRest = request.wantDepthAndNormal && !request.isOfCasters;
        frame_.hasPyramid =
            std::find(request.passes.begin(), request.passes.end(), render::Pass::push) != request.passes.end();
        frame_.mayHideNodes = request.mayHideNodes && !request.isOfCasters;
        frame_.tellsHiddenNodes = request.tellsHiddenNodes;
        frame_.hidden.reset();
        frame_.mirrored = {};
        frame_.isSmoothing = false;  // whatever became of the frame before
        frame_.hasSmooth =
            std::find(request.passes.begin(), request.passes.end(), render::Pass::smooth) != request.passes.end();
        times_.clear();
        const std::span<const render::Pass> passes(request.passes);
        frame_.wantsNormals = wantsNormals(frame_, passes);
        if (!request.isOfCasters) beginEffects(passes);
        for (const render::Pass pass : passes) {
            frame_.effectAtWork = render::effectOfPass(pass).value_or(0);
            if (const CpuPass& p = cpuPassOf(pass); p.begin != nullptr) p.begin(frame_);
        }
        for (size_t p = 0; p < passes.size();) {
            const double start = nowSeconds();
            std::string name = render::passName(passes[p]);
            size_t next = p + 1;
            const bool isWithRows = passes[p] == render::Pass::resolve && !frame_.hasPyramid;
            if (isWithRows) name += std::string("+") + render::passName(passes[next++]);
            frame_.effectAtWork = render::effectOfPass(passes[p]).value_or(0);
            if (const CpuPass& pass = cpuPassOf(passes[p]); pass.run != nullptr && !isWithRows) {
                pass.run(frame_);
            } else {
                for (; next < passes.size() && joinsRows(passes[next]); ++next)
                    name += std::string("+") + render::passName(passes[next]);
                const size_t first = isWithRows ? p + 1 : p;
                runRows(frame_, passes.subspan(first, next - first), passes.subspan(next));
            }
            times_.push_back({name, (nowSeconds() - start) * 1e3});
            p = next;
        }
    }

    /// What effects need beyond that of other frames is theirs from here on, or given back.
    void beginEffects(std::span<const render::Pass> passes) {
        frame_.effectRoom.begin(frame_.draws->effects);
        render::EffectSet keepers;
        for (const render::Pass pass : passes)
            if (const auto e = render::effectOfPass(pass); e && !joinsRows(pass)) keepers.add(*e);
        idle_ = keepers.bits != 0 ? 0 : idle_ + 1;
        if (keepers.bits != 0) keptFor_ = keepers;
        if (idle_ < render::kEffectHold) return;
        keptFor_ = {};
        frame_.kept.release();
    }

    Chunks chunks_;
    Frame frame_;
    render::EffectSet keptFor_;  ///< effects because of which rows are kept between passes
    uint32_t idle_ = 0;          ///< frames without any of them
};

}  // namespace

std::unique_ptr<render::Backend> makeCpuBackend(Executor& executor, const Kernels* kernels, uint64_t mostTileEntries) {
    return std::make_unique<CpuBackend>(executor, kernels ? *kernels : bestKernels(), mostTileEntries);
}

}  // namespace stipple::cpu
