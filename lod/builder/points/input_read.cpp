// The points of a build's input, delivered on one lattice.
#include <algorithm>
#include <atomic>
#include <cmath>

#include "engine/base/numbers.h"
#include "engine/base/queue.h"
#include "lod/builder/points/input.h"
#include "lod/builder/points/input_colours.h"
#include "lod/primitives/octahedral.h"
#include "shaders/shared/border.h"

namespace stipple::lod {
PointInput::Range PointInput::nextRange(const Range& range, uint64_t wanted) const {
    Range next{range.end, range.end, range.before};
    for (size_t i = range.begin; i < range.end; ++i) next.before += parts_[i].usable;
    uint64_t held = 0;
    while (next.end < parts_.size() && held < wanted) held += parts_[next.end++].usable;
    return next;
}

Result<double> PointInput::read(Executor& executor, int workers, Progress& progress, const std::string& stage,
                                const Range& range, const Sink& sink, Wanted wanted, std::vector<FarCubes>* far) const {
    std::atomic<bool> stop{false};
    std::atomic<uint64_t> done{range.before};
    std::atomic<size_t> next{range.begin};
    const size_t end = std::min(range.end, parts_.size());
    CompletionQueue<Error> errors;
    std::vector<double> roundings(static_cast<size_t>(workers), 0);
    executor.parallelFor(static_cast<size_t>(workers), 1, [&](size_t first, size_t last) {
        for (size_t worker = first; worker < last; ++worker) {
            PointBlock block;
            Points out;
            double& rounding = roundings[worker];
            for (size_t i = next++; i < end && !stop; i = next++) {
                const Part& part = parts_[i];
                if (part.error || !isOwnPart(i)) continue;
                FarCubes* const cubes = far != nullptr && !far->empty() ? &(*far)[worker] : nullptr;
                const auto result =
                    readPart(part, wanted, block, out, rounding, cubes, [&](const Points& b) -> Result<void> {
                        STIPPLE_TRY(sink(static_cast<int>(worker), b));
                        progress.update(stage, done += b.size(), points);
                        return {};
                    });
                if (!result) {
                    stop = true;
                    errors.push(result.error());
                }
            }
        }
    });
    if (const auto found = errors.takeAll(); !found.empty()) return tl::unexpected(found.front());
    return *std::max_element(roundings.begin(), roundings.end()) * (allLattice_ ? unit / step_ : unit);
}

/// What the survey kept of it, or else from the file, with all that it has.
Result<PointReader> PointInput::openPart(const Part& part, Wanted wanted) const {
    const auto what = wanted == Wanted::all ? KeptPoints::What::all : KeptPoints::What::places;
    if (isKept(part, what)) return kept_->read(numberOf(part), what);
    return sources_[part.source].openPart(part.index);
}

void PointInput::dropPlaces() {
    if (kept_) kept_->releasePlaces();
}

Result<void> PointInput::readPart(const Part& part, Wanted wanted, PointBlock& block, Points& out, double& rounding,
                                  FarCubes* far, const std::function<Result<void>(const Points&)>& sink) const {
    const PointSource& from = sources_[part.source];
    const auto changed = [&] {
        return fail(ErrorKind::input, "changed while it was read", from.info.path, "build again when it is complete");
    };
    STIPPLE_ASSIGN(const PointReader read, openPart(part, wanted));
    const bool isFilled = wanted == Wanted::all || !allLattice_ || !isKept(part, KeptPoints::What::places);
    const bool isWatched = far != nullptr && outliers_.reaches(boundsOf(part));
    uint64_t usable = 0, farPoints = 0;
    for (uint64_t at = 0;;) {
        block.clear();
        STIPPLE_ASSIGN(size_t count, read(block, kBlockPoints));
        if (count == 0) {
            if (at != part.count || usable != part.usable || farPoints != part.far) return changed();
            if (wanted == Wanted::all && isKept(part, KeptPoints::What::all)) kept_->release(numberOf(part));
            return {};
        }
        if (count > part.count - at || block.colourMax > std::max(sourceColourMax_[part.source], 255u))
            return changed();
        if (from.info.isLattice)
            for (size_t i = 0; i < count; ++i)
                if (glm::min(part.lo, block.lattice[i]) != part.lo || glm::max(part.hi, block.lattice[i]) != part.hi)
                    return changed();
        at += count;
        for (size_t i = 0; isWatched && i < count; ++i)
            if (const glm::dvec3 p = commonOf(part.source, block, i); isPlace(p) && outliers_.isFar(p))
                outliers_.gather(p, *far);
        if (part.far > 0 && leavesOut()) {
            const size_t left = leaveOut(part, block, count, farPoints);
            usable += count - left;
            count = left;
        } else {
            farPoints = part.far;
        }
        if (isFilled) fill(part, block, out);
        place(part, block, count, out, rounding);
        usable += out.size();
        if (!isWithin(out)) return changed();
        STIPPLE_TRY(sink(out));
    }
}

namespace {

/// Keeps the elements `kept`, `width` values each.
template <typename T>
void keepOnly(std::vector<T>& values, const std::vector<uint32_t>& kept, size_t width = 1) {
    if (values.empty()) return;
    for (size_t k = 0; k < kept.size(); ++k)
        std::copy_n(values.begin() + static_cast<ptrdiff_t>(kept[k] * width), width,
                    values.begin() + static_cast<ptrdiff_t>(k * width));
    values.resize(kept.size() * width);
}

}  // namespace

/// Are all coordinates what the survey found?
bool PointInput::isWithin(const Points& block) const {
    if (!block.high.empty()) {
        for (size_t i = 0; i < block.size(); ++i)
            for (size_t a = 0; a < 3; ++a)
                if (block.place(i).at(a) > greatest.at(a)) return false;
        return true;
    }
    for (const auto& [axis, limit] :
         {std::pair{&block.x, greatest[0]}, {&block.y, greatest[1]}, {&block.z, greatest[2]}})
        for (const uint32_t v : *axis)
            if (v > limit) return false;
    return true;
}

/// Takes outliers out of a block; returns how many points stay. `far` grows by how many are far.
size_t PointInput::leaveOut(const Part& part, PointBlock& block, size_t count, uint64_t& far) const {
    std::vector<uint32_t> kept;
    for (size_t i = 0; i < count; ++i) {
        const glm::dvec3 p = commonOf(part.source, block, i);
        const bool isFar = outliers_.isFar(p);
        far += isFar ? 1 : 0;
        if (!isFar || !outliers_.isOutlier(p)) kept.push_back(static_cast<uint32_t>(i));
    }
    if (kept.size() == count) return count;
    keepOnly(block.position, kept);
    keepOnly(block.lattice, kept);
    keepOnly(block.colour, kept);
    keepOnly(block.colour16, kept);
    keepOnly(block.normal, kept);
    keepOnly(block.radius, kept);
    keepOnly(block.material, kept);
    for (size_t k = 0; k < block.attributes.size(); ++k)
        keepOnly(block.attributes[k], kept, bytesOf(attributes_[k].type));
    return kept.size();
}

void PointInput::fillMaterials(const Part& part, const PointBlock& block, size_t count,
                               std::vector<uint8_t>& out) const {
    const std::vector<uint8_t>& numbers = materialOf_[part.source];
    out.resize(count);
    for (size_t i = 0; i < count; ++i) {
        const size_t own = block.material.empty() ? 0 : block.material[i];
        out[i] = numbers[own < numbers.size() ? own : 0];
    }
}

/// Everything but the positions.
void PointInput::fill(const Part& part, const PointBlock& block, Points& out) const {
    const SourceInfo& info = sources_[part.source].info;
    const size_t count = std::max(block.position.size(), block.lattice.size());
    const bool wide = isWide_[part.source];
    out.colour.resize(count);
    const uint32_t kept = 0xffffffu | (info.isReflectance ? shared::kFlagBorder << 24 : 0u);
    for (size_t i = 0; i < count; ++i)
        out.colour[i] = isBlack_                  ? kPlainColour
                        : !block.colour16.empty() ? narrowed(block.colour16[i], wide)
                        : !block.colour.empty()   ? block.colour[i] & kept
                                                  : kPlainColour;
    out.normal.resize(hasNormal ? count : 0);
    for (size_t i = 0; hasNormal && i < count; ++i) {
        const glm::vec3 n = block.normal.empty() ? glm::vec3(0) : block.normal[i];
        const bool usable = hasDirection(n);
        out.normal[i] = usable ? roundedNormal(n / std::max({std::abs(n.x), std::abs(n.y), std::abs(n.z)})) : 0u;
        if (!usable) out.colour[i] |= shared::kFlagNoNormal << 24;
        if (usable && info.isTwoSided) out.colour[i] |= shared::kFlagTwoSided << 24;
    }
    if (!hasNormal)
        for (uint32_t& c : out.colour) c |= shared::kFlagNoNormal << 24;
    out.radius.assign(hasRadius ? count : 0, 0.0f);
    for (size_t i = 0; hasRadius && i < block.radius.size(); ++i)
        out.radius[i] = std::isfinite(block.radius[i]) && block.radius[i] > 0 ? toFloat(block.radius[i] / unit) : 0.0f;
    out.attributes.resize(attributes_.size());
    for (size_t k = 0; k < attributes_.size(); ++k) {
        if (!materialOf_.empty() && k + 1 == attributes_.size())
            fillMaterials(part, block, count, out.attributes[k]);
        else if (k < block.attributes.size() && !block.attributes[k].empty())
            out.attributes[k] = block.attributes[k];
        else
            out.attributes[k].assign(count * bytesOf(attributes_[k].type), 0);
    }
}

void PointInput::place(const Part& part, const PointBlock& block, size_t count, Points& out, double& rounding) const {
    for (auto* axis : {&out.x, &out.y, &out.z}) axis->resize(count);
    out.high.assign(isWide() ? count : 0, 0);
    if (isWide()) {
        placeWide(part, block, count, out, rounding);
        return;
    }
    if (allLattice_) {
        const ToLattice& to = lattice_.of[part.source];
        for (int a = 0; a < 3; ++a) {
            auto& axis = a == 0 ? out.x : a == 1 ? out.y : out.z;
            const auto ratio = toWhole<int64_t>(to.ratio[a]);
            const auto shift = toWhole<int64_t>(to.shift[a] - least_[a]);
            const bool whole = to.exact && step_ == 1 && std::abs(to.shift[a] - least_[a]) < 9e15;
            if (whole) {
                for (size_t i = 0; i < count; ++i) axis[i] = static_cast<uint32_t>(block.lattice[i][a] * ratio + shift);
                continue;
            }
            for (size_t i = 0; i < count; ++i) {
                const double q = (block.lattice[i][a] * to.ratio[a] + to.shift[a] - least_[a]) / step_,
                             r = std::round(q);
                rounding = std::max(rounding, std::abs(r - q) * step_);
                axis[i] = toWhole<uint32_t>(r);
            }
        }
        return;
    }
    placeEach(part, block, count, out, [&](const glm::dvec3& p, size_t to) {
        const glm::dvec3 q = (p - origin) / unit, r = glm::round(q), d = glm::abs(r - q);
        rounding = std::max({rounding, d.x, d.y, d.z});
        out.x[to] = toWhole<uint32_t>(r.x);
        out.y[to] = toWhole<uint32_t>(r.y);
        out.z[to] = toWhole<uint32_t>(r.z);
    });
}

/// Coordinates of more than 32 bits.
void PointInput::placeWide(const Part& part, const PointBlock& block, size_t count, Points& out,
                           double& rounding) const {
    const double perStep = allLattice_ ? step_ : 1;
    const auto put = [&](const glm::dvec3& q, size_t to) {
        const glm::dvec3 r = glm::clamp(glm::round(q), glm::dvec3(0), glm::dvec3(std::exp2(kPlaceBits) - 1));
        const glm::dvec3 d = glm::abs(r - q) * perStep;
        rounding = std::max({rounding, d.x, d.y, d.z});
        const Place place{toWhole<uint64_t>(r.x), toWhole<uint64_t>(r.y), toWhole<uint64_t>(r.z)};
        out.x[to] = static_cast<uint32_t>(place[0]);
        out.y[to] = static_cast<uint32_t>(place[1]);
        out.z[to] = static_cast<uint32_t>(place[2]);
        out.high[to] = highOf(place);
    };
    if (!allLattice_) {
        placeEach(part, block, count, out, [&](const glm::dvec3& p, size_t to) { put((p - origin) / unit, to); });
        return;
    }
    const ToLattice& of = lattice_.of[part.source];
    for (size_t i = 0; i < count; ++i) put((glm::dvec3(block.lattice[i]) * of.ratio + (of.shift - least_)) / step_, i);
}

/// Of points with world coordinates: calls put(p, i) for those that are finite, and closes up what belongs to them.
template <typename Put>
void PointInput::placeEach(const Part& part, const PointBlock& block, size_t count, Points& out, const Put& put) const {
    const SourceInfo& info = sources_[part.source].info;
    size_t to = 0;
    for (size_t i = 0; i < count; ++i) {
        const glm::dvec3 p =
            info.isLattice ? glm::dvec3(block.lattice[i]) * info.scale + info.offset : block.position[i];
        if (!isPlace(p)) continue;
        put(p, to);
        if (to != i) {
            out.colour[to] = out.colour[i];
            if (!out.normal.empty()) out.normal[to] = out.normal[i];
            if (!out.radius.empty()) out.radius[to] = out.radius[i];
            for (size_t k = 0; k < attributes_.size(); ++k) {
                const size_t width = bytesOf(attributes_[k].type);
                std::copy_n(out.attributes[k].begin() + static_cast<ptrdiff_t>(i * width), width,
                            out.attributes[k].begin() + static_cast<ptrdiff_t>(to * width));
            }
        }
        ++to;
    }
    if (to == count) return;
    for (auto* axis : {&out.x, &out.y, &out.z}) axis->resize(to);
    if (!out.high.empty()) out.high.resize(to);
    out.colour.resize(to);
    if (!out.normal.empty()) out.normal.resize(to);
    if (!out.radius.empty()) out.radius.resize(to);
    for (size_t k = 0; k < attributes_.size(); ++k) out.attributes[k].resize(to * bytesOf(attributes_[k].type));
}

}  // namespace stipple::lod
