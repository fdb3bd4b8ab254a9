// Rows of tiles: from reconstructed texels (or from what an earlier run left) through passes that read their own pixel
// to the picture (or to what a later pass reads).
#include <algorithm>
#include <array>

#include "engine/cpu/passes/resolve.h"
#include "engine/cpu/passes/seconds.h"
#include "engine/cpu/passes/shown_tiles.h"
#include "shaders/shared/bindings.h"
#include "shaders/shared/occlusion.h"
#include "shaders/shared/pack.h"

namespace stipple::cpu {
namespace {

/// What a pixel without anything looks like.
struct EmptyPixel {
    std::array<uint32_t, kTile> rgba{};
    std::array<float, size_t{3} * kTile> linear{};
    void fill(const ShadeOutput& out, size_t n) const {
        std::fill_n(out.rgba, n, rgba.front());
        if (out.depth) std::fill_n(out.depth, n, 0.0f);
        if (out.normal) std::fill_n(out.normal, 3 * n, 0.0f);
        for (size_t i = 0; out.linear && i < n; ++i) std::copy_n(linear.begin(), 3, out.linear + 3 * i);
    }
};
EmptyPixel emptyPixel(const Frame& frame) {
    EmptyPixel pixel;
    static const SurfaceRow kNothing{};
    frame.k.outputRow(frame.constants, frame.tables, kTile, kNothing,
                      {pixel.rgba.data(), nullptr, nullptr, pixel.linear.data()});
    return pixel;
}

ShadeOutput outputAt(Frame& frame, size_t pixel) {
    render::Image& image = *frame.image;
    const bool rest = frame.wantsRest;
    return {image.rgba.data() + pixel, frame.wantAll ? image.depth.data() + pixel : nullptr,
            rest ? image.normal.data() + 3 * pixel : nullptr, rest ? image.linear.data() + 3 * pixel : nullptr};
}

/// The planes of the surface buffer from a pixel on.
KeptRow keptAt(Frame& frame, size_t pixel) {
    KeptSurface& kept = frame.kept;
    return {kept.depth.data() + pixel, kept.normal.data() + pixel, kept.colour.data() + pixel,
            kept.material.data() + pixel};
}

/// False if nothing is there.
bool takeRow(const RowPlace& at, const SurfacePlanes& planes, const SurfaceWants& wants, SurfaceRow& row) {
    row.hasTriangles = planes.surface != nullptr;
    row.hasEmission = planes.surface != nullptr && planes.emissive != nullptr;
    row.hasMaterials = at.frame.constants.hasMaterials != 0;
    row.hasCoverage = planes.coverage != nullptr;
    row.hasOcclusion = at.frame.draws->tableAt<shared::OcclusionConstants>(shared::kOcclusionBinding) != nullptr;
    if (!at.frame.k.takeRow(keptAt(at.frame, at.first), wants, at.n, row)) return false;
    if (row.hasEmission)
        for (size_t i = 0; i < at.n; ++i)
            row.emission[i] = (row.material[i] & shared::kPixelTriangle) != 0 ? planes.emissive[i] : 0u;
    if (row.hasCoverage)
        for (size_t i = 0; i < at.n; ++i) row.coverage[i] = static_cast<float>(planes.coverage[i]) * (1.0f / 255.0f);
    return true;
}

void takeMirrored(const RowPlace& at, SurfaceRow& row) {
    const Frame::Mirrored& of = at.frame.mirrored;
    const bool isAny = of.rows != nullptr && of.rows[at.frame.tileRow(at.x0, at.y)] != 0;
    row.mirroredRed = isAny ? of.red + at.first : nullptr;
    row.mirroredGreen = isAny ? of.green + at.first : nullptr;
    row.mirroredBlue = isAny ? of.blue + at.first : nullptr;
}

/// A run of passes over rows.
class RowProgram {
  public:
    RowProgram(Frame& frame, std::span<const render::Pass> passes, std::span<const render::Pass> later)
        : frame_(frame),
          isKept_(!render::passInfo(passes.back()).writes.has(render::Plane::image)),
          isFirst_(passes.front() == render::Pass::surface),
          empty_(emptyPixel(frame)) {
        for (const render::Pass pass : passes) {
            if (pass != render::Pass::surface) steps_.push_back({&cpuPassOf(pass).row, takesMixed(pass)});
            showsEmpty_ = showsEmpty_ || cpuPassOf(pass).row.showsEmpty;
        }
        for (const render::Pass pass : later) {
            const CpuPass& p = cpuPassOf(pass);
            if (p.row.wants != nullptr)
                p.row.wants(frame, kept_);
            else if (p.run != nullptr)
                kept_.normal = kept_.leaf = true;
        }
        kept_.depth = isKept_;
        if (isKept_ || !isFirst_) frame.kept.resize(frame.visibilityPixels);
        if (isKept_ && isFirst_) frame.kept.renew();
    }

