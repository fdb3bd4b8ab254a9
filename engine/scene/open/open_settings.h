// How inputs are read, and how what is not built yet is built, on the way to a scene that can be drawn.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "engine/base/process.h"
#include "engine/base/progress.h"
#include "engine/base/result.h"
#include "engine/scene/read_settings.h"
#include "lod/builder/build.h"
#include "lod/import/formats.h"

namespace stipple::scene {

class BuildsOfScene;

/// A line for a person: notes begin with "note: ". Empty: nobody is told.
using Say = std::function<void(const std::string& line)>;

/// Sizes are bytes ("512M", "2G"); words are those of `stipple build`, which says what they mean.
struct OpenSettings {
    std::string memory = "2G", normals = "auto", radii = "auto", up, attributes = "none", temp, duplicates = "keep";
    std::string grid;        ///< of files that hold several: the one that is wanted; empty: all
    std::string cacheLimit;  ///< of the cache of built scenes; empty: its default
    int threads = 0;
    bool skipBad = false, onlyPoints = false, allowOutside = false, dropOutliers = false;
    bool surfelWeights = false;  ///< only where a store is built to a file
    double curveRadius = 0;
    uint64_t surfels = 0;
    Ranks* ranks = nullptr;                      ///< of an MPI job
    std::optional<lod::PointMaterial> material;  ///< of stores of points that are built to a file
    std::shared_ptr<BuildsOfScene> together;     ///< of the scene that is opened: its builds show one progress
    lod::Leftovers leftovers = lod::Leftovers::goOn;
    std::function<bool()> isStopped = isStopRequested;  ///< of builds and conversions
    Say say;                                            ///< notes
    Say loss;  ///< what is left out of a scene, which is to be told where notes are not wanted, too
    ProgressStyle progressStyle = ProgressStyle::silent;
    ProgressCall onProgress;                                          ///< beside that
    std::shared_ptr<lod::Kept> kept = std::make_shared<lod::Kept>();  ///< see FormatOptions

    Result<lod::BuildSettings> settings() const;
    /// How scene files are read.
    ReadSettings reading() const;
    /// How files of the formats in the table are.
    lod::FormatOptions formatOptions() const;
};

/// What all builds of one scene tell.
void say(const OpenSettings& to, const std::string& line);

/// .gltf, .glb or .obj, unless the bytes are of another kind; what begins as a .glb whatever its name.
bool isSceneFile(const std::string& path);

}  // namespace stipple::scene
