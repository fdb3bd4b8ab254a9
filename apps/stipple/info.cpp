#include <fmt/format.h>

#include <cmath>
#include <filesystem>

#include "apps/stipple/common.h"
#include "engine/base/hash.h"
#include "engine/base/process.h"
#include "lod/import/import.h"

namespace stipple::app {
namespace {

struct Options {
    std::string input;
    bool verify = false, json = false;
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
        l["largest_error"] = std::max(l["largest_error"].get<double>(), h.unit * h.errors.decode(n.errorCode));
    }
    return {{"kind", "stipple store"},
            {"path", store.path},
            {"bytes", store.fileBytes},
            {"content_hash", hexDigits(store.contentHash)},
            {"source", d.source},
            {"points", d.points},
            {"records", d.records},
            {"nodes", h.nodes.size()},
            {"levels", levels},
            {"min", vectorJson(d.boundsMin)},
            {"max", vectorJson(d.boundsMax)},
            {"origin", vectorJson(h.origin)},
            {"lattice_unit", h.unit},
            {"coordinate_rounding", d.roundingUnits},
            {"metres_per_unit", d.metresPerUnit},
            {"up", std::string(1, static_cast<char>('x' + static_cast<int>(d.up)))},
            {"crs", d.crs},
            {"attributes", d.attributes},
            {"has_colour", d.hasColour},
            {"has_normals", d.hasNormals}};
}

void printStore(const nlohmann::json& j) {
    const auto vec = [](const nlohmann::json& v) {
        return fmt::format("{:.10g} {:.10g} {:.10g}", v[0].get<double>(), v[1].get<double>(), v[2].get<double>());
    };
    fmt::print("{}: {} points from {}, {} records in {} nodes, {}\n", j["path"].get<std::string>(),
               j["points"].get<uint64_t>(), j["source"].get<std::string>(), j["records"].get<uint64_t>(),
               j["nodes"].get<uint64_t>(), humanBytes(j["bytes"].get<uint64_t>()));
    fmt::print("  bounds        {} .. {}\n  origin        {}\n", vec(j["min"]), vec(j["max"]), vec(j["origin"]));
    fmt::print("  lattice unit  {:.6g} (coordinates {})\n", j["lattice_unit"].get<double>(),
               j["coordinate_rounding"].get<double>() == 0
                   ? std::string("exact")
                   : fmt::format("rounded by at most {:.3g}", j["coordinate_rounding"].get<double>()));
    fmt::print("  up            {}\n  colour        {}\n  normals       {}\n", j["up"].get<std::string>(),
               j["has_colour"].get<bool>() ? "yes" : "no", j["has_normals"].get<bool>() ? "yes" : "no");
    if (!j["crs"].get<std::string>().empty()) fmt::print("  crs           {}\n", j["crs"].get<std::string>());
    std::string names;
    for (const auto& a : j["attributes"]) names += (names.empty() ? "" : ", ") + a.get<std::string>();
    fmt::print("  attributes    {}\n  hash          {}\n  level   nodes    records      bytes  largest error\n", names,
               j["content_hash"].get<std::string>());
    for (size_t l = 0; l < j["levels"].size(); ++l) {
        const auto& level = j["levels"][l];
        fmt::print("  {:5} {:7} {:10} {:>10}  {:.4g}\n", l, level["nodes"].get<uint64_t>(),
                   level["records"].get<uint64_t>(), humanBytes(level["bytes"].get<uint64_t>()),
                   level["largest_error"].get<double>());
    }
}

Result<void> run(const Options& o) {
    if (std::filesystem::path(o.input).extension() == ".stipple") {
        STIPPLE_ASSIGN(const lod::Store store, lod::openStore(o.input));
        nlohmann::json j = storeInfo(store);
        if (o.verify) {
            const auto executor = makeTbbExecutor(0);
            STIPPLE_TRY(lod::verifyStore(store, *executor));
            j["verified"] = true;
        }
        if (o.json) {
            fmt::print("{}\n", j.dump(2));
            return {};
        }
        printStore(j);
        if (o.verify) fmt::print("  verified: hashes, counts, order, errors and spheres are right\n");
        return {};
    }
    STIPPLE_ASSIGN(const lod::PointSource source, lod::openPointSource(o.input));
    const lod::SourceInfo& i = source.info;
    nlohmann::json j = {{"kind", "input"},
                        {"path", i.path},
                        {"format", i.format},
                        {"points", i.points},
                        {"attributes", i.attributes},
                        {"crs", i.crs},
                        {"notes", i.notes},
                        {"has_colour", i.hasColour},
                        {"has_normals", i.hasNormal},
                        {"has_radii", i.hasRadius}};
    if (i.isLattice) {
        j["scale"] = vectorJson(i.scale);
        j["offset"] = vectorJson(i.offset);
    }
    if (i.hasDeclaredBounds) {
        j["declared_min"] = vectorJson(i.declaredMin);
        j["declared_max"] = vectorJson(i.declaredMax);
    }
    if (o.verify) {  // read everything: counts and bounds against the header
        uint64_t points = 0, notFinite = 0;
        glm::dvec3 lo(1e300), hi(-1e300);
        lod::PointBlock block;
        for (;;) {
            block.clear();
            STIPPLE_ASSIGN(const size_t count, source.read(block, 65536));
            if (count == 0) break;
            points += count;
            for (glm::dvec3 p : block.position) {
                if (i.isLattice) p = p * i.scale + i.offset;
                if (!std::isfinite(p.x + p.y + p.z)) {
                    ++notFinite;
                    continue;
                }
                lo = glm::min(lo, p);
                hi = glm::max(hi, p);
            }
        }
        j["points_read"] = points;
        j["points_not_finite"] = notFinite;
        if (points > notFinite) {
            j["min"] = vectorJson(lo);
            j["max"] = vectorJson(hi);
        }
    }
    if (o.json) {
        fmt::print("{}\n", j.dump(2));
        return {};
    }
    fmt::print("{}: {}, {} points\n", i.path, i.format, i.points);
    for (const auto& [key, value] : j.items())
        if (key != "path" && key != "format" && key != "points" && key != "kind")
            fmt::print("  {:18} {}\n", key, value.dump());
    return {};
}

}  // namespace

void setupInfo(CLI::App& app, int& status) {
    auto o = std::make_shared<Options>();
    CLI::App* sub = app.add_subcommand("info", "what a scene or an input file holds");
    sub->add_option("SCENE", o->input, "a .stipple scene, or a .ply or .las file")->required();
    sub->add_flag("--verify", o->verify, "read everything and check it");
    sub->add_flag("--json", o->json, "as JSON");
    sub->callback([o, &status] {
        if (const auto result = run(*o); !result) status = report(result.error());
    });
}

}  // namespace stipple::app