    /// From texels. `own`: the row before it was reconstructed. `any`: is there anything? `smooth`: what was
    /// reconstructed of wide discs there, or null.
    void run(uint32_t x0, uint32_t n, uint32_t y, TexelRow& own, TexelRow& row, bool any,
             const TexelRow* smooth = nullptr) const {
        const shared::FrameConstants& f = frame_.constants;
        const RowPlace at = placeOf(x0, n, y);
        if (!any) return finishEmpty(at);
        if (row.hasTubes) frame_.k.finishRow(f.focal, n, row);
        if (own.hasTubes && &own != &row) frame_.k.finishRow(f.focal, n, own);
        const SurfacePlanes planes = planesOf(at);
        const SurfaceWants wants = wantsOf(planes);
        thread_local SurfaceRow surface{};
        surface.shadowSlots = 0;
        surface.hasBehind = false;
        SurfaceWants made = wants;
        made.depth = made.depth || smooth != nullptr;
        made.isMerged = frame_.hasPyramid && frame_.pyramid.levels() > 1;
        frame_.k.surfaceRow(f, own, row, planes, made, x0, y, n, surface);
        if (smooth != nullptr && planes.smooth != nullptr) {
            thread_local SurfaceRow mean{};
            made.isMerged = true;
            frame_.k.surfaceRow(f, *smooth, *smooth, {}, made, x0, y, n, mean);
            frame_.k.smoothRow(f, *smooth, mean, planes, n, surface);
        }
        finish(at, planes, surface);
    }

    /// From what an earlier run has kept.
    void resume(uint32_t x0, uint32_t n, uint32_t y) const {
        const RowPlace at = placeOf(x0, n, y);
        const SurfacePlanes planes = planesOf(at);
        thread_local SurfaceRow surface{};
        surface.shadowSlots = 0;
        surface.hasBehind = false;
        if (!takeRow(at, planes, wantsOf(planes), surface)) return finishEmpty(at);
        takeMirrored(at, surface);
        finish(at, planes, surface);
    }

    /// Is the picture of a row of points their own colours, and nothing else asked for?
    bool showsOwnColours() const {
        for (const Step& step : steps_)
            if (step.pass != &cpuPassOf(render::Pass::output).row && concerns(*step.pass, {})) return false;
        return !isKept_ && !frame_.wantAll && frame_.constants.debugView == shared::kDebugNone && !frame_.isBlended() &&
               !frame_.draws->hasSurfaces() && !frame_.draws->hasBlending;
    }
    /// Does anything read how deep pixels are?
    bool needsDepths() const {
        const SurfaceWants wants = wantsOf(frame_.planesAt(0));
        return wants.depth || wants.ownDepth;
    }
    /// Does nothing need more of texels than depths and colours?
    bool needsColoursAlone() const {
        const SurfaceWants wants = wantsOf(frame_.planesAt(0));
        return !wants.depth && !wants.normal && !wants.leaf && !wants.ownDepth;
    }
    /// Then this shows such a row.
    RowContent showPoints(uint32_t x0, uint32_t n, uint32_t y) const {
        const RowPlace at = placeOf(x0, n, y);
        return frame_.k.showPoints(frame_.constants, frame_.tables, frame_.blocks.data(), frame_.hasSmooth,
                                   frame_.visibility.data() + at.first, n, empty_.rgba.front(),
                                   outputAt(frame_, at.first).rgba);
    }

