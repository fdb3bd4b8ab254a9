#include "apps/study/figures.h"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>

#include "apps/study/measure.h"
#include "apps/study/patch_figures.h"
#include "apps/study/pictures.h"
#include "engine/image/coverage.h"
#include "engine/image/image_io.h"
#include "engine/reference/variants/variants.h"
#include "engine/scene/camera.h"

namespace stipple::study {
namespace {

using glm::dvec3;
using render::Image;
using Panels = Result<std::vector<Image>>;

constexpr const char *kBunny = "01_meshes/bunny/bun_zipper.ply", *kIgea = "01_meshes/misc/igea.ply",
                     *kHelmet = "06_gltf/DamagedHelmet.glb",
                     *kOutcrop = "02_scans/outcrop_rgb_cloudcompare/example_data.laz";

/// Draws one store as modes and as variants have it.
class Panel {
  public:
    Panel(const FigureTools& tools, StorePtr store, const lod::View& view, bool isLit)
        : tools_(tools), store_(std::move(store)), view_(view), isLit_(isLit) {}

    Result<Image> mode(render::Mode mode) const {
        STIPPLE_ASSIGN(auto backend, tools_.backend());
        return by(std::move(backend), mode);
    }
    Result<Image> variant(const char* name) const {
        for (const reference::Variant& v : reference::variants())
            if (std::string_view(name) == v.name)
                return by(reference::makeVariantBackend(name, tools_.executor), v.mode);
        return fail(ErrorKind::usage, "there is no such variant", name);
    }
    Panels variants(std::initializer_list<const char*> names) const {
        std::vector<Image> out;
        for (const char* name : names) {
            STIPPLE_ASSIGN(Image image, variant(name));
            out.push_back(std::move(image));
        }
        return out;
    }
    Result<Image> traced() const { return traceStore(store_, view_, isLit_, 4, tools_.executor); }
    const lod::View& view() const { return view_; }

