#include "apps/stipple/common.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <sstream>

#include "engine/base/hash.h"
#include "engine/base/process.h"
#include "engine/cpu/cpu_backend.h"
#include "engine/image/image_io.h"
#include "engine/reference/reference.h"
#include "lod/colour.h"
#include "lod/import/import.h"
#ifdef STIPPLE_WITH_GPU
#include "engine/gpu/gpu_backend.h"
#endif

namespace stipple::app {
namespace fs = std::filesystem;

int report(const Error& error) {
    fmt::print(stderr, "stipple: {}\n", error.line());
    return static_cast<int>(error.kind);
}

void BuildOptions::addTo(CLI::App& app) {
    app.add_option("--memory", memory, "memory that the build may use, e.g. 512M or 4G")->capture_default_str();
    app.add_option("--threads", threads, "threads (0: all cores)")->check(CLI::Range(0, 1024))->capture_default_str();
    app.add_option("--normals", normals,
                   "auto: estimate missing normals; keep: only those of the file; none: no normals at all")
        ->check(CLI::IsMember({"auto", "keep", "none"}))
        ->capture_default_str();
    app.add_option("--radii", radii, "auto: estimate missing radii from the spacing; keep: only those of the file")
        ->check(CLI::IsMember({"auto", "keep"}))
        ->capture_default_str();
    app.add_option("--up", up, "up axis, instead of the format's own (LAS: z, PLY: y)")
        ->check(CLI::IsMember({"x", "y", "z"}));
    app.add_option("--attributes", attributes,
                   "attributes to keep beside position, colour and normal: all, none, or names with commas")
        ->capture_default_str();
    app.add_option("--surfels", surfels, "samples that a scene with meshes (.gltf, .glb) is turned into")
        ->check(CLI::Range(uint64_t{1}, uint64_t{200'000'000}))
        ->capture_default_str();
    app.add_flag("--skip-bad", skipBad, "go on past corrupt chunks and files, and say what was lost");
}

void ColourOptions::addTo(CLI::App& app) {
    app.add_option("--colour,--color", what,
                   "rgb, intensity, class, return, height, normal or the name of an attribute")
        ->capture_default_str();
    app.add_option("--colour-map,--color-map", map, "grey, viridis, magma or turbo");
    app.add_option("--colour-range,--color-range", range, "LOW,HIGH (default: 2nd to 98th percentile)");
    app.add_flag("--legend", legend, "draw what the colours stand for into the picture");
}

namespace {

std::vector<std::string> namesOf(const std::string& list) {
    std::vector<std::string> names;
    std::istringstream in(list);
    for (std::string name; std::getline(in, name, ',');)
        if (!name.empty() && name != "none" && name != "all") names.push_back(lod::attributeBehind(name));
    return names;
}

}  // namespace

bool isSceneFile(const std::string& path) {
    const std::string extension = fs::path(path).extension().string();
    return extension == ".gltf" || extension == ".glb" || extension == ".obj";
}

Result<std::vector<scene::DecodedImage>> decodeImages(const scene::Scene& scene) {
    std::vector<scene::DecodedImage> images;
    for (const scene::EncodedImage& encoded : scene.images) {
        STIPPLE_ASSIGN(render::Image image, image::decodeImage(encoded.bytes, scene.path + ": " + encoded.name));
        images.push_back({image.width, image.height, std::move(image.rgba)});
    }
    return images;
}

namespace {

/// Scans by the readers of lod; meshes as surfels.
Result<lod::PointSource> openInput(const std::string& path, const lod::ReadOptions& options, uint64_t surfels) {
    if (!isSceneFile(path)) return lod::openPointSource(path, options);
    STIPPLE_ASSIGN(const scene::Scene scene, scene::readScene(path));
    STIPPLE_ASSIGN(const std::vector<scene::DecodedImage> images, decodeImages(scene));
    return scene::sampleSurfels(scene, images, {surfels});
}

}  // namespace

Result<lod::BuildSettings> BuildOptions::settings() const {
    lod::BuildSettings s;
    s.memoryBytes = parseBytes(memory);
    if (s.memoryBytes == 0)
        return fail(ErrorKind::usage, fmt::format("'{}' is not a size", memory), "--memory", "e.g. 2G");
    s.normals = normals == "none"   ? lod::NormalsMode::none
                : normals == "keep" ? lod::NormalsMode::keep
                                    : lod::NormalsMode::automatic;
    s.estimateRadii = radii != "keep";
    s.skipBad = skipBad;
    s.open = [count = surfels](const std::string& path, const lod::ReadOptions& o) {
        return openInput(path, o, count);
    };
    s.allAttributes = attributes == "all";
    s.attributes = namesOf(attributes);
    if (!up.empty()) s.up = static_cast<lod::UpAxis>(up[0] - 'x');
    return s;
}

namespace {

Result<std::string> cachePath(const std::vector<std::string>& inputs, const BuildOptions& build) {
    std::string key = build.normals + "|" + build.radii + "|" + build.up + "|" + build.attributes +
                      (build.skipBad ? "|skip" : "|") + std::to_string(build.surfels) + STIPPLE_VERSION +
                      fmt::format("|{}", lod::kStoreVersion);
    STIPPLE_ASSIGN(const std::vector<std::string> files, lod::expandInputs(inputs));
    for (const std::string& input : files) {
        std::error_code error;
        const fs::path absolute = fs::absolute(input, error);
        const auto size = fs::file_size(absolute, error);
        const auto time = fs::last_write_time(absolute, error);
        key +=
            fmt::format("|{}|{}|{}", absolute.string(), error ? 0 : size, error ? 0 : time.time_since_epoch().count());
    }
    const char* cache = std::getenv("XDG_CACHE_HOME");
    const char* home = std::getenv("HOME");
    const fs::path folder =
        cache && *cache ? fs::path(cache) / "stipple" : fs::path(home ? home : ".") / ".cache" / "stipple";
    std::error_code error;
    fs::create_directories(folder, error);
    if (error)
        return fail(ErrorKind::output, "cannot be created: " + error.message(), folder.string(), "set XDG_CACHE_HOME");
    return (folder / (hexDigits(hashBytes(key.data(), key.size())) + ".stipple")).string();
}

}  // namespace

namespace {

Result<std::shared_ptr<const lod::Store>> openStoreFile(const std::string& path) {
    STIPPLE_ASSIGN(lod::Store store, lod::openStore(path));
    return std::make_shared<const lod::Store>(std::move(store));
}

/// Raw inputs: through the cache.
Result<std::shared_ptr<const lod::Store>> openBuilt(const std::vector<std::string>& inputs, BuildOptions build,
                                                    const ColourOptions& colour, Executor& executor,
                                                    bool showProgress) {
    const std::string needed = isSceneFile(inputs.front()) ? "" : lod::attributeBehind(colour.what);
    if (!needed.empty() && build.attributes != "all")
        build.attributes = build.attributes == "none" ? needed : build.attributes + "," + needed;
    STIPPLE_ASSIGN(const lod::BuildSettings settings, build.settings());
    STIPPLE_ASSIGN(const std::string path, cachePath(inputs, build));
    if (!fs::exists(path)) {
        Progress progress(showProgress);
        STIPPLE_ASSIGN(const lod::BuildReport built, lod::buildStore(inputs, path, settings, executor, progress));
        if (showProgress)
            fmt::print(stderr, "{}: built into the cache in {:.1f} s ({})\n", inputs.front(), built.seconds, path);
        for (const std::string& note : built.notes)
            if (showProgress) fmt::print(stderr, "note: {}\n", note);
    }
    return openStoreFile(path);
}

/// A transform as rotation, even scale and translation.
Result<lod::Instance> placeOf(const glm::dmat4& m, const std::string& where) {
    lod::Instance place;
    const glm::dmat3 linear(m);
    place.scale = std::cbrt(std::abs(glm::determinant(linear)));
    place.translation = glm::dvec3(m[3]);
    const glm::dmat3 rotation = linear / std::max(place.scale, 1e-300);
    const glm::dmat3 product = glm::transpose(rotation) * rotation;
    double deviation = 0;
    for (int c = 0; c < 3; ++c)
        for (int r = 0; r < 3; ++r) deviation = std::max(deviation, std::abs(product[c][r] - (c == r ? 1 : 0)));
    if (!(place.scale > 0) || !(deviation < 1e-6) || glm::determinant(linear) < 0)
        return fail(ErrorKind::input, "places a store with uneven scale, shear or a mirror", where,
                    "stores can be moved, turned and scaled evenly");
    // What is no rotation but for rounding is none: records then stay as they are.
    double fromIdentity = 0;
    for (int c = 0; c < 3; ++c)
        for (int r = 0; r < 3; ++r) fromIdentity = std::max(fromIdentity, std::abs(rotation[c][r] - (c == r ? 1 : 0)));
    if (fromIdentity > 1e-12) place.rotation = rotation;
    return place;
}

/// The stores that a scene's nodes refer to, and its meshes as one more.
Result<std::vector<render::PlacedStore>> openSceneFile(const std::string& path, const BuildOptions& build,
                                                       const ColourOptions& colour, Executor& executor,
                                                       bool showProgress) {
    STIPPLE_ASSIGN(const scene::Scene scene, scene::readScene(path));
    std::vector<render::PlacedStore> placed;
    std::map<std::string, std::shared_ptr<const lod::Store>> open;
    const std::vector<glm::dmat4> world = scene.worldTransforms();
    const std::vector<bool> visible = scene.visibility();
    bool hasMeshes = false;
    for (size_t n = 0; n < scene.nodes.size(); ++n) {
        const scene::Node& node = scene.nodes[n];
        hasMeshes = hasMeshes || (visible[n] && node.mesh >= 0);
        if (node.store.empty() || !visible[n]) continue;
        if (open.count(node.store) == 0) {
            STIPPLE_ASSIGN(open[node.store], openStoreFile(node.store));
        }
        std::vector<glm::dmat4> places = node.instances;
        if (places.empty()) places.emplace_back(1);
        for (const glm::dmat4& place : places) {
            STIPPLE_ASSIGN(const lod::Instance instance,
                           placeOf(world[n] * place, path + ": node '" + node.name + "'"));
            placed.push_back({open[node.store], instance, {}});
        }
    }
    if (hasMeshes || placed.empty()) {
        STIPPLE_ASSIGN(std::shared_ptr<const lod::Store> meshes,
                       openBuilt({path}, build, colour, executor, showProgress));
        placed.push_back({std::move(meshes), {}, {}});
    }
    return placed;
}

/// One description for all: the only store's own, or the union with y up, as glTF has it.
lod::StoreDescription describe(const std::vector<render::PlacedStore>& placed) {
    lod::StoreDescription all = placed.front().store->description;
    if (placed.size() == 1 && placed[0].place.rotation == glm::dmat3(1) && placed[0].place.scale == 1 &&
        placed[0].place.translation == glm::dvec3(0))
        return all;
    all.up = {0, 1, 0};
    all.boundsMin = all.focusMin = glm::dvec3(1e300);
    all.boundsMax = all.focusMax = glm::dvec3(-1e300);
    all.points = 0;
    for (const render::PlacedStore& p : placed) {
        const lod::StoreDescription& d = p.store->description;
        for (int corner = 0; corner < 8; ++corner) {
            const auto pick = [&](const glm::dvec3& lo, const glm::dvec3& hi) {
                const glm::dvec3 at((corner & 1) != 0 ? hi.x : lo.x, (corner & 2) != 0 ? hi.y : lo.y,
                                    (corner & 4) != 0 ? hi.z : lo.z);
                return p.place.translation + p.place.rotation * (p.place.scale * at);
            };
            all.boundsMin = glm::min(all.boundsMin, pick(d.boundsMin, d.boundsMax));
            all.boundsMax = glm::max(all.boundsMax, pick(d.boundsMin, d.boundsMax));
            all.focusMin = glm::min(all.focusMin, pick(d.focusMin, d.focusMax));
            all.focusMax = glm::max(all.focusMax, pick(d.focusMin, d.focusMax));
        }
        all.points += d.points;
        all.hasColour = all.hasColour || d.hasColour;
        all.hasNormals = all.hasNormals || d.hasNormals;
        // Lit if any part needs it: meshes and scans without colours look flat otherwise.
        all.isReflectance = all.isReflectance || isShaded(d);
        if (all.attributes.empty()) all.attributes = d.attributes;
    }
    return all;
}

}  // namespace

Result<OpenedScene> openScene(const std::vector<std::string>& inputs, const BuildOptions& build,
                              const ColourOptions& colour, Executor& executor, bool showProgress) {
    OpenedScene scene;
    const bool isStore = fs::path(inputs.front()).extension() == ".stipple";
    for (const std::string& input : inputs)
        if (inputs.size() > 1 && (fs::path(input).extension() == ".stipple" || isSceneFile(input)))
            return fail(ErrorKind::usage, "a built scene and other inputs cannot be mixed", input,
                        "name one scene, or only raw inputs; a .gltf scene can place several stores");
    if (isSceneFile(inputs.front())) {
        STIPPLE_ASSIGN(scene.placed, openSceneFile(inputs.front(), build, colour, executor, showProgress));
    } else {
        STIPPLE_ASSIGN(
            std::shared_ptr<const lod::Store> store,
            isStore ? openStoreFile(inputs.front()) : openBuilt(inputs, build, colour, executor, showProgress));
        scene.placed.push_back({std::move(store), {}, {}});
    }
    scene.description = describe(scene.placed);
    return scene;
}

Result<lod::ColourBy> applyColours(OpenedScene& scene, const std::string& what, const std::string& map,
                                   const std::string& range) {
    std::optional<lod::ColourBy> first;
    std::optional<Error> problem;
    for (render::PlacedStore& p : scene.placed) {
        const auto by = lod::parseColourBy(what, map, range, p.store->description);
        if (!by) problem = problem ? problem : by.error();
        p.colour = by.value_or(lod::ColourBy{});
        if (by && !first) first = *by;
    }
    if (!first) return tl::unexpected(*problem);
    return *first;
}

Result<std::unique_ptr<render::Backend>> makeBackend(const std::string& device, Executor& executor) {
    if (device == "cpu") return cpu::makeCpuBackend(executor);
    if (device == "reference") return reference::makeReferenceBackend(executor);
#ifdef STIPPLE_WITH_GPU
    if (device == "auto") {
        // A real GPU if there is one; software Vulkan only when asked for.
        if (gpu::hasHardwareDevice()) {
            auto backend = gpu::makeGpuBackend({});
            if (backend) return backend;
        }
        return cpu::makeCpuBackend(executor);
    }
    if (device == "gpu" || device.rfind("gpu:", 0) == 0) {
        gpu::GpuSettings settings;
        settings.deviceName = device.size() > 4 ? device.substr(4) : "";
        settings.validation = std::getenv("STIPPLE_VALIDATION") != nullptr;
        return gpu::makeGpuBackend(settings);
    }
#else
    if (device == "auto") return cpu::makeCpuBackend(executor);
    if (device.rfind("gpu", 0) == 0)
        return fail(ErrorKind::device, "this program was built without Vulkan", "--device " + device,
                    "use --device cpu");
#endif
    return fail(ErrorKind::usage, fmt::format("'{}' is not a device", device), "--device",
                "auto, cpu, gpu, gpu:NAME or reference");
}

std::string listDevices() {
    const auto executor = makeTbbExecutor(0);
    std::string text = "  cpu        " + cpu::makeCpuBackend(*executor)->device() + "\n";
#ifdef STIPPLE_WITH_GPU
    for (const std::string& name : gpu::deviceNames()) text += "  gpu        " + name + "\n";
#else
    text += "  gpu        not built in\n";
#endif
    return text + "  reference  fp64, scalar, slow: the oracle of the tests\n";
}

Result<glm::dvec3> parseVector(const std::string& text, const char* option) {
    glm::dvec3 v(0);
    std::istringstream in(text);
    char comma1 = 0, comma2 = 0;
    if (!(in >> v.x >> comma1 >> v.y >> comma2 >> v.z) || comma1 != ',' || comma2 != ',' || !(in >> std::ws).eof() ||
        !std::isfinite(v.x + v.y + v.z))
        return fail(ErrorKind::usage, fmt::format("'{}' is not three numbers", text), option, "e.g. 1.5,2,-3");
    return v;
}

Result<glm::uvec2> parseSize(const std::string& text) {
    unsigned w = 0, h = 0;
    char x = 0;
    std::istringstream in(text);
    if (!(in >> w >> x >> h) || x != 'x' || !(in >> std::ws).eof() || w == 0 || h == 0 || w > 16384 || h > 16384)
        return fail(ErrorKind::usage, fmt::format("'{}' is not a size up to 16384x16384", text), "--size",
                    "e.g. 1920x1080");
    return glm::uvec2(w, h);
}

nlohmann::json jsonNumber(double value) {
    if (std::isfinite(value)) return value;
    return value > 0 ? "inf" : "nan";
}

}  // namespace stipple::app
