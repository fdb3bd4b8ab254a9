#include "engine/scene/open/cache.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>

#include "engine/base/one_at_a_time.h"
#include "engine/base/process.h"
#include "engine/base/text.h"
#include "engine/base/units.h"
#include "engine/scene/open/builds_of_scene.h"
#include "engine/scene/open/cache_folder.h"
#include "engine/scene/scene_files.h"
#include "lod/builder/octree/journal.h"
#include "lod/builder/source_identity.h"
#include "lod/import/import.h"

namespace stipple::scene {
namespace fs = std::filesystem;
using StorePtr = std::shared_ptr<const lod::Store>;

namespace {

/// Of everything that decides what a build gives. A new option does not compile until it is named here: does it change
/// the bytes?
std::string settingsText(const OpenSettings& build) {
    const auto& [memory, normals, radii, up, attributes, temp, duplicates, grid, cacheLimit, threads, skipBad,
                 onlyPoints, allowOutside, dropOutliers, surfelWeights, curveRadius, surfels, ranks, material, together,
                 leftovers, isStopped, told, lost, progressStyle, onProgress, kept] = build;
    // Not memory, temp, threads, ranks, together, leftovers, kept, and who is told: any give the same. Not attributes:
    // what is cached has all of them.
    const std::string of = material ? fmt::format("|{}", lod::identityOf(*material)) : std::string();
    return fmt::format("{}|{}|{}|{}|{}|{}|{}|{}|{}|{}{}{}", normals, radii, up, duplicates, skipBad, onlyPoints,
                       allowOutside, dropOutliers, curveRadius, surfels, of, surfelWeights ? "|weights" : "") +
           (grid.empty() ? "" : "|grid " + grid);
}

/// Of a scene file and of all that it is made of. Which files these are is kept until one of them changes, so that
/// thousands of parts need not look again.
std::string identityOfScene(const std::string& path) {
    struct Known {
        std::vector<std::string> files;
        std::string identity;
    };
    static std::map<std::string, Known> known;
    static OneAtATime alone;  // any thread may open scenes
    return alone([&]() -> std::string {
        Known& own = known[path];
        const auto identity = [&] {
            std::string text = lod::sourceIdentity(path);
            for (const std::string& other : own.files) text += lod::sourceIdentity(other);
            return text;
        };
        if (identity() != own.identity) {
            own.files = scene::filesOf(path);
            own.identity = identity();
        }
        return own.identity;
    });
}

Result<std::string> keyOf(const std::vector<std::string>& inputs, const OpenSettings& build, const std::string& part,
                          std::vector<std::string>& notes) {
    STIPPLE_ASSIGN(const std::vector<std::string> files, lod::expandInputs(inputs, &notes));
    std::string sources;
    for (const std::string& file : files)
        sources += isSceneFile(file) ? identityOfScene(file) : lod::sourceIdentity(file);
    return lod::cacheKey(sources, fmt::format("{}|{}|{}", part, settingsText(build), STIPPLE_VERSION));
}

Result<const CacheFolder*> folder() {
    static Result<CacheFolder> opened = CacheFolder::open();  // its locks are held until the process ends
    if (!opened) return tl::unexpected(opened.error());
    return &*opened;
}

/// One lookup in the cache.
class Lookup {
  public:
    /// `notes`: on the inputs, before any build.
    Lookup(const CacheFolder& cache, std::string key, std::vector<std::string> notes,
           const std::vector<std::string>& inputs, std::string part, const OpenSettings& build)
        : cache_(cache),
          key_(std::move(key)),
          notes_(std::move(notes)),
          inputs_(inputs),
          part_(std::move(part)),
          build_(build),
          path_(cache.storePath(key_)) {}

    Result<StorePtr> open(const StoreMaker& make) {
        STIPPLE_ASSIGN(const uint64_t limit, cacheLimit(build_.cacheLimit));
        sayNotes(notes_);
        STIPPLE_TRY(cache_.use(key_, build_.isStopped));
        if (Result<StorePtr> found = openWhole(); found) return found;
        STIPPLE_TRY(cache_.lockBuild(
            key_, [&] { tell("is being built already: waiting for it"); }, build_.isStopped));
        Result<StorePtr> store = openOrBuild(make, limit);
        cache_.unlockBuild(key_);
        return store;
    }

  private:
    void tell(const std::string& what) const {
        say(build_, fmt::format("{} ({}): {}", printable(inputs_.front()), part_, printable(what)));
    }
    void sayNotes(const std::vector<std::string>& notes) const {
        for (const std::string& note : notes) say(build_, "note: " + printable(note));
    }

    /// What is there, if it is whole.
    Result<StorePtr> openWhole() const {
        Result<StorePtr> store = openStoreFile(path_);
        if (!store) return store;
        cache_.touch(key_);
        if (const auto record = cache_.readRecord(key_)) sayNotes(record->notes);
        return store;
    }

