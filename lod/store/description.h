// What a store says of itself beside its node table: kept as JSON text in the file.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <map>
#include <string>
#include <vector>

#include "lod/primitives/primitives.h"
#include "shaders/shared/material.h"

namespace stipple::lod {

/// What a store of patches holds at its finest level.
struct PatchCounts {
    uint64_t patches = 0, samples = 0;
    uint64_t left = 0, discs = 0;  ///< of the input, what no patch stands for, and what is drawn for that
};

struct StoreDescription {
    double metresPerUnit = 1;
    glm::dvec3 up{0, 0, 1};  ///< unit length
    Crs crs;
    std::vector<AttributeInfo> attributes;  ///< streams that every chunk has
    double lowHeight = 0, highHeight = 0;   ///< 2nd and 98th percentile of dot(up, position), world units
    uint64_t points = 0;                    ///< leaf records: the points of the input that were kept
    uint64_t records = 0;                   ///< all records, coarse levels included
    double roundingUnits = 0;               ///< largest rounding of a coordinate to the lattice, world units; 0: exact
    glm::dvec3 boundsMin{0}, boundsMax{0};  ///< of the points, world units
    glm::dvec3 focusMin{0}, focusMax{0};    ///< the same without stray points: what a camera looks at first
    bool hasColour = false;                 ///< the points have colours of their own
    bool isReflectance = false;             ///< those are of the material, to be lit
    bool isCurves = false;                  ///< ribbons and tubes: points count segments
    bool isRigid = false;                   ///< wind does not bend it: curves of what is no plant
    bool isStochastic = false;              ///< see Hierarchy::isStochastic
    std::vector<float> discFactors;         ///< of a stochastic store, see Hierarchy
    double smallestDisc = 0;                ///< world units
    bool hasNormals = false;                ///< from the file or estimated
    std::vector<shared::SurfaceMaterial> materials;  ///< of a mesh store
    std::vector<Optics> optics;                      ///< of each of `materials`; empty: all are plain
    std::vector<PointMaterial> pointMaterials;       ///< see materials.h
    uint64_t pointsIn = 0;                           ///< that the input declares; 0: not told
    std::map<std::string, uint64_t> dropped, added;  ///< reason -> points: pointsIn + added = points + dropped
    PatchCounts patches;
    std::string source;  ///< file names of the input, without folders
};

std::string describeAsText(const StoreDescription& description);
/// Throws std::exception if the text is not what describeAsText writes.
StoreDescription descriptionFromText(const std::string& text);

}  // namespace stipple::lod
