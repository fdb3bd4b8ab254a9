#include "lod/builder/points/outliers.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace stipple::lod {
namespace {

constexpr double kLowShare = 0.02, kHighShare = 0.98;  ///< of places, along each axis
constexpr double kTimesExtent = 4, kTimesLargest = 0.5, kCubesAcross = 16;
constexpr size_t kFewestPlaces = 16;  ///< of fewer nothing is said

bool isBefore(const glm::dvec3& a, const glm::dvec3& b) {
    return a.x != b.x ? a.x < b.x : a.y != b.y ? a.y < b.y : a.z < b.z;
}

void makeUnique(std::vector<glm::dvec3>& places) {
    std::sort(places.begin(), places.end(), isBefore);
    places.erase(std::unique(places.begin(), places.end()), places.end());
}

}  // namespace

// ---- the sample ----

PlaceSample::PlaceSample(uint64_t points) : share_(static_cast<uint64_t>(std::exp2(32) * shareOf(points))) {}

bool PlaceSample::isTaken(const glm::dvec3& p) const {
    // (+ 0: the two zeros are one place.)
    return mixed(std::bit_cast<uint64_t>(p.x + 0), std::bit_cast<uint64_t>(p.y + 0), std::bit_cast<uint64_t>(p.z + 0)) <
           share_;
}

void PlaceSample::keep(const glm::dvec3& p) {
    constexpr size_t kOften = 4096;
    if (!places_.empty() && places_.back() == p) return;
    places_.push_back(p);
    if (places_.size() < 2 * unique_ + kOften) return;
    makeUnique(places_);
    unique_ = places_.size();
}

std::vector<glm::dvec3> PlaceSample::take() {
    makeUnique(places_);
    return std::move(places_);
}

// ---- cubes of far points ----

FarCubes::Key FarCubes::keyOf(const glm::dvec3& p) const {
    const glm::dvec3 k = glm::floor((p - corner_) / size_);
    return {k.x, k.y, k.z};
}

void FarCubes::Cube::addPlace(const glm::dvec3& p) {
    if (places.size() < kManyPlaces && std::find(places.begin(), places.end(), p) == places.end()) places.push_back(p);
}

void FarCubes::add(const glm::dvec3& p) {
    Cube& cube = cubes_[keyOf(p)];
    ++cube.points;
    cube.bounds.add(p);
    cube.addPlace(p);
    while (cubes_.size() > kMostCubes) coarsen();
}

void FarCubes::merge(const Key& key, const Cube& cube) {
    Cube& mine = cubes_[key];
    mine.points += cube.points;
    mine.bounds.add(cube.bounds);
    for (const glm::dvec3& p : cube.places) mine.addPlace(p);
}

/// Cubes of twice the width. How far that goes hangs only on what all of them hold.
void FarCubes::coarsen() {
    const std::map<Key, Cube> finer = std::exchange(cubes_, {});
    size_ *= 2;
    for (const auto& [key, cube] : finer)
        merge({std::floor(key[0] / 2), std::floor(key[1] / 2), std::floor(key[2] / 2)}, cube);
}

void FarCubes::add(const FarCubes& other) {
    FarCubes theirs = other;
    while (size_ < theirs.size_) coarsen();
    while (theirs.size_ < size_) theirs.coarsen();
    for (const auto& [key, cube] : theirs.cubes_) merge(key, cube);
    while (cubes_.size() > kMostCubes) coarsen();
    atOrigin_ += other.atOrigin_;
}

size_t FarCubes::placesAround(const Key& key) const {
    size_t places = 0;
    for (int n = 0; n < 27; ++n) {
        const std::array<int, 3> step{n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1};
        Key at = key;
        bool isOther = true;  // (so far out that there is no next cube, a step leads nowhere)
        for (size_t a = 0; a < 3; ++a) {
            at.at(a) += step.at(a);
            isOther = isOther && (step.at(a) == 0 || at.at(a) != key.at(a));
        }
        if (!isOther) continue;
        if (const auto found = cubes_.find(at); found != cubes_.end()) places += found->second.places.size();
    }
    return places;
}

void FarCubes::findIsolated() {
    isolated_ = 0;
    for (auto& [key, cube] : cubes_) {
        cube.isIsolated = placesAround(key) < kManyPlaces;
        if (cube.isIsolated) isolated_ += cube.points;
    }
}

bool FarCubes::isIsolated(const glm::dvec3& p) const {
    const auto found = cubes_.find(keyOf(p));
    return found != cubes_.end() && found->second.isIsolated;
}

