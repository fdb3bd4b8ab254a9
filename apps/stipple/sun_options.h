// A sun that stands somewhere and casts shadows, on the command line.
#pragma once

#include <glm/glm.hpp>
#include <string>

#include "engine/base/result.h"
#include "engine/render/draw_list.h"

namespace CLI {
class App;
}  // namespace CLI

namespace stipple::app {

struct SunOptions {
    std::string sun;  ///< AZIMUTH,ELEVATION in degrees
    double size = 0;  ///< degrees

    void addTo(CLI::App& app);
    bool isGiven() const { return !sun.empty(); }
    /// Refuses what cannot be meant. `shade`: as --shade has it.
    Result<void> check(const std::string& shade) const;
    /// Adds the sun to the lights, and lights points; after check.
    void applyTo(render::DrawSettings& settings) const;
};

/// From the world towards a sun: clockwise from north (z-up: +y, y-up: -z), above the horizon, degrees.
glm::dvec3 towardsSun(double azimuth, double elevation, const glm::dvec3& up);

}  // namespace stipple::app
