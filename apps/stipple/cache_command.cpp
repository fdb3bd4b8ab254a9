// stipple cache: what is in the folder of built scenes, and how it is emptied.
#include <fmt/format.h>

#include <ctime>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "apps/stipple/common.h"
#include "apps/stipple/options.h"
#include "engine/base/process.h"
#include "engine/base/text.h"
#include "engine/base/units.h"
#include "engine/scene/open/cache_folder.h"

namespace stipple::app {
namespace {

using Clock = std::chrono::system_clock;

struct CacheCommand {
    bool json = false;
    double olderDays = -1;
    std::string to;
};

double daysSince(Clock::time_point t) {
    return std::chrono::duration<double, std::ratio<86400>>(Clock::now() - t).count();
}

std::string ageText(Clock::time_point t) {
    const double days = daysSince(t);
    if (days >= 2) return fmt::format("{:.0f} days", days);
    if (days * 24 >= 2) return fmt::format("{:.0f} h", days * 24);
    return fmt::format("{:.0f} min", std::max(days * 1440, 0.0));
}

std::string isoTime(Clock::time_point t) {
    const std::time_t seconds = Clock::to_time_t(t);
    std::tm parts{};
    ::gmtime_r(&seconds, &parts);
    std::string text(20, ' ');
    text.resize(std::strftime(text.data(), text.size() + 1, "%Y-%m-%dT%H:%M:%SZ", &parts));
    return text;
}

std::string scenes(size_t count) { return fmt::format("{} scene{}", count, count == 1 ? "" : "s"); }

std::string inputText(const scene::CacheEntry& entry) {
    if (!entry.record || entry.record->inputs.empty()) return "not recorded";
    const std::vector<std::string>& inputs = entry.record->inputs;
    const std::string more = inputs.size() > 1 ? fmt::format(" and {} more", inputs.size() - 1) : "";
    return fmt::format("{}{} ({}{})", printable(inputs.front()), more, printable(entry.record->part),
                       entry.isWhole ? "" : ", interrupted build");
}

nlohmann::json entryJson(const scene::CacheEntry& entry) {
    nlohmann::json j = {{"path", entry.path},
                        {"bytes", entry.bytes},
                        {"last_used", isoTime(entry.used)},
                        {"complete", entry.isWhole},
                        {"in_use", entry.isInUse}};
    if (entry.record) {
        j["inputs"] = entry.record->inputs;
        j["part"] = entry.record->part;
        j["made"] = isoTime(entry.record->made);
        j["age_days"] = daysSince(entry.record->made);
    }
    return j;
}

Result<void> list(const CacheCommand& o) {
    STIPPLE_ASSIGN(const uint64_t limit, scene::cacheLimit(""));
    const std::string folder = scene::CacheFolder::path();
    std::vector<scene::CacheEntry> entries;
    if (std::error_code error; std::filesystem::exists(folder, error)) {
        STIPPLE_ASSIGN(const scene::CacheFolder cache, scene::CacheFolder::open());
        entries = cache.entries();
        for (scene::CacheEntry& entry : entries) entry.record = cache.readRecord(entry.key);
    }
    uint64_t sum = 0;
    for (const scene::CacheEntry& entry : entries) sum += entry.bytes;
    if (o.json) {
        nlohmann::json j = {{"folder", folder}, {"bytes", sum}, {"limit_bytes", limit}};
        j["entries"] = nlohmann::json::array();
        for (const scene::CacheEntry& entry : entries) j["entries"].push_back(entryJson(entry));
        printJson("cache", j);
        return {};
    }
    if (!entries.empty()) fmt::print("{:>10}  {:>9}  {:>9}  made from\n", "size", "age", "last used");
    for (const scene::CacheEntry& entry : entries)
        fmt::print("{:>10}  {:>9}  {:>9}  {}{}\n{:36}{}\n", humanBytes(entry.bytes),
                   entry.record ? ageText(entry.record->made) : "-", ageText(entry.used), inputText(entry),
                   entry.isInUse ? " (in use)" : "", "", printable(entry.path));
    fmt::print("{}: {}, {} of at most {}\n", printable(folder), scenes(entries.size()), humanBytes(sum),
               humanBytes(limit));
    return {};
}

Result<void> clean(const CacheCommand& o) {
    std::vector<scene::CacheEntry> removed;
    uint64_t most = 0, kept = 0, bytes = 0;
    if (!o.to.empty()) {
        most = parseBytes(o.to);
        if (most == 0 && o.to != "0")
            return fail(ErrorKind::usage, fmt::format("'{}' is not a size", o.to), "--to", "e.g. 2G");
    }
    const std::string folder = scene::CacheFolder::path();
    if (std::error_code error; std::filesystem::exists(folder, error)) {
        STIPPLE_ASSIGN(const scene::CacheFolder cache, scene::CacheFolder::open());
        if (o.olderDays >= 0) {
            for (scene::CacheEntry& entry : cache.entries())
                if (daysSince(entry.used) >= o.olderDays && cache.remove(entry)) removed.push_back(std::move(entry));
        } else {
            removed = cache.shrinkTo(most);
            const std::string pipelines = scene::CacheFolder::pipelinesPath();
            std::error_code ignored;
            if (most == 0 && !pipelines.empty()) std::filesystem::remove_all(pipelines, ignored);
        }
        for (const scene::CacheEntry& entry : cache.entries()) kept += entry.isInUse ? 1 : 0;
    }
    for (const scene::CacheEntry& entry : removed) bytes += entry.bytes;
    if (o.json) {
        printJson("cache", {{"folder", folder}, {"removed", removed.size()}, {"bytes", bytes}, {"in_use", kept}});
        return {};
    }
    fmt::print("{}: removed {}, {}{}\n", printable(folder), scenes(removed.size()), humanBytes(bytes),
               kept > 0 ? fmt::format("; {} in use stay", kept) : "");
    return {};
}

}  // namespace

void setupCache(CLI::App& app, int& status) {
    auto o = std::make_shared<CacheCommand>();
    CLI::App* sub =
        app.add_subcommand("cache", "scenes built from raw inputs for render and view: list them, remove them");
    sub->require_subcommand(1);
    CLI::App* shown =
        sub->add_subcommand("list", "what is there: size, age, last use, made from what; newest use first");
    shown->add_flag("--json", o->json, "print it as JSON (stipple help json)");
    shown->callback([o, &status] {
        if (const auto result = list(*o); !result) status = report(result.error());
    });
    CLI::App* emptied =
        sub->add_subcommand("clean", "remove all that is not in use (what drivers compiled, too), or a part of it");
    auto* older = emptied->add_option("--older", o->olderDays, "only what was not used for that many days")
                      ->transform(within(0.0, 1e6))
                      ->type_name("DAYS");
    emptied->add_option("--to", o->to, "only as much, least recently used first, that the rest has this size, e.g. 2G")
        ->type_name("SIZE")
        ->excludes(older);
    emptied->add_flag("--json", o->json, "print it as JSON (stipple help json)");
    emptied->callback([o, &status] {
        if (const auto result = clean(*o); !result) status = report(result.error());
    });
}

}  // namespace stipple::app