Bounds FarCubes::boundsOfRest() const {
    Bounds bounds;
    for (const auto& [key, cube] : cubes_)
        if (!cube.isIsolated) bounds.add(cube.bounds);
    return bounds;
}
Bounds FarCubes::boundsOfIsolated() const {
    Bounds bounds;
    for (const auto& [key, cube] : cubes_)
        if (cube.isIsolated) bounds.add(cube.bounds);
    return bounds;
}

void FarCubes::save(ByteWriter& to) const {
    to.put(corner_);
    to.put(size_);
    to.put(atOrigin_);
    to.put(uint64_t{cubes_.size()});
    for (const auto& [key, cube] : cubes_) {
        to.put(key);
        to.put(cube.points);
        to.put(cube.bounds);
        to.put(cube.places);
    }
}

void FarCubes::load(ByteReader& from) {
    cubes_.clear();
    uint64_t cubes = 0;
    from.get(corner_);
    from.get(size_);
    from.get(atOrigin_);
    from.get(cubes);
    for (uint64_t i = 0; i < cubes && !from.isBroken(); ++i) {
        Key key{};
        Cube cube;
        from.get(key);
        from.get(cube.points);
        from.get(cube.bounds);
        from.get(cube.places);
        cubes_[key] = std::move(cube);
    }
}

// ---- what is an outlier ----

Outliers::Outliers(std::vector<glm::dvec3> places, const glm::dvec3& origin, double tolerance)
    : tolerance_(tolerance), origin_(origin) {
    std::erase_if(places, [&](const glm::dvec3& p) { return isAtOrigin(p); });
    makeUnique(places);
    if (places.size() < kFewestPlaces) return;
    const auto last = static_cast<double>(places.size() - 1);
    std::vector<double> along(places.size());
    for (int a = 0; a < 3; ++a) {
        for (size_t i = 0; i < places.size(); ++i) along[i] = places[i][a];
        const auto below = [&](double rank) {
            const auto nth = along.begin() + static_cast<ptrdiff_t>(rank);
            std::nth_element(along.begin(), nth, along.end());
            return *nth;
        };
        dense_.least[a] = below(std::floor(last * kLowShare));
        dense_.greatest[a] = below(std::ceil(last * kHighShare));
    }
    const glm::dvec3 extent = dense_.greatest - dense_.least;
    const double largest = std::max({extent.x, extent.y, extent.z});
    isKnown_ = largest > 0 && std::isfinite(largest);
    cubeSize_ = largest / kCubesAcross;
    const glm::dvec3 margin = glm::max(kTimesExtent * extent, glm::dvec3(kTimesLargest * largest));
    far_.least = dense_.least - margin;
    far_.greatest = dense_.greatest + margin;
}

bool Outliers::isAtOrigin(const glm::dvec3& p) const {
    const glm::dvec3 d = glm::abs(p - origin_);
    return d.x <= tolerance_ && d.y <= tolerance_ && d.z <= tolerance_;
}

bool Outliers::reaches(const Bounds& bounds) const {
    return !bounds.isEmpty() && (isFar(bounds.least) || isFar(bounds.greatest));
}

void Outliers::gather(const glm::dvec3& p, FarCubes& cubes) const {
    if (isAtOrigin(p))
        cubes.addAtOrigin();
    else
        cubes.add(p);
}

void Outliers::conclude(FarCubes all) {
    cubes_ = std::move(all);
    cubes_.findIsolated();
}

bool Outliers::isOutlier(const glm::dvec3& p) const { return isFar(p) && (isAtOrigin(p) || cubes_.isIsolated(p)); }

double Outliers::farthest() const {
    Bounds of = cubes_.boundsOfIsolated();
    if (cubes_.atOrigin() > 0) of.add(origin_);
    double most = 0;
    for (int a = 0; a < 3; ++a)
        most = std::max({most, dense_.least[a] - of.least[a], of.greatest[a] - dense_.greatest[a]});
    return most;
}

void Outliers::save(ByteWriter& to) const {
    to.put(isKnown_);
    to.put(dense_);
    to.put(far_);
    to.put(cubeSize_);
    to.put(tolerance_);
    to.put(origin_);
    cubes_.save(to);
}

void Outliers::load(ByteReader& from) {
    from.get(isKnown_);
    from.get(dense_);
    from.get(far_);
    from.get(cubeSize_);
    from.get(tolerance_);
    from.get(origin_);
    cubes_.load(from);
    cubes_.findIsolated();
}

}  // namespace stipple::lod
