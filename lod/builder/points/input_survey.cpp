// The survey of a build's input: bounds, what is corrupt, what the colours mean, which points are outliers; and from
// that the one lattice.
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>

#include "engine/base/numbers.h"
#include "engine/base/queue.h"
#include "lod/builder/points/input.h"
#include "lod/builder/points/input_colours.h"
#include "lod/builder/points/separation.h"

namespace stipple::lod {
namespace {

constexpr double kLatticeLimit = 9007199254740991.0;  // 2^kPlaceBits - 1

}  // namespace

Result<void> PointInput::survey(BuildReport& report, Executor& executor, Progress& progress, bool keepsPoints) {
    constexpr uint64_t kSample = 65536;
    sampleShare = declared_ / kSample + 1;
    kept_ = roomToKeep(keepsPoints);
    std::atomic<bool> stop{false};
    std::atomic<uint64_t> done{0};
    executor.parallelFor(parts_.size(), 1, [&](size_t begin, size_t end) {
        PointBlock block;
        for (size_t i = begin; i < end && !stop; ++i) {
            if (!isOwnPart(i)) continue;
            if (const auto read = surveyPart(parts_[i], block); !read) {
                parts_[i].error = read.error();
                if (!settings_.skipBad) stop = true;
            }
            progress.update("survey", done += parts_[i].count, declared_);
        }
    });
    if (settings_.ranks != nullptr) exchangeParts();
    STIPPLE_TRY(checkParts());
    findDenseBox();
    if (isLeavingOut()) STIPPLE_TRY(findOutliers(executor));
    STIPPLE_TRY(conclude(report));
    placeSample();
    return {};
}

std::unique_ptr<KeptPoints> PointInput::roomToKeep(bool keepsPoints) const {
    // A part goes as a whole, once its last point is in a bucket: of large ones both were there.
    const uint64_t large = std::max(uint64_t{1} << 20, declared_ / 8);
    std::vector<KeptPoints::Part> parts;
    for (const Part& part : parts_) {
        const SourceInfo& info = sources_[part.source].info;
        const auto what = !keepsPoints || !info.isLattice            ? KeptPoints::What::nothing
                          : info.isCompressed && part.count <= large ? KeptPoints::What::all
                                                                     : KeptPoints::What::places;
        parts.push_back({part.count, what, info.hasColour});
    }
    std::vector<size_t> widths;
    for (const AttributeInfo& a : attributes_) widths.push_back(bytesOf(a.type));
    return std::make_unique<KeptPoints>(std::move(parts), std::move(widths));
}

Result<void> PointInput::checkParts() const {
    for (const Part& p : parts_)  // the first one in the order of the input
        if (p.error && !settings_.skipBad) return tl::unexpected(*p.error);
    return {};
}

/// From what is known of the parts.
Result<void> PointInput::conclude(BuildReport& report) {
    tally(report);
    if (points == 0)
        return fail(ErrorKind::input,
                    declared_ == 0 ? "holds no points" : fmt::format("none of its {} points can be used", declared_),
                    firstPath(), "nothing was written");
    findColours(report);
    if (sources_.size() > 1)
        for (std::string& note : notesOnPlaces()) report.notes.push_back(std::move(note));
    STIPPLE_TRY(allLattice_ ? placeIntegers(report) : placeFloats());
    findSpan();
    return {};
}

void PointInput::tally(BuildReport& report) {
    report.pointsIn = declared_;
    points = 0;
    sayOutliers(report);
    for (const Part& p : parts_) {
        if (p.error) {
            report.dropped["corrupt"] += p.count;
            report.notes.push_back(fmt::format("lost {} points: {}", p.count, p.error->line()));
            continue;
        }
        points += p.usable;
        if (p.notFinite > 0) report.dropped["not_finite"] += p.notFinite;
        if (p.beyond > 0) report.dropped["beyond_1e150"] += p.beyond;
    }
    if (!leavesOut()) return;
    const FarCubes& far = outliers_.cubes();
    points -= outliers_.count();
    if (far.atOrigin() > 0) report.dropped["outlier_at_origin"] += far.atOrigin();
    if (far.isolated() > 0) report.dropped["outlier_isolated"] += far.isolated();
}

bool PointInput::isOwnPart(size_t part) const { return isOwnOf(settings_.ranks, part); }

namespace {

/// What the survey finds out about a part.
template <typename Archive, typename Part>
void visitPart(const Archive& with, Part& part) {
    with(part.usable);
    with(part.notFinite);
    with(part.beyond);
    with(part.lo);
    with(part.hi);
    with(part.least);
    with(part.greatest);
    with(part.narrowest);
    with(part.colourMax);
    with(part.firstColour);
    with(part.hasColour);
    with(part.isVaried);
    with(part.sample);
    with(part.places);
    with(part.near);
    with(part.far);
}

}  // namespace

void PointInput::putPart(size_t i, ByteWriter& to) {
    visitPart([&](const auto& value) { to.put(value); }, parts_[i]);
    const Error none{};
    const Error& e = parts_[i].error ? *parts_[i].error : none;
    to.put(static_cast<int>(parts_[i].error ? e.kind : ErrorKind{}));
    for (const std::string* text : {&e.what, &e.where, &e.hint}) to.put(*text);
}

void PointInput::getPart(size_t i, ByteReader& from) {
    visitPart([&](auto& value) { from.get(value); }, parts_[i]);
    int kind = 0;
    Error e;
    from.get(kind);
    for (std::string* text : {&e.what, &e.where, &e.hint}) from.get(*text);
    e.kind = static_cast<ErrorKind>(kind);
    parts_[i].error = kind != 0 ? std::optional(e) : std::nullopt;
}

void PointInput::save(ByteWriter& to) {
    for (size_t i = 0; i < parts_.size(); ++i) putPart(i, to);
    outliers_.save(to);
    to.put(dense_);
    to.put(outliersRuin_);
}

Result<void> PointInput::load(ByteReader& from, BuildReport& report) {
    for (size_t i = 0; i < parts_.size(); ++i) getPart(i, from);
    outliers_.load(from);
    from.get(dense_);
    from.get(outliersRuin_);
    STIPPLE_TRY(checkParts());
    return conclude(report);
}

/// What each rank found out about its parts, all ranks know afterwards.
void PointInput::exchangeParts() {
    ByteWriter mine;
    for (size_t i = 0; i < parts_.size(); ++i)
        if (isOwnPart(i)) putPart(i, mine);
    const std::vector<std::vector<uint8_t>> all = settings_.ranks->gather(mine.bytes());
    for (size_t r = 0; r < all.size(); ++r) {
        ByteReader from(all[r]);
        for (size_t i = r; i < parts_.size(); i += all.size()) getPart(i, from);
    }
}

void PointInput::placeSample() {
    for (Part& part : parts_) {
        const SourceInfo& info = sources_[part.source].info;
        for (const glm::dvec3& p : std::exchange(part.sample, {})) {
            if (part.error || !isPlace(p)) continue;
            glm::dvec3 q(0);
            if (allLattice_) {
                const ToLattice& to = lattice_.of[part.source];
                q = (p * to.ratio + to.shift - least_) / step_;
            } else {
                q = ((info.isLattice ? p * info.scale + info.offset : p) - origin) / unit;
            }
            q = glm::clamp(glm::round(q), glm::dvec3(0), glm::dvec3(greatest[0], greatest[1], greatest[2]));
            const Place at{toWhole<uint64_t>(q.x), toWhole<uint64_t>(q.y), toWhole<uint64_t>(q.z)};
            sample.x.push_back(static_cast<uint32_t>(at[0]));
            sample.y.push_back(static_cast<uint32_t>(at[1]));
            sample.z.push_back(static_cast<uint32_t>(at[2]));
            if (isWide()) sample.high.push_back(highOf(at));
        }
    }
}

Result<void> PointInput::surveyPart(Part& part, PointBlock& block) const {
    const PointSource& from = sources_[part.source];
    STIPPLE_ASSIGN(const PointReader read, from.openPart(part.index));
    PlaceSample places(declared_);
    for (uint64_t at = 0;;) {
        block.clear();
        STIPPLE_ASSIGN(const size_t count, read(block, kBlockPoints));
        if (count == 0) {
            part.places = places.take();
            if (at == part.count) {
                kept_->finish(numberOf(part));
                return {};
            }
            return fail(ErrorKind::input, fmt::format("has {} points instead of {}", at, part.count), from.info.path);
        }
        if (count > part.count - at) return fail(ErrorKind::input, "has more points than it declares", from.info.path);
        surveyBounds(block, count, part);
        kept_->keep(numberOf(part), at, block);
        for (const glm::ivec3& p : block.lattice) places.add(p);
        for (const glm::dvec3& p : block.position)
            if (isPlace(p)) places.add(p);
        surveyColours(block, count, part);
        for (const float r : block.radius)
            if (r > 0 && std::isfinite(r)) part.narrowest = part.narrowest > 0 ? std::min(part.narrowest, r) : r;
        for (uint64_t i = (sampleShare - at % sampleShare) % sampleShare; i < count; i += sampleShare)
            part.sample.push_back(from.info.isLattice ? glm::dvec3(block.lattice[i]) : block.position[i]);
        at += count;
        part.usable = at - part.notFinite - part.beyond;
    }
}

void PointInput::surveyBounds(const PointBlock& block, size_t count, Part& part) const {
    const SourceInfo& info = sources_[part.source].info;
    for (size_t i = 0; i < count; ++i) {
        if (info.isLattice) {
            part.lo = glm::min(part.lo, block.lattice[i]);
            part.hi = glm::max(part.hi, block.lattice[i]);
            continue;
        }
        if (!isPlace(block.position[i])) {
            ++(isFinite(block.position[i]) ? part.beyond : part.notFinite);
            continue;
        }
        part.least = glm::min(part.least, block.position[i]);
        part.greatest = glm::max(part.greatest, block.position[i]);
    }
    if (!info.isLattice || allLattice_) return;
    for (const glm::ivec3& corner : {part.lo, part.hi}) {  // beside files that are none
        const glm::dvec3 p = glm::dvec3(corner) * info.scale + info.offset;
        part.least = glm::min(part.least, p);
        part.greatest = glm::max(part.greatest, p);
    }
}

void PointInput::surveyColours(const PointBlock& block, size_t count, Part& part) const {
    if (block.colour.empty() && block.colour16.empty()) return;
    part.colourMax = std::max(part.colourMax, block.colourMax);
    const auto raw = [&](size_t i) -> uint64_t {
        return block.colour16.empty() ? block.colour[i] & 0xffffffu : block.colour16[i] & 0xffffffffffffu;
    };
    if (!part.hasColour) part.firstColour = raw(0);
    part.hasColour = true;
    for (size_t i = 0; i < count && !part.isVaried; ++i) part.isVaried = raw(i) != part.firstColour;
}

/// 16-bit colours may hold 8-bit values: what they are, a whole file says. A scan whose points all have one colour has
/// no colours of its own: it is shaded; and if that colour is 0, nobody has written any.
void PointInput::findColours(BuildReport& report) {
    sourceColourMax_.assign(sources_.size(), 0);
    for (const Part& p : parts_)
        if (!p.error) sourceColourMax_[p.source] = std::max(sourceColourMax_[p.source], p.colourMax);
    isWide_.assign(sources_.size(), false);
    for (size_t s = 0; s < sources_.size(); ++s) isWide_[s] = sourceColourMax_[s] > 255;
    bool any = false, isVaried = false, isAnyColoured = false, isAnyLit = false;
    uint32_t first = 0;
    for (const Part& p : parts_) {
        if (p.error || p.usable == 0) continue;
        const bool wide = isWide_[p.source];
        // `firstColour` has 16-bit channels only where the file has.
        const uint32_t colour = !p.hasColour                  ? kPlainColour
                                : p.firstColour >> 24 || wide ? narrowed(p.firstColour, wide)
                                                              : static_cast<uint32_t>(p.firstColour);
        isAnyColoured = isAnyColoured || p.hasColour;
        isAnyLit = isAnyLit || (p.hasColour && (p.isVaried || p.firstColour != 0));
        isVaried = isVaried || p.isVaried || (any && colour != first);
        if (!any) first = colour;
        any = true;
    }
    isBlack_ = isAnyColoured && !isAnyLit && !isReflectance;
    hasColour = hasColour && isVaried && !isBlack_;
    if (isBlack_) report.notes.emplace_back("the colours of all points are 0: they count as having none");
}

namespace {

/// Of the radii that are given, world units; 0: none is.
template <typename Parts>
double narrowestOf(const Parts& parts) {
    double radius = 0;
    for (const auto& p : parts)
        if (!p.error && p.narrowest > 0) radius = radius > 0 ? std::min<double>(radius, p.narrowest) : p.narrowest;
    return radius;
}

}  // namespace

Result<void> PointInput::placeIntegers(BuildReport& report) {
    const CommonLattice& lattice = lattice_;
    const Bounds all = bounds();
    const glm::dvec3 lo = glm::round(all.least), hi = glm::round(all.greatest);
    const glm::dvec3 extents = hi - lo;
    const double extent = std::max({extents.x, extents.y, extents.z});
    if (extent > kLatticeLimit) {
        step_ = std::exp2(std::ceil(std::log2(extent / kLatticeLimit)) + 1);
        report.notes.push_back(fmt::format("the points span {:.3g} steps of {}; coordinates are rounded to {} units",
                                           extent, lattice.unit, lattice.unit * step_));
    }
    least_ = lo;
    unit = lattice.unit * step_;
    origin = lattice.base + lattice.unit * lo;
    for (int a = 0; a < 3; ++a) greatest.at(static_cast<size_t>(a)) = toWhole<uint64_t>(std::round(extents[a] / step_));
    resolution = dense_.spacing / step_;
    const auto isOff = [](const auto& of) { return !of.exact; };
    const auto first = std::find_if(lattice.of.begin(), lattice.of.end(), isOff);
    if (first == lattice.of.end()) return {};
    const auto more = std::count_if(first + 1, lattice.of.end(), isOff);
    report.notes.push_back(
        fmt::format("{}{}: scale and offset do not fit a common lattice; coordinates are rounded to {} units",
                    sources_[static_cast<size_t>(first - lattice.of.begin())].info.path,
                    more > 0 ? fmt::format(" and {} more files", more) : "", lattice.unit));
    return {};
}

/// Radii are stored as shares of cells: a cell that is as small as what a few points span would cut their discs off.
/// (One disc that is too wide does not count: what all are, the narrowest is.)
void PointInput::findSpan() {
    const double discs = std::min(std::ceil(narrowestOf(parts_) / unit), kLatticeLimit);
    span = std::max({greatest[0], greatest[1], greatest[2], toWhole<uint64_t>(discs)});
}

Result<void> PointInput::placeFloats() {
    const Bounds all = bounds();
    const glm::dvec3 &lo = all.least, &hi = all.greatest;
    const glm::dvec3 extents = hi - lo;
    const double extent = std::max({extents.x, extents.y, extents.z});
    if (!std::isfinite(extent))
        return fail(ErrorKind::input, "the coordinates span more than a double can hold", firstPath());
    constexpr double kBitsOfExtent = 21, kBitsOfDouble = 52, kFewSteps = 64, kManySteps = 2048;
    const auto powerAbove = [](double v) { return std::ceil(std::log2(v)); };
    // All in one place: their discs are what is seen.
    const double seen = extent > 0 ? extent : narrowestOf(parts_);
    unit = seen > 0 ? std::exp2(powerAbove(seen) - kBitsOfExtent) : std::exp2(-10);
    double farthest =
        std::max({std::abs(lo.x), std::abs(lo.y), std::abs(lo.z), std::abs(hi.x), std::abs(hi.y), std::abs(hi.z)});
    origin = lo;
    if (dense_.spacing > 0 && unit > dense_.spacing / kFewSteps) {
        unit = std::exp2(std::floor(std::log2(dense_.spacing / kManySteps)));
        if (dense_.extent > 0) unit = std::min(unit, std::exp2(powerAbove(dense_.extent) - kBitsOfExtent));
        unit = std::max(unit, std::exp2(powerAbove(extent) - kPlaceBits));
        farthest = dense_.farthest;
        // Whole steps from zero: what is rounded, and to what, does not hang on where the farthest point lies.
        if (const glm::dvec3 whole = glm::floor(lo / unit) * unit; glm::all(glm::lessThanEqual(whole, lo)))
            origin = whole;
    }
    // Below the spacing of doubles at this place there is nothing to resolve.
    if (farthest > 0) unit = std::max(unit, std::exp2(powerAbove(farthest) - kBitsOfDouble));
    for (int a = 0; a < 3; ++a)
        greatest.at(static_cast<size_t>(a)) = toWhole<uint64_t>(std::round((hi[a] - origin[a]) / unit));
    resolution = dense_.spacing / unit;
    return {};
}

}  // namespace stipple::lod
