// What drawing elevation patches costs: as strips, as splats and directly, beside the same triangles as a mesh store
// and the same samples as points. Prints a table.
//
//   stipple_patch_draw MESH.ply [SAMPLES] [PICTURE_PREFIX]
#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <map>

#include "engine/base/process.h"
#include "engine/cpu/cpu_backend.h"
#include "engine/image/image_io.h"
#include "lod/builder/mesh/mesh_build.h"
#include "lod/import/ply/mesh.h"
#include "lod/primitives/mesh_source.h"
#include "lod/primitives/octahedral.h"
#include "lod/primitives/patch_samples.h"
#include "tests/support/patch_scene.h"
#include "tests/support/patch_shapes.h"

namespace stipple {
namespace {

constexpr uint32_t kWidth = 1920, kHeight = 1080;
constexpr int kRounds = 9;

template <typename T>
T valueOf(Result<T> result) {
    if (!result) throw std::runtime_error(result.error().line());
    return std::move(*result);
}

lod::TriangleMesh readMesh(const std::string& path) {
    const lod::MeshSource source = valueOf(lod::openPlyMesh(path, uint64_t{1} << 30, "/tmp"));
    lod::TriangleMesh mesh;
    if (source.survey) valueOf(source.survey([](uint64_t, uint64_t) { return Result<void>(); }));
    const auto read = source.read([&](const lod::TriangleMesh& block) -> Result<void> {
        lod::append(mesh, block);
        return {};
    });
    if (!read) throw std::runtime_error(read.error().line());
    return mesh;
}

/// Into [-1, 1]^3, by a power of two.
std::vector<lod::Patch> shrunk(std::vector<lod::Patch> patches) {
    glm::dvec3 low(HUGE_VAL), high(-HUGE_VAL);
    for (const lod::Patch& p : patches)
        for (const test::Triangle& t : test::trianglesOf(p, glm::dvec3(0)))
            for (const glm::dvec3& c : t) {
                low = glm::min(low, c);
                high = glm::max(high, c);
            }
    const glm::dvec3 size = high - low, middle = 0.5 * (low + high);
    const int up = -static_cast<int>(std::ceil(std::log2(0.5 * std::max({size.x, size.y, size.z}))));
    for (lod::Patch& p : patches) {
        p.origin = (p.origin - middle) * std::ldexp(1.0, up);
        p.step = std::ldexp(p.step, up);
        p.quantumExponent += up;
    }
    return patches;
}

/// The same triangles, with the patches' normals and colours.
lod::TriangleMesh meshOf(const std::vector<lod::Patch>& patches) {
    lod::TriangleMesh mesh;
    for (const lod::Patch& p : patches) {
        const lod::PatchSurface surface(p);
        const auto base = static_cast<uint32_t>(mesh.position.size());
        for (size_t s = 0; s < p.heights.size(); ++s) {
            mesh.position.push_back(surface.position(s));
            mesh.normal.push_back(glm::vec3(surface.frame() * glm::dvec3(shared::octDecode(p.normals[s]))));
            mesh.uv.emplace_back(0);
            mesh.colour.push_back(p.colours[s] | 0xff000000u);
            mesh.surface.push_back(shared::kSurfaceTwoSided);
        }
        surface.triangles([&](size_t a, size_t b, size_t c) {
            for (const size_t s : {a, b, c}) mesh.indices.push_back(base + static_cast<uint32_t>(s));
        });
    }
    return mesh;
}

lod::View viewAt(int k) {
    const double azimuth = 1.1 * k, elevation = 0.3 * (k % 3 - 1);
    lod::View view;
    const glm::dvec3 from(std::cos(azimuth) * std::cos(elevation), std::sin(elevation),
                          std::sin(azimuth) * std::cos(elevation));
    view.eye = 3.2 * from;
    view.forward = -from;
    view.right = glm::normalize(glm::cross(view.forward, glm::dvec3(0, 1, 0)));
    view.down = glm::cross(view.forward, view.right);
    view.width = kWidth;
    view.height = kHeight;
    view.focalPixels = 1.3 * kHeight;
    view.nearPlane = 1e-3;
    return view;
}

/// Milliseconds: of the pass that draws the kind, and of the whole frame.
struct Times {
    std::vector<double> pass, frame;
    void add(const render::Backend& backend, const std::string& name) {
        double own = 0, all = 0;
        for (const render::PassTime& t : backend.passTimes()) {
            own += t.name == name ? t.ms : 0;
            all += t.ms;
        }
        pass.push_back(own);
        frame.push_back(all);
    }
    static double middle(std::vector<double> v) {
        std::sort(v.begin(), v.end());
        return v[v.size() / 2];
    }
    static double least(const std::vector<double>& v) { return *std::min_element(v.begin(), v.end()); }
};

int run(int argc, char** argv) {
    if (argc < 2) return 2;
    const auto executor = makeTbbExecutor(0);
    const auto backend = cpu::makeCpuBackend(*executor);
    lod::PatchSettings settings;
    settings.samples = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 0;
    const lod::PatchSet set = test::patchesOf(readMesh(argv[1]), settings);
    const std::vector<lod::Patch> patches = shrunk(set.patches);
    test::PatchScene scene(patches);
    lod::TriangleMesh mesh = meshOf(patches);
    const size_t triangles = mesh.indices.size() / 3;
    const test::TempFolder folder;
    lod::MeshBuildSettings build;
    build.description.materials.resize(1);
    build.description.materials[0].baseColour = {1, 1, 1};
    build.description.materials[0].roughness = build.description.materials[0].alpha = 1;
    Progress progress(false);
    valueOf(lod::buildMeshStore(lod::sourceOf(std::move(mesh)), folder / "m.stipple", build, *executor, progress));
    const auto store = std::make_shared<const lod::Store>(valueOf(lod::openStore(folder / "m.stipple")));
    fmt::print("{}: {} patches, {} samples, {} triangles, {} blocks of {} bytes, {}\n\n", argv[1], patches.size(),
               set.samples, triangles, scene.chunk().patchBlocks.size(), sizeof(shared::PatchBlock), backend->device());
    const std::string prefix = argc > 3 ? argv[3] : "";
    std::map<std::string, Times> times;
    const std::vector<std::tuple<std::string, uint32_t, render::Mode, std::string>> ways{
        {"strips", shared::kPatchStrips, render::Mode::pullpush, "patches"},
        {"splats, correct", shared::kPatchSplats, render::Mode::pullpush, "patches"},
        {"splats, direct", shared::kPatchDirect, render::Mode::pullpush, "patches"},
        {"samples, pullpush", lod::kPatchesAsSamples, render::Mode::pullpush, "project"},
        {"samples, splat", lod::kPatchesAsSamples, render::Mode::splat, "splat"},
        {"samples, ewa", lod::kPatchesAsSamples, render::Mode::ewa, "ewa"}};
    for (int round = 0; round < kRounds; ++round) {
        const lod::View view = viewAt(round);
        for (const auto& [name, as, mode, pass] : ways) {
            render::DrawSettings draw;
            draw.patchAs = as;
            draw.lit = true;
            const render::Image image = scene.draw(*backend, view, mode, draw);
            times[name].add(*backend, pass);
            if (!prefix.empty() && round == 0)
                image::writeImage(prefix + name.substr(name.find(' ') + 1) + ".png", image);
        }
        const render::Image image =
            test::renderView(store, *backend, *executor, view, test::drawnAs(render::Mode::pullpush));
        times["mesh clusters"].add(*backend, "rasterise");
        if (!prefix.empty() && round == 0) image::writeImage(prefix + "mesh.png", image);
    }
    fmt::print("| way | its pass, ms: median (least) | frame, ms: median (least) |\n|---|---|---|\n");
    for (const auto& [name, t] : times)
        fmt::print("| {} | {:.1f} ({:.1f}) | {:.1f} ({:.1f}) |\n", name, Times::middle(t.pass), Times::least(t.pass),
                   Times::middle(t.frame), Times::least(t.frame));
    return 0;
}

}  // namespace
}  // namespace stipple

int main(int argc, char** argv) {
    try {
        return stipple::run(argc, argv);
    } catch (const std::exception& e) {
        fmt::print(stderr, "{}\n", e.what());
        return 1;
    }
}
