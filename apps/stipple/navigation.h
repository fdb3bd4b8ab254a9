// Orbit and fly controls. Speeds are per second, so the frame rate does not matter (a long pause counts as 0.1 s);
// turns are per height of the window, so neither do its size and the density of its pixels.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

#include "engine/render/backend.h"
#include "engine/scene/camera.h"

namespace stipple::app {

/// What the user's hands do in one frame.
struct Motion {
    double seconds = 0;
    glm::dvec2 turn{0}, slide{0};  ///< drags, pixels: left button, right button
    double scroll = 0;
    glm::dvec3 step{0};  ///< right, up, ahead: -1 to 1
    bool fast = false;
    uint32_t width = 1, height = 1;  ///< of the window, pixels
    bool isIdle() const {
        return turn == glm::dvec2(0) && slide == glm::dvec2(0) && scroll == 0 && step == glm::dvec3(0);
    }
};

/// Distance (along the view) of what is in the middle of a picture with depths, or next to it; none: only background.
inline std::optional<double> depthInTheMiddle(const render::Image& image) {
    const int w = static_cast<int>(image.width), h = static_cast<int>(image.height);
    if (image.depth.size() < size_t{image.width} * image.height) return {};
    std::optional<double> found;
    int nearest = (h / 20 + 1) * (h / 20 + 1);
    for (int dy = -h / 20; dy <= h / 20; ++dy)
        for (int dx = -h / 20; dx <= h / 20; ++dx) {
            const int x = w / 2 + dx, y = h / 2 + dy, squared = dx * dx + dy * dy;
            if (x < 0 || y < 0 || x >= w || y >= h || squared >= nearest) continue;
            const float depth = image.depth[static_cast<size_t>(y) * image.width + static_cast<size_t>(x)];
            if (!(depth > 0) || !std::isfinite(depth)) continue;
            nearest = squared;
            found = depth;
        }
    return found;
}

/// The next up axis (0 to 2: x to z) to try for a scene whose own is `own`: y and z are taken for each other most
/// often.
inline int nextUpAxis(int now, int own) {
    constexpr int kX = 0, kY = 1, kZ = 2;
    const int second = own == kZ ? kY : kZ, third = 3 - own - second;
    static_assert(kX + kY + kZ == 3);
    return now == own ? second : now == second ? third : own;
}

class Navigation {
  public:
    /// `up`: the axis to turn about. `diagonal`: of the scene.
    Navigation(const scene::Camera& start, const glm::dvec3& up, double diagonal)
        : camera_(start), up_(glm::normalize(up)), diagonal_(diagonal), speed_(0.2 * diagonal) {}
    const scene::Camera& camera() const { return camera_; }
    bool isFlying() const { return flying_; }
    double speed() const { return speed_; }
    void fly() { flying_ = true; }
    void setCamera(const scene::Camera& camera) { camera_ = camera; }

    /// Goes on in orbit: about what is `depth` ahead, or, where nothing is, about `focus`, which is then looked at.
    void orbit(std::optional<double> depth, const glm::dvec3& focus) {
        flying_ = false;
        const glm::dvec3 ahead = glm::normalize(camera_.target - camera_.eye);
        if (depth)
            camera_.target = camera_.eye + ahead * *depth;
        else if (glm::length(focus - camera_.eye) > 1e-9 * diagonal_)
            camera_.target = focus;
    }

    void move(const Motion& in) {
        if (in.isIdle()) return;
        if (flying_)
            moveFlying(in);
        else
            moveInOrbit(in);
    }

  private:
    static constexpr double kRadiansPerHeight = 3.6;

    /// Turns `v` about the up axis and then towards it, staying off the poles.
    glm::dvec3 turned(const glm::dvec3& v, double yaw, double pitch) {
        const double length = glm::length(v);
        const double height =
            std::clamp(std::asin(std::clamp(glm::dot(v, up_) / length, -1.0, 1.0)) + pitch, -1.55, 1.55);
        glm::dvec3 flat = v - up_ * glm::dot(v, up_);
        if (!(glm::length(flat) > 1e-9 * length))  // straight up or down: what was above in the picture is ahead
            flat = camera_.up - up_ * glm::dot(camera_.up, up_);
        if (!(glm::length(flat) > 1e-9)) flat = glm::cross(up_, glm::dvec3(up_.y, up_.z, up_.x));
        flat = glm::normalize(flat);
        flat = flat * std::cos(yaw) + glm::cross(up_, flat) * std::sin(yaw);
        camera_.up = up_;
        return length * (flat * std::cos(height) + up_ * std::sin(height));
    }

    void zoomOrthographic(double scroll) {
        const double now = std::max(camera_.orthoWidth, camera_.orthoHeight);
        const double factor = std::clamp(now * std::exp(-0.15 * scroll), 1e-6 * diagonal_, 1e3 * diagonal_) / now;
        camera_.orthoWidth *= factor;
        camera_.orthoHeight *= factor;
    }

    void moveInOrbit(const Motion& in) {
        const double perPixel = kRadiansPerHeight / in.height;
        glm::dvec3 back = camera_.eye - camera_.target;
        if (in.turn != glm::dvec2(0)) back = turned(back, -perPixel * in.turn.x, perPixel * in.turn.y);
        const double length = glm::length(back);
        if (camera_.isOrthographic())  // nearer shows nothing more of it
            zoomOrthographic(in.scroll);
        else
            back *= std::clamp(length * std::exp(-0.15 * in.scroll), 1e-6 * diagonal_, 1e3 * diagonal_) / length;
        if (in.slide != glm::dvec2(0)) {
            const lod::View view = scene::makeView(camera_, in.width, in.height, 1);
            // What is under the pointer stays there.
            camera_.target -= (in.slide.x * view.right + in.slide.y * view.down) *
                              ((view.isOrthographic ? 1 : glm::length(back)) / view.focalPixels);
        }
        camera_.eye = camera_.target + back;
    }

    void moveFlying(const Motion& in) {
        const double perPixel = kRadiansPerHeight / in.height;
        glm::dvec3 forward = camera_.target - camera_.eye;
        const double length = glm::length(forward);
        if (in.turn != glm::dvec2(0)) forward = turned(forward, -perPixel * in.turn.x, -perPixel * in.turn.y);
        speed_ = std::clamp(speed_ * std::exp(0.15 * in.scroll), 1e-9 * diagonal_, 1e3 * diagonal_);
        const glm::dvec3 ahead = glm::normalize(forward);
        camera_.target = camera_.eye + forward;
        const glm::dvec3 right = scene::makeView(camera_, in.width, in.height, 1).right;
        const glm::dvec3 step = right * in.step.x + up_ * in.step.y + ahead * in.step.z;
        camera_.eye += step * (std::clamp(in.seconds, 0.0, 0.1) * speed_ * (in.fast ? 5.0 : 1.0));
        camera_.target = camera_.eye + ahead * length;
    }

    scene::Camera camera_;
    glm::dvec3 up_;
    double diagonal_, speed_;
    bool flying_ = false;
};

}  // namespace stipple::app