    /// What shows nothing.
    void finishEmpty(const TileRect& rect) const {
        for (uint32_t y = rect.row0; y < rect.row1; ++y) finishEmpty(placeOf(rect.x0, rect.n, y));
    }

  private:
    /// What this run's passes want of surfaces, and those after it.
    SurfaceWants wantsOf(const SurfacePlanes& planes) const {
        SurfaceWants wants = isKept_ ? kept_ : SurfaceWants{};
        for (const Step& step : steps_)
            if (concerns(*step.pass, planes)) step.pass->wants(frame_, wants);
        return wants;
    }
    RowPlace placeOf(uint32_t x0, uint32_t n, uint32_t y) const {
        return {frame_, x0, y, n, size_t{y} * frame_.constants.width + x0};
    }
    /// Of a row without winners the planes are those of an older frame.
    SurfacePlanes planesOf(const RowPlace& at) const {
        return frame_.mayShow(at.x0, at.y, at.n) ? frame_.planesAt(at.first) : SurfacePlanes{};
    }
    bool concerns(const RowPass& step, const SurfacePlanes& planes) const {
        return step.concerns == nullptr || step.concerns(frame_, planes);
    }
    struct Step {
        const RowPass* pass;
        bool takesMixed;  ///< is about what pixels send: second surfaces are part of that
    };
    static bool takesMixed(render::Pass pass) {
        const auto effect = render::effectOfPass(pass);
        return pass == render::Pass::output || (effect && render::effects()[*effect]->stage == render::Stage::lit);
    }
    /// Second surfaces are lit as the first ones are, and mixed with them after that (without light: before what is
    /// about what pixels send).
    void finish(const RowPlace& at, const SurfacePlanes& planes, SurfaceRow& surface) const {
        thread_local SurfaceRow second{};
        const auto lights = [&](const Step& step) {
            const bool isOne =
                step.pass == &cpuPassOf(render::Pass::light).row || step.pass == &cpuPassOf(render::Pass::refract).row;
            return isOne && concerns(*step.pass, planes);
        };
        bool isMixed = false;
        for (const Step& step : steps_) {
            if (!concerns(*step.pass, planes)) continue;
            const bool isLight = lights(step);
            const bool hasSeconds = !isMixed && (isLight || step.takesMixed) && takeSeconds(at, surface, second);
            isMixed = isMixed || isLight || step.takesMixed;
            if (hasSeconds && isLight) {
                for (const Step& other : steps_)
                    if (other.pass->beside != nullptr) other.pass->beside(at, second);
                step.pass->run(at, second);
            }
            if (hasSeconds && !isLight) mixSeconds(at, second, surface);
            step.pass->run(at, surface);
            if (hasSeconds && isLight) mixSeconds(at, second, surface);
        }
        if (!isKept_) return;
        KeptRow kept = keptAt(frame_, at.first);
        // Depths and normals stay what they were: other threads may be reading them, about their own pixels.
        if (!isFirst_) kept.depth = nullptr;
        frame_.k.keepRow(surface, kept_, at.n, kept);
    }
    void finishEmpty(const RowPlace& at) const {
        if (isKept_ && isFirst_) std::fill_n(keptAt(frame_, at.first).depth, at.n, 0.0f);
        if (!isKept_ && showsEmpty_) return showEmpty(at);
        if (!isKept_) empty_.fill(outputAt(frame_, at.first), at.n);
    }
    /// Rows of several empty tiles come as one; passes take those of a tile at most.
    void showEmpty(const RowPlace& whole) const {
        thread_local SurfaceRow nothing{};
        for (uint32_t done = 0; done < whole.n; done += kTile) {
            RowPlace at = whole;
            at.x0 += done;
            at.first += done;
            at.n = std::min(whole.n - done, kTile);
            for (const Step& step : steps_)
                if (step.pass->showsEmpty) step.pass->run(at, nothing);
            cpuPassOf(render::Pass::output).row.run(at, nothing);
        }
    }

