// Figures of elevation patches (Ochotta, Hiller & Saupe 2006; Ochotta & Hiller 2006), with what each is off.
#include "apps/study/patch_figures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/constants.hpp>

#include "apps/study/loose_patches.h"
#include "apps/study/measure.h"
#include "apps/study/pictures.h"
#include "engine/base/progress.h"
#include "engine/render/environment.h"
#include "lod/builder/patches/patch_build.h"
#include "lod/primitives/octahedral.h"
#include "lod/primitives/patch_samples.h"
#include "lod/store/materials.h"

namespace stipple::study {
namespace {

using glm::dvec3;
using render::Image;

constexpr uint32_t kSide = 380;  ///< px of a panel

/// Lines every 15 degrees, of another colour in each of eight directions.
render::HdrImage gridOfLines() {
    constexpr uint32_t kWidth = 2048, kCells = 24, kCell = kWidth / kCells, kLine = kCell / 8;
    render::HdrImage image{kWidth, kWidth / 2, {}};
    for (uint32_t y = 0; y < image.height; ++y)
        for (uint32_t x = 0; x < kWidth; ++x) {
            const bool isLine = (x + kLine / 2) % kCell < kLine || (y + kLine / 2) % kCell < kLine;
            const glm::vec3 ground(x * 4 / kWidth % 2 == 0 ? 0.75f : 0.35f, y * 2 < image.height ? 0.6f : 0.3f,
                                   x * 2 < kWidth ? 0.35f : 0.8f);
            for (int c = 0; c < 3; ++c) image.rgb.push_back(isLine ? 0.02f : ground[c]);
        }
    return image;
}

/// Pictures of some patches.
class Stage {
  public:
    Stage(const FigureTools& tools, const lod::View& view) : tools_(tools), view_(view) {}
    render::DrawSettings settings(uint32_t patchAs) const {
        render::DrawSettings s;
        s.lit = true;
        s.patchAs = patchAs;
        s.worldUp = {0, 1, 0};
        return s;
    }
    /// As a mirror of the grid.
    render::DrawSettings mirror(uint32_t patchAs) const {
        render::DrawSettings s = settings(patchAs);
        s.pointMaterial = lod::packed(*lod::materialNamed("mirror"));
        s.environment = std::make_shared<const render::Environment>(
            render::makeEnvironment(gridOfLines(), 1, tools_.executor, true));
        return s;
    }
    Result<Image> draw(const std::vector<lod::Patch>& patches, const render::DrawSettings& settings,
                       render::Mode mode = render::Mode::pullpush) const {
        STIPPLE_ASSIGN(auto backend, tools_.backend());
        STIPPLE_ASSIGN(const LoosePatches loose, LoosePatches::of(patches));
        return loose.draw(*backend, view_, mode, settings);
    }
    const lod::View& view() const { return view_; }

