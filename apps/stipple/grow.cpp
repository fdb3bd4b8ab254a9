#include "apps/grow/grow.h"

#include <fmt/format.h>

#include "apps/grow/meshes.h"
#include "apps/stipple/common.h"
#include "engine/base/process.h"
#include "engine/image/image_io.h"

namespace stipple::app {
namespace {

struct Options {
    std::string output, origin = "0,0,0";
    grow::ScanOptions scan;
    bool json = false;
};

Result<void> run(Options& o) {
    STIPPLE_ASSIGN(const glm::dvec3 origin, parseVector(o.origin, "--origin"));
    o.scan.origin = {origin.x, origin.y, origin.z};
    const double start = nowSeconds();
    const auto points = grow::growScan(o.scan);
    STIPPLE_TRY(grow::writeScan(o.output, points, o.scan));
    if (o.json)
        fmt::print("{}\n", nlohmann::json{{"points", points.size()}, {"seconds", nowSeconds() - start}}.dump(2));
    else
        fmt::print("{}: {} points, {:.1f} s\n", o.output, points.size(), nowSeconds() - start);
    return {};
}

struct MeshRun {
    std::string output, triangles = "100000";
    grow::MeshOptions mesh;
    bool json = false;
};

/// "10M", "250k" or a plain number; 0 if it is none.
uint64_t parseCount(const std::string& text) {
    double value = 0;
    char unit = 0, rest = 0;
    const int got = std::sscanf(text.c_str(), "%lf%c%c", &value, &unit, &rest);
    const double factor = got == 1                                   ? 1
                          : got == 2 && (unit == 'k' || unit == 'K') ? 1e3
                          : got == 2 && unit == 'M'                  ? 1e6
                                                                     : 0;
    return value * factor >= 1 && value * factor <= 1e9 ? static_cast<uint64_t>(value * factor) : 0;
}

Result<void> runMesh(MeshRun& o) {
    o.mesh.triangles = parseCount(o.triangles);
    if (o.mesh.triangles == 0)
        return fail(ErrorKind::usage, fmt::format("'{}' is not a number up to 1000M", o.triangles), "--triangles",
                    "e.g. 250k or 10M");
    const double start = nowSeconds();
    scene::Scene scene = grow::growMesh(o.mesh);
    if (o.mesh.textureSize == 0) {
        scene.textures.clear();
        for (scene::Material& m : scene.materials) m.baseColourTexture = m.normalTexture = {};
    }
    const grow::Textures textures = grow::growTextures(o.mesh);
    for (const auto& [name, pixels] : {std::pair{"colour.png", &textures.colour}, {"normal.png", &textures.normal}}) {
        if (pixels->size == 0) continue;
        render::Image image;
        image.width = image.height = pixels->size;
        image.rgba = pixels->rgba;
        STIPPLE_ASSIGN(const std::vector<char> bytes, image::encodeImage(name, image));
        scene.images.push_back({name, {bytes.begin(), bytes.end()}});
    }
    uint64_t triangles = 0;
    for (const auto& p : scene.meshes[0].primitives) triangles += p.indices.size() / 3;
    STIPPLE_TRY(scene::writeGltf(scene, o.output));
    if (o.json)
        fmt::print("{}\n", nlohmann::json{{"triangles", triangles}, {"seconds", nowSeconds() - start}}.dump(2));
    else
        fmt::print("{}: {} triangles, {:.1f} s\n", o.output, triangles, nowSeconds() - start);
    return {};
}

void addMesh(CLI::App& parent, const char* kind, const char* what, int& status) {
    auto o = std::make_shared<MeshRun>();
    o->mesh.kind = kind;
    CLI::App* sub = parent.add_subcommand(kind, what);
    sub->add_option("-o,--output", o->output, "the file to write (.glb, .gltf)")->required();
    sub->add_option("--triangles", o->triangles, "about that many, e.g. 250k or 10M")->capture_default_str();
    sub->add_option("--seed", o->mesh.seed, "another seed, another shape")->capture_default_str();
    sub->add_option("--texture", o->mesh.textureSize, "edge of the textures, pixels; 0: none")
        ->check(CLI::Range(0, 8192))
        ->capture_default_str();
    sub->add_flag("--json", o->json, "as JSON");
    sub->callback([o, &status] {
        if (const auto result = runMesh(*o); !result) status = report(result.error());
    });
}

}  // namespace

void setupGrow(CLI::App& app, int& status) {
    auto o = std::make_shared<Options>();
    CLI::App* sub = app.add_subcommand("grow", "generate test scenes");
    sub->require_subcommand(1);
    CLI::App* scan = sub->add_subcommand("scan", "simulate a laser scan of a grove with rocks and a house");
    scan->add_option("-o,--output", o->output, "the file to write (.las, .ply)")->required();
    scan->add_option("--points", o->scan.points, "number of points")
        ->check(CLI::Range(uint64_t{1}, uint64_t{500'000'000}))
        ->capture_default_str();
    scan->add_option("--seed", o->scan.seed, "another seed, another grove")->capture_default_str();
    scan->add_option("--origin", o->origin, "added to every coordinate, e.g. 500000,5400000,300")
        ->capture_default_str();
    scan->add_option("--positions", o->scan.positions, "scanner positions")
        ->check(CLI::Range(1, 64))
        ->capture_default_str();
    scan->add_option("--noise", o->scan.noiseMetres, "range noise, standard deviation, metres")
        ->check(CLI::Range(0.0, 1.0))
        ->capture_default_str();
    addMesh(*sub, "rock", "a textured boulder", status);
    addMesh(*sub, "building", "a textured block of flats with windows", status);
    addMesh(*sub, "terrain", "two kilometres of textured hills", status);
    scan->add_flag("--json", o->json, "as JSON");
    scan->callback([o, &status] {
        if (const auto result = run(*o); !result) status = report(result.error());
    });
}

}  // namespace stipple::app