    Frame& frame_;
    bool isKept_;
    bool showsEmpty_ = false;
    bool isFirst_;         ///< surfaces are made in this run; else an earlier one has kept them
    SurfaceWants kept_{};  ///< of later passes
    EmptyPixel empty_;
    std::vector<Step> steps_;  ///< after the surface
};

/// Texels of the rows of one tile, rounded as levels hold them.
class TileTexels {
  public:
    void keep(const Kernels& k, const TexelRow& row, uint32_t n, uint32_t line) {
        hasTubes_.at(line) = row.hasTubes;
        held_.at(line) = k.packRow(row, n, planesOf(line));
    }
    void load(const Frame& frame, uint32_t n, uint32_t line, TexelRow& row) {
        row.hasTubes = hasTubes_.at(line);
        row.hasMaterials = frame.constants.hasMaterials != 0;
        frame.k.unpackRow(planesOf(line), kPad, n, held_.at(line), true, row);
        if (frame.hasCurves && !row.hasTubes) Pyramid::clearTubes(row);
    }

  private:
    using Line = std::array<uint32_t, kTile>;
    Planes planesOf(uint32_t line) {
        const auto at = [&](size_t plane) { return words_.at(plane).at(line).data(); };
        return {reinterpret_cast<float*>(at(0)), at(1), at(2), at(3), at(4), at(5)};
    }
    alignas(64) std::array<std::array<Line, kTileRows>, 6> words_;
    std::array<uint32_t, kTileRows> held_;
    std::array<bool, kTileRows> hasTubes_;
};

/// Tiles from the visibility buffer to the picture, where no pyramid is made of their pixels.
class TileProgram {
  public:
    TileProgram(Frame& frame, const RowProgram& program)
        : frame_(frame), program_(program), resolver_(frame), showsOwnColours_(program.showsOwnColours()) {
        resolver_.setPoints(program.needsDepths(), !mayBeWide());
    }

    bool mayShow(const TileRect& r) const {
        bool any = false;
        for (uint32_t y = r.row0; y < r.row1; ++y) any = any || frame_.isSeen(pixelAt(r.x0, y), r.n);
        return any;
    }
    void finishEmpty(const TileRect& r) const {
        for (uint32_t y = r.row0; y < r.row1; ++y)
            for (uint32_t x = r.x0; x < r.x0 + r.n; x += kTile) frame_.shownRow(x, y) = 0;
        program_.finishEmpty(r);
    }
    void run(const TileRect& r) const {
        thread_local TexelRow row{};
        thread_local TileTexels texels;
        const bool hasWide = mayBeWide();
        std::array<bool, kTileRows> isShown{};
        std::array<uint32_t, kTileRows> wide{};
        for (uint32_t y = r.row0; y < r.row1; ++y) {
            const uint32_t line = hasWide ? y - r.row0 : 0;
            isShown.at(line) = showsOwnColours_ && showPoints(r, y);
            if (isShown.at(line)) continue;
            const bool any = resolve(r, y, row);
            if (any && !row.isRounded) texels.keep(frame_.k, row, r.n, line);
            if (!hasWide) show(r, y, texels, line, row, nullptr);
            wide.at(line) = hasWide && any ? wideGroups(r, y) : 0;
        }
        if (!hasWide) return;
        const auto wanted = [&](uint32_t y) { return wide.at(y - r.row0); };
        const auto use = [&](uint32_t y, TexelRow&, TexelRow& smooth, bool any) {
            const uint32_t line = y - r.row0;
            row.isRounded = false;
            if (!isShown.at(line)) show(r, y, texels, line, row, any ? &smooth : nullptr);
        };
        frame_.pyramid.pushTile(frame_.pyramid.level(0), frame_.pyramid.level(1), 1.0f, r.x0, r.n, r.row0, r.row1,
                                false, wanted, use);
    }
    void finish() const { resolver_.finish(); }

