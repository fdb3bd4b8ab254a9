#include "engine/scene/open/proxies.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "engine/scene/open/cache.h"
#include "lod/builder/curves/curve_coverage.h"
#include "lod/builder/stochastic/stochastic_build.h"
#include "lod/store/nearest.h"

namespace stipple::scene {
Result<Proxies> meshProxies(const scene::Scene& scene, const std::vector<scene::Placement>& of, const lod::Store& mesh,
                            const std::string& part, const OpenSettings& build, Executor& executor) {
    constexpr uint64_t kManyTriangles = 2000, kSurfels = 200'000;
    const lod::Hierarchy& h = mesh.hierarchy;
    uint64_t coarsest = 0;
    for (size_t i = 0; i < h.nodes.size(); ++i) coarsest += h.groups[i].parents == 0 ? h.nodes[i].records : 0;
    if (coarsest < kManyTriangles) return Proxies();
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
        STIPPLE_ASSIGN(const std::vector<scene::DecodedImage> images,
                       decodeImages(scene, build.reading().memoryBytes, build.say));
        STIPPLE_ASSIGN(lod::PointSource samples, scene::sampleSurfels(only, images, {kSurfels}));
        STIPPLE_ASSIGN(lod::BuildSettings settings, build.settings());
        settings.open = [&](const std::string&, const lod::ReadOptions&) -> Result<lod::PointSource> {
            return samples;
        };
        return lod::buildStore({scene.path}, path, settings, executor, progress);
    };
    render::Proxy points;
    STIPPLE_ASSIGN(points.store, openCached({scene.path}, build, part + ", proxy", make));
    STIPPLE_ASSIGN(points.error, lod::largestLeafRadius(*points.store));
    return std::make_shared<const std::vector<render::Proxy>>(std::vector{points});
}

namespace {

constexpr uint64_t kMostSamples = 1048576;

lod::StochasticSettings stochasticSettings(const std::string& input) {
    lod::StochasticSettings settings;
    settings.description.source = std::filesystem::path(input).filename().string();
    settings.description.up = {0, 1, 0};
    return settings;
}

/// The whole of some samples, where they are. `of`: the store that they show.
lod::StochasticItem itemOf(const lod::CurveSamples& samples, const lod::Store& of) {
    lod::StochasticItem item;
    item.samples = &samples;
    item.count = static_cast<uint32_t>(samples.points.position.size());
    const lod::Hierarchy& h = of.hierarchy;
    item.centre = h.origin + h.unit * h.nodes[0].centre;
    item.reach = h.unit * h.nodes[0].radius;
    return item;
}

/// The same, with a sphere of its own.
lod::StochasticItem itemAlone(const lod::CurveSamples& samples) {
    lod::StochasticItem item;
    item.samples = &samples;
    item.count = static_cast<uint32_t>(samples.points.position.size());
    glm::dvec3 lo(1e300), hi(-1e300);
    for (const glm::dvec3& p : samples.points.position) {
        lo = glm::min(lo, p);
        hi = glm::max(hi, p);
    }
    item.centre = 0.5 * (lo + hi);
    for (const glm::dvec3& p : samples.points.position) item.reach = std::max(item.reach, glm::length(p - item.centre));
    return item;
}

}  // namespace

const lod::CurveSet& CurveModel::curves() {
    if (!curves_) curves_ = make_();
    return *curves_;
}
const lod::CurveSamples& CurveModel::samples() {
    if (!samples_) {
        const uint64_t segments = curves().position.size() - curves().curves();
        samples_ = lod::sampleCurves(curves(), std::min(kMostSamples, std::max<uint64_t>(2 * segments, 64)));
    }
    return *samples_;
}
const lod::DiscFactors& CurveModel::factors() {
    if (!factors_) factors_ = {lod::coverageFactors(curves(), samples(), executor_), samples().radius};
    return *factors_;
}