    Result<StorePtr> openOrBuild(const StoreMaker& make, uint64_t limit) const {
        if (std::error_code error; fs::exists(path_, error)) {
            Result<StorePtr> store = openWhole();  // somebody was faster
            if (store) return store;
            say(build_,
                "note: the scene in the cache cannot be used and is built again: " + printable(store.error().line()));
            cache_.removeStore(key_);
        }
        CacheRecord record{absolute(), part_, {}, std::chrono::system_clock::now()};
        cache_.writeRecord(key_, record);
        const Result<lod::BuildReport> result = made(make);
        std::error_code error;
        if (!result && !fs::exists(workFolder(), error) && !fs::exists(partialPath(), error))
            cache_.removeRecord(key_);  // it was refused: there is nothing to go on with
        STIPPLE_ASSIGN(const lod::BuildReport built, result);
        for (const std::string& note : built.notes)
            if (std::find(notes_.begin(), notes_.end(), note) == notes_.end() &&
                !(build_.together && build_.together->says(note)))
                record.notes.push_back(note);
        for (const auto& [reason, count] : built.dropped)
            record.notes.push_back(fmt::format("dropped {}: {}", count, reason));
        cache_.writeRecord(key_, record);
        tell(fmt::format("built into the cache in {:.1f} s ({})", built.seconds, path_));
        sayNotes(record.notes);
        STIPPLE_ASSIGN(StorePtr store, openStoreFile(path_));
        uint64_t bytes = 0;
        const std::vector<CacheEntry> removed = cache_.shrinkTo(limit);
        for (const CacheEntry& entry : removed) bytes += entry.bytes;
        if (!removed.empty())
            say(build_, fmt::format("note: {} scenes used least recently, {}, went from the cache, whose limit is {} "
                                    "(--cache-limit, STIPPLE_CACHE_LIMIT; see stipple cache list)",
                                    removed.size(), humanBytes(bytes), humanBytes(limit)));
        return store;
    }

    Result<lod::BuildReport> made(const StoreMaker& make) const {
        std::error_code error;
        const bool hasLeftovers = fs::exists(workFolder(), error) || fs::exists(partialPath(), error);
        Result<lod::BuildReport> built = madeOnce(make);
        if (hasLeftovers && !built && isOfLeftovers(built.error()) && removeLeftovers()) {
            Error why = built.error();
            why.hint.clear();
            sayNotes({"what an interrupted build left cannot be used, it is built from the start: " + why.line()});
            built = madeOnce(make);
        }
        if (built) return built;
        Error& why = built.error();
        if (why.kind == ErrorKind::output)
            why.hint =
                "it is in the cache of built scenes: make room with 'stipple cache clean', or set "
                "XDG_CACHE_HOME to another folder";
        else if (why.hint.find("--restart") != std::string::npos)  // which only builds to a file have
            why.hint = fmt::format("run the same command again, or remove {}", workFolder());
        return built;
    }

    Result<lod::BuildReport> madeOnce(const StoreMaker& make) const {
        if (build_.together) {
            Result<lod::BuildReport> built = make(path_, build_.together->begin(part_));
            build_.together->settle(part_);
            return built;
        }
        Progress progress(build_.progressStyle, build_.onProgress);
        return make(path_, progress);
    }

    std::string workFolder() const { return lod::Journal::folderOf(path_, build_.temp); }
    std::string partialPath() const { return path_ + ".partial"; }

    /// Is it what an earlier build left that is wrong, and not what is built?
    bool isOfLeftovers(const Error& why) const {
        const std::string folder = workFolder();
        const auto isBelow = [&](const std::string& path) { return why.where.rfind(path, 0) == 0; };
        if (why.kind == ErrorKind::input) return why.where.empty() || isBelow(folder) || isBelow(path_);
        return why.kind == ErrorKind::output && (why.where == folder || why.where == partialPath());
    }

    /// A folder that was named with --temp may hold what others put there: there only what a build left.
    bool removeLeftovers() const {
        if (!cache_.removeLeftovers(key_)) return false;
        std::error_code error;
        return !fs::exists(workFolder(), error) ||
               lod::Journal::open(workFolder(), path_, 0, lod::Leftovers::replace).has_value();
    }

    std::vector<std::string> absolute() const {
        std::vector<std::string> paths;
        std::error_code error;
        for (const std::string& input : inputs_)
            paths.push_back(fs::absolute(input, error).lexically_normal().string());
        return paths;
    }

    const CacheFolder& cache_;
    const std::string key_;
    const std::vector<std::string> notes_;
    const std::vector<std::string>& inputs_;
    const std::string part_;
    const OpenSettings& build_;
    const std::string path_;
};

}  // namespace

Result<StorePtr> openStoreFile(const std::string& path, lod::Tables tables) {
    STIPPLE_ASSIGN(lod::Store store, lod::openStore(path, tables));
    return std::make_shared<const lod::Store>(std::move(store));
}

Result<StorePtr> openCached(const std::vector<std::string>& inputs, const OpenSettings& build, const std::string& part,
                            const StoreMaker& make) {
    std::vector<std::string> notes;
    STIPPLE_ASSIGN(const std::string key, keyOf(inputs, build, part, notes));
    STIPPLE_ASSIGN(const CacheFolder* const cache, folder());
    Result<StorePtr> store = Lookup(*cache, key, std::move(notes), inputs, part, build).open(make);
    if (build.together) build.together->settle(part);
    return store;
}

}  // namespace stipple::scene