  private:
    bool mayBeWide() const { return frame_.hasSmooth && frame_.pyramid.isUsed(); }
    size_t pixelAt(uint32_t x, uint32_t y) const { return size_t{y} * frame_.constants.width + x; }
    bool resolve(const TileRect& r, uint32_t y, TexelRow& row) const {
        row.isRounded = false;
        row.hasTubes = frame_.hasCurves;  // may have; the kernel says whether it does
        row.hasMaterials = frame_.constants.hasMaterials != 0;
        thread_local ClosedUpRow closedUp{};
        float largest = 0;
        const bool any =
            frame_.isSeen(pixelAt(r.x0, y), r.n) && resolver_.resolve(r.x0, y, r.n, row, closedUp, largest);
        frame_.shownRow(r.x0, y) = any ? 1 : 0;
        return any;
    }
    void show(const TileRect& r, uint32_t y, TileTexels& texels, uint32_t line, TexelRow& row,
              const TexelRow* smooth) const {
        const bool any = frame_.shownRow(r.x0, y) != 0;
        if (any && !row.isRounded) texels.load(frame_, r.n, line, row);
        program_.run(r.x0, r.n, y, row, row, any, smooth);
    }
    /// False, and nothing is done, where a row shows more than points' own colours.
    bool showPoints(const TileRect& r, uint32_t y) const {
        const bool isSeen = frame_.isSeen(pixelAt(r.x0, y), r.n);
        const RowContent content = isSeen ? program_.showPoints(r.x0, r.n, y) : RowContent::nothing;
        if (content == RowContent::other) return false;
        frame_.shownRow(r.x0, y) = content == RowContent::points ? 1 : 0;
        if (content == RowContent::nothing) program_.finishEmpty({r.x0, r.n, y, y + 1});
        return true;
    }
    /// Groups of the row's pixels in which some show a point of a node that is smooth.
    uint32_t wideGroups(const TileRect& r, uint32_t y) const {
        const uint8_t* const first = frame_.smooth.data() + pixelAt(r.x0, y);
        uint32_t groups = 0;
        for (uint32_t x = 0; x < r.n; x += kTexelGroup) {
            const uint8_t* const end = first + std::min(x + kTexelGroup, r.n);
            if (std::find(first + x, end, uint8_t{1}) != end) groups |= 1u << (x / kTexelGroup);
        }
        return groups;
    }

