// One .stipple file: what it says of itself.
#pragma once

#include <stipple/result.h>
#include <stipple/view.h>

#include <cstdint>
#include <memory>
#include <string>

namespace stipple::v1 {

class STIPPLE_API Store {
  public:
    /// Copies share what they are of; what has been moved from is a copy, too.
    Store(const Store&) = default;
    Store& operator=(const Store&) = default;
    static Result<Store> open(const std::string& path);

    std::string primitive() const;  ///< point, triangle, segment or patch
    uint64_t primitives() const;    ///< at full detail
    uint64_t records() const;       ///< of all levels
    uint64_t nodes() const;
    Vec3 boundsMin() const;
    Vec3 boundsMax() const;
    Vec3 up() const;
    /// The largest rounding of a coordinate, world units; 0: exact.
    double rounding() const;
    std::string crs() const;  ///< "EPSG:26910 (...)"; empty: the input names none

    struct Held;

  private:
    friend class Scene;
    explicit Store(std::shared_ptr<const Held> held) : held_(std::move(held)) {}
    std::shared_ptr<const Held> held_;
};

}  // namespace stipple::v1