  private:
    const FigureTools& tools_;
    lod::View view_;
};

/// Shrunk and moved into [-1, 1]^3, by a power of two.
std::vector<lod::Patch> within(const lod::PatchSet& set, double extent) {
    std::vector<lod::Patch> out = set.patches;
    const int down = static_cast<int>(std::ceil(std::log2(extent)));
    for (lod::Patch& p : out) {
        p.origin = p.origin * std::ldexp(1.0, -down);
        p.step = std::ldexp(p.step, -down);
        p.quantumExponent -= down;
    }
    return out;
}

/// The unit sphere, half as large, from points, as the paper's 9,858 samples.
lod::PatchSet spherePatches(const FigureTools& tools) {
    lod::PatchSettings settings;
    settings.samples = 9'858;
    lod::PointBlock points = unitSphere(9'858);
    for (dvec3& p : points.position) p *= 0.5;
    Progress silent(false);
    return lod::patchesOfPoints(std::move(points), settings, tools.executor, silent);
}
lod::View sphereView() { return viewFrom({0.5, 0.45, 1.35}, {0, 0, 0}, {0, 1, 0}, kSide, kSide); }

/// The angle between a picture's normals and those of the ball that its patches are of, 95th percentile, degrees.
double normalsOff(const Image& image, const lod::View& view) {
    std::vector<double> off;
    for (uint32_t y = 0; y < image.height; ++y)
        for (uint32_t x = 0; x < image.width; ++x) {
            const size_t i = size_t{y} * image.width + x;
            const dvec3 d =
                glm::normalize(view.forward + (x + 0.5 - 0.5 * image.width) / view.focalPixels * view.right +
                               (y + 0.5 - 0.5 * image.height) / view.focalPixels * view.down);
            const double b = glm::dot(view.eye, d), k = b * b - glm::dot(view.eye, view.eye) + 0.25;
            if (!(image.depth[i] > 0) || k < 0) continue;
            const dvec3 n = 2.0 * (view.eye + (-b - std::sqrt(k)) * d);
            if (-glm::dot(n, d) < 0.2) continue;  // the rim
            const dvec3 seen(image.normal[3 * i], image.normal[3 * i + 1], image.normal[3 * i + 2]);
            off.push_back(glm::degrees(std::acos(std::min(1.0, glm::dot(n, seen)))));
        }
    if (off.empty()) return 180;
    std::sort(off.begin(), off.end());
    return off[off.size() * 95 / 100];
}
/// The largest angle between normals of pixels beside each other, degrees.
double largestJump(const Image& image) {
    double least = 1;
    for (uint32_t y = 0; y + 1 < image.height; ++y)
        for (uint32_t x = 0; x + 1 < image.width; ++x)
            for (const size_t step : {size_t{1}, size_t{image.width}}) {
                const size_t i = size_t{y} * image.width + x, j = i + step;
                if (!(image.depth[i] > 0 && image.depth[j] > 0)) continue;
                const auto at = [&](size_t k) {
                    return dvec3(image.normal[3 * k], image.normal[3 * k + 1], image.normal[3 * k + 2]);
                };
                least = std::min(least, glm::dot(at(i), at(j)));
            }
    return glm::degrees(std::acos(least));
}

/// One colour a patch; samples beside cells that are not drawn dark.
std::vector<lod::Patch> coloured(std::vector<lod::Patch> patches) {
    constexpr std::array<uint32_t, 8> kColours{0x4f6fd9, 0x5fb05a, 0xc97a3c, 0x9a5fb4,
                                               0x3fa7b8, 0xc4b23f, 0xb85f8a, 0x7a8f6a};
    for (size_t k = 0; k < patches.size(); ++k) {
        lod::Patch& p = patches[k];
        const auto isInside = [&](uint32_t i, uint32_t j) {
            return i > 0 && j > 0 && i + 1 < p.width && j + 1 < p.height && p.hasCell(i - 1, j - 1) &&
                   p.hasCell(i, j - 1) && p.hasCell(i - 1, j) && p.hasCell(i, j);
        };
        for (uint32_t j = 0; j < p.height; ++j)
            for (uint32_t i = 0; i < p.width; ++i)
                p.colours[p.at(i, j)] = isInside(i, j) ? kColours.at(k % kColours.size()) : 0x101010;
    }
    return patches;
}
std::vector<lod::Patch> flattened(std::vector<lod::Patch> patches) {
    for (lod::Patch& p : patches) {
        uint64_t sum = 0;
        for (const uint16_t code : p.heights) sum += code;
        const auto mean = static_cast<uint16_t>(std::max<uint64_t>(1, sum / std::max<size_t>(p.samples(), 1)));
        for (size_t s = 0; s < p.heights.size(); ++s) {
            if (p.heights[s] != 0) p.heights[s] = mean;
            p.normals[s] = lod::roundedNormal(glm::vec3(0, 0, 1));
        }
    }
    return patches;
}
/// Upper left, upper right, lower left and lower right quarter of four pictures.
Image quartered(const std::array<Image, 4>& of) {
    Image out = of[0];
    for (uint32_t y = 0; y < out.height; ++y)
        for (uint32_t x = 0; x < out.width; ++x) {
            const size_t i = size_t{y} * out.width + x;
            out.rgba[i] = of.at((x * 2 < out.width ? 0u : 1u) + (y * 2 < out.height ? 0u : 2u)).rgba[i];
        }
    return out;
}

Result<void> views(const FigureTools& tools, FigureSheet& out) {
    const lod::PatchSet set = spherePatches(tools);
    const std::vector<lod::Patch> own = coloured(set.patches);
    const Stage stage(tools, sphereView());
    render::DrawSettings small = stage.settings(lod::kPatchesAsSamples);
    small.supportScale = 0.5f;
    STIPPLE_ASSIGN(Image flat, stage.draw(flattened(own), stage.settings(shared::kPatchSplats)));
    STIPPLE_ASSIGN(Image lifted, stage.draw(own, stage.settings(shared::kPatchSplats)));
    STIPPLE_ASSIGN(Image reduced, stage.draw(own, small, render::Mode::splat));
    STIPPLE_ASSIGN(const Image light, stage.draw(set.patches, stage.settings(shared::kPatchSplats)));
    STIPPLE_ASSIGN(const Image mirror, stage.draw(set.patches, stage.mirror(shared::kPatchSplats)));
    render::DrawSettings both = stage.mirror(shared::kPatchSplats);
    both.pointMaterial = lod::packed({0.35f, 0.5f});
    STIPPLE_ASSIGN(const Image mixed, stage.draw(set.patches, both));
    out.add(std::move(flat), fmt::format("{} patches of {} samples, heights 0", set.patches.size(), set.samples));
    out.add(std::move(lifted), "their heights; borders dark");
    out.add(quartered({light, mirror, reduced, mixed}),
            "light, mirror / samples at half their radii, half mirror and half light");
    out.add(std::move(reduced), "samples at half their radii");
    return {};
}

/// Nine samples of one height whose normals turn outwards.
Result<void> nineSplats(const FigureTools& tools, FigureSheet& out) {
    lod::Patch p;
    p.origin = dvec3(-0.5, -0.5, -1.0 / 65536);
    p.step = 0.5f;
    p.quantumExponent = -16;
    p.width = p.height = 3;
    p.cells.assign(4, 1);
    p.heights.assign(9, 1);
    p.colours.assign(9, 0xffffff);
    for (uint32_t s = 0; s < 9; ++s)
        p.normals.push_back(lod::roundedNormal(
            glm::vec3(0.5f * (static_cast<float>(s % 3) - 1), 0.5f * (static_cast<float>(s / 3) - 1), 1)));
    const Stage stage(tools, viewFrom({0.15, -0.7, 1.0}, {0, 0, 0}, {0, 1, 0}, kSide, kSide));
    const auto add = [&](const char* name, const render::DrawSettings& settings, render::Mode mode) -> Result<void> {
        STIPPLE_ASSIGN(Image image, stage.draw({p}, settings, mode));
        const std::string caption = fmt::format("{}: normals jump by {:.1f} degrees a pixel", name, largestJump(image));
        out.add(std::move(image), caption);
        return {};
    };
    STIPPLE_TRY(add("direct", stage.mirror(shared::kPatchDirect), render::Mode::pullpush));
    STIPPLE_TRY(add("correct", stage.mirror(shared::kPatchSplats), render::Mode::pullpush));
    return add("samples in ewa", stage.mirror(lod::kPatchesAsSamples), render::Mode::ewa);
}

Result<void> sphere(const FigureTools& tools, FigureSheet& out) {
    const lod::PatchSet set = spherePatches(tools);
    const Stage stage(tools, sphereView());
    const auto add = [&](const char* name, uint32_t patchAs, float radii, render::Mode mode) -> Result<void> {
        render::DrawSettings settings = stage.mirror(patchAs);
        settings.supportScale = radii;
        STIPPLE_ASSIGN(const Image image, stage.draw(set.patches, settings, mode));
        out.add(stacked({image, cropped(image, 140, 140, 95, 70, 4)}),
                fmt::format("{}: normals p95 {:.2f} degrees", name, normalsOff(image, stage.view())));
        return {};
    };
    STIPPLE_TRY(add("correct", shared::kPatchSplats, 1, render::Mode::pullpush));
    STIPPLE_TRY(add("direct", shared::kPatchDirect, 1, render::Mode::pullpush));
    STIPPLE_TRY(add("blended (ewa), r", lod::kPatchesAsSamples, 1, render::Mode::ewa));
    return add("blended, 2r", lod::kPatchesAsSamples, 2, render::Mode::ewa);
}

Result<lod::PatchSet> patchesOfIgea(const FigureTools& tools, uint64_t samples, double& extent) {
    STIPPLE_ASSIGN(const Surface surface, readSurface(tools.dataFolder + "/01_meshes/misc/igea.ply", tools.folder));
    lod::TriangleMesh mesh = meshOf(surface);
    lod::PatchSettings settings;
    settings.samples = samples;
    Progress silent(false);
    dvec3 lo(HUGE_VAL), hi(-HUGE_VAL);
    for (const dvec3& p : mesh.position) lo = glm::min(lo, p), hi = glm::max(hi, p);
    extent = 0.5 * glm::length(hi - lo);
    return lod::patchesOfMesh(std::move(mesh), settings, tools.executor, silent);
}

/// A tenth of the samples.
Result<void> density(const FigureTools& tools, FigureSheet& out) {
    const Stage stage(tools, viewFrom({0.36, 0.21, 0.9}, {0, 0, 0}, {0, 1, 0}, kSide, kSide));
    Image dense;
    for (const uint64_t samples : {uint64_t{134'345}, uint64_t{13'434}}) {
        double extent = 1;
        STIPPLE_ASSIGN(const lod::PatchSet set, patchesOfIgea(tools, samples, extent));
        STIPPLE_ASSIGN(Image image, stage.draw(within(set, extent), stage.settings(shared::kPatchSplats)));
        std::string caption = fmt::format("{} samples, {} patches", set.samples, set.patches.size());
        if (dense.width == 0) {
            dense = image;
        } else {
            double sum = 0;
            size_t both = 0;
            for (size_t i = 0; i < image.depth.size(); ++i) {
                if (!(image.depth[i] > 0 && dense.depth[i] > 0)) continue;
                const double off =
                    (double{image.depth[i]} - dense.depth[i]) * stage.view().focalPixels / dense.depth[i];
                sum += std::min(off * off, 100.0);
                ++both;
            }
            caption += fmt::format(": depths {:.2f} px off (rms)",
                                   std::sqrt(sum / static_cast<double>(std::max<size_t>(both, 1))));
        }
        out.add(stacked({image, cropped(image, 140, 120, 95, 70, 4)}), caption);
    }
    return {};
}

}  // namespace

std::vector<PatchFigure> patchFigures() {
    const char *splats = "Ochotta, Hiller & Saupe 2006", *maps = "Ochotta & Hiller 2006";
    return {
        {{"patches-views.png", fmt::format("{}, Fig 1 and 9", splats), "Patches of a sphere", {}}, views},
        {{"patches-nine.png", fmt::format("{}, Fig 5", splats), "Nine splats of one height, a mirror of a grid", {}},
         nineSplats},
        {{"patches-sphere.png",
          fmt::format("{}, Fig 6 and 7", splats),
          "A mirror ball: interpolated, and blended with radii r and 2r",
          {}},
         sphere},
        {{"patches-density.png", fmt::format("{}, Fig 13", maps), "A tenth of the samples", {}}, density}};
}

}  // namespace stipple::study