  private:
    Result<Image> by(std::unique_ptr<render::Backend> backend, render::Mode mode) const {
        Drawer drawer(store_, std::move(backend), tools_.executor);
        return drawer.draw(view_, settingsOf(mode, kLeaves, isLit_));
    }
    const FigureTools& tools_;
    StorePtr store_;
    lod::View view_;
    bool isLit_;
};

Result<StorePtr> modelOf(const FigureTools& tools, const char* file, uint64_t count) {
    STIPPLE_ASSIGN(const Surface surface, readSurface(tools.dataFolder + "/" + file, tools.folder));
    const std::string name = std::filesystem::path(file).stem().string();
    return surfelStore(surface, count, fmt::format("{}/{}_{}.stipple", tools.folder, name, count), tools.executor);
}

/// From so near that single discs are seen.
lod::View nearView(const lod::Store& store, double share, uint32_t size) {
    lod::View view = fittedView(store, size, size);
    view.focalPixels *= share;
    return view;
}

Panels shapes(const FigureTools& tools) {
    STIPPLE_ASSIGN(const StorePtr store, modelOf(tools, kBunny, 20'000));
    const Panel panel(tools, store, nearView(*store, 2.5, 380), true);
    STIPPLE_ASSIGN(std::vector<Image> out, panel.variants({"squares", "size-only"}));
    STIPPLE_ASSIGN(Image exact, panel.mode(render::Mode::splat));
    out.push_back(std::move(exact));
    STIPPLE_ASSIGN(Image reduced, panel.variant("reduced-radii"));
    out.push_back(std::move(reduced));
    return out;
}

/// The depth of a picture from another camera, in the shades of its normals: steps become visible.
Panels depthFromAside(const FigureTools& tools) {
    STIPPLE_ASSIGN(const StorePtr store, modelOf(tools, kBunny, 4'000));
    lod::View view = nearView(*store, 2, 640);
    const Panel panel(tools, store, view, true);
    STIPPLE_ASSIGN(const Image flat, panel.variant("flat-depth"));
    STIPPLE_ASSIGN(const Image corrected, panel.mode(render::Mode::splat));
    const dvec3 middle = 0.5 * (store->description.boundsMin + store->description.boundsMax);
    const double away = glm::length(view.eye - middle);
    lod::View aside = viewFrom(middle + away * glm::normalize(-0.55 * view.forward + 0.85 * view.right), middle,
                               store->description.up, 480, 480);
    aside.focalPixels *= 1.3;
    return std::vector<Image>{reference::seenFrom(flat, view, aside), reference::seenFrom(corrected, view, aside)};
}

/// A checker plane to its horizon.
Panels checkers(const FigureTools& tools) {
    STIPPLE_ASSIGN(const StorePtr store,
                   pointStore(checkerPlane(253, 8), tools.folder + "/checker_64009.stipple", tools.executor));
    const Panel panel(tools, store, viewFrom({0, -1.02, 0.08}, {0, 0, -0.12}, {0, 0, 1}, 400, 300), false);
    STIPPLE_ASSIGN(Image points, panel.mode(render::Mode::points));
    STIPPLE_ASSIGN(Image splat, panel.mode(render::Mode::splat));
    STIPPLE_ASSIGN(Image ewa, panel.mode(render::Mode::ewa));
    STIPPLE_ASSIGN(Image plain, panel.variant("unnormalised"));
    return std::vector<Image>{stacked({points, splat}), stacked({ewa, plain})};
}

Panels textures(const FigureTools& tools) {
    STIPPLE_ASSIGN(const StorePtr store, modelOf(tools, kHelmet, 352'467));
    lod::View view = fittedView(*store, 300, 300);
    view.focalPixels *= 1.4;
    const Panel panel(tools, store, view, false);
    std::vector<Image> out;
    const auto add = [&](const Image& image) { out.push_back(stacked({image, cropped(image, 125, 160, 75, 50, 4)})); };
    STIPPLE_ASSIGN(const Image splat, panel.mode(render::Mode::splat));
    STIPPLE_ASSIGN(const Image ewa, panel.mode(render::Mode::ewa));
    STIPPLE_ASSIGN(const Image traced, panel.traced());
    for (const Image* image : {&splat, &ewa, &traced}) add(*image);
    return out;
}

/// Shift of fronts, sums and order: what blending needs. 48 degrees off the axis of a wide lens, where shifts along the
/// axis and along the ray part.
Panels blending(const FigureTools& tools) {
    STIPPLE_ASSIGN(const StorePtr store, modelOf(tools, kBunny, 6'000));
    lod::View view = fittedView(*store, 900, 900);
    const dvec3 middle = 0.5 * (store->description.boundsMin + store->description.boundsMax);
    const double away = glm::length(middle - view.eye);
    view = viewFrom(view.eye, middle - 1.1 * away * view.right, store->description.up, 900, 900);
    view.focalPixels = 330;
    const Panel panel(tools, store, view, true);
    const auto part = [](const Image& image) { return cropped(image, 700, 350, 200, 200, 2); };
    STIPPLE_ASSIGN(const Image ewa, panel.mode(render::Mode::ewa));
    STIPPLE_ASSIGN(const Image shifted, panel.variant("z-shift"));
    STIPPLE_ASSIGN(const Image raw, panel.variant("unnormalised"));
    STIPPLE_ASSIGN(const Image sorted, panel.variant("sorted-blending"));
    return std::vector<Image>{part(ewa), part(shifted), part(raw), part(sorted)};
}

Panels kernels(const FigureTools& tools) {
    STIPPLE_ASSIGN(const StorePtr store, modelOf(tools, kBunny, 10'000));
    const Panel panel(tools, store, nearView(*store, 2.5, 380), true);
    STIPPLE_ASSIGN(std::vector<Image> out, panel.variants({"box-kernel", "gaussian-kernel"}));
    STIPPLE_ASSIGN(Image own, panel.mode(render::Mode::pullpush));
    out.push_back(std::move(own));
    STIPPLE_ASSIGN(Image centre, panel.variant("centre-test"));
    out.push_back(std::move(centre));
    return out;
}

Panels lights(const FigureTools& tools) {
    STIPPLE_ASSIGN(const StorePtr store, modelOf(tools, kHelmet, 12'000));
    lod::View view = fittedView(*store, 380, 380);
    view.focalPixels *= 1.4;
    const Panel panel(tools, store, view, true);
    STIPPLE_ASSIGN(Image perPoint, panel.variant("light-per-point"));
    STIPPLE_ASSIGN(Image deferred, panel.mode(render::Mode::pullpush));
    STIPPLE_ASSIGN(Image grey, panel.variant("no-colour"));
    return std::vector<Image>{perPoint, deferred, grey};
}

/// Every mode on one statue at full detail, and a part of each three times as large.
Panels modes(const FigureTools& tools) {
    STIPPLE_ASSIGN(const StorePtr store, modelOf(tools, kIgea, 134'345));
    const Panel panel(tools, store, fittedView(*store, 300, 300), true);
    std::vector<Image> out;
    const auto add = [&](const Image& image) { out.push_back(stacked({image, cropped(image, 100, 60, 100, 60, 3)})); };
    for (const render::Reconstruction& r : render::reconstructions()) {
        STIPPLE_ASSIGN(const Image image, panel.mode(r.mode));
        add(image);
    }
    STIPPLE_ASSIGN(const Image traced, panel.traced());
    add(traced);
    return out;
}

/// The modes that differ, on a scan at two pixels of error, and a part of each four times as large.
Panels scan(const FigureTools& tools) {
    STIPPLE_ASSIGN(const StorePtr store,
                   scanStore(tools.dataFolder + "/" + kOutcrop, tools.folder + "/outcrop.stipple", tools.executor));
    // Of what is dense; the part of it in the middle.
    const lod::StoreDescription& d = store->description;
    const lod::View view = scene::makeView(scene::fitCamera(d.focusMin, d.focusMax, d.up, 1.5), 720, 480, 1e-9);
    std::vector<Image> out;
    const auto add = [&](const Image& image) {
        out.push_back(stacked({cropped(image, 220, 75, 180, 110, 1), cropped(image, 290, 110, 45, 28, 4)}));
    };
    for (const render::Mode mode :
         {render::Mode::points, render::Mode::pullpush, render::Mode::splat, render::Mode::ewa}) {
        STIPPLE_ASSIGN(auto backend, tools.backend());
        Drawer drawer(store, std::move(backend), tools.executor);
        STIPPLE_ASSIGN(const Image image, drawer.draw(view, settingsOf(mode, 2, false)));
        add(image);
    }
    STIPPLE_ASSIGN(const Image traced, traceStore(store, view, false, 4, tools.executor));
    add(traced);
    return out;
}

struct Recipe {
    Figure figure;
    Panels (*draw)(const FigureTools& tools);
};

std::vector<std::string> modePanels() {
    std::vector<std::string> names;
    for (const render::Reconstruction& r : render::reconstructions()) names.emplace_back(r.name);
    names.emplace_back("traced");
    return names;
}

std::vector<Recipe> recipes() {
    return {
        {{"modes.png", "all of them", "Every mode on Igea, 134,345 surfels", modePanels()}, modes},
        {{"scan.png",
          "the modes that differ",
          "One scan in four modes at an error of two pixels, and traced in full detail",
          {"points", "pullpush", "splat, pullpush-exact", "ewa", "traced"}},
         scan},
        {{"shapes.png",
          "Botsch & Kobbelt 2003, Fig 1 and 3",
          "Squares, size, size and shape, reduced radii",
          {"squares", "size only", "size and shape (splat)", "half the radii"}},
         shapes},
        {{"depth.png",
          "Botsch & Kobbelt 2003, Fig 6",
          "The depth of a picture, seen from a second camera",
          {"without depth correction", "with it (splat)"}},
         depthFromAside},
        {{"textures.png",
          "Botsch & Kobbelt 2003, Fig 5 and 8; Ren et al. 2002, Fig 12",
          "A textured model of 352,467 points, and a part of it",
          {"splat (unfiltered)", "ewa (filtered)", "traced, 16 rays a pixel"}},
         textures},
        {{"checkers.png",
          "Ren et al. 2002, Fig 11",
          "A checker plane to the horizon",
          {"points above, splat below", "ewa above, ewa without normalisation below"}},
         checkers},
        {{"blending.png",
          "Ren et al. 2002, Fig 4 and 5, section 7; Botsch & Kobbelt 2003, 5",
          "What blending needs",
          {"ewa", "fronts shifted along the axis", "not normalised", "one pass, sorted"}},
         blending},
        {{"kernels.png",
          "Marroquim et al. 2008, Fig 4 and section 3.2",
          "Kernels of the push, and the centre test",
          {"box", "Gaussian", "(1 - rho^2)^2 (pullpush)", "only ellipses that contain the parent's centre"}},
         kernels},
        {{"light.png",
          "Marroquim et al. 2008, Fig 5 and Table 1",
          "Light per point, deferred, without colours",
          {"light per point", "deferred (pullpush)", "no colour plane"}},
         lights},
    };
}

}  // namespace

namespace {

/// One figure: its panels side by side, or its name in `missing`.
Result<void> writeFigure(const FigureTools& tools, const Figure& figure, const Panels& panels,
                         std::vector<std::string>& missing, std::vector<Figure>& out) {
    if (!panels && panels.error().kind == ErrorKind::input) {
        missing.push_back(figure.file + ": " + panels.error().line());
        return {};
    }
    if (!panels) return tl::unexpected(panels.error());
    Image sheet = sideBySide(*panels);
    STIPPLE_TRY(image::writePicture(tools.folder + "/../" + figure.file, sheet, {}));
    out.push_back(figure);
    return {};
}

}  // namespace

Result<std::vector<Figure>> drawFigures(const FigureTools& tools, std::vector<std::string>& missing) {
    std::vector<Figure> out;
    for (const Recipe& recipe : recipes()) {
        STIPPLE_TRY(tools.say(recipe.figure.file));
        STIPPLE_TRY(writeFigure(tools, recipe.figure, recipe.draw(tools), missing, out));
    }
    for (PatchFigure& patches : patchFigures()) {
        STIPPLE_TRY(tools.say(patches.figure.file));
        FigureSheet sheet;
        const Result<void> drawn = patches.draw(tools, sheet);
        patches.figure.panels = std::move(sheet.captions);
        STIPPLE_TRY(writeFigure(tools, patches.figure,
                                drawn ? Panels(std::move(sheet.panels)) : tl::unexpected(drawn.error()), missing, out));
    }
    return out;
}

}  // namespace stipple::study
