#include "apps/grow/grow.h"

#include <fmt/format.h>

#include "apps/stipple/common.h"
#include "engine/base/process.h"

namespace stipple::app {
namespace {

struct Options {
    std::string output, origin = "0,0,0";
    grow::ScanOptions scan;
    bool json = false;
};

Result<void> run(Options& o) {
    STIPPLE_ASSIGN(const glm::dvec3 origin, parseVector(o.origin, "--origin"));
    o.scan.origin = {origin.x, origin.y, origin.z};
    const double start = nowSeconds();
    const auto points = grow::growScan(o.scan);
    STIPPLE_TRY(grow::writeScan(o.output, points, o.scan));
    if (o.json)
        fmt::print("{}\n", nlohmann::json{{"points", points.size()}, {"seconds", nowSeconds() - start}}.dump(2));
    else
        fmt::print("{}: {} points, {:.1f} s\n", o.output, points.size(), nowSeconds() - start);
    return {};
}

}  // namespace

void setupGrow(CLI::App& app, int& status) {
    auto o = std::make_shared<Options>();
    CLI::App* sub = app.add_subcommand("grow", "generate test scenes");
    sub->require_subcommand(1);
    CLI::App* scan = sub->add_subcommand("scan", "simulate a laser scan of a grove with rocks and a house");
    scan->add_option("-o,--output", o->output, "the file to write (.las, .ply)")->required();
    scan->add_option("--points", o->scan.points, "number of points")
        ->check(CLI::Range(uint64_t{1}, uint64_t{500'000'000}))
        ->capture_default_str();
    scan->add_option("--seed", o->scan.seed, "another seed, another grove")->capture_default_str();
    scan->add_option("--origin", o->origin, "added to every coordinate, e.g. 500000,5400000,300")
        ->capture_default_str();
    scan->add_option("--positions", o->scan.positions, "scanner positions")
        ->check(CLI::Range(1, 64))
        ->capture_default_str();
    scan->add_option("--noise", o->scan.noiseMetres, "range noise, standard deviation, metres")
        ->check(CLI::Range(0.0, 1.0))
        ->capture_default_str();
    scan->add_flag("--json", o->json, "as JSON");
    scan->callback([o, &status] {
        if (const auto result = run(*o); !result) status = report(result.error());
    });
}

}  // namespace stipple::app
