// From files to one cloud on one lattice. LAS integers stay what they are: the lattice unit is the file's scale. For
// floating-point input the unit is a power of two, 2^-21 of the extent.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "lod/build/cloud.h"
#include "lod/build/octahedral.h"
#include "lod/import/import.h"

namespace stipple::lod {
namespace {

constexpr double kLatticeLimit = 4294967295.0;

/// 16-bit colours that hold 8-bit values: bytes are taken as they are until a larger value shows, then what was kept
/// so far is rescaled in place. One pass, no second copy.
class ColourRange {
  public:
    void append(const PointBlock& block, std::vector<uint32_t>& out) {
        if (!wide_ && block.colourMax > 255) {
            wide_ = true;
            for (size_t i = start_; i < out.size(); ++i) {
                uint32_t c = 0;
                for (unsigned shift = 0; shift < 24; shift += 8) c |= (((out[i] >> shift & 255u) + 128) / 257) << shift;
                out[i] = c;
            }
        }
        for (const uint64_t c : block.colour16) {
            const auto channel = [&](unsigned shift) {
                const auto v = static_cast<uint32_t>(c >> shift & 0xffffu);
                return wide_ ? (v + 128) / 257 : v;
            };
            out.push_back(channel(0) | channel(16) << 8 | channel(32) << 16);
        }
    }
    void startFile(size_t at) {
        wide_ = false;
        start_ = at;
    }

