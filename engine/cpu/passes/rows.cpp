// Rows of tiles: from reconstructed texels (or from what an earlier run left) through passes that read their own pixel
// to the picture (or to what a later pass reads).
#include <algorithm>
#include <array>

#include "engine/cpu/passes/passes.h"
#include "engine/cpu/passes/seconds.h"
#include "shaders/shared/pack.h"

namespace stipple::cpu {
namespace {

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
ShadedRow emptyRow(const Frame& frame) {
    ShadedRow shaded;
    static const SurfaceRow kNothing{};
    frame.k.outputRow(frame.constants, frame.tables, kTile, kNothing,
                      {shaded.rgba.data(), nullptr, nullptr, shaded.linear.data()});
    return shaded;
}

ShadeOutput outputAt(Frame& frame, size_t pixel) {
    render::Image& image = *frame.image;
    const bool all = frame.wantAll;
    return {image.rgba.data() + pixel, all ? image.depth.data() + pixel : nullptr,
            all ? image.normal.data() + 3 * pixel : nullptr, all ? image.linear.data() + 3 * pixel : nullptr};
}

/// Into the surface buffer: 16 bytes a pixel. Colours beyond 1 are 1 there.
void keepRow(const RowPlace& at, const SurfaceRow& row) {
    shared::SurfaceWords* const words = at.frame.surfaceWords.data() + at.first;
    for (size_t i = 0; i < at.n; ++i) {
        shared::SurfaceWords& w = words[i];
        w.depth = row.depth[i];
        w.normal = row.depth[i] > 0 ? shared::octEncode({row.nx[i], row.ny[i], row.nz[i]}) : 0;
        w.albedo = shared::packColour(row.red[i], row.green[i], row.blue[i]);
        w.material = row.material[i] | (row.leaf[i] > 0.5f ? shared::kPixelLeaf : 0u);
    }
}

/// False if nothing is there.
bool takeRow(const RowPlace& at, const SurfacePlanes& planes, SurfaceRow& row) {
    const shared::SurfaceWords* const words = at.frame.surfaceWords.data() + at.first;
    row.hasTriangles = planes.surface != nullptr;
    row.hasEmission = planes.surface != nullptr && planes.emissive != nullptr;
    row.hasMaterials = at.frame.constants.hasMaterials != 0;
    bool any = false;
    for (size_t i = 0; i < at.n; ++i) {
        const shared::SurfaceWords& w = words[i];
        const shared::vec3 n = shared::octDecode(w.normal);
        row.depth[i] = row.ownDepth[i] = w.depth;
        row.nx[i] = n.x;
        row.ny[i] = n.y;
        row.nz[i] = n.z;
        row.red[i] = shared::unpackRed(w.albedo);
        row.green[i] = shared::unpackGreen(w.albedo);
        row.blue[i] = shared::unpackBlue(w.albedo);
        row.leaf[i] = (w.material & shared::kPixelLeaf) != 0 ? 1.0f : 0.0f;
        row.material[i] = w.material;
        row.emission[i] = row.hasEmission && (w.material & shared::kPixelTriangle) != 0 ? planes.emissive[i] : 0u;
        any = any || w.depth > 0;
    }
    return any;
}

/// A run of passes over rows.
class RowProgram {
  public:
    RowProgram(Frame& frame, std::span<const render::Pass> passes)
        : frame_(frame),
          fine_(frame.texels()),
          isKept_(!render::passInfo(passes.back()).writes.has(render::Plane::image)),
          empty_(emptyRow(frame)) {
        for (const render::Pass pass : passes)
            if (pass != render::Pass::surface) steps_.push_back(&cpuPassOf(pass).row);
        const size_t pixels = frame.visibilityPixels;
        const bool isUsed = isKept_ || passes.front() != render::Pass::surface;
        if (!isUsed || frame.surfaceWordPixels == pixels) return;
        frame.surfaceWords.assign(pixels, {});
        frame.surfaceWordPixels = pixels;
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
        SurfaceWants wants{isKept_, isKept_, isKept_, false};
        for (const RowPass* step : steps_)
            if (concerns(*step, planes)) step->wants(frame_, wants);
        thread_local SurfaceRow surface{};
        surface.shadowSlots = 0;
        wants.depth = wants.depth || smooth != nullptr;
        frame_.k.surfaceRow(f, own, row, planes, wants, x0, y, n, surface);
        if (smooth != nullptr && planes.smooth != nullptr) {
            thread_local SurfaceRow mean{};
            frame_.k.surfaceRow(f, *smooth, *smooth, {}, wants, x0, y, n, mean);
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
        if (!takeRow(at, planes, surface)) return finishEmpty(at);
        finish(at, planes, surface);
    }

  private:
    RowPlace placeOf(uint32_t x0, uint32_t n, uint32_t y) const {
        return {frame_, x0, y, n, size_t{y} * fine_.width + x0};
    }
    /// Of a row without winners the planes are those of an older frame.
    SurfacePlanes planesOf(const RowPlace& at) const {
        return fine_.mayHold(at.y, at.x0, at.n) ? frame_.planesAt(at.first) : SurfacePlanes{};
    }
    bool concerns(const RowPass& step, const SurfacePlanes& planes) const {
        return step.concerns == nullptr || step.concerns(frame_, planes);
    }
    /// Second surfaces are lit as the first ones are, and mixed with them after that (without light: before output).
    void finish(const RowPlace& at, const SurfacePlanes& planes, SurfaceRow& surface) const {
        thread_local SurfaceRow second{};
        const auto lights = [&](const RowPass* step) {
            const bool isOne =
                step == &cpuPassOf(render::Pass::light).row || step == &cpuPassOf(render::Pass::refract).row;
            return isOne && concerns(*step, planes);
        };
        const bool isLit = std::any_of(steps_.begin(), steps_.end(), lights);
        for (const RowPass* step : steps_) {
            if (!concerns(*step, planes)) continue;
            const bool isLight = lights(step);
            const bool isMixed = isLight || (!isLit && step == &cpuPassOf(render::Pass::output).row);
            const bool hasSeconds = isMixed && takeSeconds(at, surface, second);
            if (hasSeconds && isLight) {
                if (!frame_.shadowMaps.empty()) shadowSeconds(at, second);
                step->run(at, second);
            }
            if (hasSeconds && !isLight) mixSeconds(at, second, surface);
            step->run(at, surface);
            if (hasSeconds && isLight) mixSeconds(at, second, surface);
        }
        if (isKept_) keepRow(at, surface);
    }
    void finishEmpty(const RowPlace& at) const {
        if (isKept_)
            std::fill_n(frame_.surfaceWords.data() + at.first, at.n, shared::SurfaceWords{});
        else
            empty_.copyTo(outputAt(frame_, at.first), at.n);
    }

    Frame& frame_;
    Level& fine_;
    bool isKept_;
    ShadedRow empty_;
    std::vector<const RowPass*> steps_;  ///< after the surface
};

/// Does any pixel of the tile show a point of a node that is smooth?
bool showsWide(Frame& frame, const Level& shown, uint32_t x0, uint32_t n, uint32_t row0, uint32_t row1) {
    for (uint32_t y = row0; y < row1; ++y) {
        const uint8_t* const first = frame.smooth.data() + size_t{y} * shown.width + x0;
        if (shown.mayHold(y, x0, n) && std::find(first, first + n, uint8_t{1}) != first + n) return true;
    }
    return false;
}

}  // namespace

void runRows(Frame& frame, std::span<const render::Pass> passes) {
    Level& fine = frame.texels();
    const Planes planes = fine.planes();
    const RowProgram program(frame, passes);
    const bool isFromTexels = passes.front() == render::Pass::surface;
    frame.pyramid.forTiles(fine, [&](uint32_t x0, uint32_t n, uint32_t row0, uint32_t row1) {
        if (!isFromTexels) {
            for (uint32_t y = row0; y < row1; ++y) program.resume(x0, n, y);
            return;
        }
        thread_local TexelRow shown{};
        const auto show = [&](uint32_t y, const TexelRow* smooth) {
            shown.hasTubes = frame.hasCurves;
            shown.hasMaterials = frame.constants.hasMaterials != 0;
            const bool any = frame.pyramid.loadRow(fine, planes, y, x0, n, kPad, shown);
            program.run(x0, n, y, shown, shown, any, smooth);
        };
        if (frame.hasSmooth && frame.pyramid.isUsed() && showsWide(frame, fine, x0, n, row0, row1)) {
            frame.pyramid.pushTile(
                frame.pyramid.level(0), frame.pyramid.level(1), 1.0f, x0, n, row0, row1,
                [&](uint32_t y, TexelRow&, TexelRow& smooth, bool any) { show(y, any ? &smooth : nullptr); });
            return;
        }
        if (frame.hasPyramid && frame.pyramid.isUsed()) {
            // The last push, into level 0.
            frame.pyramid.pushTile(
                fine, frame.pyramid.level(1), 1.0f, x0, n, row0, row1,
                [&](uint32_t y, TexelRow& own, TexelRow& row, bool any) { program.run(x0, n, y, own, row, any); });
            return;
        }
        for (uint32_t y = row0; y < row1; ++y) show(y, nullptr);
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
        if (p.run != nullptr) return true;  // over the frame: rows are kept for it, with all that they have
        if (p.row.concerns == nullptr || p.row.concerns(frame, planes)) p.row.wants(frame, wants);
    }
    return wants.normal;
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
                    const render::DrawList& draws = *at.frame.draws;
                    const LightInput light{draws.lights.data(),
                                           draws.environment ? draws.environment->table.data() : nullptr};
                    at.frame.k.lightRow(at.frame.constants, light, at.x0, at.y, at.n, row);
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
                    at.frame.k.outputRow(at.frame.constants, at.frame.tables, at.n, row, outputAt(at.frame, at.first));
                }}};

}  // namespace stipple::cpu
