// What the subcommands share: options, backends, scenes from any input, errors to exit codes.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/stipple/report.h"
#include "engine/api/devices.h"
#include "engine/base/executor.h"
#include "engine/base/result.h"
#include "engine/render/backend.h"
#include "engine/render/effects/request.h"
#include "engine/render/frame.h"
#include "engine/scene/open/open_scene.h"
#include "lod/builder/build.h"
#include "lod/store/store.h"

namespace CLI {
class App;
}  // namespace CLI

namespace stipple::app {

using scene::OpenedScene;
using scene::OpenSettings;

/// Of `stipple build --patches`.
struct PatchBuildOptions {
    bool isAsked = false, fillGaps = false, overlap = false;
    double coneDegrees = 50;
    uint64_t samples = 0;  ///< 0: as many as there are vertices
    std::string texels = "auto";
};

struct BuildOptions : OpenSettings {
    PatchBuildOptions patches;  ///< of `stipple build`
    bool repair = false;        ///< of former versions: what it did is always done
    std::string progress = "auto";
    void addTo(CLI::App& app);
    void addProgressTo(CLI::App& app);
    ProgressStyle styleOf(bool isQuiet) const;
    void addOutliersTo(CLI::App& app);
    /// What render and view have beside what builds have.
    void addCacheTo(CLI::App& app);
    /// The same, whose notes and progress go to standard error.
    OpenSettings told(bool isQuiet) const;
    /// --only-points and --grid.
    void addFormatsTo(CLI::App& app);
    void addGridTo(CLI::App& app);
};
/// To standard error.
void printLine(const std::string& line);
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
