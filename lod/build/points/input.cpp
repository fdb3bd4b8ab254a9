#include "lod/build/points/input.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <filesystem>

#include "engine/base/file.h"
#include "engine/base/hash.h"
#include "engine/base/queue.h"
#include "lod/import/import.h"
#include "lod/octahedral.h"

namespace stipple::lod {
namespace {

constexpr double kLatticeLimit = 4294967295.0;
constexpr size_t kBlockPoints = 65536;

uint32_t toByte(uint32_t wide) { return (wide + 128) / 257; }
uint32_t narrowed(uint64_t c, bool isWide) {
    const auto r = static_cast<uint32_t>(c & 0xffffu), g = static_cast<uint32_t>(c >> 16 & 0xffffu),
               b = static_cast<uint32_t>(c >> 32 & 0xffffu);
    return isWide ? toByte(r) | toByte(g) << 8 | toByte(b) << 16 : r | g << 8 | b << 16;
}
bool isFinite(const glm::dvec3& p) { return std::isfinite(p.x + p.y + p.z); }

}  // namespace

Result<PointInput> PointInput::open(const std::vector<std::string>& inputs, const BuildSettings& settings,
                                    BuildReport& report) {
    PointInput input;
    input.settings_ = settings;
    STIPPLE_TRY(input.openAll(inputs, settings, report));
    return input;
}

Result<void> PointInput::openAll(const std::vector<std::string>& inputs, const BuildSettings& settings,
                                 BuildReport& report) {
    STIPPLE_ASSIGN(const std::vector<std::string> files, expandInputs(inputs));
    ReadOptions options;
    options.skipBad = settings.skipBad;
    if (settings.allAttributes) STIPPLE_TRY(collectNames(files, options));
    for (const std::string& name : settings.attributes) options.attributes.push_back(name);
    attributes_.resize(options.attributes.size());
    std::vector<bool> found(options.attributes.size(), false);
    for (const std::string& path : files) {
        auto source_ = openInput(path, options);
        if (!source_) {
            if (!settings.skipBad) return tl::unexpected(source_.error());
            report.notes.push_back("skipped: " + source_.error().line());
            ++report.skippedFiles;
            continue;
        }
        STIPPLE_TRY(adopt(std::move(*source_), options, found, report));
    }
    if (sources_.empty()) return fail(ErrorKind::input, "no input could be read", inputs.front());
    for (const std::string& input : inputs)
        if (const auto octree = declaredByOctree(input); octree && inputs.size() == 1 && *octree != declared_)
            report.notes.push_back(
                fmt::format("{}: declares {} points, its node files hold {}", input, *octree, declared_));
    for (size_t k = 0; k < found.size(); ++k)
        if (!found[k]) {
            std::string known;
            for (const AttributeInfo& a : sources_.front().info.attributes)
                known += (known.empty() ? "" : ", ") + a.name;
            return fail(ErrorKind::usage, fmt::format("has no attribute '{}'", options.attributes[k]), firstPath(),
                        known.empty() ? "it has none" : "it has " + known);
        }
    up = settings.up.value_or(sources_.front().info.up);
    source = std::filesystem::path(firstPath()).filename().string();
    if (sources_.size() > 1) source += fmt::format(" and {} more", sources_.size() - 1);
    return {};
}

Result<PointSource> PointInput::openInput(const std::string& path, const ReadOptions& options) const {
    return settings_.open ? settings_.open(path, options) : openPointSource(path, options);
}

/// Every attribute of every file, in order of first appearance.
Result<void> PointInput::collectNames(const std::vector<std::string>& files, ReadOptions& options) const {
    for (const std::string& path : files) {
        const auto opened = openInput(path, {{}, settings_.skipBad});
        if (!opened) continue;  // said when it is opened for reading
        for (const AttributeInfo& a : opened->info.attributes)
            if (std::find(options.attributes.begin(), options.attributes.end(), a.name) == options.attributes.end())
                options.attributes.push_back(a.name);
    }
    return {};
}

Result<void> PointInput::adopt(PointSource from, const ReadOptions& options, std::vector<bool>& found,
                               BuildReport& report) {
    const SourceInfo& info = from.info;
    if (!crs.agreesWith(info.crs))
        return fail(ErrorKind::input, fmt::format("is in {}, but {} is in {}", info.crs.label(), crsPath_, crs.label()),
                    info.path, "bring all files into one coordinate system first");
    if (crs.label().empty() && !info.crs.label().empty()) {
        crs = info.crs;
        crsPath_ = info.path;
    }
    for (size_t k = 0; k < options.attributes.size(); ++k)
        for (const AttributeInfo& a : info.attributes) {
            if (a.name != options.attributes[k]) continue;
            AttributeInfo& mine = attributes_[k];
            if (found[k] && (mine.type != a.type || mine.scale != a.scale || mine.offset != a.offset))
                return fail(ErrorKind::input,
                            fmt::format("stores attribute '{}' as {} x {} + {}, other files as {} x {} + {}", a.name,
                                        kScalarNames.at(static_cast<size_t>(a.type)), a.scale, a.offset,
                                        kScalarNames.at(static_cast<size_t>(mine.type)), mine.scale, mine.offset),
                            info.path, "leave this attribute out");
            mine = a;
            found[k] = true;
        }
    for (size_t p = 0; p < from.parts.size(); ++p) {
        Part part;
        part.source = sources_.size();
        part.index = p;
        part.count = from.parts[p];
        declared_ += part.count;
        parts_.push_back(std::move(part));
    }
    allLattice_ = allLattice_ && info.isLattice;
    hasColour = hasColour || info.hasColour;
    hasNormal = hasNormal || (info.hasNormal && settings_.normals != NormalsMode::none);
    hasRadius = hasRadius || info.hasRadius;
    isReflectance = isReflectance || info.isReflectance;
    for (const std::string& note : info.notes) report.notes.push_back(fmt::format("{}: {}", info.path, note));
    sources_.push_back(std::move(from));
    return {};
}

uint64_t PointInput::identity() const {
    std::vector<uint64_t> of;
    for (const PointSource& s : sources_) of.insert(of.end(), {fileIdentity(s.info.path), s.info.points});
    return hashBytes(of.data(), of.size() * sizeof(uint64_t));
}

// ---- the survey ----

Result<void> PointInput::survey(BuildReport& report, Executor& executor, Progress& progress) {
    constexpr uint64_t kSample = 65536;
    sampleShare = declared_ / kSample + 1;
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
    STIPPLE_TRY(conclude(report));
    placeSample();
    return {};
}

/// From what is known of the parts.
Result<void> PointInput::conclude(BuildReport& report) {
    report.pointsIn = declared_;
    points = 0;
    for (const Part& p : parts_) {
        if (p.error) {  // the first one in the order of the input
            if (!settings_.skipBad) return tl::unexpected(*p.error);
            report.dropped["corrupt"] += p.count;
            report.notes.push_back(fmt::format("lost {} points: {}", p.count, p.error->line()));
            continue;
        }
        points += p.usable;
        if (p.notFinite > 0) report.dropped["not_finite"] += p.notFinite;
    }
    if (points == 0)
        return fail(ErrorKind::input,
                    declared_ == 0 ? "holds no points" : fmt::format("none of its {} points can be used", declared_),
                    firstPath(), "nothing was written");
    findColours();
    return allLattice_ ? placeIntegers(report) : placeFloats();
}

bool PointInput::isOwnPart(size_t part) const { return isOwnOf(settings_.ranks, part); }

namespace {

/// What the survey finds out about a part.
template <typename Archive, typename Part>
void visitPart(const Archive& with, Part& part) {
    with(part.usable);
    with(part.notFinite);
    with(part.lo);
    with(part.hi);
    with(part.least);
    with(part.greatest);
    with(part.colourMax);
    with(part.firstColour);
    with(part.hasColour);
    with(part.isVaried);
    with(part.sample);
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
}

Result<void> PointInput::load(ByteReader& from, BuildReport& report) {
    for (size_t i = 0; i < parts_.size(); ++i) getPart(i, from);
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
            if (part.error || !isFinite(p)) continue;
            glm::dvec3 q(0);
            if (allLattice_) {
                const ToLattice& to = toLattice_[part.source];
                q = (p * to.ratio + to.shift - least_) / step_;
            } else {
                q = ((info.isLattice ? p * info.scale + info.offset : p) - origin) / unit;
            }
            q = glm::clamp(glm::round(q), glm::dvec3(0), glm::dvec3(greatest[0], greatest[1], greatest[2]));
            sample.x.push_back(static_cast<uint32_t>(q.x));
            sample.y.push_back(static_cast<uint32_t>(q.y));
            sample.z.push_back(static_cast<uint32_t>(q.z));
        }
    }
}

