#include "apps/grow/grow.h"

#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "apps/grow/landscapes.h"
#include "apps/grow/meshes.h"
#include "apps/grow/plants.h"
#include "apps/stipple/common.h"
#include "apps/stipple/options.h"
#include "apps/stipple/outputs.h"
#include "engine/base/file.h"
#include "engine/base/process.h"
#include "engine/image/image_io.h"

namespace stipple::app {
namespace {

struct GrowCommand {
    std::string output, origin = "0,0,0";
    grow::ScanOptions scan;
    bool json = false, force = false;
};

Result<void> run(GrowCommand& o) {
    STIPPLE_ASSIGN(const glm::dvec3 origin, parseVector(o.origin, "--origin"));
    o.scan.origin = {origin.x, origin.y, origin.z};
    STIPPLE_TRY(checkOutputs({{o.output}}, {}, o.force));
    STIPPLE_TRY(grow::checkScanPath(o.output));
    catchStopSignals();
    const double start = nowSeconds();
    const auto points = grow::growScan(o.scan);
    STIPPLE_TRY(checkStopped(o.output));
    STIPPLE_TRY(grow::writeScan(o.output, points, o.scan));
    if (o.json)
        printJson("grow", {{"output", o.output}, {"points", points.size()}, {"seconds", nowSeconds() - start}});
    else
        fmt::print("{}: {} points, {:.1f} s\n", o.output, points.size(), nowSeconds() - start);
    return {};
}

struct MeshRun {
    std::string output;
    grow::MeshOptions mesh;
    bool json = false, force = false;
};

/// The pictures that a grown mesh's textures refer to.
Result<void> addTextures(const grow::MeshOptions& mesh, scene::Scene& scene) {
    const grow::Textures textures = grow::growTextures(mesh);
    for (const auto& [name, pixels] : {std::pair{"colour.png", &textures.colour}, {"normal.png", &textures.normal}}) {
        if (pixels->size == 0) continue;
        render::Image image;
        image.width = image.height = pixels->size;
        image.rgba = pixels->rgba;
        STIPPLE_ASSIGN(const std::vector<char> bytes, image::encodeImage(name, image));
        scene.images.push_back({name, {bytes.begin(), bytes.end()}});
    }
    return {};
}

Result<void> runMesh(const MeshRun& o) {
    STIPPLE_TRY(checkOutputs({{o.output}}, {}, o.force));
    catchStopSignals();
    const double start = nowSeconds();
    scene::Scene scene = grow::growMesh(o.mesh);
    if (o.mesh.textureSize == 0) {
        scene.textures.clear();
        for (scene::Material& m : scene.materials) m.baseColourTexture = m.normalTexture = {};
    }
    STIPPLE_TRY(addTextures(o.mesh, scene));
    uint64_t triangles = 0;
    for (const auto& p : scene.meshes[0].primitives) triangles += p.indices.size() / 3;
    STIPPLE_TRY(checkStopped(o.output));
    STIPPLE_TRY(scene::writeGltf(scene, o.output));
    if (o.json)
        printJson("grow", {{"output", o.output}, {"triangles", triangles}, {"seconds", nowSeconds() - start}});
    else
        fmt::print("{}: {} triangles, {:.1f} s\n", o.output, triangles, nowSeconds() - start);
    return {};
}

void addMesh(CLI::App& parent, const char* kind, const char* what, int& status) {
    auto o = std::make_shared<MeshRun>();
    o->mesh.kind = kind;
    CLI::App* sub = parent.add_subcommand(kind, what);
    sub->add_option("-o,--output", o->output, "the file to write (.glb, .gltf)")->type_name("FILE")->required();
    o->mesh.triangles = 100'000;
    sub->add_option("--triangles", o->mesh.triangles, "about that many, e.g. 250k or 10M")
        ->transform(within(uint64_t{1}, uint64_t{1'000'000'000}))
        ->default_str("100k");
    sub->add_option("--seed", o->mesh.seed, "another seed, another shape")
        ->transform(within(uint64_t{0}, uint64_t{1} << 53))
        ->capture_default_str();
    sub->add_option("--texture", o->mesh.textureSize, "edge of the textures, pixels; 0: none")
        ->transform(within(0, 8192))
        ->capture_default_str();
    sub->add_flag("--json", o->json, "print what was made as JSON (stipple help json)");
    addForce(*sub, o->force);
    sub->callback([o, &status] {
        if (const auto result = runMesh(*o); !result) status = report(result.error());
    });
}

struct PlantRun {
    std::string output, as = "curves";
    grow::PlantOptions plant;
    bool json = false, force = false;
};

Result<void> runPlant(PlantRun& o) {
    o.plant.asTriangles = o.as == "triangles";
    STIPPLE_TRY(checkOutputs({{o.output}}, {}, o.force));
    catchStopSignals();
    const double start = nowSeconds();
    const scene::Scene scene = grow::growPlant(o.plant);
    uint64_t segments = 0, triangles = 0;
    for (const auto& p : scene.meshes[0].primitives)
        (o.plant.asTriangles ? triangles : segments) += p.indices.size() / (o.plant.asTriangles ? 3 : 2);
    const uint64_t trees = std::max<size_t>(1, scene.nodes[0].instances.size());
    STIPPLE_TRY(checkStopped(o.output));
    STIPPLE_TRY(scene::writeGltf(scene, o.output));
    if (o.json)
        printJson("grow", {{"output", o.output},
                           {"segments", segments},
                           {"triangles", triangles},
                           {"trees", trees},
                           {"seconds", nowSeconds() - start}});
    else
        fmt::print("{}: {} {} a tree, {} trees, {:.1f} s\n", o.output, segments + triangles,
                   o.plant.asTriangles ? "triangles" : "segments", trees, nowSeconds() - start);
    return {};
}

void addPlant(CLI::App& parent, const char* name, const char* what, uint32_t rows, int& status) {
    auto o = std::make_shared<PlantRun>();
    o->plant.rows = rows;
    CLI::App* sub = parent.add_subcommand(name, what);
    sub->add_option("-o,--output", o->output, "the file to write (.glb, .gltf)")->type_name("FILE")->required();
    sub->add_option("--species", o->plant.species, "oak, birch or spruce")
        ->check(oneOf({"oak", "birch", "spruce"}))
        ->capture_default_str();
    o->plant.leaves = 50'000;
    sub->add_option("--leaves", o->plant.leaves, "leaves of a tree, about, e.g. 200k")
        ->transform(within(uint64_t{1}, uint64_t{1'000'000'000}))
        ->default_str("50k");
    sub->add_option("--as", o->as, "curves: tubes and ribbons; triangles: the same shape")
        ->transform(oldName("strands", "curves"))
        ->check(oneOf({"curves", "triangles"}))
        ->capture_default_str();
    if (rows > 1)
        sub->add_option("--rows", o->plant.rows, "rows x rows trees")
            ->transform(within(1, 1000))
            ->capture_default_str();
    sub->add_option("--seed", o->plant.seed, "another seed, another tree")
        ->transform(within(uint64_t{0}, uint64_t{1} << 53))
        ->capture_default_str();
    sub->add_flag("--json", o->json, "print what was made as JSON (stipple help json)");
    addForce(*sub, o->force);
    sub->callback([o, &status] {
        if (const auto result = runPlant(*o); !result) status = report(result.error());
    });
}

struct LandscapeRun {
    std::string kind, output, as = "curves";
    grow::LandscapeOptions landscape;
    uint64_t scanPoints = 2'000'000;
    bool json = false, force = false;
};

namespace fs = std::filesystem;

/// What a folder of a demo holds.
struct DemoFolder {
    explicit DemoFolder(const std::string& folder)
        : scan((fs::path(folder) / "scan.las").string()),
          store((fs::path(folder) / "scan.stipple").string()),
          scene((fs::path(folder) / "demo.glb").string()),
          walk((fs::path(folder) / "walk.json").string()) {}
    std::string scan, store, scene, walk;
};

/// Makes the folder of a demo, which is an output itself.
Result<std::vector<Output>> outputsOf(const LandscapeRun& o) {
    if (o.kind != "demo") return std::vector<Output>{{o.output}};
    std::error_code error;
    fs::create_directories(o.output, error);
    if (error)
        return fail(ErrorKind::output, "cannot be created: " + error.message(), o.output, "name a folder to write");
    const DemoFolder demo(o.output);
    return std::vector<Output>{{demo.scan}, {demo.store, OutputKind::store}, {demo.scene}, {demo.walk}};
}

/// The folder of a demo: a scan, built, a path through the scene, and the scene that places it.
Result<std::string> growDemoFolder(const LandscapeRun& o, scene::Scene& scene) {
    const DemoFolder demo(o.output);
    grow::ScanOptions options;
    options.points = o.scanPoints;
    const auto points = grow::growScan(options);
    STIPPLE_TRY(checkStopped(o.output));
    STIPPLE_TRY(grow::writeScan(demo.scan, points, options));
    const auto executor = makeTbbExecutor(0);
    Progress progress(true);
    lod::BuildSettings settings;
    settings.isStopped = isStopRequested;
    STIPPLE_TRY(lod::buildStore({demo.scan}, demo.store, settings, *executor, progress));
    const std::string walk = grow::demoWalk();
    STIPPLE_TRY(writeWholeFile(demo.walk, walk.data(), walk.size()));
    scene = grow::growDemo(o.landscape, "scan.stipple");
    STIPPLE_TRY(addTextures({}, scene));
    return demo.scene;
}

Result<void> runLandscape(LandscapeRun& o) {
    o.landscape.asTriangles = o.as == "triangles";
    STIPPLE_ASSIGN(const std::vector<Output> outputs, outputsOf(o));
    STIPPLE_TRY(checkOutputs(outputs, {}, o.force));
    catchStopSignals();
    const double start = nowSeconds();
    scene::Scene scene;
    std::string output = o.output;
    if (o.kind == "demo") {
        STIPPLE_ASSIGN(output, growDemoFolder(o, scene));
    } else {
        scene = o.kind == "forest" ? grow::growForest(o.landscape) : grow::growMeadow(o.landscape);
    }
    uint64_t instances = 0, placed = 0;
    for (const scene::Node& node : scene.nodes) {
        instances += node.instances.size();
        if (node.mesh < 0) continue;
        for (const auto& p : scene.meshes[static_cast<size_t>(node.mesh)].primitives)
            placed += p.indices.size() / (p.kind == scene::PrimitiveKind::lines ? 2 : 3) *
                      std::max<size_t>(1, node.instances.size());
    }
    STIPPLE_TRY(checkStopped(output, o.kind == "demo" ? "it is not written" : "nothing is written"));
    STIPPLE_TRY(scene::writeGltf(scene, output));
    if (o.json)
        printJson("grow", {{"output", output},
                           {"instances", instances},
                           {"primitives_placed", placed},
                           {"seconds", nowSeconds() - start}});
    else
        fmt::print("{}: {} plants and stones, {} segments and triangles, {:.1f} s\n", output, instances, placed,
                   nowSeconds() - start);
    return {};
}

void addLandscape(CLI::App& parent, const char* kind, const char* what, int& status) {
    auto o = std::make_shared<LandscapeRun>();
    o->kind = kind;
    const bool isForest = o->kind == "forest", isMeadow = o->kind == "meadow", isDemo = o->kind == "demo";
    CLI::App* sub = parent.add_subcommand(kind, what);
    sub->add_option("-o,--output", o->output, isDemo ? "the folder to write" : "the file to write (.glb, .gltf)")
        ->type_name(isDemo ? "FOLDER" : "FILE")
        ->required();
    if (isForest) {
        o->landscape.trees = 10'000;
        sub->add_option("--trees", o->landscape.trees, "how many, e.g. 100k")
            ->transform(within(uint64_t{1}, uint64_t{10'000'000}))
            ->default_str("10k");
        sub->add_option("--spacing", o->landscape.spacing, "metres between trees, about")
            ->transform(within(2.0, 100.0))
            ->capture_default_str();
        sub->add_option("--variants", o->landscape.variants, "trees that are grown of each of the three species")
            ->transform(within(1, 16))
            ->capture_default_str();
        sub->add_option("--as", o->as, "curves: tubes and ribbons; triangles: the same shapes")
            ->transform(oldName("strands", "curves"))
            ->check(oneOf({"curves", "triangles"}))
            ->capture_default_str();
    }
    if (isDemo)
        sub->add_option("--points", o->scanPoints, "points of the scan, e.g. 2M")
            ->transform(within(uint64_t{1000}, uint64_t{100'000'000}))
            ->default_str("2M");
    o->landscape.leaves = isDemo ? 60'000 : 200'000;
    if (!isMeadow)
        sub->add_option("--leaves", o->landscape.leaves, "leaves of a tree, about, e.g. 200k")
            ->transform(within(uint64_t{1}, uint64_t{10'000'000}))
            ->default_str(isDemo ? "60k" : "200k");
    if (isMeadow)
        sub->add_option("--size", o->landscape.meadow, "edge, metres")
            ->transform(within(2.0, 2000.0))
            ->capture_default_str();
    sub->add_option("--seed", o->landscape.seed, "another seed, another landscape")
        ->transform(within(uint64_t{0}, uint64_t{1} << 53))
        ->capture_default_str();
    sub->add_flag("--json", o->json, "print what was made as JSON (stipple help json)");
    addForce(*sub, o->force);
    sub->callback([o, &status] {
        if (const auto result = runLandscape(*o); !result) status = report(result.error());
    });
}

}  // namespace

void setupGrow(CLI::App& app, int& status) {
    auto o = std::make_shared<GrowCommand>();
    CLI::App* sub = app.add_subcommand("grow", "generate test scenes");
    sub->require_subcommand(1);
    CLI::App* scan = sub->add_subcommand("scan", "simulate a laser scan of a grove with rocks and a house");
    scan->add_option("-o,--output", o->output, "the file to write (.las, .ply)")->type_name("FILE")->required();
    scan->add_option("--points", o->scan.points, "number of points, e.g. 500k or 10M")
        ->transform(within(uint64_t{1}, uint64_t{500'000'000}))
        ->capture_default_str();
    scan->add_option("--seed", o->scan.seed, "another seed, another grove")
        ->transform(within(uint64_t{0}, uint64_t{1} << 53))
        ->capture_default_str();
    scan->add_option("--origin", o->origin, "added to every coordinate, metres, e.g. 500000,5400000,300")
        ->type_name("X,Y,Z")
        ->capture_default_str();
    scan->add_option("--positions", o->scan.positions, "scanner positions")
        ->transform(within(1, 64))
        ->capture_default_str();
    scan->add_option("--noise", o->scan.noiseMetres, "range noise, standard deviation, metres")
        ->transform(within(0.0, 1.0))
        ->capture_default_str();
    addMesh(*sub, "rock", "a textured boulder", status);
    addMesh(*sub, "building", "a textured block of flats with windows", status);
    addMesh(*sub, "terrain", "two kilometres of textured hills", status);
    addPlant(*sub, "tree", "a tree of tubes and ribbons", 1, status);
    addPlant(*sub, "orchard", "one tree in rows, each turned and scaled", 4, status);
    addLandscape(*sub, "forest", "trees of three species on hills, each instanced many times", status);
    addLandscape(*sub, "meadow", "grass and flowers", status);
    addLandscape(*sub, "demo", "a scan, an orchard, a meadow, a boulder, glass and mirrors on one ground", status);
    scan->add_flag("--json", o->json, "print what was made as JSON (stipple help json)");
    addForce(*scan, o->force);
    scan->callback([o, &status] {
        if (const auto result = run(*o); !result) status = report(result.error());
    });
}

}  // namespace stipple::app
