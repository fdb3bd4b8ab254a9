// Glass, what is transparent, and what else reflects more or less than most, is drawn after all else, body by body, the
// farthest first:
//
//     what is opaque -> picture 0 -> body 1, through which picture 0 is seen -> picture 1 -> body 2 ... -> picture n
//
// Of what is transparent (Optics::blends, --opacity) a layer is a picture of its own, put over the one behind by its
// alpha: coverage times opacity. What of it is opaque (kOpaque) is drawn with all else, and hides what of the same body
// is behind it; of the rest the nearest is seen.
//
// Each is an ordinary frame of the backend, of those nodes of the cut that are of it, in the mode of the frame; a body
// that is seen through twice (kRefractObject) is drawn once more from behind, in parallel rays. A scene without such
// materials has one frame, as ever: none of the passes, tables and pictures below.
#pragma once

#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "engine/base/executor.h"
#include "engine/render/backend.h"
#include "lod/store/store.h"
#include "shaders/shared/optics.h"

namespace stipple::render {

/// Optics in world units.
struct WorldOptic {
    double transmission = 0, ior = 1.5, thickness = 0;
    glm::dvec3 absorption{0}, straightOn{0.04};
    double most = 1;
};

/// How much light a world unit takes away, of red, green and blue: the exponent's factor, at most 1e30, so that it is a
/// float's whatever the file says and no way takes nothing away (infinity times zero would be no number). `scale`:
/// world units of a unit of the store.
glm::dvec3 absorptionInWorld(const lod::Optics& o, double scale);

/// One layer, and what is seen through it; world space.
struct LayerInput {
    uint32_t way = shared::kRefractEnvironment;
    std::vector<WorldOptic> optics;  ///< the first is of what has none
    uint32_t pointOptic = 0;         ///< of its points and curves
    double plainRoughness = 1;
    const Image* behind = nullptr;  ///< with depths; null: nothing
    const Image* back = nullptr;    ///< from behind, by `backView`, with depths and normals; null: not known
    lod::View backView;
    glm::dvec3 bodyCentre{0};
    double bodyRadius = 0;
    Executor* executor = nullptr;  ///< what the tables of its pixels are made on; null: the calling thread
};

/// The same for shaders.
struct LayerTables {
    shared::LayerConstants constants{};
    std::vector<shared::Optic> optics;
    std::vector<float> behind, back;
};
/// `out`: its view and eye are set.
void fillLayer(const LayerInput& layer, const DrawList& out, LayerTables& tables);

/// Of one store, what of it is drawn in layers.
struct OpticsOf {
    bool hasAny = false;       ///< some material is
    bool transmits = false;    ///< ... and lets light through
    bool isWhole = false;      ///< all are, and let it through
    bool isSolid = false;      ///< none of them is a thin wall
    bool isPlainMesh = false;  ///< has no material of its own
    uint32_t points = 0;       ///< of its points and curves: which of Appearance::optics
    bool blends = false;       ///< what is behind some of it shows through ...
    float opacity = 1;         ///< ... and as far through all of it
    bool isGlass = false;      ///< some of it is of Appearance::optics
};

/// The materials of all stores of a scene as a frame shows them.
struct Appearance {
    std::optional<uint32_t> pointMaterial;  ///< these two are what it was made of
    std::optional<lod::Optics> given;
    bool transparency = true;
    float opacity = 1;
    std::vector<shared::SurfaceMaterial> shown, cutOut;  ///< the second without those of layers
    std::vector<lod::Optics> optics;                     ///< kMostOptics different ones at most, behind a plain one
    std::vector<OpticsOf> hierarchies;
    bool hasLayers = false;
};
/// `materials`: of all stores, one after another. Optics beyond kMostOptics become the nearest of those before them.
Appearance makeAppearance(std::span<const std::shared_ptr<const lod::Store>> stores,
                          const std::vector<shared::SurfaceMaterial>& materials, const DrawSettings& settings);

/// A body in the world.
struct Body {
    glm::dvec3 centre{0};
    double radius = 0;    ///< of a sphere around it
    double thinnest = 0;  ///< edge of its box
};
Body bodyOf(const lod::StoreDescription& description, const lod::Instance& instance);

/// One layer of a cut.
struct LayerDraw {
    std::vector<uint32_t> instances;  ///< ascending; one, unless there are too many; points and others never together
    bool isSeenTwice = false;         ///< by kRefractObject
    bool transmits = true;            ///< light goes through some of it
    bool blends = false, isGlass = false;
    float opacity = 1;  ///< of all of it
    double distance = 0;
};
/// Shares of opacity from which on something is opaque, and below which it is not there.
inline constexpr float kOpaque = 511.0f / 512, kLeastOpacity = 0.5f / 255;
inline constexpr size_t kMostBodies = 8;  ///< nearer ones; those beyond are one layer, and one of points
/// What of a cut is drawn in layers, the farthest first; what only reflects otherwise than most is the first of them.
std::vector<LayerDraw> layersOf(const lod::Cut& cut, std::span<const lod::Instance> instances,
                                std::span<const std::shared_ptr<const lod::Store>> stores, const Appearance& appearance,
                                const lod::View& view, const DrawSettings& settings);

/// A view from behind, away from the eye, that holds the whole body at about as many pixels as `view` has of it.
lod::View viewFromBehind(const Body& body, const lod::View& view);

/// The layer over the picture of what is behind it, into `behind`: the layer's coverage counts, times `opacity`. Where
/// both are there the nearer is seen; depth and normal stay those behind where less than half of the layer is seen.
/// `background`: linear, of both.
void putLayer(const Image& layer, const glm::vec3& background, float opacity, Image& behind, Executor& executor);

/// White, rough, without textures: a mesh that says nothing of its material.
bool isPlainMesh(const lod::StoreDescription& description);

/// What is smoother than the environment's usual maps show (Environment::sharpEdge).
bool hasMirrors(const lod::StoreDescription& description);

}  // namespace stipple::render
