// A build as a straight line.
#include "lod/build/build.h"

#include <fmt/format.h>

#include "lod/attributes.h"
#include "lod/build/aggregate.h"
#include "lod/build/cloud.h"
#include "lod/store.h"

namespace stipple::lod {

namespace {

/// What colour maps are stretched over.
void describeRanges(const Cloud& cloud, StoreDescription& description) {
    for (const CloudAttribute& a : cloud.attributes) {
        AttributeInfo info = a.info;
        const size_t width = bytesOf(info.type);
        const ValueRange r =
            rangeOf(cloud.size(), [&](size_t i) { return attributeValue(info, a.values.data() + i * width); });
        info.least = r.least;
        info.greatest = r.greatest;
        info.low = r.low;
        info.high = r.high;
        if (info.aggregate == Aggregate::mode && width == 1) {
            std::array<uint64_t, 256> counts{};
            for (const uint8_t v : a.values) ++counts.at(v);
            for (size_t v = 0; v < counts.size(); ++v)
                if (counts.at(v) > 0) info.counts.emplace_back(static_cast<double>(v), counts.at(v));
        }
        description.attributes.push_back(info);
    }
    const glm::dvec3 up = description.up;
    const ValueRange r = rangeOf(cloud.size(), [&](size_t i) {
        return glm::dot(up, cloud.origin + cloud.unit * glm::dvec3(cloud.x[i], cloud.y[i], cloud.z[i]));
    });
    description.lowHeight = r.low;
    description.highHeight = r.high;
    // One point in 200 lies beyond each edge; what a tenth of the extent more does not reach is stray.
    for (int a = 0; a < 3; ++a) {
        const std::vector<uint32_t>& axis = a == 0 ? cloud.x : a == 1 ? cloud.y : cloud.z;
        const ValueRange along = rangeOf(cloud.size(), [&](size_t i) { return static_cast<double>(axis[i]); });
        const double margin = 0.1 * (along.edgeHigh - along.edgeLow);
        description.focusMin[a] = cloud.origin[a] + cloud.unit * std::max(along.least, along.edgeLow - margin);
        description.focusMax[a] = cloud.origin[a] + cloud.unit * std::min(along.greatest, along.edgeHigh + margin);
    }
}

/// The axis of the format or of the settings; away from the Earth's centre for coordinates that are relative to it.
glm::dvec3 upOf(const Cloud& cloud, const BuildSettings& settings, const StoreDescription& description) {
    constexpr double kLeastRadius = 6.33e6, kGreatestRadius = 6.40e6;  // metres, sea floor to mountain tops
    const glm::dvec3 centre = 0.5 * (description.boundsMin + description.boundsMax);
    const double radius = glm::length(centre) * description.metresPerUnit;
    const double extent = glm::length(description.boundsMax - description.boundsMin) * description.metresPerUnit;
    const bool isGeocentric =
        radius > kLeastRadius && radius < kGreatestRadius && extent < 1e5 && std::abs(centre.z) > 1e5;
    if (!settings.up && isGeocentric && !cloud.crs.isDegrees && (cloud.crs.isGeocentric || cloud.crs.label().empty()))
        return glm::normalize(centre);
    return axisVector(cloud.up);
}

}  // namespace

Result<BuildReport> buildStore(const std::vector<std::string>& inputs, const std::string& output,
                               const BuildSettings& settings, Executor& executor, Progress& progress) {
    BuildReport report;
    StageClock clock(report);
    STIPPLE_ASSIGN(StoreWriter writer, StoreWriter::create(output));  // an unwritable output is found first
    STIPPLE_ASSIGN(Cloud cloud, readCloud(inputs, settings, report, executor, progress));
    clock.ends("read");
    const Partition partition = partitionCloud(cloud, settings.leafRecords, executor);
    clock.ends("partition");
    estimateAttributes(cloud, partition, settings, executor, progress);
    clock.ends("attributes");
    STIPPLE_ASSIGN(const Hierarchy hierarchy, simplifyAndWrite(cloud, partition, writer, executor, progress));
    StoreDescription description;
    description.crs = cloud.crs;
    description.metresPerUnit = cloud.crs.metresPerUnit;
    description.points = cloud.size();
    for (const Node& node : hierarchy.nodes) description.records += node.records;
    description.roundingUnits = cloud.roundingUnits;
    description.hasColour = cloud.hasColour;
    description.isReflectance = cloud.isReflectance;
    description.hasNormals = cloud.hasNormal || settings.normals == NormalsMode::automatic;
    description.source = cloud.source;
    glm::dvec3 lo(cloud.x[0], cloud.y[0], cloud.z[0]), hi = lo;
    for (size_t i = 1; i < cloud.size(); ++i) {
        const glm::dvec3 p(cloud.x[i], cloud.y[i], cloud.z[i]);
        lo = glm::min(lo, p);
        hi = glm::max(hi, p);
    }
    description.boundsMin = cloud.origin + cloud.unit * lo;
    description.boundsMax = cloud.origin + cloud.unit * hi;
    description.up = upOf(cloud, settings, description);
    describeRanges(cloud, description);
    STIPPLE_TRY(writer.finish(hierarchy, description));
    clock.ends("simplify");
    STIPPLE_ASSIGN(const Store store, openStore(writer.temporaryPath()));
    STIPPLE_TRY(verifyStore(store, executor));
    clock.ends("verify");
    report.bytesOut = writer.bytes();
    STIPPLE_TRY(writer.commit());
    report.pointsOut = cloud.size();
    report.nodes = hierarchy.nodes.size();
    report.records = description.records;
    report.contentHash = writer.contentHash();
    report.seconds = clock.seconds();
    return report;
}

}  // namespace stipple::lod
