#include "apps/stipple/common.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <sstream>

#include "apps/stipple/camera_options.h"
#include "apps/stipple/options.h"
#include "engine/base/hash.h"
#include "engine/base/process.h"
#include "engine/base/units.h"
#include "engine/image/image_io.h"
#include "lod/import/import.h"
#include "lod/store/colour.h"
#include "lod/store/file_kind.h"

namespace stipple::app {
namespace fs = std::filesystem;

void BuildOptions::addTo(CLI::App& app) {
    app.add_option("--memory", memory, "memory that the build may use, bytes: 512M, 4G (stipple help budgets)")
        ->check(bytes())
        ->type_name("SIZE")
        ->capture_default_str();
    addProgressTo(app);
    app.add_option("--temp", temp,
                   "folder for temporary files of a build that does not fit in memory (default: the output's)")
        ->type_name("FOLDER");
    app.add_option("--duplicates", duplicates, "points at one place: keep all, or merge them into one")
        ->check(oneOf({"keep", "merge"}))
        ->capture_default_str();
    app.add_option("--threads", threads, "threads (0: all cores)")->transform(within(0, 1024))->capture_default_str();
    app.add_option("--normals", normals,
                   "auto: estimate missing normals; fine: the same, each point from its own twelve nearest; keep: only "
                   "those of the file; none: no normals at all")
        ->check(oneOf({"auto", "fine", "keep", "none"}))
        ->capture_default_str();
    app.add_option("--radii", radii, "auto: estimate missing radii from the spacing; keep: only those of the file")
        ->check(oneOf({"auto", "keep"}))
        ->capture_default_str();
    addUpOption(app, up);
    app.add_option("--attributes", attributes,
                   "attributes to keep beside position, colour and normal: all, none, or names with commas")
        ->type_name("NAMES")
        ->capture_default_str();
    app.add_option("--surfels", surfels,
                   "turn meshes (.gltf, .glb, .obj) into that many samples, e.g. 1M; 0: keep triangles")
        ->transform(within(uint64_t{0}, uint64_t{200'000'000}))
        ->capture_default_str();
    addSceneFileOptions(app, allowOutside, repair);
    app.add_option("--curve-radius,--strand-radius", curveRadius,
                   "radius of curves that have none, file units (0: a 4000th of the extent)")
        ->transform(within(0.0, 1e300));
    addOutliersTo(app);
    addFormatsTo(app);
    app.add_flag("--skip-bad", skipBad, "go on past corrupt chunks and files, and say what was lost");
}

void MaterialOptions::addTo(CLI::App& app, const char* of) {
    app.add_option("--material", name, fmt::format("material of {}: {}", of, lod::kMaterialNames))
        ->check(oneOf({"matte", "plastic", "metal", "mirror", "glass", "water"}))
        ->type_name("NAME");
    app.add_option(
           "--roughness", roughness,
           fmt::format("roughness, 0 (mirror) to 1, of {}; what --metallic and --material leave open is matte", of))
        ->transform(within(0.0, 1.0));
    app.add_option("--metallic", metallic,
                   fmt::format("0 to 1 (metal), of {}; what --roughness and --material leave open is matte", of))
        ->transform(within(0.0, 1.0));
}

std::optional<lod::PointMaterial> MaterialOptions::material() const {
    if (name.empty() && !roughness && !metallic) return {};
    lod::PointMaterial m = name.empty() ? lod::PointMaterial{} : *lod::materialNamed(name);
    if (roughness) m.roughness = static_cast<float>(*roughness);
    if (metallic) m.metallic = static_cast<float>(*metallic);
    return m;
}

Result<void> MaterialOptions::check(const std::string& shade) const {
    if (material() && shade == "unlit")
        return fail(ErrorKind::usage, "is not seen where nothing is lit", "--material, --roughness, --metallic",
                    "leave --shade unlit out");
    return {};
}

void addSceneFileOptions(CLI::App& app, bool& allowOutside, bool& repair) {
    app.add_flag("--allow-outside", allowOutside,
                 "of a scene (.gltf, .glb, .obj) also read the files that it names outside its own folder");
    app.add_flag("--repair", repair,
                 "is always done: faults of a glTF file that can be drawn are noted and passed over")
        ->group("");
}

void BuildOptions::addFormatsTo(CLI::App& app) {
    app.add_flag("--only-points", onlyPoints,
                 "of what could be triangles take points: of PLY the vertices, of level sets discs on their surface");
    addGridTo(app);
}

void BuildOptions::addGridTo(CLI::App& app) {
    app.add_option("--grid", grid,
                   "of files that hold several (.vdb): the one to take (default: all that can be drawn)")
        ->type_name("NAME");
}

void BuildOptions::addOutliersTo(CLI::App& app) {
    app.add_flag("--drop-outliers", dropOutliers,
                 "of points leave out invalid returns at the origin (0,0,0), and places with fewer than 16 around them "
                 "far outside of what holds 96 of 100; counted by reason");
}

void BuildOptions::addCacheTo(CLI::App& app) {
    app.add_option(
           "--cache-limit", cacheLimit,
           "what the cache of built scenes may hold, e.g. 10G; beyond that the least recently used go (default: "
           "STIPPLE_CACHE_LIMIT, or 20G, or a fifth of the disk)")
        ->type_name("SIZE");
}

void BuildOptions::addProgressTo(CLI::App& app) {
    app.add_option("--progress", progress,
                   "on standard error: auto: a bar on a terminal, only notes otherwise; json: one line a second")
        ->check(oneOf({"auto", "bar", "json", "none"}))
        ->capture_default_str();
}

ProgressStyle BuildOptions::styleOf(bool isQuiet) const {
    if (isQuiet) return ProgressStyle::silent;
    if (progress == "none") return ProgressStyle::notes;
    if (progress == "bar") return ProgressStyle::bar;
    return progress == "json" ? ProgressStyle::json : automaticProgress();
}

void printLine(const std::string& line) { fmt::print(stderr, "{}\n", line); }

OpenSettings BuildOptions::told(bool isQuiet) const {
    OpenSettings to = *this;
    to.progressStyle = styleOf(isQuiet);
    if (!isQuiet) to.say = printLine;
    to.loss = printLine;
    return to;
}

void ColourOptions::addTo(CLI::App& app) {
    app.add_option(
           "--colour,--color", what,
           "auto (own colours; of points without any, their height), plain (own colours, or grey), rgb, intensity, "
           "class, return, height, normal or the name of an attribute")
        ->type_name("WHAT")
        ->capture_default_str();
    app.add_option("--colour-map,--color-map", map,
                   "colours of a range of values: grey, viridis, magma, turbo or relief")
        ->check(oneOf({"grey", "viridis", "magma", "turbo", "relief"}))
        ->type_name("MAP");
    app.add_option("--colour-range,--color-range", range,
                   "values at the ends of the map (default: 2nd to 98th percentile of what has data)")
        ->check(CLI::Validator(
            [](std::string& text) {
                return lod::parseRange(text) ? std::string()
                                             : fmt::format("'{}' is not a range; give e.g. 0,255", text);
            },
            ""))
        ->type_name("LOW,HIGH");
    app.add_flag("--legend", legend, "draw what the colours stand for into the picture");
}

void EnvironmentOptions::addTo(CLI::App& app) {
    app.add_option("--environment", path, "HDR picture all around (.hdr, .exr; equirectangular) that lights the scene")
        ->type_name("FILE");
    app.add_option("--environment-scale", scale, "factor of its light")
        ->transform(within(0.0, 1e6))
        ->capture_default_str();
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

}  // namespace stipple::app
