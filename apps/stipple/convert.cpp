#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "apps/stipple/common.h"
#include "apps/stipple/convert_format.h"
#include "apps/stipple/convert_patches.h"
#include "apps/stipple/options.h"
#include "apps/stipple/outputs.h"
#include "engine/base/process.h"
#include "engine/scene/curve_fit.h"
#include "engine/scene/triangles.h"
#include "lod/builder/curves/curve_build.h"
#include "lod/builder/mesh/mesh_build.h"

namespace stipple::app {
namespace {
namespace fs = std::filesystem;

struct ConvertCommand {
    std::string input, output;
    bool curves = false, patches = false, json = false, force = false;
    PatchConversion asPatches;
    FormatConversion asFormat;
    BuildOptions build;  ///< of which reading the input uses some
    scene::CurveFitSettings fit;
};

/// The curves as lines with radii (and normals: ribbons), beside what is left of the scene.
void addLines(const lod::CurveSet& curves, scene::Scene& scene) {
    scene::Mesh mesh;
    mesh.name = "curves";
    mesh.primitives.resize(2);  // tubes, ribbons
    for (scene::Primitive& p : mesh.primitives) {
        p.kind = scene::PrimitiveKind::lines;
        p.material = -1;
    }
    for (size_t s = 0; s < curves.curves(); ++s) {
        const bool isRibbon = curves.isRibbon[s] != 0;
        scene::Primitive& p = mesh.primitives[isRibbon ? 1 : 0];
        for (uint32_t i = curves.first[s]; i < curves.first[s + 1]; ++i) {
            const auto at = static_cast<uint32_t>(p.position.size());
            p.position.emplace_back(curves.position[i]);
            p.radius.push_back(curves.radius[i]);
            if (isRibbon) p.normal.push_back(glm::normalize(curves.normal[i]));
            const auto channel = [&](uint32_t shift) {
                return shared::linearFromSrgb(static_cast<float>(curves.colour[i] >> shift & 255u) / 255.0f);
            };
            p.colour.emplace_back(channel(0), channel(8), channel(16), 1);
            if (i > curves.first[s]) p.indices.insert(p.indices.end(), {at - 1, at});
        }
    }
    std::erase_if(mesh.primitives, [](const scene::Primitive& p) { return p.indices.empty(); });
    if (mesh.primitives.empty()) return;
    scene.meshes.push_back(std::move(mesh));
    scene::Node node;
    node.name = "curves";
    node.mesh = static_cast<int>(scene.meshes.size()) - 1;
    scene.nodes.push_back(std::move(node));
}

/// What a glTF file may hold: no empty primitives and meshes, normals of length 1 (OBJ files have others).
void tidy(scene::Scene& scene) {
    std::vector<int> number;
    std::vector<scene::Mesh> kept;
    for (scene::Mesh& mesh : scene.meshes) {
        std::erase_if(mesh.primitives, [](const scene::Primitive& p) { return p.indices.empty(); });
        for (scene::Primitive& p : mesh.primitives)
            for (glm::vec3& n : p.normal) n = glm::length(n) > 1e-6f ? glm::normalize(n) : glm::vec3(0, 1, 0);
        number.push_back(mesh.primitives.empty() ? -1 : static_cast<int>(kept.size()));
        if (!mesh.primitives.empty()) kept.push_back(std::move(mesh));
    }
    scene.meshes = std::move(kept);
    for (scene::Node& node : scene.nodes)
        if (node.mesh >= 0) {
            node.mesh = number[static_cast<size_t>(node.mesh)];
            if (node.mesh < 0 && node.store.empty()) node.instances.clear();
        }
}

/// What is written beside a store, which holds one kind: the triangles that are left, and a scene that has both.
struct Beside {
    explicit Beside(const std::string& store)
        : rest(fs::path(store).replace_extension(".rest.glb").string()),
          scene(fs::path(store).replace_extension(".scene.glb").string()) {}
    std::string rest, scene;
};

/// What belongs to the one is of no use to the other.
Result<void> checkAsked(const ConvertCommand& o, const CLI::App& sub) {
    const bool isFormat = !o.curves && !o.patches && isWritten(o.output);
    if (o.curves == o.patches && !isFormat)
        return fail(
            ErrorKind::usage, o.curves ? "are two things to convert to" : "says nothing of what to convert to",
            o.curves ? "--curves and --patches" : "stipple convert",
            fmt::format("give --curves: polygon plants become ribbons and tubes, or --patches: a scan or a mesh "
                        "becomes elevation patches; or name an output of another format ({})",
                        writtenEndings()));
    using Names = std::vector<const char*>;
    const std::string toOthers = writtenEndings();
    const auto refuse = [&](const Names& names, const std::string& of) -> Result<void> {
        for (const char* name : names)
            if (sub.count(name) > 0) return fail(ErrorKind::usage, "belongs to " + of, name);
        return {};
    };
    if (!o.patches) STIPPLE_TRY(refuse({"--cone", "--fill-gaps", "--overlap", "--patch-samples"}, "--patches"));
    if (o.curves) STIPPLE_TRY(refuse({"--only-points", "--threads"}, "--patches"));
    if (!o.curves) STIPPLE_TRY(refuse({"--tolerance", "--joints"}, "--curves"));
    if (!isFormat) STIPPLE_TRY(refuse({"--voxel"}, "outputs of other formats: " + toOthers));
    return {};
}

Result<void> run(const ConvertCommand& o) {
    if (!scene::isSceneFile(o.input))
        return fail(ErrorKind::usage, "is not read by convert, which takes polygon plants as .gltf, .glb or .obj",
                    o.input, "other files are drawn as they are: stipple render, stipple view");
    const std::string extension = fs::path(o.output).extension().string();
    if (extension != ".stipple" && extension != ".glb" && extension != ".gltf")
        return fail(ErrorKind::usage, "is neither a store nor a scene", o.output, "write to .stipple, .glb or .gltf");
    const bool isStore = extension == ".stipple";
    const Beside beside(o.output);
    std::vector<Output> outputs{{o.output, isStore ? OutputKind::store : OutputKind::other}};
    if (isStore) outputs.insert(outputs.end(), {{beside.rest}, {beside.scene}});
    STIPPLE_TRY(checkOutputs(outputs, {o.input}, o.force));
    catchStopSignals();
    const double start = nowSeconds();
    const auto executor = makeTbbExecutor(0);
    STIPPLE_ASSIGN(const scene::Scene scene, scene::readScene(o.input, o.build.reading()));
    STIPPLE_ASSIGN(const std::vector<scene::DecodedImage> images,
                   scene::decodeImages(scene, o.build.reading().memoryBytes, printLine));
    scene::CurveFit fit = scene::fitCurves(scene, images, o.fit, *executor);
    STIPPLE_TRY(checkStopped(o.output));
    if (fit.trianglesIn == 0) return fail(ErrorKind::input, "holds no triangles", o.input);
    tidy(fit.rest);
    const bool hasCurves = fit.curves.curves() > 0;
    std::vector<std::string> written;
    if (!isStore) {
        addLines(fit.curves, fit.rest);
        STIPPLE_TRY(scene::writeGltf(fit.rest, o.output));
        written.push_back(o.output);
    } else {
        if (!hasCurves) return fail(ErrorKind::input, "has no part that looks like a ribbon or a tube", o.input);
        Progress progress(true);
        lod::CurveBuildSettings settings;
        settings.description.source = fs::path(o.input).filename().string();
        settings.limits.isStopped = isStopRequested;
        STIPPLE_TRY(lod::buildCurveStore(lod::sourceOf(lod::cleanCurves(fit.curves, 0)), o.output, settings, *executor,
                                         progress));
        written.push_back(o.output);
        if (fit.trianglesLeft > 0) {
            STIPPLE_TRY(scene::writeGltf(fit.rest, beside.rest));
            scene::Scene all = fit.rest;
            scene::Node node;
            node.name = "curves";
            node.store = fs::path(o.output).filename().string();
            all.nodes.push_back(node);
            STIPPLE_TRY(scene::writeGltf(all, beside.scene));
            written.push_back(beside.rest);
            written.push_back(beside.scene);
        }
    }
    if (o.json) {
        printJson(
            "convert",
            {{"triangles", fit.trianglesIn},
             {"triangles_left", fit.trianglesLeft},
             {"ribbons", fit.ribbons},
             {"tubes", fit.tubes},
             {"segments", fit.curves.position.size() - fit.curves.curves()},
             {"deviation", {{"mean", fit.meanDeviation}, {"p95", fit.p95Deviation}, {"largest", fit.largestDeviation}}},
             {"written", written},
             {"seconds", nowSeconds() - start}});
        return {};
    }
    fmt::print("{}: {} triangles became {} ribbons and {} tubes ({} segments); {} triangles are left\n", o.input,
               fit.trianglesIn, fit.ribbons, fit.tubes, fit.curves.position.size() - fit.curves.curves(),
               fit.trianglesLeft);
    fmt::print(
        "  from the mesh to its curves: {:.3g} on average, {:.3g} for 95 %, {:.3g} at most (units of the file)\n",
        fit.meanDeviation, fit.p95Deviation, fit.largestDeviation);
    for (const std::string& path : written) fmt::print("  {}\n", path);
    return {};
}

}  // namespace

void setupConvert(CLI::App& app, int& status) {
    auto o = std::make_shared<ConvertCommand>();
    CLI::App* sub = app.add_subcommand("convert",
                                       "polygon plants to ribbons and tubes, scans and meshes to patches or "
                                       "to other formats");
    sub->add_option("INPUT", o->input,
                    "the plant (.gltf, .glb, .obj); of patches: a scan or a mesh; to other formats: also a built scene")
        ->required();
    sub->add_option("-o,--output", o->output,
                    "the file to write (.stipple: what is neither ribbon nor tube goes to NAME.rest.glb beside it, and "
                    "NAME.scene.glb shows both; .glb or .gltf: lines with radii; of other formats: " +
                        writtenEndings() + ")")
        ->type_name("FILE")
        ->required();
    addForce(*sub, o->force);
    sub->add_flag("--curves,--strands", o->curves,
                  "leaves and blades become ribbons, branches tubes; what is neither is kept");
    sub->add_option("--tolerance", o->fit.tolerance, "how far a part may be from its curve, share of its own width")
        ->transform(within(0.01, 2.0))
        ->capture_default_str();
    sub->add_option("--joints", o->fit.joints, "segments of a curve at most")
        ->transform(within(2, 1000))
        ->capture_default_str();
    addPatchOptions(*sub, o->patches, o->asPatches);
    addFormatOptions(*sub, o->asFormat);
    sub->add_option("--memory", o->build.memory, "memory that reading the input may use, bytes: 512M, 4G")
        ->check(bytes())
        ->type_name("SIZE")
        ->capture_default_str();
    addSceneFileOptions(*sub, o->build.allowOutside, o->build.repair);
    sub->add_flag("--json", o->json, "print what became of it as JSON (stipple help json)");
    sub->callback([o, sub, &status] {
        Result<void> result = checkAsked(*o, *sub);
        if (result && o->patches) {
            PatchConversion& p = o->asPatches;
            p.input = o->input;
            p.output = o->output;
            p.json = o->json;
            p.force = o->force;
            p.build.memory = o->build.memory;
            p.build.allowOutside = o->build.allowOutside;
            result = convertToPatches(p);
        } else if (result && !o->curves) {
            FormatConversion& f = o->asFormat;
            f.input = o->input;
            f.output = o->output;
            f.json = o->json;
            f.force = o->force;
            f.build.memory = o->build.memory;
            f.build.allowOutside = o->build.allowOutside;
            f.build.onlyPoints = o->asPatches.build.onlyPoints;
            result = convertToFormat(f);
        } else if (result) {
            result = run(*o);
        }
        if (!result) status = report(result.error());
    });
}

}  // namespace stipple::app
