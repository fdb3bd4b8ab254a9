// Outliers of a build's input: looked for while the points are counted, or, to be left out, before that in the parts
// that reach far out.
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>

#include "engine/base/queue.h"
#include "lod/builder/points/input.h"
#include "lod/builder/points/separation.h"
#include "lod/builder/points/spacing.h"

namespace stipple::lod {
// ---- where points are: steps of the common lattice, or world units where there is none ----

glm::dvec3 PointInput::commonOf(size_t from, const PointBlock& block, size_t i) const {
    const SourceInfo& info = sources_[from].info;
    if (!info.isLattice) return block.position[i];
    const glm::dvec3 step(block.lattice[i]);
    return allLattice_ ? step * lattice_.of[from].ratio + lattice_.of[from].shift : step * info.scale + info.offset;
}

Bounds PointInput::boundsOf(const Part& part) const {
    if (part.error || part.usable == 0) return {};
    if (!allLattice_) return {part.least, part.greatest};
    const ToLattice& to = lattice_.of[part.source];
    return {glm::dvec3(part.lo) * to.ratio + to.shift, glm::dvec3(part.hi) * to.ratio + to.shift};
}

/// Of all that is kept.
Bounds PointInput::bounds() const {
    Bounds all;
    for (const Part& part : parts_) all.add(leavesOut() ? part.near : boundsOf(part));
    if (leavesOut()) all.add(outliers_.cubes().boundsOfRest());
    return all;
}

Bounds PointInput::worldBounds(const Part& part) const {
    const Bounds b = leavesOut() ? part.near : boundsOf(part);
    if (!allLattice_ || b.isEmpty()) return b;
    return {lattice_.base + lattice_.unit * b.least, lattice_.base + lattice_.unit * b.greatest};
}

std::vector<std::string> PointInput::notesOnPlaces() const {
    std::vector<PlacedInput> inputs(sources_.size());
    for (size_t s = 0; s < sources_.size(); ++s) inputs[s].info = &sources_[s].info;
    for (const Part& part : parts_) inputs[part.source].bounds.add(worldBounds(part));
    return separationNotes(inputs, crs, crsPath_);
}

// ---- outliers ----

void PointInput::findDenseBox() {
    std::vector<glm::dvec3> places;
    for (Part& part : parts_) {
        const SourceInfo& info = sources_[part.source].info;
        for (const glm::dvec3& p : std::exchange(part.places, {})) {
            if (part.error) break;
            places.push_back(!info.isLattice ? p
                             : allLattice_   ? p * lattice_.of[part.source].ratio + lattice_.of[part.source].shift
                                             : p * info.scale + info.offset);
        }
    }
    const auto isBefore = [](const glm::dvec3& a, const glm::dvec3& b) {
        return a.x != b.x ? a.x < b.x : a.y != b.y ? a.y < b.y : a.z < b.z;
    };
    std::sort(places.begin(), places.end(), isBefore);
    places.erase(std::unique(places.begin(), places.end()), places.end());
    Bounds all;
    for (const Part& part : parts_) all.add(boundsOf(part));
    const glm::dvec3 extent = all.isEmpty() ? glm::dvec3(0) : all.greatest - all.least;
    // (So few steps are told apart whatever lies how near.)
    const bool isKnown = allLattice_ && std::max({extent.x, extent.y, extent.z}) < std::exp2(kShortBits);
    dense_.spacing = isKnown ? 0 : denseSpacing(places, PlaceSample::shareOf(declared_));
    dense_.extent = denseExtent(places);
    dense_.farthest = denseDistance(places);
    const glm::dvec3 world(0);
    outliers_ = allLattice_ ? Outliers(std::move(places), (world - lattice_.base) / lattice_.unit, 0.5)
                            : Outliers(std::move(places), world, 0);
    for (Part& part : parts_) part.near = boundsOf(part);
    // Beside what lies so far out the others' places could not be told apart.
    constexpr double kFewestInSpacing = 16, kFewestInExtent = 0x1p16;
    const double coarsest = dense_.spacing > 0 ? dense_.spacing / kFewestInSpacing : dense_.extent / kFewestInExtent;
    const double largest = std::max({extent.x, extent.y, extent.z});
    outliersRuin_ = coarsest > 0 && largest * std::exp2(-double{kPlaceBits}) > coarsest && outliers_.reaches(all);
}

/// Reads what reaches far out once more.
Result<void> PointInput::findOutliers(Executor& executor) {
    const auto workers = static_cast<size_t>(std::max(executor.threads(), 1));
    std::vector<FarCubes> far(workers, outliers_.empty());
    std::atomic<size_t> next{0};
    std::atomic<bool> stop{false};
    CompletionQueue<Error> errors;
    executor.parallelFor(workers, 1, [&](size_t first, size_t last) {
        for (size_t worker = first; worker < last; ++worker) {
            PointBlock block;
            for (size_t i = next++; i < parts_.size() && !stop; i = next++) {
                if (!isOwnPart(i) || !outliers_.reaches(boundsOf(parts_[i]))) continue;
                const Result<void> found = findFar(parts_[i], block, far[worker]);
                if (found) continue;
                stop = true;
                errors.push(found.error());
            }
        }
    });
    const auto failed = errors.takeAll();
    STIPPLE_TRY(agree(settings_.ranks, failed.empty() ? Result<void>() : Result<void>(tl::unexpected(failed.front()))));
    if (settings_.ranks != nullptr) exchangeParts();
    outliers_.conclude(together(far));
    if (!leavesOut())
        for (Part& part : parts_) part.far = 0;  // nobody looks again
    return {};
}

Result<void> PointInput::findFar(Part& part, PointBlock& block, FarCubes& cubes) const {
    STIPPLE_ASSIGN(const PointReader read, openPart(part, Wanted::places));
    part.near = {};
    part.far = 0;
    for (;;) {
        block.clear();
        STIPPLE_ASSIGN(const size_t count, read(block, kBlockPoints));
        if (count == 0) return {};
        for (size_t i = 0; i < count; ++i) {
            const glm::dvec3 p = commonOf(part.source, block, i);
            if (!isPlace(p)) continue;
            if (!outliers_.isFar(p)) {
                part.near.add(p);
                continue;
            }
            ++part.far;
            outliers_.gather(p, cubes);
        }
    }
}

/// Of all workers of all ranks.
FarCubes PointInput::together(const std::vector<FarCubes>& far) const {
    FarCubes all = outliers_.empty();
    for (const FarCubes& cubes : far) all.add(cubes);
    if (settings_.ranks == nullptr) return all;
    ByteWriter mine;
    all.save(mine);
    all = outliers_.empty();
    for (const std::vector<uint8_t>& bytes : settings_.ranks->gather(mine.bytes())) {
        ByteReader from(bytes);
        FarCubes theirs;
        theirs.load(from);
        all.add(theirs);
    }
    return all;
}

std::vector<FarCubes> PointInput::farCubes(int workers) const {
    if (isLeavingOut()) return {};
    const bool isAny =
        std::any_of(parts_.begin(), parts_.end(), [&](const Part& p) { return outliers_.reaches(boundsOf(p)); });
    return std::vector<FarCubes>(isAny ? static_cast<size_t>(workers) : 0, outliers_.empty());
}

void PointInput::concludeOutliers(const std::vector<FarCubes>& far, BuildReport& report) {
    outliers_.conclude(together(far));
    sayOutliers(report);
}

Bounds PointInput::withoutOutliers() const {
    if (!outliers_.any() || leavesOut()) return {glm::dvec3(-1e300), glm::dvec3(1e300)};
    const Bounds& near = outliers_.farBox();
    if (allLattice_) return {(near.least - least_) / step_, (near.greatest - least_) / step_};
    return {(near.least - origin) / unit, (near.greatest - origin) / unit};
}

/// First of all that is said.
void PointInput::sayOutliers(BuildReport& report) const {
    if (!outliers_.any()) return;
    const FarCubes& far = outliers_.cubes();
    std::string what;
    if (far.atOrigin() > 0) what += fmt::format("{} at the origin (0, 0, 0)", far.atOrigin());
    if (far.isolated() > 0) what += fmt::format("{}{} isolated", what.empty() ? "" : ", ", far.isolated());
    const double distance = outliers_.farthest() * (allLattice_ ? lattice_.unit : 1);
    report.notes.insert(report.notes.begin(),
                        fmt::format("OUTLIERS: {} of {} points lie far outside of all others ({}; up to {:.7g} units "
                                    "away): {}",
                                    outliers_.count(), declared_, what, distance,
                                    !isLeavingOut() ? "--drop-outliers leaves them out"
                                    : outliersRuin_ ? "left out: beside them the others' places could not be told apart"
                                                    : "left out"));
}

}  // namespace stipple::lod
