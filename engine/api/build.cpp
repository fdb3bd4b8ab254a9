// Builds, of files and of points that come from anywhere.
#define STIPPLE_WITHIN
#include <stipple/build.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <numeric>

#include "engine/api/convert.h"
#include "engine/base/executor.h"
#include "engine/base/hash.h"
#include "engine/scene/open/build_bytes.h"

namespace stipple::v1 {
namespace {

BuildReport given(lod::BuildReport report) {
    BuildReport out;
    out.primitive = std::move(report.primitive);
    out.in = report.pointsIn;
    out.kept = report.pointsOut;
    out.added = std::move(report.added);
    out.dropped = std::move(report.dropped);
    out.records = report.records;
    out.nodes = report.nodes;
    out.bytes = report.bytesOut;
    out.seconds = report.seconds;
    out.notes = std::move(report.notes);
    out.notes.insert(out.notes.end(), report.coarseNotes.begin(), report.coarseNotes.end());
    return out;
}

scene::OpenSettings settingsOf(const BuildSettings& s) {
    scene::OpenSettings settings = openSettings(s.memoryBytes, s.threads, s.surfels, s.listener);
    settings.temp = s.temporary;
    settings.normals = s.estimateNormals ? "auto" : "keep";
    settings.radii = s.estimateRadii ? "auto" : "keep";
    settings.skipBad = s.skipBad;
    settings.leftovers = lod::Leftovers::goOnOrReplace;
    return settings;
}

/// Output that cannot be written is said before hours of work.
::stipple::Result<void> checkOutput(const std::string& store) {
    if (store.empty()) return fail(::stipple::ErrorKind::usage, "has no name", "the store to build");
    std::error_code error;
    if (std::filesystem::is_directory(store, error))
        return fail(::stipple::ErrorKind::output, "is a folder", store, "name a file");
    return {};
}

template <typename Work>
Result<BuildReport> run(const std::string& store, const BuildSettings& settings, const Work& work) {
    if (const auto fine = checkOutput(store); !fine) return v1::given(fine.error());
    const auto executor = makeTbbExecutor(static_cast<int>(settings.threads));
    const scene::OpenSettings how = settingsOf(settings);
    ::stipple::Progress progress(ProgressStyle::silent, how.onProgress);
    ::stipple::Result<lod::BuildReport> built = work(how, *executor, progress);
    if (!built) return v1::given(built.error());
    return given(std::move(*built));
}

/// Bytes that are the caller's.
class CallersBytes final : public ByteSource {
  public:
    explicit CallersBytes(const Bytes& bytes) : bytes_(bytes) {}
    uint64_t sizeBytes() const override { return bytes_.count; }
    const std::string& path() const override { return bytes_.name; }
    uint64_t identity() const override { return hashBytes(bytes_.data, bytes_.count); }
    ::stipple::Result<void> readAt(uint64_t offset, void* to, size_t count) const override {
        if (offset > bytes_.count || count > bytes_.count - offset)
            return fail(::stipple::ErrorKind::input,
                        "ends after " + std::to_string(bytes_.count) + " bytes, read at " + std::to_string(offset),
                        bytes_.name, "is it whole?");
        if (count > 0) std::memcpy(to, static_cast<const char*>(bytes_.data) + offset, count);
        return {};
    }

