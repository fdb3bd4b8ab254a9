// From files to one cloud on one lattice, all parts of all files at once. Scanner integers stay what they are: the
// lattice unit is the files' scale. For floating-point input the unit is a power of two, 2^-21 of the extent.
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <filesystem>
#include <optional>

#include "lod/build/cloud.h"
#include "lod/build/lattice.h"
#include "lod/import/import.h"
#include "lod/octahedral.h"

namespace stipple::lod {
namespace {

constexpr double kLatticeLimit = 4294967295.0;
constexpr size_t kBlockPoints = 65536;

struct Part {
    size_t source = 0, index = 0;
    uint64_t first = 0, count = 0;  ///< where its points go in the cloud
    // Results.
    std::optional<Error> error;
    glm::ivec3 lo{INT32_MAX}, hi{INT32_MIN};
    uint32_t colourMax = 0;
    std::vector<std::pair<uint64_t, uint64_t>> narrow;  ///< runs whose 16-bit colours all fitted into 8 bits
};

uint32_t toByte(uint32_t wide) { return (wide + 128) / 257; }

/// Everything that is needed while reading.
class Reading {
  public:
    Reading(const std::vector<std::string>& inputs, const BuildSettings& settings, BuildReport& report)
        : inputs_(inputs), settings_(settings), report_(report) {}

    Result<Cloud> run(Executor& executor, Progress& progress) {
        STIPPLE_TRY(openAll());
        STIPPLE_TRY(checkBudget());
        STIPPLE_TRY(verifyCounts());
        allocate();
        std::atomic<bool> stop{false};
        std::atomic<uint64_t> done{0};
        executor.parallelFor(parts_.size(), 1, [&](size_t begin, size_t end) {
            PointBlock block;
            for (size_t i = begin; i < end && !stop; ++i) {
                const auto read = readPart(parts_[i], block);
                if (!read) {
                    parts_[i].error = read.error();
                    if (!settings_.skipBad) stop = true;
                }
                progress.update("read", done += parts_[i].count, declared_);
            }
        });
        STIPPLE_TRY(takeErrors());
        widenColours();
        compact();
        if (cloud_.size() == 0 && position_.empty())
            return fail(ErrorKind::input,
                        report_.pointsIn == 0 ? "holds no points"
                                              : fmt::format("none of its {} points can be used", report_.pointsIn),
                        inputs_.front(), "nothing was written");
        if (allLattice_)
            STIPPLE_TRY(placeIntegers(executor));
        else
            STIPPLE_TRY(placeFloats());
        finishAttributes();
        return std::move(cloud_);
    }

  private:
    Result<void> openAll() {
        STIPPLE_ASSIGN(const std::vector<std::string> files, expandInputs(inputs_));
        ReadOptions options;
        options.skipBad = settings_.skipBad;
        if (settings_.allAttributes) STIPPLE_TRY(collectNames(files, options));
        for (const std::string& name : settings_.attributes) options.attributes.push_back(name);
        cloud_.attributes.resize(options.attributes.size());
        std::vector<bool> found(options.attributes.size(), false);
        for (const std::string& path : files) {
            auto source = openInput(path, options);
            if (!source) {
                if (!settings_.skipBad) return tl::unexpected(source.error());
                report_.notes.push_back("skipped: " + source.error().line());
                ++report_.skippedFiles;
                continue;
            }
            STIPPLE_TRY(adopt(std::move(*source), options, found));
        }
        if (sources_.empty()) return fail(ErrorKind::input, "no input could be read", inputs_.front());
        for (const std::string& input : inputs_)
            if (const auto octree = declaredByOctree(input); octree && inputs_.size() == 1 && *octree != declared_)
                report_.notes.push_back(
                    fmt::format("{}: declares {} points, its node files hold {}", input, *octree, declared_));
        for (size_t k = 0; k < found.size(); ++k)
            if (!found[k]) {
                std::string known;
                for (const AttributeInfo& a : sources_.front().info.attributes)
                    known += (known.empty() ? "" : ", ") + a.name;
                return fail(ErrorKind::usage, fmt::format("has no attribute '{}'", options.attributes[k]),
                            sources_.front().info.path, known.empty() ? "it has none" : "it has " + known);
            }
        cloud_.up = settings_.up.value_or(sources_.front().info.up);
        return {};
    }

    Result<PointSource> openInput(const std::string& path, const ReadOptions& options) const {
        return settings_.open ? settings_.open(path, options) : openPointSource(path, options);
    }

