// Any input to a scene that can be drawn: built scenes, scenes of placed stores and meshes, raw files through the
// cache.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "engine/base/executor.h"
#include "engine/base/result.h"
#include "engine/render/backdrop.h"
#include "engine/render/effects/request.h"
#include "engine/render/environment.h"
#include "engine/render/frame.h"
#include "engine/scene/camera.h"
#include "engine/scene/open/open_settings.h"
#include "engine/scene/surfels.h"
#include "lod/builder/build.h"
#include "lod/store/colour.h"
#include "lod/store/store.h"

namespace stipple::scene {

/// Scans by the readers of lod; meshes as `surfels` samples (0: only the points that they hold).
Result<lod::PointSource> openInput(const std::string& path, const lod::ReadOptions& options, uint64_t surfels,
                                   const ReadSettings& reading, const Say& say = {},
                                   const lod::FormatOptions& more = {});
/// The images of a scene in at most half of `memoryBytes`. One that cannot be decoded counts as white (or flat), and
/// `say` is told so, once.
Result<std::vector<DecodedImage>> decodeImages(const Scene& scene, uint64_t memoryBytes, const Say& say = {});
/// Scans, or the triangles of one scene, to a store.
Result<lod::BuildReport> buildAny(const std::vector<std::string>& inputs, const std::string& output,
                                  const OpenSettings& build, Executor& executor, Progress& progress);

/// Stores and where they stand, and what else their files say.
struct OpenedScene {
    std::vector<render::PlacedStore> placed;
    std::vector<render::PlacedGroup> groups;
    lod::StoreDescription description;  ///< of all together: bounds, up, what colours can be asked for
    std::vector<render::WorldLight> lights;
    std::vector<Camera> cameras;      ///< of the scene's visible nodes, in their order
    render::SceneWishes effects;      ///< that the scene file asks for
    std::vector<glm::dvec3> outline;  ///< points on the outside of what is dense: what a camera must see
};
/// Another up axis than the files': of heights, light and cameras.
void turnUp(OpenedScene& scene, lod::UpAxis up);

/// Could these be one scene, and are they there? Nothing is read.
Result<void> checkInputs(const std::vector<std::string>& inputs);

/// A .stipple file is opened; a .gltf or .glb scene is opened with the stores that its nodes refer to; anything else,
/// and the meshes of a scene, are built into the cache first (and found there the next time), with all attributes.
Result<OpenedScene> openScene(const std::vector<std::string>& inputs, const OpenSettings& build, Executor& executor);

/// Distance before which nothing is drawn, world units.
double nearPlaneOf(const OpenedScene& opened);

/// Needs light to be seen: it has no photographed colours of its own.
inline bool isShaded(const lod::StoreDescription& d) { return !d.hasColour || d.isReflectance; }

/// What `--shade` (auto, lit, unlit) means for points that are coloured like this. Auto: lit, unless a scan has its own
/// colours; of colours that stand for values, heights and categories, which stay what they are when lit.
bool isLit(const std::string& shade, const lod::StoreDescription& d, const lod::ColourBy& colour);

/// Gives every store its colours; one that does not have what is asked for keeps its own. An error if none has it. The
/// result is for the legend. `what`, `map`, `range`: as lod::parseColourBy has them.
Result<lod::ColourBy> applyColours(OpenedScene& scene, const std::string& what, const std::string& map,
                                   const std::string& range);

/// An HDR picture as light; null for an empty path. `hasMirrors`: the scene has something smooth.
Result<std::shared_ptr<const render::Environment>> openEnvironment(const std::string& path, double scale,
                                                                   uint64_t memoryBytes, Executor& executor,
                                                                   bool hasMirrors);
/// The same as what is seen behind everything.
Result<std::shared_ptr<const render::Backdrop>> openBackdrop(const std::string& path, double scale,
                                                             uint64_t memoryBytes, Executor& executor);

}  // namespace stipple::scene
