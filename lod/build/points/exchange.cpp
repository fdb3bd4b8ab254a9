#include "lod/build/points/exchange.h"

#include <fmt/format.h>

#include <filesystem>

#include "engine/base/file.h"
#include "engine/base/hash.h"

namespace stipple::lod {
namespace {

namespace fs = std::filesystem;

Result<std::vector<uint8_t>> readAll(const std::string& path) {
    STIPPLE_ASSIGN(const InputFile file, InputFile::open(path));
    std::vector<uint8_t> bytes(file.sizeBytes());
    STIPPLE_TRY(file.readAt(0, bytes.data(), bytes.size()));
    return bytes;
}

std::string builtPath(const std::string& folder, size_t bucket) { return fmt::format("{}/built-{}", folder, bucket); }

}  // namespace

std::string ownFolder(const Ranks& ranks, const std::string& folder) {
    return fmt::format("{}/rank-{}", folder, ranks.rank());
}

Result<void> makeSharedFolder(Ranks& ranks, const std::string& folder) {
    std::error_code error;
    if (ranks.rank() == 0) {
        fs::remove_all(folder, error);
        fs::create_directories(folder, error);
    }
    const auto failed = [&] {
        return fail(ErrorKind::output, fmt::format("cannot be written: {}", error.message()), folder,
                    "--temp must name a folder that all ranks see");
    };
    STIPPLE_TRY(agree(&ranks, error ? Result<void>(failed()) : Result<void>()));
    fs::create_directory(ownFolder(ranks, folder), error);
    STIPPLE_TRY(agree(&ranks, error ? Result<void>(failed()) : Result<void>()));
    // Do all see it?
    for (int r = 0; r < ranks.count() && !error; ++r)
        if (!fs::exists(fmt::format("{}/rank-{}", folder, r)))
            error = std::make_error_code(std::errc::no_such_file_or_directory);
    return agree(&ranks, error ? Result<void>(failed()) : Result<void>());
}

Result<void> collectBuckets(Ranks& ranks, const std::string& folder, Buckets& buckets) {
    const std::string own = ownFolder(ranks, folder);
    for (size_t b = 0; b < buckets.size(); ++b) {
        if (!isOwn(&ranks, b)) continue;
        for (int r = 0; r < ranks.count(); ++r) {
            if (r == ranks.rank()) continue;
            const BucketBytes theirs(fmt::format("{}/rank-{}", folder, r), b);
            for (const auto& [from, to] : {std::pair{theirs.points.path(), &buckets[b]->points},
                                           std::pair{theirs.ghosts.path(), &buckets[b]->ghosts}}) {
                std::error_code error;
                if (!fs::exists(from, error)) continue;
                STIPPLE_ASSIGN(const std::vector<uint8_t> bytes, readAll(from));
                STIPPLE_TRY(to->append(bytes));
                fs::remove(from, error);
            }
        }
    }
    return {};
}

Result<void> saveBuilt(const std::string& folder, size_t bucket, const BuiltBucket& built) {
    ByteWriter to;
    to.put(uint64_t{built.atoms.size()});
    for (const BuiltAtom& atom : built.atoms) {
        putPending(atom.root, to);
        to.put(atom.batch.nodes);
        to.put(atom.batch.counts);
        to.put(atom.batch.bytes);
    }
    built.ranges.save(to);
    to.put(built.merged);
    to.put(built.tooMany);
    to.put(uint64_t{built.seconds.size()});
    for (const auto& [what, seconds] : built.seconds) {
        to.put(what);
        to.put(seconds);
    }
    return writeFileAt(builtPath(folder, bucket), 0, to.bytes().data(), to.bytes().size());
}

Result<BuiltBucket> loadBuilt(const std::string& folder, size_t bucket, const ValueRanges& empty) {
    const std::string path = builtPath(folder, bucket);
    STIPPLE_ASSIGN(const std::vector<uint8_t> bytes, readAll(path));
    ByteReader from(bytes);
    BuiltBucket out;
    uint64_t atoms = 0, stages = 0;
    from.get(atoms);
    for (uint64_t a = 0; a < atoms && a <= bytes.size(); ++a) {
        BuiltAtom& atom = out.atoms.emplace_back();
        getPending(from, atom.root);
        from.get(atom.batch.nodes);
        from.get(atom.batch.counts);
        from.get(atom.batch.bytes);
    }
    out.ranges = empty;
    out.ranges.load(from);
    from.get(out.merged);
    from.get(out.tooMany);
    from.get(stages);
    for (uint64_t s = 0; s < stages && s < 100; ++s) {
        std::string what;
        from.get(what);
        from.get(out.seconds[what]);
    }
    if (!from.isWhole()) return fail(ErrorKind::input, "is not what a rank wrote", path, "build again");
    std::error_code error;
    fs::remove(path, error);
    return out;
}

}  // namespace stipple::lod
