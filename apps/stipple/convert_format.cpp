#include "apps/stipple/convert_format.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "apps/stipple/info_parts.h"
#include "apps/stipple/options.h"
#include "apps/stipple/outputs.h"
#include "engine/base/process.h"
#include "engine/base/text.h"
#include "engine/scene/triangles.h"
#include "lod/import/formats.h"
#include "lod/import/import.h"
#include "lod/store/file_kind.h"
#include "lod/store/leaves.h"

namespace stipple::app {
namespace {

tl::unexpected<Error> cannotHold(const char* what, const FormatConversion& o, const lod::Format& format) {
    return fail(ErrorKind::usage, fmt::format("holds {}, and {} files are not written with those", what, format.name),
                o.input, "write to another format");
}

Result<lod::WriteReport> write(const lod::MeshSource& triangles, const FormatConversion& o, const lod::Format& format,
                               const lod::FormatOptions& more) {
    if (!format.writeMesh) return cannotHold("triangles", o, format);
    return format.writeMesh(triangles, o.output, o.voxel, more);
}
Result<lod::WriteReport> write(const lod::PointSource& points, const FormatConversion& o, const lod::Format& format,
                               const lod::FormatOptions& more) {
    if (!format.writePoints) return cannotHold("points", o, format);
    return format.writePoints(points, o.output, o.voxel, more);
}

Result<lod::WriteReport> ofStore(const FormatConversion& o, const lod::Format& format, const lod::FormatOptions& more) {
    STIPPLE_ASSIGN(lod::Store opened, lod::openStore(o.input));
    const auto store = std::make_shared<const lod::Store>(std::move(opened));
    if (store->hierarchy.isGraph) {
        STIPPLE_ASSIGN(const lod::MeshSource triangles, lod::leafTriangles(store));
        return write(triangles, o, format, more);
    }
    STIPPLE_ASSIGN(const lod::PointSource points, lod::leafPoints(store));
    return write(points, o, format, more);
}

Result<lod::WriteReport> ofScene(const FormatConversion& o, const lod::Format& format, const lod::FormatOptions& more) {
    STIPPLE_ASSIGN(const scene::Scene scene, scene::readScene(o.input, o.build.reading()));
    const lod::MeshSource triangles = scene::triangleSource(scene, scene::placements(scene));
    if (triangles.triangles == 0)
        return fail(ErrorKind::input, "holds no triangles of its own", o.input, "stores are converted one by one");
    return write(triangles, o, format, more);
}

Result<lod::WriteReport> ofFile(const FormatConversion& o, const lod::Format& format, const lod::FormatOptions& more) {
    STIPPLE_ASSIGN(const bool hasMesh, lod::hasMesh(o.input, more));
    if (hasMesh) {
        STIPPLE_ASSIGN(const lod::OpenedMesh mesh, lod::openMesh(o.input, more));
        for (const std::string& note : mesh.notes) fmt::print(stderr, "note: {}\n", printable(note));
        return write(mesh.source, o, format, more);
    }
    STIPPLE_ASSIGN(lod::PointSource points, lod::openPointSource(o.input, {}, more));
    lod::ReadOptions all;
    for (const lod::AttributeInfo& a : points.info.attributes) all.attributes.push_back(a.name);
    STIPPLE_ASSIGN(points, lod::openPointSource(o.input, all, more));
    return write(points, o, format, more);
}

}  // namespace

bool isWritten(const std::string& output) {
    const lod::Format* const format = lod::formatNamed(output);
    return format && (format->writePoints || format->writeMesh);
}

std::string writtenEndings() {
    std::string text;
    for (const lod::Format& format : lod::formats())
        if (format.writePoints || format.writeMesh)
            text += (text.empty() ? "" : ", ") + std::string(format.endings.front());
    return text;
}

void addFormatOptions(CLI::App& app, FormatConversion& o) {
    app.add_option("--voxel", o.voxel,
                   fmt::format("of {}: edge of a voxel, units of the input (needed for level sets)", writtenEndings()))
        ->transform(positive())
        ->type_name("SIZE");
    o.build.addGridTo(app);
}

Result<void> convertToFormat(const FormatConversion& o) {
    STIPPLE_TRY(checkOutputs({{o.output}}, {o.input}, o.force));
    catchStopSignals();
    const double start = nowSeconds();
    const lod::Format& format = *lod::formatNamed(o.output);
    const lod::FormatOptions more = o.build.formatOptions();
    STIPPLE_ASSIGN(const lod::WriteReport report, [&] {
        if (lod::isStoreFile(o.input)) return ofStore(o, format, more);
        return scene::isSceneFile(o.input) ? ofScene(o, format, more) : ofFile(o, format, more);
    }());
    if (o.json) {
        nlohmann::json j = factsJson(report.facts);
        j["written"] = nlohmann::json::array({o.output});
        j["seconds"] = nowSeconds() - start;
        printJson("convert", j);
        return {};
    }
    fmt::print("{}: {}\n", printable(o.output), report.line);
    return {};
}

}  // namespace stipple::app