    /// Every attribute of every file, in order of first appearance.
    Result<void> collectNames(const std::vector<std::string>& files, ReadOptions& options) const {
        for (const std::string& path : files) {
            const auto source = openInput(path, {{}, settings_.skipBad});
            if (!source) continue;  // said when it is opened for reading
            for (const AttributeInfo& a : source->info.attributes)
                if (std::find(options.attributes.begin(), options.attributes.end(), a.name) == options.attributes.end())
                    options.attributes.push_back(a.name);
        }
        return {};
    }

    Result<void> adopt(PointSource source, const ReadOptions& options, std::vector<bool>& found) {
        const SourceInfo& info = source.info;
        if (!cloud_.crs.agreesWith(info.crs))
            return fail(ErrorKind::input,
                        fmt::format("is in {}, but {} is in {}", info.crs.label(), crsPath_, cloud_.crs.label()),
                        info.path, "bring all files into one coordinate system first");
        if (cloud_.crs.label().empty() && !info.crs.label().empty()) {
            cloud_.crs = info.crs;
            crsPath_ = info.path;
        }
        for (size_t k = 0; k < options.attributes.size(); ++k)
            for (const AttributeInfo& a : info.attributes) {
                if (a.name != options.attributes[k]) continue;
                AttributeInfo& mine = cloud_.attributes[k].info;
                if (found[k] && (mine.type != a.type || mine.scale != a.scale || mine.offset != a.offset))
                    return fail(ErrorKind::input,
                                fmt::format("stores attribute '{}' as {} x {} + {}, other files as {} x {} + {}",
                                            a.name, kScalarNames.at(static_cast<size_t>(a.type)), a.scale, a.offset,
                                            kScalarNames.at(static_cast<size_t>(mine.type)), mine.scale, mine.offset),
                                info.path, "leave this attribute out");
                mine = a;
                found[k] = true;
            }
        for (size_t p = 0; p < source.parts.size(); ++p) {
            Part part;
            part.source = sources_.size();
            part.index = p;
            part.first = declared_;
            part.count = source.parts[p];
            declared_ += part.count;
            parts_.push_back(std::move(part));
        }
        allLattice_ = allLattice_ && info.isLattice;
        cloud_.hasColour = cloud_.hasColour || info.hasColour;
        cloud_.hasNormal = cloud_.hasNormal || (info.hasNormal && settings_.normals != NormalsMode::none);
        cloud_.hasRadius = cloud_.hasRadius || info.hasRadius;
        cloud_.isReflectance = cloud_.isReflectance || info.isReflectance;
        for (const std::string& note : info.notes) report_.notes.push_back(fmt::format("{}: {}", info.path, note));
        sources_.push_back(std::move(source));
        return {};
    }

    Result<void> checkBudget() const {
        uint64_t perPoint = kBuildBytesPerPoint;
        for (const CloudAttribute& a : cloud_.attributes) perPoint += 2 * bytesOf(a.info.type);
        const uint64_t needed = declared_ * perPoint + (uint64_t{96} << 20);
        if (declared_ > 0xfffffff0u) return fail(ErrorKind::budget, "more than 4,294,967,280 points", inputs_.front());
        if (needed > settings_.memoryBytes)
            return fail(ErrorKind::budget,
                        fmt::format("building {} points needs about {} MiB, but --memory allows {} MiB", declared_,
                                    needed >> 20, settings_.memoryBytes >> 20),
                        inputs_.front(), fmt::format("give --memory {}M or fewer points", (needed >> 20) + 1));
        return {};
    }

    /// A small file may promise many points and still be right (a flat grid compresses to almost nothing): it is read
    /// once before anything is allocated for what it promises.
    Result<void> verifyCounts() {
        constexpr uint64_t kPlausiblePointsPerByte = 16;
        for (const PointSource& source : sources_) {
            std::error_code error;
            const uint64_t bytes = std::filesystem::file_size(source.info.path, error);
            if (error || source.info.points / kPlausiblePointsPerByte <= bytes) continue;
            STIPPLE_TRY(readPoints(source));
        }
        return {};
    }

    void allocate() {
        const auto n = static_cast<size_t>(declared_);
        if (allLattice_)
            for (auto* axis : {&cloud_.x, &cloud_.y, &cloud_.z}) axis->resize(n);
        else
            position_.resize(n);
        cloud_.colour.assign(n, kPlainColour);
        if (cloud_.hasNormal) cloud_.normal.resize(n);
        cloud_.radius.resize(n);
        for (CloudAttribute& a : cloud_.attributes) a.values.resize(n * bytesOf(a.info.type));
        cloud_.source = std::filesystem::path(sources_.front().info.path).filename().string();
        if (sources_.size() > 1) cloud_.source += fmt::format(" and {} more", sources_.size() - 1);
    }

