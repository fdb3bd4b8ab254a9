// What is drawn: stores, and where they stand.
#pragma once

#include <stipple/progress.h>
#include <stipple/result.h>
#include <stipple/store.h>
#include <stipple/view.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace stipple::v1 {

struct OpenSettings {
    uint64_t memoryBytes = uint64_t{2} << 30;  ///< of builds on the way
    unsigned threads = 0;                      ///< 0: all cores
    uint64_t surfels = 0;                      ///< above 0: meshes of glTF and OBJ as so many points
    /// What the cache of built scenes may hold, bytes; 0: its default.
    uint64_t cacheBytes = 0;
    Listener listener;
};

/// A store moved, turned and scaled evenly: p -> translation + scale * (rotation * p).
struct Place {
    std::array<Vec3, 3> rotation{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};  ///< rows; orthonormal, no mirror
    double scale = 1;
    Vec3 translation{0, 0, 0};
};

/// What a Renderer draws stays as it was when that was made.
class STIPPLE_API Scene {
  public:
    /// Copies share what they are of; what has been moved from is a copy, too.
    Scene(const Scene&) = default;
    Scene& operator=(const Scene&) = default;
    /// A .stipple file; a glTF or OBJ scene; or scans, which are built into the user's cache first, and found there the
    /// next time.
    static Result<Scene> open(const std::vector<std::string>& inputs, const OpenSettings& settings = {});
    /// Of stores, in one place or many.
    static Result<Scene> of(const std::vector<std::pair<Store, Place>>& placed);

    Vec3 boundsMin() const;
    Vec3 boundsMax() const;
    Vec3 up() const;
    uint64_t primitives() const;          ///< at full detail, of all places
    std::vector<Camera> cameras() const;  ///< of the scene's file
    /// One that sees all of it, at a picture of this width over its height.
    Camera overview(double aspect) const;

    /// Colours of points: auto, plain, rgb, intensity, class, height, normal, or an attribute; `map`: grey, viridis,
    /// magma, turbo, relief, or empty.
    Result<void> colourBy(const std::string& what, const std::string& map = "");

    struct Held;

  private:
    friend class Renderer;
    explicit Scene(std::shared_ptr<Held> held) : held_(std::move(held)) {}
    std::shared_ptr<Held> held_;
};

}  // namespace stipple::v1
