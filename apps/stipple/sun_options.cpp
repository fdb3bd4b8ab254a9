#include "apps/stipple/sun_options.h"

#include <array>
#include <charconv>
#include <cmath>
#include <optional>

#include "apps/stipple/options.h"

namespace stipple::app {
namespace {

constexpr double kPi = 3.14159265358979323846;

std::optional<std::array<double, 2>> anglesOf(const std::string& text) {
    std::array<double, 2> angles{};
    const char* at = text.data();
    const char* const end = at + text.size();
    for (size_t k = 0; k < 2; ++k) {
        const auto [next, error] = std::from_chars(at, end, angles.at(k));
        if (error != std::errc() || !std::isfinite(angles.at(k))) return {};
        at = next;
        if (k == 0 && (at == end || *at++ != ',')) return {};
    }
    return at == end ? std::optional(angles) : std::nullopt;
}

}  // namespace

glm::dvec3 towardsSun(double azimuth, double elevation, const glm::dvec3& up) {
    const glm::dvec3 u = glm::normalize(up);
    const glm::dvec3 aside = std::abs(u.y) < 0.9 ? glm::dvec3(0, 1, 0) : glm::dvec3(0, 0, -1);
    const glm::dvec3 north = glm::normalize(aside - glm::dot(aside, u) * u), east = glm::cross(north, u);
    const double a = azimuth * kPi / 180, e = elevation * kPi / 180;
    return std::cos(e) * (std::sin(a) * east + std::cos(a) * north) + std::sin(e) * u;
}

void SunOptions::addTo(CLI::App& app) {
    auto* const given =
        app.add_option("--sun", sun,
                       "a sun that casts shadows instead of the one over the viewer's shoulder: degrees "
                       "clockwise from north (+y; y-up: -z), and above the horizon")
            ->type_name("AZIMUTH,ELEVATION");
    app.add_option("--sun-size", size,
                   "how large it is seen, degrees (ours: 0.53): shadows are softer farther from what casts them")
        ->transform(within(0.0, 20.0))
        ->needs(given)
        ->capture_default_str();
}

Result<void> SunOptions::check(const std::string& shade) const {
    if (sun.empty()) return {};
    const auto angles = anglesOf(sun);
    if (!angles || std::abs((*angles)[0]) > 360 || std::abs((*angles)[1]) > 90)
        return fail(ErrorKind::usage, "is no azimuth (0 to 360) and elevation (0 to 90), in degrees", "--sun " + sun,
                    "say it as 135,40");
    if ((*angles)[1] < 0)
        return fail(ErrorKind::usage, "is below the horizon: it has set", "--sun " + sun,
                    "give an elevation of 0 to 90 degrees, or leave it out");
    if (shade == "unlit")
        return fail(ErrorKind::usage, "is not seen where nothing is lit", "--sun", "leave --shade unlit out");
    return {};
}

void SunOptions::applyTo(render::DrawSettings& settings) const {
    if (sun.empty()) return;
    const auto angles = anglesOf(sun).value_or(std::array<double, 2>{});
    render::WorldLight light;
    light.kind = shared::kLightDirectional;
    light.direction = -towardsSun(angles[0], angles[1], settings.worldUp);
    // As bright as the sun that stands over the viewer's shoulder.
    light.colour = glm::vec3(static_cast<float>(0.75 * kPi));
    light.castsShadow = light.isSun = true;
    light.size = static_cast<float>(size * kPi / 180);
    settings.lights.push_back(light);
    settings.lit = true;
    settings.unlitTriangles = false;
}

}  // namespace stipple::app
