#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "apps/stipple/build_patches.h"
#include "apps/stipple/common.h"
#include "apps/stipple/info_parts.h"
#include "apps/stipple/options.h"
#include "engine/base/hash.h"
#include "engine/base/numbers.h"
#include "engine/base/process.h"
#include "engine/base/units.h"
#include "engine/base/words.h"
#include "lod/builder/patch_store/against.h"
#include "lod/builder/patches/patch_build.h"
#include "lod/primitives/codecs.h"
#include "lod/primitives/kinds.h"
#include "lod/primitives/patch_samples.h"
#include "lod/store/file_kind.h"
#include "lod/store/materials.h"
#include "lod/store/nearest.h"
#include "lod/store/patch_bytes.h"
#include "lod/store/pruning.h"
#include "shaders/shared/patch_map.h"

namespace stipple::app {
namespace {

struct InfoCommand {
    std::string input, at, against;
    bool verify = false, json = false, skipBad = false;
    BuildOptions build;  ///< of which reading scene files uses some
};

/// A place of the store's lattice: as its integers say, without what the sum of origin and steps added.
nlohmann::json placeJson(const lod::Hierarchy& h, const glm::dvec3& v) {
    return {latticeValue(v.x, h.unit, h.origin.x), latticeValue(v.y, h.unit, h.origin.y),
            latticeValue(v.z, h.unit, h.origin.z)};
}
std::string placeText(const nlohmann::json& place, const nlohmann::json& unit, const nlohmann::json& origin) {
    std::string text;
    for (size_t a = 0; a < 3; ++a)
        text += (a == 0 ? "" : " ") + latticeText(place[a].get<double>(), unit.get<double>(), origin[a].get<double>());
    return text;
}

/// What nodes hold: by kind and codec, how many payloads of how many records, and the ids of their streams.
nlohmann::json payloadInfo(const lod::Hierarchy& h) {
    struct Sum {
        uint64_t payloads = 0, records = 0, bytes = 0;
        double largestError = 0;
        std::set<uint32_t> streams;
    };
    std::map<std::pair<lod::Kind, lod::Codec>, Sum> sums;
    for (uint32_t n = 0; n < h.nodes.size(); ++n)
        h.forEachPayload(n, [&](uint32_t chunk) {
            const lod::Payload& p = h.payload(chunk);
            Sum& sum = sums[{p.kind, p.codec}];
            ++sum.payloads;
            sum.records += p.records;
            sum.bytes += uint64_t{p.chunkBytes} + p.attributeBytes;
            if (p.errorCode != lod::ErrorScale::kNoParent)
                sum.largestError = std::max(sum.largestError, h.unit * h.errors.decode(p.errorCode));
            sum.streams.insert(static_cast<uint32_t>(lod::StreamId::records));
            if (p.attributeBytes > 0) sum.streams.insert(static_cast<uint32_t>(lod::StreamId::attributes));
            for (uint32_t k = p.firstStream; k < p.firstStream + p.streams; ++k) {
                sum.streams.insert(static_cast<uint32_t>(h.streams[k].id));
                sum.bytes += h.streams[k].bytes;
            }
        });
    nlohmann::json out = nlohmann::json::array();
    for (const auto& [of, sum] : sums)
        out.push_back({{"kind", lod::traitsOf(of.first).name},
                       {"codec", lod::traitsOf(of.second).name},
                       {"payloads", sum.payloads},
                       {"records", sum.records},
                       {"bytes", sum.bytes},
                       {"largest_error", sum.largestError},
                       {"streams", sum.streams}});
    return out;
}

uint64_t bytesOfTiles(const lod::Hierarchy& h) {
    uint64_t bytes = 0;
    for (const lod::TextureTile& t : h.tiles) bytes += t.bytes;
    return bytes;
}

/// What its records are.
std::string recordsOf(const lod::Store& store) {
    if (store.description.patches.patches > 0) return "blocks of patches";
    return store.hierarchy.isMixed ? "records" : lod::traitsOf(store.hierarchy.nodes[0].kind).records;
}

/// With the points that have them, where those are counted.
nlohmann::json materialInfo(const lod::StoreDescription& d, const lod::Hierarchy& h) {
    nlohmann::json materials = nlohmann::json::array();
    for (const lod::PointMaterial& m : d.pointMaterials)
        materials.push_back({{"roughness", m.roughness},
                             {"metallic", m.metallic},
                             {"transmission", m.optics.transmission},
                             {"points", d.points}});
    if (lod::hasPatches(h))  // samples are not counted
        for (nlohmann::json& m : materials) m.erase("points");
    if (const auto index = lod::materialAttribute(d)) {
        for (nlohmann::json& m : materials) m["points"] = 0;
        for (const auto& [value, count] : d.attributes[*index].counts)
            if (value >= 0 && value < static_cast<double>(materials.size()))
                materials[toWhole<size_t>(value)]["points"] = count;
    }
    return materials;
}

/// What leaves with patches say of their distance from the source, units; none: there are no such.
nlohmann::json leafDistances(const lod::Hierarchy& h) {
    std::vector<double> all;
    for (const lod::Node& n : h.nodes)
        if (n.sourceCode != 0) all.push_back(h.unit * h.errors.decode(n.sourceCode));
    if (all.empty()) return nullptr;
    std::sort(all.begin(), all.end());
    return {{"median", all[all.size() / 2]}, {"p95", all[all.size() * 95 / 100]}, {"greatest", all.back()}};
}

/// Maps of patches: how many payloads have which, and what they take in the file and in memory, with their mips.
Result<nlohmann::json> mapInfo(const lod::Store& store) {
    const lod::Hierarchy& h = store.hierarchy;
    std::map<uint32_t, uint64_t> payloads;  // by texels along an edge of a cell
    uint64_t bytes = 0, inMemory = 0;
    bool hasColours = false, hasNormals = false, hasLight = false;
    std::array<uint8_t, lod::kPatchHeadBytes> head{};
    for (uint32_t n = 0; n < h.nodes.size(); ++n) {
        Result<void> read;
        h.forEachPayload(n, [&](uint32_t chunk) {
            const lod::Payload& p = h.payload(chunk);
            if (p.maps == 0 || !read) return;
            ++payloads[1u << (p.maps & shared::kMapDensity)];
            hasColours = hasColours || (p.maps & shared::kMapDensity) != 0;
            hasNormals = hasNormals || (p.maps & shared::kMapNormals) != 0;
            hasLight = hasLight || (p.maps & shared::kMapLight) != 0;
            inMemory += uint64_t{p.records} * shared::mapWords(p.maps) * sizeof(uint32_t);
            const size_t count = std::min<size_t>(head.size(), p.chunkBytes);
            read = store.file->readAt(p.chunkOffset, head.data(), count);
            bytes += lod::mapBytesOf(std::span(head).first(count));
        });
        STIPPLE_TRY(read);
    }
    if (payloads.empty()) return nlohmann::json();
    nlohmann::json texels = nlohmann::json::object();
    for (const auto& [k, count] : payloads) texels[std::to_string(k)] = count;
    return nlohmann::json{
        {"texels", texels},          {"bytes", bytes},       {"bytes_with_mips", inMemory}, {"has_colours", hasColours},
        {"has_normals", hasNormals}, {"has_light", hasLight}};
}

/// How far stored normals are off, at most; null: they are as they came, or there are none.
nlohmann::json normalDegrees(const lod::StoreDescription& d, const lod::Hierarchy& h) {
    if (!d.hasNormals || h.isGraph || h.isCurves) return nullptr;
    bool hasPoints = false;  // whose normals have fewer bits than mirrors of patches
    for (uint32_t n = 0; n < h.nodes.size(); ++n)
        h.forEachPayload(n, [&](uint32_t chunk) { hasPoints = hasPoints || kindOf(h, chunk) == lod::Kind::points; });
    return !hasPoints && lod::hasMirrors(d.pointMaterials) ? 0.03 : 0.12;
}

/// What is told of a level: of leaves of patches their distance from the source.
double largestErrorOf(const lod::Hierarchy& h, uint32_t node) {
    // The coarsest groups of a mesh are never replaced: they have no error to speak of.
    const uint32_t code = h.errorCodeOf(node);
    const double error = code == lod::ErrorScale::kNoParent ? 0 : h.unit * h.errors.decode(code);
    return h.nodes[node].sourceCode == 0 ? error : std::max(error, h.unit * h.errors.decode(h.nodes[node].sourceCode));
}

Result<nlohmann::json> storeInfo(const lod::Store& store) {
    STIPPLE_ASSIGN(nlohmann::json maps, mapInfo(store));
    const lod::Hierarchy& h = store.hierarchy;
    const lod::StoreDescription& d = store.description;
    nlohmann::json levels = nlohmann::json::array();
    for (const lod::Node& n : h.nodes) {
        while (levels.size() <= n.level)
            levels.push_back({{"nodes", 0}, {"records", 0}, {"bytes", 0}, {"largest_error", 0.0}, {"kept_share", 1.0}});
        nlohmann::json& l = levels[n.level];
        l["nodes"] = l["nodes"].get<uint64_t>() + 1;
        const auto number = static_cast<uint32_t>(&n - h.nodes.data());
        h.forEachPayload(number, [&](uint32_t chunk) {
            l["records"] = l["records"].get<uint64_t>() + h.payload(chunk).records;
            l["bytes"] = l["bytes"].get<uint64_t>() + h.payload(chunk).chunkBytes;
        });
        l["largest_error"] = std::max(l["largest_error"].get<double>(), largestErrorOf(h, number));
        if (h.isCurves) l["kept_share"] = std::min(l["kept_share"].get<double>(), lod::keptShare(n));
    }
    nlohmann::json attributes = nlohmann::json::array();
    for (const lod::AttributeInfo& a : d.attributes)
        attributes.push_back({{"name", a.name},
                              {"type", lod::kScalarNames.at(static_cast<size_t>(a.type))},
                              {"aggregate", lod::kAggregateNames.at(static_cast<size_t>(a.aggregate))},
                              {"least", a.least},
                              {"greatest", a.greatest},
                              {"points_without_data", a.withoutData}});
    nlohmann::json textures = nlohmann::json::array();
    for (const shared::TextureInfo& t : h.textures)
        textures.push_back({{"width", t.width}, {"height", t.height}, {"levels", t.levels}});
    uint64_t weightBytes = 0;
    for (const lod::Stream& s : h.streams)
        if (s.id == lod::StreamId::surfelWeights) weightBytes += s.bytes;
    // (Of patches the description says the leaves' distance there, which is told above.)
    const bool isOfPatches = d.patches.patches > 0;
    return nlohmann::json{{"kind", "stipple store"},
                          {"primitive", recordsOf(store)},
                          {"payloads", payloadInfo(h)},
                          {"surfel_weight_bytes", weightBytes},
                          {"materials", d.materials.size()},
                          {"point_materials", materialInfo(d, h)},
                          {"textures", textures},
                          {"texture_tiles", h.tiles.size()},
                          {"texture_bytes", bytesOfTiles(h)},
                          {"path", store.path},
                          {"bytes", store.fileBytes},
                          {"content_hash", hexDigits(store.contentHash)},
                          {"source", d.source},
                          {"points", d.points},
                          {"points_in", d.pointsIn},
                          {"dropped", d.dropped},
                          {"added", d.added},
                          {"patches", patchCountsJson(d.patches)},
                          {"leaf_distance", leafDistances(h)},
                          {"maps", maps},
                          {"records", d.records},
                          {"nodes", h.nodes.size()},
                          {"levels", levels},
                          {"min", placeJson(h, d.boundsMin)},
                          {"max", placeJson(h, d.boundsMax)},
                          {"origin", vectorJson(h.origin)},
                          {"lattice_unit", h.unit},
                          {"coordinate_rounding", isOfPatches ? nlohmann::json() : nlohmann::json(d.roundingUnits)},
                          {"metres_per_unit", d.metresPerUnit},
                          {"up", vectorJson(d.up)},
                          {"crs", d.crs.label()},
                          {"attributes", attributes},
                          {"has_colour", d.hasColour},
                          {"has_normals", d.hasNormals},
                          {"normal_degrees", normalDegrees(d, h)}};
}

/// Those that most points have.
void printMaterials(const nlohmann::json& all) {
    constexpr size_t kMost = 8;
    std::vector<nlohmann::json> used;
    const auto pointsOf = [](const nlohmann::json& m) { return m.value("points", uint64_t{1}); };
    for (const auto& m : all)
        if (pointsOf(m) != 0) used.push_back(m);
    std::stable_sort(used.begin(), used.end(), [&](const auto& a, const auto& b) { return pointsOf(a) > pointsOf(b); });
    for (size_t i = 0; i < std::min(used.size(), kMost); ++i)
        fmt::print("  material      roughness {:.2g}, metallic {:.2g}{}\n", used[i]["roughness"].get<double>(),
                   used[i]["metallic"].get<double>(),
                   used[i].contains("points") ? fmt::format(": {} points", used[i]["points"].get<uint64_t>()) : "");
    if (used.size() > kMost) fmt::print("  material      and {} more\n", used.size() - kMost);
}

void printMaps(const nlohmann::json& maps) {
    if (maps.is_null()) return;
    std::string texels;
    for (const auto& [k, count] : maps["texels"].items())
        texels += fmt::format("{}{} in {}", texels.empty() ? "" : ", ", k, counted(count.get<uint64_t>(), "node"));
    std::string what;
    for (const auto& [key, name] :
         {std::pair{"has_colours", "colours"}, std::pair{"has_normals", "normals to 0.5 degrees"},
          std::pair{"has_light", "light"}})
        if (maps[key].get<bool>()) what += fmt::format("{}{}", what.empty() ? "" : ", ", name);
    fmt::print("  maps          texels an edge of a cell, at most: {}; {}; {}, {} in memory with mips\n", texels, what,
               humanBytes(maps["bytes"].get<uint64_t>()), humanBytes(maps["bytes_with_mips"].get<uint64_t>()));
}

void printLevels(const nlohmann::json& j) {
    fmt::print("  hash          {}\n  level   nodes    records      bytes  largest error\n",
               j["content_hash"].get<std::string>());
    for (size_t l = 0; l < j["levels"].size(); ++l) {
        const auto& level = j["levels"][l];
        fmt::print("  {:5} {:7} {:10} {:>10}  {:.4g}\n", l, level["nodes"].get<uint64_t>(),
                   level["records"].get<uint64_t>(), humanBytes(level["bytes"].get<uint64_t>()),
                   level["largest_error"].get<double>());
    }
}

void printStore(const nlohmann::json& j) {
    const auto vec = [](const nlohmann::json& v) {
        return fmt::format("{:.10g} {:.10g} {:.10g}", v[0].get<double>(), v[1].get<double>(), v[2].get<double>());
    };
    const auto place = [&](const char* key) { return placeText(j[key], j["lattice_unit"], j["origin"]); };
    const bool isMesh = j["primitive"] == "triangles";
    const nlohmann::json& patches = j["patches"];
    const std::string where = fmt::format("{}, {}", counted(j["nodes"].get<uint64_t>(), isMesh ? "group" : "node"),
                                          humanBytes(j["bytes"].get<uint64_t>()));
    if (patches.is_null()) {
        fmt::print("{}: {} {} from {}, {} with all levels in {}\n", j["path"].get<std::string>(),
                   j["points"].get<uint64_t>(), j["primitive"].get<std::string>(), j["source"].get<std::string>(),
                   j["records"].get<uint64_t>(), where);
    } else {
        const uint64_t discs = patches["discs"].get<uint64_t>();
        fmt::print("{}: {} in {}{}, from {}, in {}\n", j["path"].get<std::string>(),
                   counted(patches["samples"].get<uint64_t>(), "sample"),
                   counted(patches["patches"].get<uint64_t>(), "patch", "patches"),
                   discs > 0 ? fmt::format(", {} of what no patch fits", counted(discs, "disc")) : "",
                   j["source"].get<std::string>(), where);
    }
    if (isMesh)
        fmt::print("  materials     {}\n  textures      {} in {} tiles, {}\n", j["materials"].get<uint64_t>(),
                   j["textures"].size(), j["texture_tiles"].get<uint64_t>(),
                   humanBytes(j["texture_bytes"].get<uint64_t>()));
    if (j["points_in"].get<uint64_t>() > 0) {
        fmt::print("  {:<14}{}", patches.is_null() ? j["primitive"].get<std::string>() + " in" : "built from",
                   j["points_in"].get<uint64_t>());
        for (const auto& [reason, count] : j["dropped"].items())
            fmt::print(", dropped {}: {}", count.get<uint64_t>(), reason);
        for (const auto& [reason, count] : j["added"].items())
            fmt::print(", added {}: {}", count.get<uint64_t>(), reason);
        fmt::print("\n");
    }
    if (const auto& leaves = j["leaf_distance"]; !leaves.is_null())
        fmt::print("  leaves        within {:.3g} of the source (median; 95 of 100 within {:.3g}, all within {:.3g})\n",
                   leaves["median"].get<double>(), leaves["p95"].get<double>(), leaves["greatest"].get<double>());
    fmt::print("  bounds        {} .. {}\n  origin        {}\n", place("min"), place("max"), place("origin"));
    printMaps(j["maps"]);
    const auto& rounding = j["coordinate_rounding"];
    fmt::print("  lattice unit  {}{}\n", j["lattice_unit"].get<double>(),
               rounding.is_null() ? ""
               : rounding.get<double>() == 0
                   ? " (coordinates exact)"
                   : fmt::format(" (coordinates rounded by at most {:.3g})", rounding.get<double>()));
    fmt::print("  up            {}\n  colour        {}\n  normals       {}\n", vec(j["up"]),
               j["has_colour"].get<bool>() ? "yes" : "no",
               !j["has_normals"].get<bool>() ? "no"
               : j["normal_degrees"].is_null()
                   ? "yes"
                   : fmt::format("yes, stored to {} degrees", j["normal_degrees"].get<double>()));
    if (!j["crs"].get<std::string>().empty()) fmt::print("  crs           {}\n", j["crs"].get<std::string>());
    printMaterials(j["point_materials"]);
    for (const auto& a : j["attributes"])
        fmt::print("  attribute     {} ({}, coarse levels: {}), {:.15g} .. {:.15g}{}\n", a["name"].get<std::string>(),
                   a["type"].get<std::string>(), a["aggregate"].get<std::string>(), a["least"].get<double>(),
                   a["greatest"].get<double>(),
                   a["points_without_data"] == 0
                       ? ""
                       : fmt::format("; {} points without data", a["points_without_data"].get<uint64_t>()));
    if (const uint64_t bytes = j["surfel_weight_bytes"]; bytes > 0)
        fmt::print("  weights       of surfels, for --normalise surfel: {}\n", humanBytes(bytes));
    // (Of one kind the table below says all.)
    if (j["payloads"].size() > 1)
        for (const auto& p : j["payloads"])
            fmt::print("  payloads      {} of {} ({}): {} records, {}, largest error {:.4g}\n",
                       p["payloads"].get<uint64_t>(), p["kind"].get<std::string>(), p["codec"].get<std::string>(),
                       p["records"].get<uint64_t>(), humanBytes(p["bytes"].get<uint64_t>()),
                       p["largest_error"].get<double>());
    printLevels(j);
    if (j["primitive"] != "segments") return;
    double kept = 1;
    for (const auto& level : j["levels"]) kept = std::min(kept, level["kept_share"].get<double>());
    fmt::print(
        "  stochastic, beside the errors: pixels of curves narrower than a pixel{}\n",
        kept < 1 ? fmt::format("; of thin curves at the coarsest level 1 in {:.0f}, as much wider", 1 / kept) : "");
}

Result<void> showNearest(const lod::Store& store, const InfoCommand& o) {
    const bool isMixed = store.hierarchy.isMixed;
    if (isMixed || store.hierarchy.nodes[0].kind != lod::Kind::points)
        return fail(ErrorKind::usage,
                    isMixed ? "holds more than points: --at finds points" : "holds no points: --at finds points",
                    store.path, "leave --at out");
    STIPPLE_ASSIGN(const glm::dvec3 place, parseVector(o.at, "--at"));
    STIPPLE_ASSIGN(const lod::NearestPoint p, lod::findNearest(store, place));
    const uint32_t c = p.packed.colour;
    nlohmann::json j = {{"position", placeJson(store.hierarchy, p.position)},
                        {"distance", p.distance},
                        {"lattice", p.lattice},
                        {"origin", vectorJson(store.hierarchy.origin)},
                        {"unit", store.hierarchy.unit}};
    const bool hasColour = store.description.hasColour;
    if (hasColour) j["colour"] = {c & 255u, c >> 8 & 255u, c >> 16 & 255u};
    for (size_t a = 0; a < p.attributes.size(); ++a)
        j["attributes"][store.description.attributes[a].name] = p.attributes[a];
    if (o.json) {
        printJson("info", j);
        return {};
    }
    fmt::print("{}, {:.6g} away\n", placeText(j["position"], j["unit"], j["origin"]), p.distance);
    fmt::print("  lattice       {} {} {} steps of {} from the origin\n", p.lattice[0], p.lattice[1], p.lattice[2],
               store.hierarchy.unit);
    if (hasColour) fmt::print("  colour        {} {} {}\n", c & 255u, c >> 8 & 255u, c >> 16 & 255u);
    for (size_t a = 0; a < p.attributes.size(); ++a)
        fmt::print("  {:13} {:.15g}\n", store.description.attributes[a].name, p.attributes[a]);
    return {};
}

/// The finest patches against what they were made of.
Result<void> measureAgainstSource(const lod::Store& store, const InfoCommand& o, Executor& executor,
                                  nlohmann::json& j) {
    constexpr uint64_t kPlaces = 200'000;
    STIPPLE_ASSIGN(const lod::AgainstSource r, [&]() -> Result<lod::AgainstSource> {
        if (o.build.onlyPoints || !hasTriangles(o.against)) {
            STIPPLE_ASSIGN(std::vector<glm::dvec3> points, readPlaces(o.against, o.build.reading()));
            return lod::measureAgainst(store, std::move(points), kPlaces, executor);
        }
        STIPPLE_ASSIGN(lod::TriangleMesh source, readTriangles(o.against, o.build.reading()));
        return lod::measureAgainst(store, std::move(source), kPlaces, executor);
    }());
    if (r.far > 0)
        return fail(
            ErrorKind::input,
            fmt::format("{} of {} places lie farther from each other than their leaves say, up to {:.3g} times as far",
                        r.far, r.placesOfStore + r.placesOfSource, r.most),
            fmt::format("{} against {}", store.path, o.against), "is it what it was built from?");
    j["against"] = {{"places_of_store", r.placesOfStore},
                    {"places_of_source", r.placesOfSource},
                    {"to_source", r.toSource},
                    {"from_source", r.fromSource},
                    {"stated", r.stated},
                    {"most_of_stated", r.most}};
    return {};
}

Result<void> run(const InfoCommand& o) {
    catchStopSignals();
    if (!o.against.empty() && !(o.verify && lod::isStoreFile(o.input)))
        return fail(ErrorKind::usage, "is of built scenes of patches that are verified", "--against",
                    "give --verify and a .stipple scene");
    if (lod::isStoreFile(o.input)) {
        STIPPLE_ASSIGN(const lod::Store store, lod::openStore(o.input));
        if (!o.at.empty()) return showNearest(store, o);
        STIPPLE_ASSIGN(nlohmann::json j, storeInfo(store));
        const bool isMixed = store.hierarchy.isMixed;
        if (o.verify) {
            const auto executor = makeTbbExecutor(0);
            STIPPLE_TRY(lod::verifyStore(store, *executor));
            j["verified"] = true;
            j["errors_measured"] = (!isMixed || lod::hasPatches(store.hierarchy)) && !store.hierarchy.isStochastic;
            if (!o.against.empty()) STIPPLE_TRY(measureAgainstSource(store, o, *executor, j));
        }
        if (o.json) {
            printJson("info", j);
            return {};
        }
        printStore(j);
        if (o.verify)
            fmt::print("  verified: hashes, counts, order, {} and spheres are right\n",
                       isMixed && !lod::hasPatches(store.hierarchy) ? "codes (errors across kinds are not measured)"
                                                                    : "errors");
        if (j.contains("against"))
            fmt::print(
                "  against       {}: {} places of the store at most {:.4g} away, {} of the source {:.4g}; leaves "
                "state up to {:.4g}, and no place is farther than {:.2g} of what its leaf states\n",
                o.against, j["against"]["places_of_store"].get<uint64_t>(), j["against"]["to_source"].get<double>(),
                j["against"]["places_of_source"].get<uint64_t>(), j["against"]["from_source"].get<double>(),
                j["against"]["stated"].get<double>(), j["against"]["most_of_stated"].get<double>());
        return {};
    }
    if (!o.at.empty())
        return fail(ErrorKind::usage, "is not a built scene, in which --at finds points", o.input,
                    "build it first: stipple build INPUT -o SCENE.stipple");
    const auto executor = makeTbbExecutor(0);
    return showInputInfo({o.input, o.verify, o.json, o.skipBad, o.build.reading(), o.build.formatOptions()}, *executor);
}

}  // namespace

void setupInfo(CLI::App& app, int& status) {
    auto o = std::make_shared<InfoCommand>();
    CLI::App* sub = app.add_subcommand("info", "what a scene or an input file holds");
    sub->add_option("SCENE", o->input, "a .stipple scene, a scan, mesh, scene or curve file, or a folder of scans")
        ->required();
    sub->add_flag("--verify", o->verify, "read everything and check it; a fault ends with 3");
    sub->add_option("--against", o->against,
                    "with --verify, of a scene of patches: measure how far they are from this mesh or scan, both ways")
        ->type_name("SOURCE");
    sub->add_flag("--only-points", o->build.onlyPoints, "with --against: the vertices of a PLY file with faces");
    o->build.addGridTo(*sub);
    sub->add_option("--at", o->at, "file coordinates: the input point of a built scene that is nearest to them")
        ->type_name("X,Y,Z");
    sub->add_flag("--skip-bad", o->skipBad, "go on past what is corrupt");
    sub->add_option("--memory", o->build.memory, "memory that reading a scene file may use, bytes: 512M, 4G")
        ->check(bytes())
        ->type_name("SIZE")
        ->capture_default_str();
    addSceneFileOptions(*sub, o->build.allowOutside, o->build.repair);
    sub->add_flag("--json", o->json, "print it as JSON (stipple help json)");
    sub->callback([o, &status] {
        if (const auto result = run(*o); !result) status = report(result.error());
    });
}

}  // namespace stipple::app
