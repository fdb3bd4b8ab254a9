#include "lod/builder/points/exchange.h"

#include <fmt/format.h>

#include <cstring>
#include <filesystem>

#include "engine/base/file.h"
#include "engine/base/hash.h"

namespace stipple::lod {
namespace {

namespace fs = std::filesystem;

std::string builtPath(const std::string& folder, size_t bucket) { return fmt::format("{}/built-{}", folder, bucket); }

}  // namespace

bool isBuilt(const std::string& folder, size_t bucket) { return fs::exists(builtPath(folder, bucket)); }

Result<void> saveBuilt(const std::string& folder, size_t bucket, const BuiltBucket& built) {
    ByteWriter to;
    to.put(uint64_t{built.subtrees.size()});
    for (const BuiltSubtree& subtree : built.subtrees) {
        putPending(subtree.root, to);
        to.put(subtree.batch.nodes);
        to.put(subtree.batch.counts);
        to.put(subtree.batch.bytes);
    }
    built.ranges.save(to);
    to.put(built.merged);
    to.put(built.tooMany);
    to.put(uint64_t{built.seconds.size()});
    for (const auto& [what, seconds] : built.seconds) {
        to.put(what);
        to.put(seconds);
    }
    // (It appears whole or not at all.)
    const std::string path = builtPath(folder, bucket), unfinished = path + ".unfinished";
    std::error_code error;
    fs::remove(unfinished, error);
    const uint64_t hash = hashBytes(to.bytes().data(), to.bytes().size());
    STIPPLE_TRY(writeFileAt(unfinished, 0, &hash, sizeof(hash)));
    STIPPLE_TRY(writeFileAt(unfinished, sizeof(hash), to.bytes().data(), to.bytes().size()));
    fs::rename(unfinished, path, error);
    if (error) return fail(ErrorKind::output, fmt::format("cannot be written: {}", error.message()), path);
    return {};
}

Result<BuiltBucket> loadBuilt(const std::string& folder, size_t bucket, const ValueRanges& empty) {
    const std::string path = builtPath(folder, bucket);
    STIPPLE_ASSIGN(const std::vector<uint8_t> bytes, readWhole(path));
    const auto isIntact = [&] {
        uint64_t hash = 0;
        if (bytes.size() < sizeof(hash)) return false;
        std::memcpy(&hash, bytes.data(), sizeof(hash));
        return hash == hashBytes(bytes.data() + sizeof(hash), bytes.size() - sizeof(hash));
    };
    if (!isIntact()) return fail(ErrorKind::input, "is not what a rank wrote", path, "begin anew with --restart");
    ByteReader from(bytes);
    uint64_t hash = 0;
    from.get(hash);
    BuiltBucket out;
    uint64_t subtrees = 0, stages = 0;
    from.get(subtrees);
    for (uint64_t a = 0; a < subtrees && a <= bytes.size(); ++a) {
        BuiltSubtree& subtree = out.subtrees.emplace_back();
        getPending(from, subtree.root);
        from.get(subtree.batch.nodes);
        from.get(subtree.batch.counts);
        from.get(subtree.batch.bytes);
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
    return out;
}

}  // namespace stipple::lod