Result<void> PointInput::surveyPart(Part& part, PointBlock& block) const {
    const PointSource& from = sources_[part.source];
    STIPPLE_ASSIGN(const PointReader read, from.openPart(part.index));
    for (uint64_t at = 0;;) {
        block.clear();
        STIPPLE_ASSIGN(const size_t count, read(block, kBlockPoints));
        if (count == 0) {
            if (at == part.count) return {};
            return fail(ErrorKind::input, fmt::format("has {} points instead of {}", at, part.count), from.info.path);
        }
        if (count > part.count - at) return fail(ErrorKind::input, "has more points than it declares", from.info.path);
        for (size_t i = 0; i < count; ++i) {
            if (from.info.isLattice) {
                part.lo = glm::min(part.lo, block.lattice[i]);
                part.hi = glm::max(part.hi, block.lattice[i]);
                continue;
            }
            if (!isFinite(block.position[i])) {
                ++part.notFinite;
                continue;
            }
            part.least = glm::min(part.least, block.position[i]);
            part.greatest = glm::max(part.greatest, block.position[i]);
        }
        if (from.info.isLattice && !allLattice_)  // beside files that are none
            for (const glm::ivec3& corner : {part.lo, part.hi}) {
                const glm::dvec3 p = glm::dvec3(corner) * from.info.scale + from.info.offset;
                part.least = glm::min(part.least, p);
                part.greatest = glm::max(part.greatest, p);
            }
        surveyColours(block, count, part);
        for (uint64_t i = (sampleShare - at % sampleShare) % sampleShare; i < count; i += sampleShare)
            part.sample.push_back(from.info.isLattice ? glm::dvec3(block.lattice[i]) : block.position[i]);
        at += count;
        part.usable = at - part.notFinite;
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
/// no colours of its own: it is shaded.
void PointInput::findColours() {
    sourceColourMax_.assign(sources_.size(), 0);
    for (const Part& p : parts_)
        if (!p.error) sourceColourMax_[p.source] = std::max(sourceColourMax_[p.source], p.colourMax);
    isWide_.assign(sources_.size(), false);
    for (size_t s = 0; s < sources_.size(); ++s) isWide_[s] = sourceColourMax_[s] > 255;
    bool any = false, isVaried = false;
    uint32_t first = 0;
    for (const Part& p : parts_) {
        if (p.error || p.usable == 0) continue;
        const bool wide = isWide_[p.source];
        // `firstColour` has 16-bit channels only where the file has.
        const uint32_t colour = !p.hasColour                  ? kPlainColour
                                : p.firstColour >> 24 || wide ? narrowed(p.firstColour, wide)
                                                              : static_cast<uint32_t>(p.firstColour);
        isVaried = isVaried || p.isVaried || (any && colour != first);
        if (!any) first = colour;
        any = true;
    }
    hasColour = hasColour && isVaried;
}

Result<void> PointInput::placeIntegers(BuildReport& report) {
    std::vector<SourceInfo> infos;
    for (const PointSource& s : sources_) infos.push_back(s.info);
    const CommonLattice lattice = findLattice(infos);
    toLattice_ = lattice.of;
    glm::dvec3 lo(std::numeric_limits<double>::max()), hi(-lo);
    for (const Part& p : parts_) {
        if (p.error || p.usable == 0) continue;
        const ToLattice& to = lattice.of[p.source];
        lo = glm::min(lo, glm::round(glm::dvec3(p.lo) * to.ratio + to.shift));
        hi = glm::max(hi, glm::round(glm::dvec3(p.hi) * to.ratio + to.shift));
    }
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
    for (int a = 0; a < 3; ++a)
        greatest.at(static_cast<size_t>(a)) = static_cast<uint32_t>(std::max(std::round(extents[a] / step_), 0.0));
    for (size_t s = 0; s < infos.size(); ++s)
        if (!lattice.of[s].exact)
            report.notes.push_back(
                fmt::format("{}: scale and offset do not fit a common lattice; coordinates are "
                            "rounded to {} units",
                            infos[s].path, lattice.unit));
    return {};
}

Result<void> PointInput::placeFloats() {
    glm::dvec3 lo(1e300), hi(-1e300);
    for (const Part& p : parts_) {
        if (p.error || p.usable == 0) continue;
        lo = glm::min(lo, p.least);
        hi = glm::max(hi, p.greatest);
    }
    const glm::dvec3 extents = hi - lo;
    const double extent = std::max({extents.x, extents.y, extents.z});
    if (!std::isfinite(extent))
        return fail(ErrorKind::input, "the coordinates span more than a double can hold", firstPath());
    unit = extent > 0 ? std::exp2(std::ceil(std::log2(extent)) - 21) : std::exp2(-10);
    // Below the spacing of doubles at this place there is nothing to resolve.
    const double farthest =
        std::max({std::abs(lo.x), std::abs(lo.y), std::abs(lo.z), std::abs(hi.x), std::abs(hi.y), std::abs(hi.z)});
    if (farthest > 0) unit = std::max(unit, std::exp2(std::ceil(std::log2(farthest)) - 52));
    origin = lo;
    for (int a = 0; a < 3; ++a)
        greatest.at(static_cast<size_t>(a)) = static_cast<uint32_t>(std::round(extents[a] / unit));
    return {};
}

// ---- delivery ----

PointInput::Range PointInput::nextRange(const Range& range, uint64_t wanted) const {
    Range next{range.end, range.end, range.before};
    for (size_t i = range.begin; i < range.end; ++i) next.before += parts_[i].usable;
    uint64_t held = 0;
    while (next.end < parts_.size() && held < wanted) held += parts_[next.end++].usable;
    return next;
}

Result<double> PointInput::read(Executor& executor, int workers, Progress& progress, const std::string& stage,
                                const Range& range, const Sink& sink) const {
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
                const auto result = readPart(part, block, out, rounding, [&](const Points& b) -> Result<void> {
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

Result<void> PointInput::readPart(const Part& part, PointBlock& block, Points& out, double& rounding,
                                  const std::function<Result<void>(const Points&)>& sink) const {
    const PointSource& from = sources_[part.source];
    const auto changed = [&] {
        return fail(ErrorKind::input, "changed while it was read", from.info.path, "build again when it is complete");
    };
    STIPPLE_ASSIGN(const PointReader read, from.openPart(part.index));
    uint64_t usable = 0;
    for (uint64_t at = 0;;) {
        block.clear();
        STIPPLE_ASSIGN(const size_t count, read(block, kBlockPoints));
        if (count == 0) {
            if (at != part.count || usable != part.usable) return changed();
            return {};
        }
        if (count > part.count - at || block.colourMax > std::max(sourceColourMax_[part.source], 255u))
            return changed();
        if (from.info.isLattice)
            for (size_t i = 0; i < count; ++i)
                if (glm::min(part.lo, block.lattice[i]) != part.lo || glm::max(part.hi, block.lattice[i]) != part.hi)
                    return changed();
        at += count;
        fill(part, block, out);
        place(part, block, count, out, rounding);
        usable += out.size();
        for (const auto& [axis, limit] : {std::pair{&out.x, greatest[0]}, {&out.y, greatest[1]}, {&out.z, greatest[2]}})
            for (const uint32_t v : *axis)
                if (v > limit) return changed();
        STIPPLE_TRY(sink(out));
    }
}

/// Everything but the positions.
void PointInput::fill(const Part& part, const PointBlock& block, Points& out) const {
    const SourceInfo& info = sources_[part.source].info;
    const size_t count = std::max(block.position.size(), block.lattice.size());
    const bool wide = isWide_[part.source];
    out.colour.resize(count);
    for (size_t i = 0; i < count; ++i)
        out.colour[i] = !block.colour16.empty() ? narrowed(block.colour16[i], wide)
                        : !block.colour.empty() ? block.colour[i] & 0xffffffu
                                                : kPlainColour;
    out.normal.resize(hasNormal ? count : 0);
    for (size_t i = 0; hasNormal && i < count; ++i) {
        const glm::vec3 n = block.normal.empty() ? glm::vec3(0) : block.normal[i];
        const float scale = std::max({std::abs(n.x), std::abs(n.y), std::abs(n.z)});
        const bool usable = scale > 0 && std::isfinite(scale) && std::isfinite(n.x + n.y + n.z);
        out.normal[i] = usable ? roundedNormal(n / scale) : 0u;
        if (!usable) out.colour[i] |= shared::kFlagNoNormal << 24;
        if (usable && info.isTwoSided) out.colour[i] |= shared::kFlagTwoSided << 24;
    }
    if (!hasNormal)
        for (uint32_t& c : out.colour) c |= shared::kFlagNoNormal << 24;
    out.radius.assign(hasRadius ? count : 0, 0.0f);
    const auto perUnit = static_cast<float>(1.0 / unit);
    for (size_t i = 0; hasRadius && i < block.radius.size(); ++i)
        out.radius[i] = std::isfinite(block.radius[i]) && block.radius[i] > 0 ? block.radius[i] * perUnit : 0.0f;
    out.attributes.resize(attributes_.size());
    for (size_t k = 0; k < attributes_.size(); ++k) {
        if (k < block.attributes.size() && !block.attributes[k].empty())
            out.attributes[k] = block.attributes[k];
        else
            out.attributes[k].assign(count * bytesOf(attributes_[k].type), 0);
    }
}

void PointInput::place(const Part& part, const PointBlock& block, size_t count, Points& out, double& rounding) const {
    const SourceInfo& info = sources_[part.source].info;
    for (auto* axis : {&out.x, &out.y, &out.z}) axis->resize(count);
    if (allLattice_) {
        const ToLattice& to = toLattice_[part.source];
        for (int a = 0; a < 3; ++a) {
            auto& axis = a == 0 ? out.x : a == 1 ? out.y : out.z;
            const auto ratio = static_cast<int64_t>(to.ratio[a]);
            const auto shift = static_cast<int64_t>(to.shift[a] - least_[a]);
            const bool whole = to.exact && step_ == 1 && std::abs(to.shift[a] - least_[a]) < 9e15;
            if (whole) {
                for (size_t i = 0; i < count; ++i) axis[i] = static_cast<uint32_t>(block.lattice[i][a] * ratio + shift);
                continue;
            }
            for (size_t i = 0; i < count; ++i) {
                const double q = (block.lattice[i][a] * to.ratio[a] + to.shift[a] - least_[a]) / step_,
                             r = std::round(q);
                rounding = std::max(rounding, std::abs(r - q) * step_);
                axis[i] = static_cast<uint32_t>(std::max(r, 0.0));
            }
        }
        return;
    }
    size_t to = 0;
    for (size_t i = 0; i < count; ++i) {
        const glm::dvec3 p =
            info.isLattice ? glm::dvec3(block.lattice[i]) * info.scale + info.offset : block.position[i];
        if (!isFinite(p)) continue;
        const glm::dvec3 q = (p - origin) / unit, r = glm::round(q), d = glm::abs(r - q);
        rounding = std::max({rounding, d.x, d.y, d.z});
        out.x[to] = static_cast<uint32_t>(std::max(r.x, 0.0));
        out.y[to] = static_cast<uint32_t>(std::max(r.y, 0.0));
        out.z[to] = static_cast<uint32_t>(std::max(r.z, 0.0));
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
    out.colour.resize(to);
    if (!out.normal.empty()) out.normal.resize(to);
    if (!out.radius.empty()) out.radius.resize(to);
    for (size_t k = 0; k < attributes_.size(); ++k) out.attributes[k].resize(to * bytesOf(attributes_[k].type));
}

}  // namespace stipple::lod
