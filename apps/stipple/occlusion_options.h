// How far ambient occlusion looks, and how finely.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "engine/render/draw_list.h"
#include "lod/store/store.h"

namespace stipple::app {

struct OcclusionOptions {
    double radius = 0;  ///< world units; 0: by the scene
    std::string resolution = "half";
    void addTo(CLI::App& sub);
    render::Occlusion of(const lod::StoreDescription& scene) const;
};

}  // namespace stipple::app
