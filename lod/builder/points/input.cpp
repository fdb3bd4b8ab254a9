#include "lod/builder/points/input.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "engine/base/file.h"
#include "engine/base/hash.h"
#include "lod/import/import.h"

namespace stipple::lod {
namespace {

bool isStoredAlike(const AttributeInfo& a, const AttributeInfo& b) {
    return a.type == b.type && a.scale == b.scale && a.offset == b.offset &&
           (!a.noData || !b.noData || *a.noData == *b.noData);
}

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
    STIPPLE_ASSIGN(const std::vector<std::string> files, expandInputs(inputs, &report.notes));
    ReadOptions options;
    options.skipBad = settings.skipBad;
    if (settings.allAttributes) STIPPLE_TRY(collectNames(files, options, report));
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
    findMaterials();
    if (allLattice_) {
        std::vector<SourceInfo> infos;
        for (const PointSource& s : sources_) infos.push_back(s.info);
        lattice_ = findLattice(infos);
    }
    up = settings.up.value_or(sources_.front().info.up);
    source = std::filesystem::path(firstPath()).filename().string();
    if (sources_.size() > 1) source += fmt::format(" and {} more", sources_.size() - 1);
    return {};
}

/// One list for all sources: theirs where it is the same, else the grid. A source without materials is matte among
/// others that have some.
void PointInput::findMaterials() {
    const std::vector<PointMaterial> none{PointMaterial{}};
    const auto listOf = [&](const PointSource& s) { return s.info.materials.empty() ? none : s.info.materials; };
    const bool hasAny =
        std::any_of(sources_.begin(), sources_.end(), [](const auto& s) { return !s.info.materials.empty(); });
    if (settings_.material) {
        materials = {*settings_.material};
    } else if (hasAny) {
        materials = listOf(sources_.front());
        for (const PointSource& s : sources_)
            if (listOf(s) != materials) materials = materialGrid();
    }
    isReflectance = isReflectance || !materials.empty();
    if (materials.size() < 2) return;
    for (const PointSource& s : sources_) {
        const std::vector<PointMaterial> own = listOf(s);
        std::vector<uint8_t>& numbers = materialOf_.emplace_back();
        for (size_t i = 0; i < own.size(); ++i)
            numbers.push_back(own == materials ? static_cast<uint8_t>(i)
                                               : gridIndex(double{own[i].roughness}, double{own[i].metallic}));
    }
    AttributeInfo index;
    index.name = kMaterialAttribute;
    const auto isTaken = [&](const AttributeInfo& a) { return a.name == index.name; };
    while (std::any_of(attributes_.begin(), attributes_.end(), isTaken)) index.name += "_index";
    index.aggregate = Aggregate::mode;
    index.description = "number in the list of materials";
    attributes_.push_back(index);
}

Result<PointSource> PointInput::openInput(const std::string& path, const ReadOptions& options) const {
    return settings_.open ? settings_.open(path, options) : openPointSource(path, options);
}

/// Every attribute of every file, in order of first appearance.
Result<void> PointInput::collectNames(const std::vector<std::string>& files, ReadOptions& options,
                                      BuildReport& report) const {
    std::vector<AttributeInfo> all;
    std::vector<std::string> unlike;
    for (const std::string& path : files) {
        const auto opened = openInput(path, {{}, settings_.skipBad});
        if (!opened) continue;  // said when it is opened for reading
        for (const AttributeInfo& a : opened->info.attributes) {
            const auto known =
                std::find_if(all.begin(), all.end(), [&](const AttributeInfo& k) { return k.name == a.name; });
            if (known == all.end()) {
                all.push_back(a);
            } else if (!isStoredAlike(*known, a) && settings_.leaveOutUnlike &&
                       std::find(unlike.begin(), unlike.end(), a.name) == unlike.end()) {
                unlike.push_back(a.name);
                report.notes.push_back(
                    fmt::format("attribute '{}' is left out: {} stores it in another way than others", a.name, path));
            }
        }
    }
    for (const AttributeInfo& a : all)
        if (std::find(unlike.begin(), unlike.end(), a.name) == unlike.end()) options.attributes.push_back(a.name);
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
            if (found[k] && !isStoredAlike(mine, a))
                return fail(ErrorKind::input,
                            fmt::format("stores attribute '{}' as {} x {} + {}, other files as {} x {} + {}", a.name,
                                        kScalarNames.at(static_cast<size_t>(a.type)), a.scale, a.offset,
                                        kScalarNames.at(static_cast<size_t>(mine.type)), mine.scale, mine.offset),
                            info.path, "leave this attribute out");
            const std::optional<double> declared = mine.noData;  // one file of several may say it
            mine = a;
            if (!mine.noData) mine.noData = declared;
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

}  // namespace stipple::lod
