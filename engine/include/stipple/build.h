// From raw inputs, or points of one's own, to a .stipple file: out of core, resumable, the same bytes for any number of
// threads.
#pragma once

#include <stipple/progress.h>
#include <stipple/result.h>
#include <stipple/view.h>

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

namespace stipple::v1 {

struct BuildSettings {
    uint64_t memoryBytes = uint64_t{2} << 30;  ///< never needs more; refuses if it would have to
    std::string temporary;                     ///< folder for what does not fit; empty: beside the output
    unsigned threads = 0;                      ///< 0: all cores
    bool estimateNormals = true;               ///< of points that have none
    bool estimateRadii = true;                 ///< likewise
    uint64_t surfels = 0;                      ///< above 0: meshes of glTF and OBJ as so many points
    bool skipBad = false;                      ///< go on past corrupt chunks and files, and count what is lost
    Listener listener;
};

struct BuildReport {
    std::string primitive;                           ///< what is counted: point, triangle or segment
    uint64_t in = 0, kept = 0;                       ///< in + added = kept + dropped
    std::map<std::string, uint64_t> added, dropped;  ///< by reason
    uint64_t records = 0;                            ///< of all levels
    uint64_t nodes = 0, bytes = 0;                   ///< of the file
    double seconds = 0;
    std::vector<std::string> notes;
};

/// `inputs`: scans (LAS, LAZ, PLY, folders of them), curves, or one scene with meshes (glTF, OBJ). `store` is written
/// whole or not at all; what is there is replaced.
STIPPLE_API Result<BuildReport> build(const std::vector<std::string>& inputs, const std::string& store,
                                      const BuildSettings& settings = {});

/// Bytes in memory that stand for a file. They are the caller's, and stay as they are while a build runs.
struct Bytes {
    std::string name;  ///< "scan.ply": for messages; its ending says the format where the bytes do not
    const void* data = nullptr;
    uint64_t count = 0;
};

/// What a scene names: buffers, textures, MTL. `name` is as the scene has it, decoded ("textures/a b.png"), or a URL.
using Resolve = std::function<Result<std::vector<uint8_t>>(const std::string& name)>;

/// The same of inputs in memory: points (LAS, LAZ, PLY), triangles (PLY), curves, or one scene with meshes. No file is
/// read for them: what a scene names and `resolve` does not give is missing. The store has the bytes that it would have
/// of files of these names. A build that was interrupted begins anew.
STIPPLE_API Result<BuildReport> buildBytes(const std::vector<Bytes>& inputs, const std::string& store,
                                           const BuildSettings& settings = {}, const Resolve& resolve = {});

/// A run of points. Arrays are empty (absent) or as long as `position`.
struct Points {
    std::vector<Vec3> position;
    std::vector<std::array<float, 3>> normal;    ///< any length; zero: none
    std::vector<float> radius;                   ///< world units
    std::vector<std::array<uint8_t, 3>> colour;  ///< sRGB
};

/// Points that come from anywhere. They are read more than once, each part from its start, several parts at a time,
/// by threads of the library, and must be the same each time.
struct PointSource {
    std::string name = "points";  ///< for messages
    std::vector<uint64_t> parts;  ///< how many points each has
    bool hasNormal = false, hasRadius = false, hasColour = false;
    Vec3 up{0, 0, 1};  ///< one of the axes
    /// Fills `to` with points [first, first + count) of a part.
    std::function<Result<void>(size_t part, uint64_t first, uint64_t count, Points& to)> read;
};

STIPPLE_API Result<BuildReport> buildPoints(const PointSource& source, const std::string& store,
                                            const BuildSettings& settings = {});

}  // namespace stipple::v1
