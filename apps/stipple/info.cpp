#include <fmt/format.h>

#include <cmath>
#include <filesystem>

#include "apps/stipple/common.h"
#include "apps/stipple/info_input.h"
#include "engine/base/hash.h"
#include "engine/base/process.h"
#include "lod/nearest.h"

namespace stipple::app {
namespace {

struct Options {
    std::string input, at;
    bool verify = false, json = false, skipBad = false;
    BuildOptions build;  ///< of which reading scene files uses some
};

nlohmann::json vectorJson(const glm::dvec3& v) { return {v.x, v.y, v.z}; }

nlohmann::json storeInfo(const lod::Store& store) {
    const lod::Hierarchy& h = store.hierarchy;
    const lod::StoreDescription& d = store.description;
    nlohmann::json levels = nlohmann::json::array();
    for (const lod::Node& n : h.nodes) {
        while (levels.size() <= n.level)
            levels.push_back({{"nodes", 0}, {"records", 0}, {"bytes", 0}, {"largest_error", 0.0}});
        nlohmann::json& l = levels[n.level];
        l["nodes"] = l["nodes"].get<uint64_t>() + 1;
        l["records"] = l["records"].get<uint64_t>() + n.records;
        l["bytes"] = l["bytes"].get<uint64_t>() + n.chunkBytes;
        // The coarsest groups of a mesh are never replaced: they have no error to speak of.
        const double error = n.errorCode == lod::ErrorScale::kNoParent ? 0 : h.unit * h.errors.decode(n.errorCode);
        l["largest_error"] = std::max(l["largest_error"].get<double>(), error);
    }
    nlohmann::json attributes = nlohmann::json::array();
    for (const lod::AttributeInfo& a : d.attributes)
        attributes.push_back({{"name", a.name},
                              {"type", lod::kScalarNames.at(static_cast<size_t>(a.type))},
                              {"aggregate", lod::kAggregateNames.at(static_cast<size_t>(a.aggregate))},
                              {"least", a.least},
                              {"greatest", a.greatest}});
    nlohmann::json textures = nlohmann::json::array();
    for (const shared::TextureInfo& t : h.textures)
        textures.push_back({{"width", t.width}, {"height", t.height}, {"levels", t.levels}});
    uint64_t tileBytes = 0;
    for (const lod::TextureTile& t : h.tiles) tileBytes += t.bytes;
    return {{"kind", "stipple store"},
            {"primitive", h.isMesh()    ? "triangles"
                          : h.isStrands ? "segments"
                                        : "points"},
            {"materials", d.materials.size()},
            {"textures", textures},
            {"texture_tiles", h.tiles.size()},
            {"texture_bytes", tileBytes},
            {"path", store.path},
            {"bytes", store.fileBytes},
            {"content_hash", hexDigits(store.contentHash)},
            {"source", d.source},
            {"points", d.points},
            {"points_in", d.pointsIn},
            {"dropped", d.dropped},
            {"added", d.added},
            {"records", d.records},
            {"nodes", h.nodes.size()},
            {"levels", levels},
            {"min", vectorJson(d.boundsMin)},
            {"max", vectorJson(d.boundsMax)},
            {"origin", vectorJson(h.origin)},
            {"lattice_unit", h.unit},
            {"coordinate_rounding", d.roundingUnits},
            {"metres_per_unit", d.metresPerUnit},
            {"up", vectorJson(d.up)},
            {"crs", d.crs.label()},
            {"attributes", attributes},
            {"has_colour", d.hasColour},
            {"has_normals", d.hasNormals}};
}

void printStore(const nlohmann::json& j) {
    const auto vec = [](const nlohmann::json& v) {
        return fmt::format("{:.10g} {:.10g} {:.10g}", v[0].get<double>(), v[1].get<double>(), v[2].get<double>());
    };
    const bool isMesh = j["primitive"] == "triangles";
    fmt::print("{}: {} {} from {}, {} with all levels in {} {}, {}\n", j["path"].get<std::string>(),
               j["points"].get<uint64_t>(), j["primitive"].get<std::string>(), j["source"].get<std::string>(),
               j["records"].get<uint64_t>(), j["nodes"].get<uint64_t>(), isMesh ? "groups" : "nodes",
               humanBytes(j["bytes"].get<uint64_t>()));
    if (isMesh)
        fmt::print("  materials     {}\n  textures      {} in {} tiles, {}\n", j["materials"].get<uint64_t>(),
                   j["textures"].size(), j["texture_tiles"].get<uint64_t>(),
                   humanBytes(j["texture_bytes"].get<uint64_t>()));
    if (j["points_in"].get<uint64_t>() > 0) {
        fmt::print("  {:<14}{}", j["primitive"].get<std::string>() + " in", j["points_in"].get<uint64_t>());
        for (const auto& [reason, count] : j["dropped"].items())
            fmt::print(", dropped {}: {}", count.get<uint64_t>(), reason);
        for (const auto& [reason, count] : j["added"].items())
            fmt::print(", added {}: {}", count.get<uint64_t>(), reason);
        fmt::print("\n");
    }
    fmt::print("  bounds        {} .. {}\n  origin        {}\n", vec(j["min"]), vec(j["max"]), vec(j["origin"]));
    fmt::print("  lattice unit  {:.6g} (coordinates {})\n", j["lattice_unit"].get<double>(),
               j["coordinate_rounding"].get<double>() == 0
                   ? std::string("exact")
                   : fmt::format("rounded by at most {:.3g}", j["coordinate_rounding"].get<double>()));
    fmt::print("  up            {}\n  colour        {}\n  normals       {}\n", vec(j["up"]),
               j["has_colour"].get<bool>() ? "yes" : "no",
               j["has_normals"].get<bool>()
                   ? isMesh || j["primitive"] == "segments" ? "yes" : "yes, stored to 0.12 degrees"
                   : "no");
    if (!j["crs"].get<std::string>().empty()) fmt::print("  crs           {}\n", j["crs"].get<std::string>());
    for (const auto& a : j["attributes"])
        fmt::print("  attribute     {} ({}, coarse levels: {}), {:.10g} .. {:.10g}\n", a["name"].get<std::string>(),
                   a["type"].get<std::string>(), a["aggregate"].get<std::string>(), a["least"].get<double>(),
                   a["greatest"].get<double>());
    fmt::print("  hash          {}\n  level   nodes    records      bytes  largest error\n",
               j["content_hash"].get<std::string>());
    for (size_t l = 0; l < j["levels"].size(); ++l) {
        const auto& level = j["levels"][l];
        fmt::print("  {:5} {:7} {:10} {:>10}  {:.4g}\n", l, level["nodes"].get<uint64_t>(),
                   level["records"].get<uint64_t>(), humanBytes(level["bytes"].get<uint64_t>()),
                   level["largest_error"].get<double>());
    }
}

Result<void> showNearest(const lod::Store& store, const Options& o) {
    if (store.hierarchy.isMesh() || store.hierarchy.isStrands)
        return fail(ErrorKind::usage, "holds no points: --at finds points", store.path, "leave --at out");
    STIPPLE_ASSIGN(const glm::dvec3 place, parseVector(o.at, "--at"));
    STIPPLE_ASSIGN(const lod::NearestPoint p, lod::findNearest(store, place));
    const uint32_t c = p.packed.colour;
    nlohmann::json j = {{"position", vectorJson(p.position)},
                        {"distance", p.distance},
                        {"lattice", p.lattice},
                        {"origin", vectorJson(store.hierarchy.origin)},
                        {"unit", store.hierarchy.unit},
                        {"colour", {c & 255u, c >> 8 & 255u, c >> 16 & 255u}}};
    for (size_t a = 0; a < p.attributes.size(); ++a)
        j["attributes"][store.description.attributes[a].name] = p.attributes[a];
    if (o.json) {
        fmt::print("{}\n", jsonText(j));
        return {};
    }
    fmt::print("{:.15g} {:.15g} {:.15g}, {:.6g} away\n", p.position.x, p.position.y, p.position.z, p.distance);
    fmt::print("  lattice       {} {} {} steps of {:.6g} from the origin\n", p.lattice[0], p.lattice[1], p.lattice[2],
               store.hierarchy.unit);
    fmt::print("  colour        {} {} {}\n", c & 255u, c >> 8 & 255u, c >> 16 & 255u);
    for (size_t a = 0; a < p.attributes.size(); ++a)
        fmt::print("  {:13} {:.15g}\n", store.description.attributes[a].name, p.attributes[a]);
    return {};
}

Result<void> run(const Options& o) {
    if (std::filesystem::path(o.input).extension() == ".stipple") {
        STIPPLE_ASSIGN(const lod::Store store, lod::openStore(o.input));
        if (!o.at.empty()) return showNearest(store, o);
        nlohmann::json j = storeInfo(store);
        if (o.verify) {
            const auto executor = makeTbbExecutor(0);
            STIPPLE_TRY(lod::verifyStore(store, *executor));
            j["verified"] = true;
        }
        if (o.json) {
            fmt::print("{}\n", jsonText(j));
            return {};
        }
        printStore(j);
        if (o.verify) fmt::print("  verified: hashes, counts, order, errors and spheres are right\n");
        return {};
    }
    const auto executor = makeTbbExecutor(0);
    return showInputInfo({o.input, o.verify, o.json, o.skipBad, o.build.reading()}, *executor);
}

}  // namespace

void setupInfo(CLI::App& app, int& status) {
    auto o = std::make_shared<Options>();
    CLI::App* sub = app.add_subcommand("info", "what a scene or an input file holds");
    sub->add_option("SCENE", o->input, "a .stipple scene, a scan, mesh, scene or strand file, or a folder of scans")
        ->required();
    sub->add_flag("--verify", o->verify, "read everything and check it");
    sub->add_option("--at", o->at, "X,Y,Z in file coordinates: the input point of a scene that is nearest to it");
    sub->add_flag("--skip-bad", o->skipBad, "go on past what is corrupt");
    sub->add_option("--memory", o->build.memory, "memory that reading a scene file may use")->capture_default_str();
    addSceneFileOptions(*sub, o->build.allowOutside, o->build.repair);
    sub->add_flag("--json", o->json, "as JSON");
    sub->callback([o, &status] {
        if (const auto result = run(*o); !result) status = report(result.error());
    });
}

}  // namespace stipple::app