    Result<void> readPart(Part& part, PointBlock& block) {
        const PointSource& source = sources_[part.source];
        STIPPLE_ASSIGN(const PointReader read, source.openPart(part.index));
        for (uint64_t at = part.first;;) {
            block.clear();
            STIPPLE_ASSIGN(const size_t count, read(block, kBlockPoints));
            if (count == 0) {
                if (at == part.first + part.count) return {};
                return fail(ErrorKind::input, fmt::format("has {} points instead of {}", at - part.first, part.count),
                            source.info.path);
            }
            if (count > part.first + part.count - at)
                return fail(ErrorKind::input, "has more points than it declares", source.info.path);
            store(source.info, block, count, at, part);
            at += count;
        }
    }

    void store(const SourceInfo& info, const PointBlock& block, size_t count, uint64_t at, Part& part) {
        if (allLattice_) {
            for (size_t i = 0; i < count; ++i) {
                const glm::ivec3 p = block.lattice[i];
                part.lo = glm::min(part.lo, p);
                part.hi = glm::max(part.hi, p);
                cloud_.x[at + i] = static_cast<uint32_t>(p.x);
                cloud_.y[at + i] = static_cast<uint32_t>(p.y);
                cloud_.z[at + i] = static_cast<uint32_t>(p.z);
            }
        } else {
            for (size_t i = 0; i < count; ++i)
                position_[at + i] =
                    info.isLattice ? glm::dvec3(block.lattice[i]) * info.scale + info.offset : block.position[i];
        }
        if (!block.colour16.empty()) {
            storeWide(block, count, at, part);
        } else {
            std::copy(block.colour.begin(), block.colour.end(), cloud_.colour.begin() + static_cast<ptrdiff_t>(at));
        }
        for (size_t i = 0; cloud_.hasNormal && i < count; ++i) {
            const glm::vec3 n = block.normal.empty() ? glm::vec3(0) : block.normal[i];
            const float scale = std::max({std::abs(n.x), std::abs(n.y), std::abs(n.z)});
            const bool usable = scale > 0 && std::isfinite(scale) && std::isfinite(n.x + n.y + n.z);
            cloud_.normal[at + i] = usable ? octEncode(n / scale) : 0u;
            if (!usable) cloud_.colour[at + i] |= shared::kFlagNoNormal << 24;
            if (usable && info.isTwoSided) cloud_.colour[at + i] |= shared::kFlagTwoSided << 24;
        }
        for (size_t i = 0; i < block.radius.size(); ++i)
            cloud_.radius[at + i] = std::isfinite(block.radius[i]) && block.radius[i] > 0 ? block.radius[i] : 0.0f;
        for (size_t k = 0; k < block.attributes.size(); ++k)
            if (!block.attributes[k].empty())
                std::copy(block.attributes[k].begin(), block.attributes[k].end(),
                          cloud_.attributes[k].values.begin() +
                              static_cast<ptrdiff_t>(at * bytesOf(cloud_.attributes[k].info.type)));
    }

    /// 16-bit colours that may hold 8-bit values: which, is known when the whole file was read.
    void storeWide(const PointBlock& block, size_t count, uint64_t at, Part& part) {
        const bool wide = block.colourMax > 255;
        part.colourMax = std::max(part.colourMax, block.colourMax);
        for (size_t i = 0; i < count; ++i) {
            const uint64_t c = block.colour16[i];
            const auto r = static_cast<uint32_t>(c & 0xffffu), g = static_cast<uint32_t>(c >> 16 & 0xffffu),
                       b = static_cast<uint32_t>(c >> 32 & 0xffffu);
            cloud_.colour[at + i] = wide ? toByte(r) | toByte(g) << 8 | toByte(b) << 16 : r | g << 8 | b << 16;
        }
        if (!wide) part.narrow.emplace_back(at, count);
    }

    void widenColours() {
        std::vector<uint32_t> largest(sources_.size(), 0);
        for (const Part& p : parts_) largest[p.source] = std::max(largest[p.source], p.colourMax);
        for (const Part& p : parts_) {
            if (largest[p.source] <= 255) continue;
            for (const auto& [first, count] : p.narrow)
                for (uint64_t i = first; i < first + count; ++i) {
                    const uint32_t c = cloud_.colour[i];
                    cloud_.colour[i] = toByte(c & 255u) | toByte(c >> 8 & 255u) << 8 | toByte(c >> 16 & 255u) << 16 |
                                       (c & 0xff000000u);
                }
        }
    }