Result<Proxies> curveProxies(const SharedModel& model, const lod::Store& of, const std::string& input,
                             const std::string& part, const OpenSettings& build, Executor& executor) {
    constexpr uint64_t kFewSegments = 2000;
    const uint64_t segments = of.description.points;
    if (segments < kFewSegments) return Proxies();
    const auto make = [&](const std::string& path, Progress& progress) -> Result<lod::BuildReport> {
        lod::StochasticSettings settings = stochasticSettings(input);
        lod::describeDiscs({model->factors()}, settings.description);
        constexpr uint32_t kMostInNode = 8192;
        const std::vector<lod::CurveSamples> parts = lod::splitSamples(model->samples(), kMostInNode);
        std::vector<lod::StochasticItem> items;
        items.reserve(parts.size());
        for (const lod::CurveSamples& cube : parts) items.push_back(itemAlone(cube));
        return lod::buildStochasticStore(items, path, settings, executor, progress);
    };
    render::Proxy proxy;
    STIPPLE_ASSIGN(proxy.store, openCached({input}, build, part + ", proxy", make));
    return std::make_shared<const std::vector<render::Proxy>>(std::vector{proxy});
}

void GroupBuilder::add(const SharedModel& model, uint32_t first, uint32_t count) {
    models_.push_back({model, first, count});
}

Result<void> GroupBuilder::finish(const std::string& input, const OpenSettings& build, Executor& executor,
                                  OpenedScene& scene) {
    constexpr uint64_t kFew = 64, kMostPoints = 12'000'000;
    constexpr uint32_t kGroupNode = 2048;  // small nodes: all of one is drawn as finely as its nearest part asks for
    uint64_t count = 0;
    for (const Model& m : models_) count += m.count;
    if (count < kFew) return {};
    const auto make = [&](const std::string& path, Progress& progress) -> Result<lod::BuildReport> {
        // Discs of one size for all: as many of each model as its area asks for.
        const auto areaOf = [](const Model& m) {  // n r^2
            const lod::CurveSamples& samples = m.model->samples();
            return samples.radius * samples.radius * static_cast<double>(samples.points.position.size());
        };
        double area = 0;
        for (const Model& m : models_) area += areaOf(m) * m.count;
        const double aim = static_cast<double>(std::clamp<uint64_t>(kMostPoints / count, 16, 512) * count);
        std::vector<lod::StochasticItem> items;
        std::vector<lod::DiscFactors> factors;
        for (const Model& m : models_) {
            lod::StochasticItem item = itemOf(m.model->samples(), *scene.placed[m.first].store);
            const double share = std::ceil(areaOf(m) * aim / area);
            item.count = static_cast<uint32_t>(std::clamp(share, 1.0, static_cast<double>(item.count)));
            factors.push_back(m.model->factors());
            factors.back().weight = areaOf(m) * m.count;
            for (uint32_t i = 0; i < m.count; ++i) {
                item.place = scene.placed[m.first + i].place;
                items.push_back(item);
            }
        }
        lod::StochasticSettings settings = stochasticSettings(input);
        settings.nodeRecords = kGroupNode;
        lod::describeDiscs(factors, settings.description);
        return lod::buildStochasticStore(items, path, settings, executor, progress);
    };
    render::PlacedGroup group;
    STIPPLE_ASSIGN(group.points, openCached({input}, build, "instance group", make));
    const lod::Hierarchy& h = group.points->hierarchy;
    std::vector<std::vector<uint32_t>> members(h.nodes.size());
    for (const Model& m : models_)
        for (uint32_t k = m.first; k < m.first + m.count; ++k) {
            render::PlacedStore& p = scene.placed[k];
            p.isMember = true;
            const lod::Hierarchy& own = p.store->hierarchy;
            const glm::dvec3 centre = own.origin + own.unit * own.nodes[0].centre;
            members[lod::leafOf(h, p.place.translation + p.place.rotation * (p.place.scale * centre))].push_back(k);
        }
    group.first.push_back(0);
    for (const auto& some : members) {
        group.members.insert(group.members.end(), some.begin(), some.end());
        group.first.push_back(static_cast<uint32_t>(group.members.size()));
    }
    scene.groups.push_back(std::move(group));
    return {};
}

}  // namespace stipple::scene
