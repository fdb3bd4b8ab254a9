// What a study draws: every scene at every size from every camera, in every mode at every error asked for.
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "apps/study/audit/full_detail.h"
#include "engine/render/environment.h"
#include "engine/render/frame.h"
#include "engine/scene/camera.h"

namespace stipple::study {

/// One camera of a path.
struct PathView {
    std::string path;  ///< "orbit", "dolly", "fly-through", "grazing", or the name of the user's own
    uint32_t number = 0;
    scene::Camera camera;
};

/// What is studied, and how it looks.
struct StudyScene {
    std::string name;    ///< for a person: the file's, without its folders
    std::string source;  ///< the file of points that it was built from; empty: it is of something else
    /// Of the mesh that a store of patches was built from, which pictures are audited against instead of its leaves;
    /// and what it is called. Empty: leaves.
    std::vector<FullTriangle> against;
    std::string againstName;
    uint64_t hash = 0;  ///< of the content of all stores and where they stand
    std::vector<render::PlacedStore> placed;
    std::vector<render::PlacedGroup> groups;
    std::vector<glm::dvec3> outline;  ///< points on the outside
    glm::dvec3 up{0, 0, 1};
    double nearPlane = 1e-6;
    uint64_t records = 0, storeBytes = 0;
    render::DrawSettings draw;
    std::vector<PathView> views;
};

struct StudySettings {
    std::string output;
    std::vector<glm::uvec2> sizes;
    std::vector<render::Mode> modes;
    std::vector<double> targets;  ///< px, ascending
    /// Records drawn at most, ascending: what the first mode shows of the smallest of `targets` within them.
    std::vector<uint64_t> budgets;
    uint32_t blocks = 6, frames = 3;
    uint32_t samples = 3;       ///< rays a pixel along each axis, of the traced truth
    uint32_t smallHeight = 90;  ///< px, of pictures that implementations are compared at
    size_t auditShapes = 30'000'000;
    uint64_t seed = 1;
    uint64_t residentBytes = uint64_t{1} << 30;
};

inline constexpr uint64_t kAllRecords = std::numeric_limits<uint64_t>::max();

/// A frame that is studied.
struct Cell {
    uint32_t scene = 0, size = 0, view = 0;
    render::Mode mode = render::Mode::surface;
    double target = 1;
    uint64_t records = kAllRecords;  ///< drawn at most
    bool hasBudget() const { return records != kAllRecords; }
};

/// In the order of their numbers: of one scene, size and view all together, cellsOfView of them.
std::vector<Cell> cellsOf(const std::vector<StudyScene>& scenes, const StudySettings& settings);
size_t cellsOfView(const StudySettings& settings);

/// The order in which a block draws its cells: any, the same for the same seed.
std::vector<uint32_t> orderOf(size_t cells, uint32_t block, uint64_t seed);

lod::View viewOf(const StudyScene& scene, const glm::uvec2& size, uint32_t view);
/// The same picture, smaller.
lod::View smallViewOf(const StudyScene& scene, const glm::uvec2& size, uint32_t view, uint32_t height);

/// What a study is of, as text: a folder holds one, and another is told from it.
std::string describePlan(const std::vector<StudyScene>& scenes, const StudySettings& settings);

}  // namespace stipple::study