    /// The first error in the order of the input, or what was lost.
    Result<void> takeErrors() {
        report_.pointsIn = declared_;
        for (const Part& p : parts_) {
            if (!p.error) continue;
            if (!settings_.skipBad) return tl::unexpected(*p.error);
            report_.dropped["corrupt"] += p.count;
            report_.notes.push_back(fmt::format("lost {} points: {}", p.count, p.error->line()));
        }
        return {};
    }

    /// Closes the gaps that corrupt parts and points that are not numbers leave.
    void compact() {
        if (allLattice_ && report_.dropped.empty()) return;
        uint64_t to = 0;
        for (Part& p : parts_) {
            const uint64_t first = p.first;
            p.first = to;
            for (uint64_t i = first; i < first + p.count && !p.error; ++i) {
                if (!allLattice_ && !std::isfinite(position_[i].x + position_[i].y + position_[i].z)) {
                    ++report_.dropped["not_finite"];
                    continue;
                }
                if (to != i) move(i, to);
                ++to;
            }
            p.count = to - p.first;
        }
        const auto n = static_cast<size_t>(to);
        if (allLattice_)
            for (auto* axis : {&cloud_.x, &cloud_.y, &cloud_.z}) axis->resize(n);
        else
            position_.resize(n);
        cloud_.colour.resize(n);
        if (cloud_.hasNormal) cloud_.normal.resize(n);
        cloud_.radius.resize(n);
        for (CloudAttribute& a : cloud_.attributes) a.values.resize(n * bytesOf(a.info.type));
    }

    void move(uint64_t from, uint64_t to) {
        if (allLattice_)
            for (auto* axis : {&cloud_.x, &cloud_.y, &cloud_.z}) (*axis)[to] = (*axis)[from];
        else
            position_[to] = position_[from];
        cloud_.colour[to] = cloud_.colour[from];
        if (cloud_.hasNormal) cloud_.normal[to] = cloud_.normal[from];
        cloud_.radius[to] = cloud_.radius[from];
        for (CloudAttribute& a : cloud_.attributes) {
            const size_t width = bytesOf(a.info.type);
            std::copy_n(a.values.begin() + static_cast<ptrdiff_t>(from * width), width,
                        a.values.begin() + static_cast<ptrdiff_t>(to * width));
        }
    }

    /// Scanner integers to the common lattice, in place.
    Result<void> placeIntegers(Executor& executor) {
        std::vector<SourceInfo> infos;
        for (const PointSource& s : sources_) infos.push_back(s.info);
        const CommonLattice lattice = findLattice(infos);
        glm::dvec3 lo(std::numeric_limits<double>::max()), hi(-lo);
        for (const Part& p : parts_) {
            if (p.count == 0) continue;
            const ToLattice& to = lattice.of[p.source];
            lo = glm::min(lo, glm::round(glm::dvec3(p.lo) * to.ratio + to.shift));
            hi = glm::max(hi, glm::round(glm::dvec3(p.hi) * to.ratio + to.shift));
        }
        const glm::dvec3 extents = hi - lo;
        const double extent = std::max({extents.x, extents.y, extents.z});
        const double step = stepFor(extent, lattice.unit);
        cloud_.unit = lattice.unit * step;
        cloud_.origin = lattice.base + lattice.unit * lo;
        for (size_t s = 0; s < infos.size(); ++s)
            if (!lattice.of[s].exact)
                report_.notes.push_back(
                    fmt::format("{}: scale and offset do not fit a common lattice; coordinates are "
                                "rounded to {} units",
                                infos[s].path, lattice.unit));
        std::vector<double> rounding(parts_.size(), 0.0);
        executor.parallelFor(parts_.size(), 1, [&](size_t begin, size_t end) {
            for (size_t i = begin; i < end; ++i)
                rounding[i] = placePart(parts_[i], lattice.of[parts_[i].source], lo, step);
        });
        cloud_.roundingUnits = *std::max_element(rounding.begin(), rounding.end()) * lattice.unit;
        return {};
    }

