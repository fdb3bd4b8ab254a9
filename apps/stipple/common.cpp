#include "apps/stipple/common.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <sstream>

#include "apps/stipple/camera_options.h"
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
    app.add_option("--temp", temp,
                   "folder for temporary files of a build that does not fit in memory (default: the output's)");
    app.add_option("--duplicates", duplicates, "points at one place: keep all, or merge them into one")
        ->check(CLI::IsMember({"keep", "merge"}))
        ->capture_default_str();
    app.add_option("--threads", threads, "threads (0: all cores)")->check(CLI::Range(0, 1024))->capture_default_str();
    app.add_option("--normals", normals,
                   "auto: estimate missing normals; fine: the same, each point from its own twelve nearest; keep: only "
                   "those of the file; none: no normals at all")
        ->check(CLI::IsMember({"auto", "fine", "keep", "none"}))
        ->capture_default_str();
    app.add_option("--radii", radii, "auto: estimate missing radii from the spacing; keep: only those of the file")
        ->check(CLI::IsMember({"auto", "keep"}))
        ->capture_default_str();
    addUpOption(app, up);
    app.add_option("--attributes", attributes,
                   "attributes to keep beside position, colour and normal: all, none, or names with commas")
        ->capture_default_str();
    app.add_option("--surfels", surfels, "turn meshes (.gltf, .glb, .obj) into that many samples; 0: keep triangles")
        ->check(CLI::Range(uint64_t{0}, uint64_t{200'000'000}))
        ->capture_default_str();
    app.add_flag("--repair", repair,
                 "pass over faults of a glTF file that change nothing that is drawn, and count them");
    app.add_option("--strand-radius", strandRadius,
                   "radius of strands that have none, file units (0: a 4000th of the extent)")
        ->check(numberBetween(0.0, 1e300));
    addOutliersTo(app);
    app.add_flag("--only-points", onlyPoints, "of a PLY mesh take the vertices, as points");
    app.add_flag("--skip-bad", skipBad, "go on past corrupt chunks and files, and say what was lost");
}

void BuildOptions::addOutliersTo(CLI::App& app) {
    app.add_flag("--drop-outliers", dropOutliers,
                 "of points leave out invalid returns at the origin (0,0,0), and places with fewer than 16 around them "
                 "far outside of what holds 96 of 100; counted by reason");
}

void BuildOptions::addCacheTo(CLI::App& app) {
    app.add_option("--cache-limit", cacheLimit,
                   "what the cache of built scenes may hold; beyond that the least recently used go (default: "
                   "STIPPLE_CACHE_LIMIT, or 20G, or a fifth of the disk)");
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

Result<lod::BuildSettings> BuildOptions::settings() const {
    lod::BuildSettings s;
    s.memoryBytes = parseBytes(memory);
    if (s.memoryBytes == 0)
        return fail(ErrorKind::usage, fmt::format("'{}' is not a size", memory), "--memory", "e.g. 2G");
    s.normals = normals == "none"   ? lod::NormalsMode::none
                : normals == "keep" ? lod::NormalsMode::keep
                                    : lod::NormalsMode::automatic;
    s.fineNormals = normals == "fine";
    s.mergeDuplicates = duplicates == "merge";
    s.dropOutliers = dropOutliers;
    s.tempFolder = temp;
    s.isStopped = isStopRequested;
    s.ranks = ranks;
    s.estimateRadii = radii != "keep";
    s.skipBad = skipBad;
    s.open = [count = surfels, repairs = repair](const std::string& path, const lod::ReadOptions& o) {
        return openInput(path, o, count, repairs);
    };
    s.allAttributes = attributes == "all";
    s.attributes = namesOf(attributes);
    if (!up.empty()) s.up = static_cast<lod::UpAxis>(up[0] - 'x');
    return s;
}

Result<lod::ColourBy> applyColours(OpenedScene& scene, const std::string& what, const std::string& map,
                                   const std::string& range) {
    std::optional<lod::ColourBy> first;
    std::optional<Error> problem;
    for (render::PlacedStore& p : scene.placed) {
        const lod::Hierarchy& h = p.store->hierarchy;
        if ((h.isMesh() || h.isStrands) && what != "auto" && what != "rgb") {
            const char* const kind = h.isMesh() ? "triangles" : "ribbons and tubes";
            if (!problem)
                problem = Error{ErrorKind::usage, fmt::format("{} cannot be coloured by '{}'", kind, what), "--colour",
                                h.isMesh() ? "--surfels N makes points of them" : "leave --colour out"};
            continue;
        }
        const auto by = lod::parseColourBy(what, map, range, p.store->description);
        if (!by) problem = problem ? problem : by.error();
        p.colour = by.value_or(lod::ColourBy{});
        if (by && !first) first = *by;
    }
    if (!first) return tl::unexpected(*problem);
    return *first;
}

void EnvironmentOptions::addTo(CLI::App& app) {
    app.add_option("--environment", path, "HDR picture all around (.hdr, .exr; equirectangular) that lights the scene");
    app.add_option("--environment-scale", scale, "multiplies its light")
        ->check(numberBetween(0.0, 1e6))
        ->capture_default_str();
}

Result<std::shared_ptr<const render::Environment>> openEnvironment(const std::string& path, double scale,
                                                                   Executor& executor) {
    if (path.empty()) return std::shared_ptr<const render::Environment>();
    STIPPLE_ASSIGN(const render::HdrImage image, image::readHdr(path));
    return std::make_shared<const render::Environment>(
        render::makeEnvironment(image, static_cast<float>(scale), executor));
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