  private:
    bool wide_ = false;
    size_t start_ = 0;
};

/// How one source's positions become steps of the common lattice: step = position * ratio + shift.
struct ToLattice {
    glm::dvec3 ratio{1}, shift{0};
    bool exact = true;
};

ToLattice toLattice(const SourceInfo& info, double unit, const glm::dvec3& origin) {
    ToLattice to;
    for (int a = 0; a < 3; ++a) {
        to.ratio[a] = info.scale[a] / unit;
        to.shift[a] = (info.offset[a] - origin[a]) / unit;
        // A ratio or shift that is whole but for its own rounding is whole.
        for (double* value : {&to.ratio[a], &to.shift[a]}) {
            const double whole = std::round(*value);
            if (std::abs(*value - whole) <= 1e-6 * std::max(1.0, std::abs(whole) * 1e-6))
                *value = whole;
            else
                to.exact = false;
        }
    }
    return to;
}

}  // namespace

Result<Cloud> readCloud(const std::vector<std::string>& inputs, const BuildSettings& settings, BuildReport& report,
                        Progress& progress) {
    std::vector<PointSource> sources;
    uint64_t declared = 0;
    Cloud cloud;
    bool allLattice = true;
    for (const std::string& path : inputs) {
        STIPPLE_ASSIGN(PointSource source, openPointSource(path));
        declared += source.info.points;
        allLattice = allLattice && source.info.isLattice;
        cloud.hasColour = cloud.hasColour || source.info.hasColour;
        cloud.hasNormal = cloud.hasNormal || (source.info.hasNormal && settings.normals != NormalsMode::none);
        cloud.hasRadius = cloud.hasRadius || source.info.hasRadius;
        for (const std::string& note : source.info.notes) report.notes.push_back(fmt::format("{}: {}", path, note));
        if (!cloud.source.empty()) cloud.source += ", ";
        cloud.source += std::filesystem::path(path).filename().string();
        sources.push_back(std::move(source));
    }
    const uint64_t needed = declared * kBuildBytesPerPoint + (uint64_t{96} << 20);
    if (needed > settings.memoryBytes)
        return fail(ErrorKind::budget,
                    fmt::format("building {} points needs about {} MiB, but --memory allows {} MiB", declared,
                                needed >> 20, settings.memoryBytes >> 20),
                    inputs.front(), fmt::format("give --memory {}M or fewer points", (needed >> 20) + 1));
    if (declared > 0xfffffff0u) return fail(ErrorKind::budget, "more than 4,294,967,280 points", inputs.front());
    cloud.up = settings.up.value_or(sources.front().info.up);
    cloud.crs = sources.front().info.crs;
    cloud.attributes = sources.front().info.attributes;

    double unit = 0;
    glm::dvec3 base(0);
    if (allLattice) {
        unit = sources.front().info.scale.x;
        for (const PointSource& s : sources) unit = std::min({unit, s.info.scale.x, s.info.scale.y, s.info.scale.z});
        base = sources.front().info.offset;
    }
    std::vector<glm::dvec3> position;
    position.reserve(declared);
    cloud.colour.reserve(declared);
    ColourRange colours;
    PointBlock block;
    double rounding = 0;
    for (PointSource& source : sources) {
        const SourceInfo& info = source.info;
        const ToLattice to = allLattice ? toLattice(info, unit, base) : ToLattice{};
        if (!to.exact)
            report.notes.push_back(
                fmt::format("{}: scale and offset do not fit the common lattice; coordinates are "
                            "rounded to {} units",
                            info.path, unit));
        colours.startFile(position.size());
        for (;;) {
            block.clear();
            STIPPLE_ASSIGN(const size_t count, source.read(block, 65536));
            if (count == 0) break;
            report.pointsIn += count;
            const size_t first = position.size();
            bool allFinite = true;
            for (size_t i = 0; i < count; ++i) {
                glm::dvec3 p = block.position[i];
                if (allLattice) {
                    p = p * to.ratio + to.shift;
                    if (!to.exact) {
                        const glm::dvec3 r = glm::round(p);
                        const glm::dvec3 d = glm::abs(r - p);
                        rounding = std::max({rounding, d.x, d.y, d.z});
                        p = r;
                    }
                } else if (info.isLattice) {
                    p = p * info.scale + info.offset;
                }
                allFinite = allFinite && std::isfinite(p.x + p.y + p.z);
                position.push_back(p);
            }
            if (!block.colour16.empty())
                colours.append(block, cloud.colour);
            else if (!block.colour.empty())
                cloud.colour.insert(cloud.colour.end(), block.colour.begin(), block.colour.end());
            else
                cloud.colour.resize(position.size(), 0xc8c8c8u);
            if (cloud.hasNormal) {
                for (size_t i = 0; i < count; ++i) {
                    const glm::vec3 n = block.normal.empty() ? glm::vec3(0) : block.normal[i];
                    const float scale = std::max({std::abs(n.x), std::abs(n.y), std::abs(n.z)});
                    const bool usable = scale > 0 && std::isfinite(scale) && std::isfinite(n.x + n.y + n.z);
                    cloud.normal.push_back(usable ? octEncode(n / scale) : 0u);
                    if (!usable) cloud.colour[first + i] |= shared::kFlagNoNormal << 24;
                }
            }
            if (cloud.hasRadius)
                for (size_t i = 0; i < count; ++i) {
                    const float r = block.radius.empty() ? 0.0f : block.radius[i];
                    cloud.radius.push_back(std::isfinite(r) && r > 0 ? r : 0.0f);
                }
            if (!allFinite) {  // drop what is not a number, keep the arrays parallel
                size_t to2 = first;
                for (size_t i = first; i < position.size(); ++i) {
                    if (!std::isfinite(position[i].x + position[i].y + position[i].z)) continue;
                    position[to2] = position[i];
                    cloud.colour[to2] = cloud.colour[i];
                    if (cloud.hasNormal) cloud.normal[to2] = cloud.normal[i];
                    if (cloud.hasRadius) cloud.radius[to2] = cloud.radius[i];
                    ++to2;
                }
                report.dropped["not_finite"] += position.size() - to2;
                position.resize(to2);
                cloud.colour.resize(to2);
                if (cloud.hasNormal) cloud.normal.resize(to2);
                if (cloud.hasRadius) cloud.radius.resize(to2);
            }
            progress.update("read", report.pointsIn, declared);
        }
    }
    if (position.empty())
        return fail(ErrorKind::input,
                    report.pointsIn == 0 ? "holds no points"
                                         : fmt::format("none of its {} points is a number", report.pointsIn),
                    inputs.front(), "nothing was written");

    // A scan whose points all have one colour has no colours of its own: it is shaded.
    const auto rgb = [](uint32_t c) { return c & 0xffffffu; };
    cloud.hasColour = cloud.hasColour && std::any_of(cloud.colour.begin(), cloud.colour.end(),
                                                     [&](uint32_t c) { return rgb(c) != rgb(cloud.colour[0]); });

    glm::dvec3 lo = position[0], hi = lo;
    for (const glm::dvec3& p : position) {
        lo = glm::min(lo, p);
        hi = glm::max(hi, p);
    }
    const glm::dvec3 extents = hi - lo;
    const double extent = std::max({extents.x, extents.y, extents.z});
    if (!std::isfinite(extent))
        return fail(ErrorKind::input, "the coordinates span more than a double can hold", inputs.front());
    double step = 1;  // of the positions, per lattice unit
    if (!allLattice) {
        step = extent > 0 ? std::exp2(std::ceil(std::log2(extent)) - 21) : std::exp2(-10);
        // Below the spacing of doubles at this place there is nothing to resolve.
        const double farthest =
            std::max({std::abs(lo.x), std::abs(lo.y), std::abs(lo.z), std::abs(hi.x), std::abs(hi.y), std::abs(hi.z)});
        if (farthest > 0) step = std::max(step, std::exp2(std::ceil(std::log2(farthest)) - 52));
        unit = 1;
    } else if (extent > kLatticeLimit) {
        step = std::exp2(std::ceil(std::log2(extent / kLatticeLimit)) + 1);
        report.notes.push_back(fmt::format("the points span {:.3g} steps of {}; coordinates are rounded to {} units",
                                           extent, unit, unit * step));
    }
    cloud.unit = unit * step;
    cloud.origin = allLattice ? base + unit * lo : lo;
    cloud.x.resize(position.size());
    cloud.y.resize(position.size());
    cloud.z.resize(position.size());
    for (size_t i = 0; i < position.size(); ++i) {
        const glm::dvec3 q = (position[i] - lo) / step;
        const glm::dvec3 r = glm::round(q);
        const glm::dvec3 d = glm::abs(r - q);
        rounding = std::max({rounding, d.x * step, d.y * step, d.z * step});
        cloud.x[i] = static_cast<uint32_t>(r.x);
        cloud.y[i] = static_cast<uint32_t>(r.y);
        cloud.z[i] = static_cast<uint32_t>(r.z);
    }
    cloud.roundingUnits = rounding * unit;
    const auto perUnit = static_cast<float>(1.0 / cloud.unit);
    if (cloud.hasRadius)
        for (float& r : cloud.radius) r *= perUnit;
    else
        cloud.radius.assign(position.size(), 0.0f);
    if (!cloud.hasNormal) {
        cloud.normal.assign(position.size(), 0u);
        for (uint32_t& c : cloud.colour) c |= shared::kFlagNoNormal << 24;
    }
    return cloud;
}

}  // namespace stipple::lod
