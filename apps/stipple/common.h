// What the subcommands share: options, backends, scenes from any input, errors to exit codes.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "engine/base/executor.h"
#include "engine/base/result.h"
#include "engine/render/backend.h"
#include "engine/render/frame.h"
#include "engine/scene/camera.h"
#include "engine/scene/surfels.h"
#include "lod/build/build.h"
#include "lod/store.h"

namespace stipple::app {

/// Thrown nowhere: a command returns its exit code; this prints the error's line and gives its code.
int report(const Error& error);

struct BuildOptions {
    std::string memory = "2G", normals = "auto", radii = "auto", up, attributes = "none", temp, duplicates = "keep";
    std::string cacheLimit;  ///< of the cache of built scenes; empty: its default
    int threads = 0;
    bool skipBad = false, onlyPoints = false, repair = false, dropOutliers = false;
    double strandRadius = 0;
    uint64_t surfels = 0;
    Ranks* ranks = nullptr;  ///< of an MPI job
    void addTo(CLI::App& app);
    void addOutliersTo(CLI::App& app);
    /// What render and view have beside what builds have.
    void addCacheTo(CLI::App& app);
    Result<lod::BuildSettings> settings() const;
};

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

/// What `--shade auto` does: lit, unless a scan has its own colours.
inline bool isShaded(const lod::StoreDescription& d) { return !d.hasColour || d.isReflectance; }

/// .gltf, .glb or .obj.
bool isSceneFile(const std::string& path);
/// Scans by the readers of lod; meshes as `surfels` samples (0: only the points that they hold).
Result<lod::PointSource> openInput(const std::string& path, const lod::ReadOptions& options, uint64_t surfels,
                                   bool repair);
Result<std::vector<scene::DecodedImage>> decodeImages(const scene::Scene& scene);
/// Scans, or the triangles of one scene, to a store.
Result<lod::BuildReport> buildAny(const std::vector<std::string>& inputs, const std::string& output,
                                  const BuildOptions& build, Executor& executor, Progress& progress);

/// What a command draws: stores and where they stand.
struct OpenedScene {
    std::vector<render::PlacedStore> placed;
    std::vector<render::PlacedCrowd> crowds;
    lod::StoreDescription description;  ///< of all together: bounds, up, what colours can be asked for
    std::vector<render::WorldLight> lights;
    std::vector<scene::Camera> cameras;  ///< of the scene's visible nodes, in their order
};

/// A .stipple file is opened; a .gltf or .glb scene is opened with the stores that its nodes refer to; anything else,
/// and the meshes of a scene, are built into the cache first (and found there the next time), with all attributes.
Result<OpenedScene> openScene(const std::vector<std::string>& inputs, const BuildOptions& build, Executor& executor,
                              bool showProgress);

/// Gives every store its colours; one that does not have what is asked for keeps its own. An error if none has it. The
/// result is for the legend.
Result<lod::ColourBy> applyColours(OpenedScene& scene, const std::string& what, const std::string& map,
                                   const std::string& range);

/// An HDR picture as light; null for an empty path.
Result<std::shared_ptr<const render::Environment>> openEnvironment(const std::string& path, double scale,
                                                                   Executor& executor);

Result<std::unique_ptr<render::Backend>> makeBackend(const std::string& device, Executor& executor);
/// Every backend and device, one per line.
std::string listDevices();

Result<glm::dvec3> parseVector(const std::string& text, const char* option);
Result<glm::uvec2> parseSize(const std::string& text);
/// Numbers as JSON: infinity has no number there, so it becomes the string "inf".
nlohmann::json jsonNumber(double value);

void setupBuild(CLI::App& app, int& status);
void setupCache(CLI::App& app, int& status);
void setupInfo(CLI::App& app, int& status);
void setupRender(CLI::App& app, int& status);
void setupView(CLI::App& app, int& status);
void setupCompare(CLI::App& app, int& status);
void setupGrow(CLI::App& app, int& status);
void setupConvert(CLI::App& app, int& status);

}  // namespace stipple::app
