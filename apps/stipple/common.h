// What the subcommands share: options, backends, scenes from any input, errors to exit codes.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/stipple/options.h"
#include "apps/stipple/report.h"
#include "engine/base/executor.h"
#include "engine/base/result.h"
#include "engine/render/backend.h"
#include "engine/render/effects/request.h"
#include "engine/render/frame.h"
#include "engine/scene/camera.h"
#include "engine/scene/surfels.h"
#include "lod/builder/build.h"
#include "lod/store/store.h"

namespace stipple::app {

class BuildsOfScene;

/// Of `stipple build --patches`.
struct PatchBuildOptions {
    bool isAsked = false, fillGaps = false, overlap = false;
    double coneDegrees = 50;
    uint64_t samples = 0;  ///< 0: as many as there are vertices
    std::string texels = "auto";
};

struct BuildOptions {
    std::string memory = "2G", normals = "auto", radii = "auto", up, attributes = "none", temp, duplicates = "keep";
    std::string cacheLimit;  ///< of the cache of built scenes; empty: its default
    int threads = 0;
    bool skipBad = false, onlyPoints = false, allowOutside = false, dropOutliers = false;
    bool surfelWeights = false;  ///< of `stipple build`
    PatchBuildOptions patches;   ///< likewise
    bool repair = false;         ///< of former versions: what it did is always done
    double curveRadius = 0;
    uint64_t surfels = 0;
    std::string progress = "auto";
    Ranks* ranks = nullptr;                      ///< of an MPI job
    std::optional<lod::PointMaterial> material;  ///< of `stipple build`: stores of points have it
    std::shared_ptr<BuildsOfScene> together;     ///< of the scene that is opened: its builds show one progress
    lod::Leftovers leftovers = lod::Leftovers::goOn;
    void addTo(CLI::App& app);
    void addProgressTo(CLI::App& app);
    ProgressStyle progressStyle(bool isQuiet) const;
    void addOutliersTo(CLI::App& app);
    /// What render and view have beside what builds have.
    void addCacheTo(CLI::App& app);
    Result<lod::BuildSettings> settings() const;
    /// How scene files are read.
    scene::ReadSettings reading() const;
};
/// The material of points.
struct MaterialOptions {
    std::string name;
    std::optional<double> roughness, metallic;
    /// `of`: what they are, in the help.
    void addTo(CLI::App& app, const char* of);
    /// Nothing where none was asked for. Of a name, what is given beside it is instead of its own.
    std::optional<lod::PointMaterial> material() const;
    /// An error where it would not be seen.
    Result<void> check(const std::string& shade) const;
};
/// --allow-outside, and what former versions had for scene files.
void addSceneFileOptions(CLI::App& app, bool& allowOutside, bool& repair);

/// What the colours of the picture stand for.
struct ColourOptions {
    std::string what = "auto", map, range;
    bool legend = false;
    void addTo(CLI::App& app);
};

/// Light from a picture.
struct EnvironmentOptions {
    std::string path;
    double scale = 1;
    void addTo(CLI::App& app);
};

/// Needs light to be seen: it has no photographed colours of its own.
inline bool isShaded(const lod::StoreDescription& d) { return !d.hasColour || d.isReflectance; }
/// What `--shade` (auto, lit, unlit) means for points that are coloured like this. Auto: lit, unless a scan has its own
/// colours; of colours that stand for values, heights and categories, which stay what they are when lit.
bool isLit(const std::string& shade, const lod::StoreDescription& d, const lod::ColourBy& colour);

/// .gltf, .glb or .obj, unless the bytes are of another kind; what begins as a .glb whatever its name.
bool isSceneFile(const std::string& path);
/// Scans by the readers of lod; meshes as `surfels` samples (0: only the points that they hold).
Result<lod::PointSource> openInput(const std::string& path, const lod::ReadOptions& options, uint64_t surfels,
                                   const scene::ReadSettings& reading);
/// The images of a scene in at most half of `memoryBytes`. One that cannot be decoded counts as white (or flat), with a
/// line on standard error.
Result<std::vector<scene::DecodedImage>> decodeImages(const scene::Scene& scene, uint64_t memoryBytes);
/// Scans, or the triangles of one scene, to a store.
Result<lod::BuildReport> buildAny(const std::vector<std::string>& inputs, const std::string& output,
                                  const BuildOptions& build, Executor& executor, Progress& progress);

/// What a command draws: stores and where they stand.
struct OpenedScene {
    std::vector<render::PlacedStore> placed;
    std::vector<render::PlacedGroup> groups;
    lod::StoreDescription description;  ///< of all together: bounds, up, what colours can be asked for
    std::vector<render::WorldLight> lights;
    std::vector<scene::Camera> cameras;  ///< of the scene's visible nodes, in their order
    render::SceneWishes effects;         ///< that the scene file asks for
    std::vector<glm::dvec3> outline;     ///< points on the outside of what is dense: what a camera must see
};
/// Another up axis than the files': of heights, light and cameras.
void turnUp(OpenedScene& scene, lod::UpAxis up);

/// Could these be one scene, and are they there? Nothing is read.
Result<void> checkInputs(const std::vector<std::string>& inputs);

/// A .stipple file is opened; a .gltf or .glb scene is opened with the stores that its nodes refer to; anything else,
/// and the meshes of a scene, are built into the cache first (and found there the next time), with all attributes.
Result<OpenedScene> openScene(const std::vector<std::string>& inputs, const BuildOptions& build, Executor& executor,
                              bool showProgress);

/// Gives every store its colours; one that does not have what is asked for keeps its own. An error if none has it. The
/// result is for the legend.
Result<lod::ColourBy> applyColours(OpenedScene& scene, const std::string& what, const std::string& map,
                                   const std::string& range);

/// An HDR picture as light; null for an empty path. `hasMirrors`: the scene has something smooth.
Result<std::shared_ptr<const render::Environment>> openEnvironment(const EnvironmentOptions& options,
                                                                   uint64_t memoryBytes, Executor& executor,
                                                                   bool hasMirrors);

Result<std::unique_ptr<render::Backend>> makeBackend(const std::string& device, Executor& executor);
/// Every backend and device, one per line.
std::string listDevices();

Result<glm::dvec3> parseVector(const std::string& text, const char* option);
Result<glm::uvec2> parseSize(const std::string& text);

void setupBuild(CLI::App& app, int& status);
void setupCache(CLI::App& app, int& status);
void setupInfo(CLI::App& app, int& status);
void setupRender(CLI::App& app, int& status);
void setupView(CLI::App& app, int& status);
void setupCompare(CLI::App& app, int& status);
void setupGrow(CLI::App& app, int& status);
void setupConvert(CLI::App& app, int& status);
void setupStudy(CLI::App& app, int& status);
void setupSelfTest(CLI::App& app, int& status);

}  // namespace stipple::app
