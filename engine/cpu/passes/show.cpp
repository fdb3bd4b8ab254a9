// From reconstructed rows to the picture.
#include <array>

#include "engine/cpu/passes/passes.h"

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

/// One row of a tile, back to back: its surface, light on it, the picture's pixels.
class RowProgram {
  public:
    RowProgram(Frame& frame, std::span<const render::Pass> passes)
        : frame_(frame),
          fine_(frame.pyramid.level(0)),
          light_{frame.draws->lights.data(),
                 frame.draws->environment ? frame.draws->environment->table.data() : nullptr},
          isLit_(std::find(passes.begin(), passes.end(), render::Pass::light) != passes.end()),
          empty_(emptyRow(frame)) {}

    /// `own`: the row before it was reconstructed. `any`: is there anything?
    void run(uint32_t x0, uint32_t n, uint32_t y, TexelRow& own, TexelRow& row, bool any) const {
        const shared::FrameConstants& f = frame_.constants;
        const bool wantAll = frame_.wantAll;
        render::Image& image = *frame_.image;
        const size_t at = size_t{y} * fine_.width + x0;
        const ShadeOutput out{image.rgba.data() + at, wantAll ? image.depth.data() + at : nullptr,
                              wantAll ? image.normal.data() + 3 * at : nullptr,
                              wantAll ? image.linear.data() + 3 * at : nullptr};
        if (!any) return empty_.copyTo(out, n);
        if (row.hasTubes) frame_.k.finishRow(f.focal, n, row);
        if (own.hasTubes && &own != &row) frame_.k.finishRow(f.focal, n, own);
        // Of a row without winners the planes are those of an older frame.
        const SurfacePlanes planes = fine_.mayHold(y, x0, n) ? frame_.planesAt(at) : SurfacePlanes{};
        thread_local SurfaceRow surface{};
        const bool isLit = isLit_ && (planes.surface != nullptr || (f.shade & shared::kShadeLit) != 0);
        const bool showsNormals = wantAll || f.debugView == shared::kDebugNormals;
        frame_.k.surfaceRow(
            f, own, row, planes,
            {wantAll || (isLit && f.lightCount > 0), isLit || showsNormals, isLit, f.debugView == shared::kDebugHoles},
            x0, y, n, surface);
        if (isLit) frame_.k.lightRow(f, light_, x0, y, n, surface);
        frame_.k.outputRow(f, frame_.tables, n, surface, out);
    }

  private:
    Frame& frame_;
    Level& fine_;
    LightInput light_;
    bool isLit_;
    ShadedRow empty_;
};

}  // namespace

void showRows(Frame& frame, std::span<const render::Pass> passes) {
    Level& fine = frame.pyramid.level(0);
    const Planes planes = fine.planes();
    const RowProgram program(frame, passes);
    frame.pyramid.forTiles(fine, [&](uint32_t x0, uint32_t n, uint32_t row0, uint32_t row1) {
        if (frame.hasPyramid && frame.pyramid.isUsed()) {
            // The last push, into level 0.
            frame.pyramid.pushTile(
                fine, frame.pyramid.level(1), 1.0f, x0, n, row0, row1,
                [&](uint32_t y, TexelRow& own, TexelRow& row, bool any) { program.run(x0, n, y, own, row, any); });
            return;
        }
        thread_local TexelRow row{};
        row.hasTubes = frame.hasStrands;
        for (uint32_t y = row0; y < row1; ++y) {
            const bool any = frame.pyramid.loadRow(fine, planes, y, x0, n, kPad, row);
            program.run(x0, n, y, row, row, any);
        }
    });
}

}  // namespace stipple::cpu