    Frame& frame_;
    const RowProgram& program_;
    RowResolver resolver_;
    const bool showsOwnColours_;
};

/// May any pixel show something? Of a pyramid the last push reads the parents of a tile's texels and those beside them.
bool mayShow(Frame& frame, const TileRect& r) {
    bool any = false;
    for (uint32_t y = r.row0; y < r.row1; ++y) any = any || frame.mayShow(r.x0, y, r.n);
    return any || (frame.hasPyramid && frame.pyramid.isUsed() &&
                   frame.pyramid.level(1).mayHoldParents(r.x0, r.n, r.row0, r.row1, true));
}

/// A tile of a pyramid's texels.
void pushTexels(Frame& frame, const RowProgram& program, const TileRect& rect) {
    const uint32_t x0 = rect.x0, n = rect.n, row0 = rect.row0, row1 = rect.row1;
    Level& fine = frame.pyramid.level(0);
    if (frame.pyramid.isUsed()) {
        // The last push, into level 0.
        frame.pyramid.pushTile(
            fine, frame.pyramid.level(1), 1.0f, x0, n, row0, row1, program.needsColoursAlone(),
            [](uint32_t) { return ~0u; },
            [&](uint32_t y, TexelRow& own, TexelRow& row, bool any) { program.run(x0, n, y, own, row, any); });
        return;
    }
    thread_local TexelRow shown{};
    for (uint32_t y = row0; y < row1; ++y) {
        shown.hasTubes = frame.hasCurves;
        shown.hasMaterials = frame.constants.hasMaterials != 0;
        const bool any = frame.pyramid.loadRow(fine, y, x0, n, shown);
        program.run(x0, n, y, shown, shown, any);
    }
}

}  // namespace

void runRows(Frame& frame, std::span<const render::Pass> passes, std::span<const render::Pass> later) {
    const RowProgram program(frame, passes, later);
    const uint32_t width = frame.constants.width, height = frame.constants.height;
    const bool isFromTexels = passes.front() == render::Pass::surface;
    if (isFromTexels && !frame.hasPyramid) {
        const TileProgram tiles(frame, program);
        forShownTiles(
            frame.executor, width, height, [&](const TileRect& r) { return tiles.mayShow(r); },
            [&](const TileRect& r) { tiles.finishEmpty(r); }, [&](const TileRect& r) { tiles.run(r); });
        tiles.finish();
        return;
    }
    const auto shows = [&](const TileRect& r) { return mayShow(frame, r); };
    const auto empty = [&](const TileRect& r) { program.finishEmpty(r); };
    forShownTiles(frame.executor, width, height, shows, empty, [&](const TileRect& r) {
        if (isFromTexels) return pushTexels(frame, program, r);
        for (uint32_t y = r.row0; y < r.row1; ++y) program.resume(r.x0, r.n, y);
    });
}

bool wantsNormals(const Frame& frame, std::span<const render::Pass> passes) {
    SurfaceWants wants{};
    uint32_t any = 0;
    SurfacePlanes planes{};
    if (frame.draws->hasSurfaces()) planes.surface = &any;
    const auto surface = std::find(passes.begin(), passes.end(), render::Pass::surface);
    for (auto pass = surface; pass != passes.end(); ++pass) {
        if (*pass == render::Pass::surface) continue;
        const CpuPass& p = cpuPassOf(*pass);
        if (p.run != nullptr && p.row.wants == nullptr) return true;  // over the frame, with all that rows have
        if (p.row.concerns == nullptr || p.row.concerns(frame, planes)) p.row.wants(frame, wants);
    }
    return wants.normal;
}

LightInput lightInputOf(const Frame& frame) {
    const render::DrawList& draws = *frame.draws;
    return {draws.lights.data(), draws.environment ? draws.environment->table.data() : nullptr,
            draws.shadowSlotOf.empty() ? nullptr : draws.shadowSlotOf.data()};
}

ShadowInput shadowInputOf(const Frame& frame) {
    const Frame::Shadows& s = frame.shadows;
    if (!frame.draws->isShadowed) return {};
    return {s.maps.data(), s.depths.data(), s.through.data(), static_cast<uint32_t>(s.maps.size()),
            frame.draws->shadowSlots};
}

/// Its rows are made by RowProgram::run.
constinit const CpuPass surfacePass{};

constinit const CpuPass lightPass{
    .row = {.concerns =
                [](const Frame& frame, const SurfacePlanes& planes) {
                    return planes.surface != nullptr || (frame.constants.shade & shared::kShadeLit) != 0;
                },
            .wants =
                [](const Frame& frame, SurfaceWants& wants) {
                    wants.normal = wants.leaf = true;
                    wants.depth = wants.depth || frame.constants.lightCount > 0;
                },
            .run =
                [](const RowPlace& at, SurfaceRow& row) {
                    at.frame.k.lightRow(at.frame.constants, lightInputOf(at.frame), at.x0, at.y, at.n, row);
                }}};

constinit const CpuPass outputPass{
    .row = {.concerns = nullptr,
            .wants =
                [](const Frame& frame, SurfaceWants& wants) {
                    const uint32_t debug = frame.constants.debugView;
                    wants.depth = wants.depth || frame.wantAll;
                    wants.normal = wants.normal || frame.wantAll || debug == shared::kDebugNormals;
                    wants.ownDepth = debug == shared::kDebugHoles;
                },
            .run =
                [](const RowPlace& at, SurfaceRow& row) {
                    row.hasOpacity = at.frame.draws->hasBlending;
                    at.frame.k.outputRow(at.frame.constants, at.frame.tables, at.n, row, outputAt(at.frame, at.first));
                }}};

}  // namespace stipple::cpu
