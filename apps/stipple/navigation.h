// Orbit and fly controls. Speeds are per second, so the frame rate does not matter; a long pause counts as 0.1 s.
#pragma once

#include <algorithm>
#include <cmath>

#include "engine/gpu/window.h"
#include "engine/scene/camera.h"

namespace stipple::app {

class Navigation {
  public:
    Navigation(const scene::Camera& start, double diagonal)
        : camera_(start), up_(glm::normalize(start.up)), speed_(0.2 * diagonal) {}
    const scene::Camera& camera() const { return camera_; }
    bool isFlying() const { return flying_; }
    void toggleFly() { flying_ = !flying_; }

    void move(const gpu::Input& in) {
        const double dt = std::clamp(in.seconds, 0.0, 0.1);
        if (flying_)
            fly(in, dt);
        else
            orbit(in);
    }

  private:
    static constexpr double kRadiansPerPixel = 0.005;

    /// Turns `v` about the up axis and then towards it, staying off the poles.
    glm::dvec3 turned(const glm::dvec3& v, double yaw, double pitch) const {
        const double length = glm::length(v);
        const double height =
            std::clamp(std::asin(std::clamp(glm::dot(v, up_) / length, -1.0, 1.0)) + pitch, -1.55, 1.55);
        glm::dvec3 flat = v - up_ * glm::dot(v, up_);
        if (!(glm::length(flat) > 1e-12)) flat = glm::cross(up_, glm::dvec3(up_.y, up_.z, up_.x));
        flat = glm::normalize(flat);
        flat = flat * std::cos(yaw) + glm::cross(up_, flat) * std::sin(yaw);
        return length * (flat * std::cos(height) + up_ * std::sin(height));
    }

    void orbit(const gpu::Input& in) {
        glm::dvec3 back = camera_.eye - camera_.target;
        if (in.leftButton) back = turned(back, -kRadiansPerPixel * in.mouseDeltaX, kRadiansPerPixel * in.mouseDeltaY);
        back *= std::exp(-0.15 * in.scroll);
        if (in.rightButton) {
            const glm::dvec3 right = glm::normalize(glm::cross(-back, up_)),
                             above = glm::normalize(glm::cross(right, -back));
            const double perPixel = glm::length(back) / std::max(1u, in.height);
            camera_.target += perPixel * (-in.mouseDeltaX * right + in.mouseDeltaY * above);
        }
        camera_.eye = camera_.target + back;
    }

    void fly(const gpu::Input& in, double dt) {
        glm::dvec3 forward = camera_.target - camera_.eye;
        const double length = glm::length(forward);
        if (in.leftButton)
            forward = turned(forward, -kRadiansPerPixel * in.mouseDeltaX, -kRadiansPerPixel * in.mouseDeltaY);
        speed_ *= std::exp(0.15 * in.scroll);
        const glm::dvec3 ahead = glm::normalize(forward), right = glm::normalize(glm::cross(ahead, up_));
        glm::dvec3 step =
            ahead * double(in.forward - in.back) + right * double(in.right - in.left) + up_ * double(in.up - in.down);
        step *= dt * speed_ * (in.fast ? 5.0 : 1.0);
        camera_.eye += step;
        camera_.target = camera_.eye + ahead * length;
    }

    scene::Camera camera_;
    glm::dvec3 up_;
    double speed_;
    bool flying_ = false;
};

}  // namespace stipple::app
