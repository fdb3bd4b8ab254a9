#include "apps/stipple/info_input.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "apps/stipple/common.h"
#include "apps/stipple/info_parts.h"
#include "engine/base/file.h"
#include "engine/base/text.h"
#include "engine/base/units.h"
#include "engine/base/words.h"
#include "engine/scene/scene.h"
#include "lod/import/curves/curve_readers.h"
#include "lod/import/import.h"
#include "lod/import/las/header.h"
#include "lod/import/ply/mesh.h"
#include "lod/import/survey.h"

namespace stipple::app {
namespace {

/// Files up to this many points are read whole without being asked to.
constexpr uint64_t kQuickPoints = 20'000'000;
constexpr size_t kMostProblems = 20;

/// As the integers of the file say, where it has some.
nlohmann::json placeJson(const lod::SourceInfo& i, const glm::dvec3& v) {
    if (!i.isLattice) return vectorJson(v);
    return {latticeValue(v.x, i.scale.x, i.offset.x), latticeValue(v.y, i.scale.y, i.offset.y),
            latticeValue(v.z, i.scale.z, i.offset.z)};
}

nlohmann::json attributeJson(const lod::AttributeInfo& a, bool hasRange) {
    nlohmann::json j = {{"name", a.name},
                        {"type", lod::kScalarNames.at(static_cast<size_t>(a.type))},
                        {"aggregate", lod::kAggregateNames.at(static_cast<size_t>(a.aggregate))}};
    if (a.scale != 1 || a.offset != 0) {
        j["scale"] = a.scale;
        j["offset"] = a.offset;
    }
    if (!a.description.empty()) j["description"] = a.description;
    if (a.noData) j["no_data"] = *a.noData * a.scale + a.offset;
    if (hasRange) j["points_without_data"] = a.withoutData;
    if (hasRange) {
        j["least"] = a.least;
        j["greatest"] = a.greatest;
        for (const auto& [value, count] : a.counts) j["counts"][fmt::format("{:.0f}", value)] = count;
    }
    return j;
}

/// What only LAS and LAZ have.
Result<void> addLas(const std::string& path, bool skipBad, nlohmann::json& j, std::vector<std::string>& problems,
                    const lod::Survey* survey) {
    STIPPLE_ASSIGN(const InputFile file, InputFile::open(path));
    const las::Bytes bytes{file.sizeBytes(),
                           [&](uint64_t at, void* to, size_t count) { return file.readAt(at, to, count); }};
    STIPPLE_ASSIGN(const las::LasHeader h, las::readLasHeader(bytes, path, skipBad));
    j["version"] = fmt::format("1.{}", h.minor);
    j["point_format"] = h.format;
    j["record_bytes"] = h.recordBytes;
    j["compressed"] = h.laz.has_value();
    if (h.laz)
        for (const las::LazItem& item : h.laz->items)
            j["laz_items"].push_back({{"type", item.type}, {"bytes", item.bytes}, {"version", item.version}});
    j["system"] = h.system;
    j["software"] = h.software;
    j["created"] = fmt::format("{:04}, day {}", h.year, h.day);
    j["points_by_return"] = h.pointsByReturn;
    for (const las::Vlr& v : h.vlrs)
        j["records"].push_back({{"user", v.user},
                                {"id", v.id},
                                {"bytes", v.bytes},
                                {"extended", v.isExtended},
                                {"description", v.description}});
    if (!survey) return {};
    const auto returns = std::find_if(survey->attributes.begin(), survey->attributes.end(),
                                      [](const lod::AttributeInfo& a) { return a.name == "return_number"; });
    std::array<uint64_t, 15> found{};
    for (const auto& [value, count] : returns->counts)
        // (Before LAS 1.4 a header counts five returns, whatever the points have.)
        if (value >= 1 && value <= (h.minor >= 4 ? 15 : 5)) found.at(static_cast<size_t>(value) - 1) = count;
    if (h.pointsByReturn == decltype(h.pointsByReturn){})
        j["notes"].push_back("the header does not count points by return");
    else if (found != h.pointsByReturn)
        problems.push_back(fmt::format("points by return: the header says {}, the file holds {}",
                                       fmt::join(h.pointsByReturn, " "), fmt::join(found, " ")));
    return {};
}

/// Along which axes what the header says is no range: not finite, or the greatest before the least.
std::string whyNoBox(const lod::SourceInfo& i) {
    std::vector<std::string> axes;
    for (int a = 0; a < 3; ++a) {
        const double least = i.declaredMin[a], greatest = i.declaredMax[a];
        if (!std::isfinite(least) || !std::isfinite(greatest) || least > greatest)
            axes.push_back(fmt::format("{} from {:.15g} to {:.15g}", "xyz"[a], least, greatest));
    }
    return fmt::format("{}", fmt::join(axes, ", "));
}

/// How the header's box differs from that of the points, along each axis where it does by more than headers are rounded
/// by. Points outside of it are a problem; a larger one is allowed (octrees give each node its cell) and said.
void compareBounds(const lod::SourceInfo& i, const lod::Survey& s, nlohmann::json& j,
                   std::vector<std::string>& problems) {
    std::vector<std::string> larger;
    bool isTooSmall = false;
    if (i.declaredMin == glm::dvec3(0) && i.declaredMax == glm::dvec3(0) && s.least != s.greatest) {
        j["header_box"] = "absent";
        j["notes"].push_back("the header has no box: all of it is 0");
        return;
    }
    if (const std::string none = whyNoBox(i); !none.empty()) {
        j["header_box"] = "none";
        problems.push_back("the header's box is none: " + none);
        return;
    }
    for (int a = 0; a < 3; ++a) {
        const double slack = 1.001 * i.scale[a];
        // How far the points reach beyond the box; negative: how far the box reaches beyond them.
        const std::array<double, 2> beyond{i.declaredMin[a] - s.least[a], s.greatest[a] - i.declaredMax[a]};
        const auto place = [&](double v) { return latticeText(v, i.scale[a], i.offset[a]); };
        for (size_t end = 0; end < 2; ++end) {
            const char* const side = end == 0 ? "least" : "greatest";
            const double of = end == 0 ? i.declaredMin[a] : i.declaredMax[a],
                         is = end == 0 ? s.least[a] : s.greatest[a];
            if (std::abs(beyond.at(end)) <= slack) continue;
            const std::string text =
                fmt::format("{} {} is {:.15g}, that of the points {}", side, "xyz"[a], of, place(is));
            if (beyond.at(end) < 0) {
                larger.push_back(fmt::format("{} ({:.6g} farther out)", text, -beyond.at(end)));
                continue;
            }
            isTooSmall = true;  // (also what is no number)
            problems.push_back(
                fmt::format("points lie outside of the header's box: its {} ({:.6g} beyond)", text, beyond.at(end)));
        }
    }
    j["header_box"] = isTooSmall ? "too small" : larger.empty() ? "agrees" : "larger";
    if (!larger.empty())
        j["notes"].push_back(
            fmt::format("the header's box is larger than that of the points: its {}", fmt::join(larger, "; ")));
}

Result<nlohmann::json> fileInfo(const InputInfoOptions& o, const std::string& path, Executor& executor) {
    STIPPLE_ASSIGN(lod::PointSource source, lod::openPointSource(path, {{}, o.skipBad}));
    lod::ReadOptions all{{}, o.skipBad};
    for (const lod::AttributeInfo& a : source.info.attributes) all.attributes.push_back(a.name);
    STIPPLE_ASSIGN(source, lod::openPointSource(path, all));
    const lod::SourceInfo& i = source.info;
    std::vector<std::string> problems;
    nlohmann::json j = {{"kind", "input"},           {"path", i.path},
                        {"format", i.format},        {"points", i.points},
                        {"crs", i.crs.label()},      {"metres_per_unit", i.crs.metresPerUnit},
                        {"notes", i.notes},          {"parts", source.parts.size()},
                        {"has_colour", i.hasColour}, {"has_normals", i.hasNormal},
                        {"has_radii", i.hasRadius}};
    STIPPLE_ASSIGN(const lod::PlyFaces faces, lod::plyFaces(path));
    if (faces.faces > 0) j["faces"] = faces.faces;
    if (faces.strips > 0) j["triangle_strips"] = faces.strips;
    if (i.isLattice) {
        j["scale"] = vectorJson(i.scale);
        j["offset"] = vectorJson(i.offset);
    }
    if (i.hasDeclaredBounds) {
        j["declared_min"] = vectorJson(i.declaredMin);
        j["declared_max"] = vectorJson(i.declaredMax);
    }
    std::optional<lod::Survey> survey;
    if (o.verify || i.points <= kQuickPoints) {
        Progress progress(true);
        survey = lod::surveySource(source, executor, progress);
        STIPPLE_TRY(checkStopped(path, "not all of it was read"));
        j["points_read"] = survey->points;
        j["points_not_finite"] = survey->notFinite;
        if (survey->points != i.points)
            problems.push_back(
                fmt::format("the header declares {} points, {} could be read", i.points, survey->points));
        for (const std::string& p : survey->problems) problems.push_back(p);
        if (survey->points > survey->notFinite) {
            j["min"] = placeJson(i, survey->least);
            j["max"] = placeJson(i, survey->greatest);
            if (i.isLattice) {
                j["min_integers"] = {survey->leastStep.x, survey->leastStep.y, survey->leastStep.z};
                j["max_integers"] = {survey->greatestStep.x, survey->greatestStep.y, survey->greatestStep.z};
            }
            if (i.hasDeclaredBounds) compareBounds(i, *survey, j, problems);
        }
        if (survey->colourMax > 0) j["colour_bits"] = survey->colourMax > 255 ? 16 : 8;
    }
    j["attributes"] = nlohmann::json::array();
    for (const lod::AttributeInfo& a : survey ? survey->attributes : i.attributes)
        j["attributes"].push_back(attributeJson(a, survey.has_value()));
    if (i.format.find("1.") != std::string::npos)
        STIPPLE_TRY(addLas(path, o.skipBad, j, problems, survey && survey->problems.empty() ? &*survey : nullptr));
    j["problems"] = problems;
    return j;
}

void printVector(const nlohmann::json& j, const char* key, const char* label) {
    if (!j.contains(key)) return;
    std::string text;
    for (size_t a = 0; a < 3; ++a) {
        const bool isOnLattice = j.contains("scale") && key[0] == 'm';  // least and greatest place
        const double v = j[key][a].get<double>();
        text += ' ';
        text += isOnLattice ? latticeText(v, j["scale"][a].get<double>(), j["offset"][a].get<double>())
                            : fmt::format("{:.15g}", v);
    }
    fmt::print("  {:15}{}\n", label, text);
}

void printAttributes(const nlohmann::json& attributes) {
    if (attributes.empty()) return;
    fmt::print("  attributes\n");
    for (const auto& a : attributes) {
        std::string range;
        if (a.contains("least"))
            range = fmt::format("{:.15g} .. {:.15g}", a["least"].get<double>(), a["greatest"].get<double>());
        if (a.contains("counts") && a["counts"].size() <= 12) {
            range.clear();
            std::vector<std::pair<int, uint64_t>> counts;
            for (const auto& [value, count] : a["counts"].items()) counts.emplace_back(std::stoi(value), count);
            std::sort(counts.begin(), counts.end());
            for (const auto& [value, count] : counts)
                range += fmt::format("{}{}: {}", range.empty() ? "" : ", ", value, count);
        }
        if (const auto without = a.value("points_without_data", uint64_t{0}); without > 0)
            range += fmt::format("; {} points without data", without);
        fmt::print("    {:22} {:4} {:5} {}{}\n", a["name"].get<std::string>(), a["type"].get<std::string>(),
                   a["aggregate"].get<std::string>(), range,
                   a.contains("description") ? "  (" + a["description"].get<std::string>() + ")" : "");
    }
}

void printFile(const nlohmann::json& j) {
    const bool isMesh = j.contains("faces") || j.contains("triangle_strips");
    fmt::print("{}: {}, {}\n", printable(j["path"].get<std::string>()), j["format"].get<std::string>(),
               counted(j["points"].get<uint64_t>(), isMesh ? "vertex" : "point", isMesh ? "vertices" : "points"));
    if (isMesh)
        fmt::print("  {:15} {}{}\n", "faces", j.value("faces", uint64_t{0}),
                   j.contains("triangle_strips")
                       ? fmt::format(", and {} triangle strips", j["triangle_strips"].get<uint64_t>())
                       : "");
    printVector(j, "min", "least");
    printVector(j, "max", "greatest");
    if (!j.contains("min")) {
        printVector(j, "declared_min", "least (header)");
        printVector(j, "declared_max", "greatest (header)");
    }
    printVector(j, "scale", "scale");
    printVector(j, "offset", "offset");
    const std::string crs = j["crs"].get<std::string>();
    fmt::print("  {:15} {}\n  {:15} {}\n", "crs", crs.empty() ? "not named" : crs, "metres a unit",
               j["metres_per_unit"].get<double>());
    fmt::print("  {:15} {}{}\n", "colour", j["has_colour"].get<bool>() ? "yes" : "no",
               j.contains("colour_bits") ? fmt::format(", {} bits", j["colour_bits"].get<int>()) : "");
    if (j.contains("software"))
        fmt::print("  {:15} {} (system: {}; created {})\n", "software", j["software"].get<std::string>(),
                   j["system"].get<std::string>(), j["created"].get<std::string>());
    if (j.value("compressed", false)) fmt::print("  {:15} {}\n", "chunks", j["parts"].get<size_t>());
    if (j.contains("records"))
        for (const auto& r : j["records"])
            fmt::print("  {:15} {} {}, {} bytes {}\n", r["extended"].get<bool>() ? "evlr" : "vlr",
                       r["user"].get<std::string>(), r["id"].get<int>(), r["bytes"].get<uint64_t>(),
                       r["description"].get<std::string>());
    printAttributes(j["attributes"]);
    for (const auto& n : j["notes"]) fmt::print("  note: {}\n", printable(n.get<std::string>()));
    for (const auto& p : j["problems"]) fmt::print("  problem: {}\n", printable(p.get<std::string>()));
    if (!j.contains("points_read"))
        fmt::print("  the points themselves were not read: --verify does\n");
    else if (j["problems"].empty())
        fmt::print("  all {} points were read; {}\n", j["points_read"].get<uint64_t>(),
                   !j.contains("header_box")     ? "as many as the header says"
                   : j["header_box"] == "absent" ? "as many as the header says"
                   : j["header_box"] == "agrees" ? "counts and box agree with the header"
                                                 : "counts agree with the header, whose box holds all of them");
}

/// Files that are not what they say end with 3, after all that there is to say.
Result<void> asTheySay(const InputInfoOptions& o, size_t problems) {
    if (problems == 0 || o.skipBad) return {};
    return fail(ErrorKind::input, fmt::format("is not what it says: {} (listed above)", counted(problems, "problem")),
                o.input, "--skip-bad permits it");
}

/// Many files: sums, and the files that differ or fail.
Result<void> showFolder(const InputInfoOptions& o, const std::vector<std::string>& files, Executor& executor) {
    nlohmann::json all = {{"kind", "input files"}, {"path", o.input}, {"files", files.size()}};
    uint64_t points = 0, bad = 0;
    glm::dvec3 least(1e300), greatest(-1e300);
    std::map<std::string, uint64_t> formats, systems;
    std::vector<std::string> problems;
    InputInfoOptions each = o;
    each.json = true;
    for (const std::string& path : files) {
        const auto j = fileInfo(each, path, executor);
        if (!j) {
            ++bad;
            problems.push_back(j.error().line());
            continue;
        }
        points += (*j)["points"].get<uint64_t>();
        ++formats[(*j)["format"].get<std::string>()];
        ++systems[(*j)["crs"].get<std::string>()];
        for (const auto& p : (*j)["problems"]) problems.push_back(path + ": " + p.get<std::string>());
        if (!j->contains("min")) continue;
        for (int a = 0; a < 3; ++a) {
            least[a] = std::min(least[a], (*j)["min"][static_cast<size_t>(a)].get<double>());
            greatest[a] = std::max(greatest[a], (*j)["max"][static_cast<size_t>(a)].get<double>());
        }
    }
    all["points"] = points;
    if (const auto octree = lod::declaredByOctree(o.input); octree && *octree != points)
        problems.push_back(fmt::format("the octree declares {} points, its node files hold {}", *octree, points));
    all["unreadable_files"] = bad;
    all["formats"] = formats;
    all["crs"] = systems;
    all["min"] = vectorJson(least);
    all["max"] = vectorJson(greatest);
    all["problems"] = problems;
    if (o.json) {
        printJson("info", all);
        return asTheySay(o, problems.size());
    }
    fmt::print("{}: {}, {}\n", printable(o.input), counted(files.size(), "file"), counted(points, "point"));
    printVector(all, "min", "least");
    printVector(all, "max", "greatest");
    for (const auto& [format, count] : formats) fmt::print("  {:15} {}\n", format, counted(count, "file"));
    for (const auto& [crs, count] : systems)
        fmt::print("  {:15} {} ({})\n", "crs", crs.empty() ? "not named" : crs, counted(count, "file"));
    for (size_t i = 0; i < std::min(problems.size(), kMostProblems); ++i)
        fmt::print("  problem: {}\n", printable(problems[i]));
    if (problems.size() > kMostProblems)
        fmt::print("  and {} more (--json lists all)\n", problems.size() - kMostProblems);
    return asTheySay(o, problems.size());
}

}  // namespace

namespace {

nlohmann::json sceneJson(const scene::Scene& s) {
    uint64_t triangles = 0, lines = 0, points = 0, stores = 0, instances = 0;
    for (const scene::Mesh& m : s.meshes)
        for (const scene::Primitive& p : m.primitives) {
            if (p.kind == scene::PrimitiveKind::triangles) triangles += p.indices.size() / 3;
            if (p.kind == scene::PrimitiveKind::lines) lines += p.indices.size() / 2;
            if (p.kind == scene::PrimitiveKind::points) points += p.indices.size();
        }
    for (const scene::Node& n : s.nodes) {
        if (!n.store.empty()) ++stores;
        instances += n.instances.size();
    }
    nlohmann::json j = {{"kind", "scene"},
                        {"path", s.path},
                        {"nodes", s.nodes.size()},
                        {"instances", instances},
                        {"stores", stores},
                        {"meshes", s.meshes.size()},
                        {"triangles", triangles},
                        {"lines", lines},
                        {"points", points},
                        {"materials", s.materials.size()},
                        {"textures", s.textures.size()},
                        {"images", s.images.size()},
                        {"lights", s.lights.size()},
                        {"cameras", s.cameras.size()},
                        {"notes", s.notes}};
    const scene::Box box = scene::meshBounds(s);
    if (!box.isEmpty()) {
        j["min"] = vectorJson(box.least);
        j["max"] = vectorJson(box.greatest);
    }
    return j;
}

Result<void> showScene(const InputInfoOptions& o) {
    scene::ReadSettings reading = o.reading;
    reading.isStrict = o.verify;  // what only a validator minds is an error to who asks for a check
    STIPPLE_ASSIGN(const scene::Scene s, scene::readScene(o.input, reading));
    const nlohmann::json j = sceneJson(s);
    if (o.json) {
        printJson("info", j);
        return {};
    }
    fmt::print("{}: scene\n", printable(o.input));
    printVector(j, "min", "least");
    printVector(j, "max", "greatest");
    for (const char* key : {"nodes", "instances", "stores", "meshes", "triangles", "lines", "points", "materials",
                            "textures", "images", "lights", "cameras"})
        if (j[key] != 0) fmt::print("  {:15} {}\n", key, j[key].get<uint64_t>());
    for (const std::string& note : s.notes) fmt::print("  note: {}\n", printable(note));
    return {};
}

Result<void> showCurves(const InputInfoOptions& o) {
    STIPPLE_ASSIGN(const lod::CurveSource source, lod::openCurves(o.input));
    STIPPLE_ASSIGN(lod::CurveSet set, lod::collect(source));
    const bool hasRadii = std::any_of(set.radius.begin(), set.radius.end(), [](float r) { return r > 0; });
    const uint64_t vertices = set.position.size(), curves = set.curves();
    const lod::CurveSet clean = lod::cleanCurves(std::move(set), 0);
    scene::Box box;
    for (const glm::dvec3& p : clean.position) box.add(p);
    nlohmann::json j = {{"kind", "curves"},
                        {"path", o.input},
                        {"curves", curves},
                        {"vertices", vertices},
                        {"drawn", clean.curves()},
                        {"has_radii", hasRadii},
                        {"has_colour", clean.hasColour},
                        {"dropped", clean.dropped},
                        {"mended", clean.mended}};
    if (!box.isEmpty()) {
        j["min"] = vectorJson(box.least);
        j["max"] = vectorJson(box.greatest);
    }
    if (o.json) {
        printJson("info", j);
        return {};
    }
    fmt::print("{}: {} of {}\n", printable(o.input), counted(curves, "curve"), counted(vertices, "vertex", "vertices"));
    printVector(j, "min", "least");
    printVector(j, "max", "greatest");
    fmt::print("  {:15} {}\n  {:15} {}\n", "radii", hasRadii ? "yes" : "no: see --curve-radius", "colours",
               clean.hasColour ? "yes" : "no");
    for (const auto& [what, count] : clean.dropped) fmt::print("  {:15} {} segments {}\n", "left out", count, what);
    for (const auto& [what, count] : clean.mended) fmt::print("  {:15} {} {}\n", "mended", count, what);
    return {};
}

}  // namespace

Result<void> showInputInfo(const InputInfoOptions& o, Executor& executor) {
    if (scene::isSceneFile(o.input)) return showScene(o);
    if (lod::isCurveFile(o.input)) return showCurves(o);
    if (const lod::Format* const f = lod::formatOf(o.input); f && f->describe) return showParts(o, *f);
    STIPPLE_ASSIGN(const std::vector<std::string> files, lod::expandInputs({o.input}));
    if (files.size() != 1) return showFolder(o, files, executor);
    STIPPLE_ASSIGN(const nlohmann::json j, fileInfo(o, files.front(), executor));
    if (o.json)
        printJson("info", j);
    else
        printFile(j);
    return asTheySay(o, j["problems"].size());
}

}  // namespace stipple::app