    double placePart(const Part& p, const ToLattice& to, const glm::dvec3& lo, double step) {
        double rounding = 0;
        for (int a = 0; a < 3; ++a) {
            auto& axis = a == 0 ? cloud_.x : a == 1 ? cloud_.y : cloud_.z;
            const auto ratio = static_cast<int64_t>(to.ratio[a]);
            const auto shift = static_cast<int64_t>(to.shift[a] - lo[a]);
            const bool whole = to.exact && step == 1 && std::abs(to.shift[a] - lo[a]) < 9e15;
            for (uint64_t i = p.first; i < p.first + p.count; ++i) {
                const auto x = static_cast<int32_t>(axis[i]);
                if (whole) {
                    axis[i] = static_cast<uint32_t>(x * ratio + shift);
                } else {
                    const double q = (x * to.ratio[a] + to.shift[a] - lo[a]) / step, r = std::round(q);
                    rounding = std::max(rounding, std::abs(r - q) * step);
                    axis[i] = static_cast<uint32_t>(std::max(r, 0.0));
                }
            }
        }
        return rounding;
    }

    double stepFor(double extent, double unit) {
        if (extent <= kLatticeLimit) return 1;
        const double step = std::exp2(std::ceil(std::log2(extent / kLatticeLimit)) + 1);
        report_.notes.push_back(fmt::format("the points span {:.3g} steps of {}; coordinates are rounded to {} units",
                                            extent, unit, unit * step));
        return step;
    }

    Result<void> placeFloats() {
        glm::dvec3 lo = position_[0], hi = lo;
        for (const glm::dvec3& p : position_) {
            lo = glm::min(lo, p);
            hi = glm::max(hi, p);
        }
        const glm::dvec3 extents = hi - lo;
        const double extent = std::max({extents.x, extents.y, extents.z});
        if (!std::isfinite(extent))
            return fail(ErrorKind::input, "the coordinates span more than a double can hold", inputs_.front());
        double unit = extent > 0 ? std::exp2(std::ceil(std::log2(extent)) - 21) : std::exp2(-10);
        // Below the spacing of doubles at this place there is nothing to resolve.
        const double farthest =
            std::max({std::abs(lo.x), std::abs(lo.y), std::abs(lo.z), std::abs(hi.x), std::abs(hi.y), std::abs(hi.z)});
        if (farthest > 0) unit = std::max(unit, std::exp2(std::ceil(std::log2(farthest)) - 52));
        cloud_.unit = unit;
        cloud_.origin = lo;
        double rounding = 0;
        for (auto* axis : {&cloud_.x, &cloud_.y, &cloud_.z}) axis->resize(position_.size());
        for (size_t i = 0; i < position_.size(); ++i) {
            const glm::dvec3 q = (position_[i] - lo) / unit;
            const glm::dvec3 r = glm::round(q);
            const glm::dvec3 d = glm::abs(r - q);
            rounding = std::max({rounding, d.x, d.y, d.z});
            cloud_.x[i] = static_cast<uint32_t>(r.x);
            cloud_.y[i] = static_cast<uint32_t>(r.y);
            cloud_.z[i] = static_cast<uint32_t>(r.z);
        }
        cloud_.roundingUnits = rounding * unit;
        position_ = {};
        return {};
    }

    void finishAttributes() {
        // A scan whose points all have one colour has no colours of its own: it is shaded.
        const auto rgb = [](uint32_t c) { return c & 0xffffffu; };
        cloud_.hasColour = cloud_.hasColour && std::any_of(cloud_.colour.begin(), cloud_.colour.end(),
                                                           [&](uint32_t c) { return rgb(c) != rgb(cloud_.colour[0]); });
        const auto perUnit = static_cast<float>(1.0 / cloud_.unit);
        if (cloud_.hasRadius)
            for (float& r : cloud_.radius) r *= perUnit;
        if (!cloud_.hasNormal) {
            cloud_.normal.assign(cloud_.size(), 0u);
            for (uint32_t& c : cloud_.colour) c |= shared::kFlagNoNormal << 24;
        }
    }

    const std::vector<std::string>& inputs_;
    const BuildSettings& settings_;
    BuildReport& report_;
    std::vector<PointSource> sources_;
    std::vector<Part> parts_;
    uint64_t declared_ = 0;
    bool allLattice_ = true;
    std::string crsPath_;
    std::vector<glm::dvec3> position_;  ///< where not all input is on a lattice
    Cloud cloud_;
};

}  // namespace

Result<Cloud> readCloud(const std::vector<std::string>& inputs, const BuildSettings& settings, BuildReport& report,
                        Executor& executor, Progress& progress) {
    return Reading(inputs, settings, report).run(executor, progress);
}

}  // namespace stipple::lod