  private:
    Bytes bytes_;
};

/// Never empty: no file is read for what lies in memory.
scene::Resolve resolverOf(const Resolve& resolve) {
    return [&resolve](const std::string& name) -> ::stipple::Result<std::shared_ptr<const ByteSource>> {
        if (!resolve) return std::shared_ptr<const ByteSource>();
        Result<std::vector<uint8_t>> found = resolve(name);
        if (!found) return tl::unexpected(taken(found.error()));
        return std::make_shared<const MemorySource>(name, std::move(*found));
    };
}

uint32_t packed(const std::array<uint8_t, 3>& c) {
    return static_cast<uint32_t>(c[0]) | static_cast<uint32_t>(c[1]) << 8 | static_cast<uint32_t>(c[2]) << 16;
}

/// What a source has given, as the engine has it. An error if it is not what was promised.
::stipple::Result<size_t> append(const PointSource& source, size_t part, const Points& from, uint64_t wanted,
                                 lod::PointBlock& to) {
    const size_t count = from.position.size();
    const auto fits = [&](bool isPromised, size_t size) { return size == (isPromised ? count : 0); };
    if (count != wanted || !fits(source.hasNormal, from.normal.size()) || !fits(source.hasRadius, from.radius.size()) ||
        !fits(source.hasColour, from.colour.size()))
        return fail(::stipple::ErrorKind::input, "gives other arrays than it promises",
                    source.name + ", part " + std::to_string(part), "each has one entry for each point asked for");
    for (const Vec3& p : from.position) to.position.push_back(taken(p));
    for (const auto& n : from.normal) to.normal.emplace_back(n[0], n[1], n[2]);
    to.radius.insert(to.radius.end(), from.radius.begin(), from.radius.end());
    for (const auto& c : from.colour) to.colour.push_back(packed(c));
    return count;
}

lod::PointReader readerOf(const PointSource& source, size_t part) {
    return [&source, part, done = uint64_t{0}, points = Points()](lod::PointBlock& block,
                                                                  size_t limit) mutable -> ::stipple::Result<size_t> {
        const uint64_t count = std::min<uint64_t>(limit, source.parts[part] - done);
        if (count == 0) return size_t{0};
        points = {};
        if (const Result<void> read = source.read(part, done, count, points); !read)
            return tl::unexpected(taken(read.error()));
        done += count;
        return append(source, part, points, count, block);
    };
}

lod::PointSource taken(const PointSource& source) {
    lod::PointSource out;
    out.info.path = source.name;
    out.info.format = "points of a program";
    out.info.points = std::accumulate(source.parts.begin(), source.parts.end(), uint64_t{0});
    out.info.hasColour = source.hasColour;
    out.info.hasNormal = source.hasNormal;
    out.info.hasRadius = source.hasRadius;
    const auto axis = std::max_element(source.up.begin(), source.up.end()) - source.up.begin();
    out.info.up = static_cast<lod::UpAxis>(axis);
    out.parts = source.parts;
    out.openPart = [&source](size_t part) -> ::stipple::Result<lod::PointReader> { return readerOf(source, part); };
    return out;
}

}  // namespace

Result<BuildReport> build(const std::vector<std::string>& inputs, const std::string& store,
                          const BuildSettings& settings) {
    if (inputs.empty()) return Error{ErrorKind::usage, "there is nothing to build from", "inputs", ""};
    return run(store, settings, [&](const scene::OpenSettings& how, Executor& executor, ::stipple::Progress& progress) {
        return scene::buildAny(inputs, store, how, executor, progress);
    });
}

Result<BuildReport> buildBytes(const std::vector<Bytes>& inputs, const std::string& store,
                               const BuildSettings& settings, const Resolve& resolve) {
    if (inputs.empty()) return Error{ErrorKind::usage, "there is nothing to build from", "inputs", ""};
    std::vector<std::shared_ptr<const ByteSource>> sources;
    for (const Bytes& input : inputs) {
        if (input.data == nullptr && input.count > 0)
            return Error{ErrorKind::usage, "says that it has bytes, but not where", input.name, "set data"};
        if (input.count == 0) return Error{ErrorKind::input, "is empty", input.name, "is the download complete?"};
        sources.push_back(std::make_shared<const CallersBytes>(input));
    }
    return run(store, settings, [&](const scene::OpenSettings& how, Executor& executor, ::stipple::Progress& progress) {
        return scene::buildBytes(sources, resolverOf(resolve), store, how, executor, progress);
    });
}

Result<BuildReport> buildPoints(const PointSource& source, const std::string& store, const BuildSettings& settings) {
    if (!source.read || source.parts.empty())
        return Error{ErrorKind::usage, "has no points to read", source.name, "set parts and read"};
    return run(store, settings,
               [&](const scene::OpenSettings& how, Executor& executor,
                   ::stipple::Progress& progress) -> ::stipple::Result<lod::BuildReport> {
                   STIPPLE_ASSIGN(lod::BuildSettings own, how.settings());
                   own.leftovers = lod::Leftovers::replace;  // nobody knows whether they are of the same points
                   own.open = [&](const std::string&, const lod::ReadOptions&) -> ::stipple::Result<lod::PointSource> {
                       return taken(source);
                   };
                   // (A key that no file can have: the name may be that of a folder.)
                   return lod::buildStore({"/dev/null/points"}, store, own, executor, progress);
               });
}

}  // namespace stipple::v1
