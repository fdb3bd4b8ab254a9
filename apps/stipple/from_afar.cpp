#include "apps/stipple/from_afar.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "apps/stipple/cache.h"
#include "lod/build/strands/strand_samples.h"
#include "lod/in_memory.h"
#include "lod/nearest.h"

namespace stipple::app {
namespace {

/// Points that are given, nothing to be estimated.
lod::BuildSettings pointSettings(const lod::PointSource& points, uint32_t coarserLevels) {
    lod::BuildSettings settings;
    settings.normals = lod::NormalsMode::keep;
    settings.coarserLevels = coarserLevels;
    settings.open = [&points](const std::string&, const lod::ReadOptions&) -> Result<lod::PointSource> {
        return points;
    };
    return settings;
}

lod::SourceInfo sampleInfo(const std::string& input) {
    lod::SourceInfo info;
    info.path = input;
    info.format = "strands, sampled";
    info.isReflectance = info.isTwoSided = true;
    info.up = lod::UpAxis::y;
    return info;
}

}  // namespace

Result<StandIns> meshFromAfar(const scene::Scene& scene, const std::vector<scene::Placement>& of,
                              const lod::Store& mesh, const std::string& part, const BuildOptions& build,
                              Executor& executor, bool showProgress) {
    constexpr uint64_t kManyTriangles = 2000, kSurfels = 200'000;
    const lod::Hierarchy& h = mesh.hierarchy;
    uint64_t coarsest = 0;
    for (size_t i = 0; i < h.nodes.size(); ++i) coarsest += h.groups[i].parents == 0 ? h.nodes[i].records : 0;
    if (coarsest < kManyTriangles) return StandIns();
    const auto make = [&](const std::string& path, Progress& progress) -> Result<lod::BuildReport> {
        scene::Scene only = scene;
        only.nodes.clear();
        for (const scene::Placement& p : of) {
            scene::Node node;
            node.mesh = p.mesh;
            node.local = p.world;
            only.nodes.push_back(node);
        }
        for (scene::Mesh& m : only.meshes)
            std::erase_if(m.primitives, [](const auto& p) { return p.kind != scene::PrimitiveKind::triangles; });
        STIPPLE_ASSIGN(const std::vector<scene::DecodedImage> images, decodeImages(scene));
        STIPPLE_ASSIGN(lod::PointSource samples, scene::sampleSurfels(only, images, {kSurfels}));
        STIPPLE_ASSIGN(lod::BuildSettings settings, build.settings());
        settings.open = [&](const std::string&, const lod::ReadOptions&) -> Result<lod::PointSource> {
            return samples;
        };
        return lod::buildStore({scene.path}, path, settings, executor, progress);
    };
    render::StandIn points;
    STIPPLE_ASSIGN(points.store, openCached({scene.path}, build, part + ", from afar", showProgress, make));
    STIPPLE_ASSIGN(points.error, lod::largestLeafRadius(*points.store));
    return std::make_shared<const std::vector<render::StandIn>>(std::vector{points});
}

Result<StandIns> strandsFromAfar(const lod::StrandSet& clean, const std::string& input, const std::string& part,
                                 const BuildOptions& build, Executor& executor, bool showProgress) {
    constexpr uint64_t kFewSegments = 2000, kMostSamples = 65536, kFewestSamples = 256;
    const uint64_t segments = clean.position.size() - clean.strands();
    auto out = std::make_shared<std::vector<render::StandIn>>();
    if (segments < kFewSegments) return StandIns();
    for (uint64_t count = std::min(kMostSamples, segments / 2); count >= kFewestSamples; count /= 4) {
        const auto make = [&](const std::string& path, Progress& progress) -> Result<lod::BuildReport> {
            constexpr uint32_t kCoarser = 3;
            const lod::PointSource points =
                lod::pointsInMemory(sampleInfo(input), lod::sampleStrands(clean, count).points);
            return lod::buildStore({input}, path, pointSettings(points, kCoarser), executor, progress);
        };
        render::StandIn standIn;
        STIPPLE_ASSIGN(standIn.store,
                       openCached({input}, build, fmt::format("{}, {} samples", part, count), showProgress, make));
        STIPPLE_ASSIGN(standIn.error, lod::largestLeafRadius(*standIn.store));
        out->push_back(std::move(standIn));
    }
    return StandIns(out);
}

void CrowdBuilder::add(const lod::StrandSet& clean, uint32_t first, uint32_t count) {
    models_.push_back({clean, first, count});
}

namespace {

/// The samples of one model, and where copies of them stand.
struct PlacedSamples {
    lod::StrandSamples samples;
    uint32_t first = 0, count = 0;
};

/// All copies of all samples, a part each model.
lod::PointSource placedSource(const std::vector<PlacedSamples>& models, const OpenedScene& scene,
                              const std::string& input) {
    lod::PointSource source;
    source.info = sampleInfo(input);
    source.info.hasColour = source.info.hasNormal = source.info.hasRadius = true;
    for (const PlacedSamples& m : models) {
        source.parts.push_back(m.samples.points.position.size() * m.count);
        source.info.points += source.parts.back();
    }
    source.openPart = [&models, &scene](size_t part) -> Result<lod::PointReader> {
        return lod::PointReader([&m = models[part], &scene, next = uint64_t{0}](
                                    lod::PointBlock& block, size_t limit) mutable -> Result<size_t> {
            const lod::PointBlock& from = m.samples.points;
            const uint64_t per = from.position.size(), end = std::min(next + limit, per * m.count), begin = next;
            for (; next < end; ++next) {
                const lod::Instance& place = scene.placed[m.first + next / per].place;
                const size_t k = next % per;
                block.position.push_back(place.translation + place.rotation * (place.scale * from.position[k]));
                block.normal.emplace_back(place.rotation * glm::dvec3(from.normal[k]));
                block.colour.push_back(from.colour[k]);
                block.radius.push_back(from.radius[k] * static_cast<float>(place.scale));
            }
            return static_cast<size_t>(end - begin);
        });
    };
    return source;
}

/// Which placed stores reach into which leaf's cell.
void findMembers(const std::vector<PlacedSamples>& models, const OpenedScene& scene, render::PlacedCrowd& crowd) {
    const lod::Hierarchy& h = crowd.points->hierarchy;
    std::vector<std::vector<uint32_t>> reached(h.nodes.size());
    for (const PlacedSamples& m : models)
        for (uint32_t k = m.first; k < m.first + m.count; ++k) {
            const render::PlacedStore& p = scene.placed[k];
            const lod::Hierarchy& own = p.store->hierarchy;
            const glm::dvec3 middle = own.origin + own.unit * own.nodes[0].centre;
            const glm::dvec3 centre =
                (p.place.translation + p.place.rotation * (p.place.scale * middle) - h.origin) / h.unit;
            const double radius = own.unit * own.nodes[0].radius * p.place.scale / h.unit;
            std::vector<uint32_t> stack{0};
            while (!stack.empty()) {
                const uint32_t index = stack.back();
                stack.pop_back();
                const lod::Node& node = h.nodes[index];
                const double edge = h.cellSize(node);
                const glm::dvec3 least = edge * glm::dvec3(node.cell[0], node.cell[1], node.cell[2]);
                const glm::dvec3 nearest = glm::clamp(centre, least, least + edge);
                if (glm::length(nearest - centre) > radius) continue;
                if (node.isLeaf()) reached[index].push_back(k);
                for (int c = 0; c < __builtin_popcount(node.childMask); ++c)
                    stack.push_back(node.firstChild + static_cast<uint32_t>(c));
            }
        }
    crowd.first.push_back(0);
    for (const auto& members : reached) {
        crowd.members.insert(crowd.members.end(), members.begin(), members.end());
        crowd.first.push_back(static_cast<uint32_t>(crowd.members.size()));
    }
}

}  // namespace

Result<void> CrowdBuilder::finish(const std::string& input, const BuildOptions& build, Executor& executor,
                                  bool showProgress, OpenedScene& scene) {
    constexpr uint64_t kFew = 64, kMostPoints = 12'000'000;
    uint64_t count = 0;
    for (const Model& m : models_) count += m.count;
    if (count < kFew) return {};
    const uint64_t samples = std::clamp<uint64_t>(kMostPoints / count, 16, 512);
    std::vector<PlacedSamples> models;
    render::PlacedCrowd crowd;
    for (const Model& m : models_) {
        models.push_back({lod::sampleStrands(m.strands, samples), m.first, m.count});
        for (uint32_t k = m.first; k < m.first + m.count; ++k) {
            constexpr double kRounding = 1.05;  // of radii in the file
            crowd.error = std::max(crowd.error, kRounding * models.back().samples.radius * scene.placed[k].place.scale);
            scene.placed[k].isMember = true;
        }
    }
    const auto make = [&](const std::string& path, Progress& progress) -> Result<lod::BuildReport> {
        const lod::PointSource points = placedSource(models, scene, input);
        return lod::buildStore({input}, path, pointSettings(points, 0), executor, progress);
    };
    STIPPLE_ASSIGN(crowd.points, openCached({input}, build, fmt::format("crowd of {}", samples), showProgress, make));
    findMembers(models, scene, crowd);
    scene.crowds.push_back(std::move(crowd));
    return {};
}

}  // namespace stipple::app
