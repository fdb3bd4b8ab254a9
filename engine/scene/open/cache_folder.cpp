#include "engine/scene/open/cache_folder.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <thread>

#include "engine/base/file.h"
#include "engine/base/text.h"
#include "engine/base/units.h"

namespace stipple::scene {
namespace fs = std::filesystem;
using Clock = std::chrono::system_clock;

namespace {

constexpr size_t kKeyDigits = 16;
constexpr uint64_t kMostRecordBytes = uint64_t{16} << 20;

/// Places of a store's two locks.
uint64_t usePlace(const std::string& key) { return std::strtoull(key.c_str(), nullptr, 16) >> 2 & ~uint64_t{1}; }
uint64_t buildPlace(const std::string& key) { return usePlace(key) + 1; }

/// The key of a file that is the cache's own; empty for all others, which nobody touches.
std::string keyOf(const std::string& name) {
    const std::string key = name.substr(0, name.find('.')), rest = name.substr(key.size());
    const bool isKey = key.size() == kKeyDigits && key.find_first_not_of("0123456789abcdef") == std::string::npos;
    const bool isOurs = rest == ".stipple" || rest == ".stipple.build" || rest.rfind(".stipple.partial", 0) == 0 ||
                        rest == ".json" || rest.rfind(".json.partial", 0) == 0;
    return isKey && isOurs ? key : "";
}

uint64_t bytesBelow(const fs::path& path) {
    std::error_code error;
    if (!fs::is_directory(path, error)) {
        const uint64_t bytes = fs::file_size(path, error);
        return error ? 0 : bytes;
    }
    uint64_t bytes = 0;
    for (auto it = fs::recursive_directory_iterator(path, error); !error && it != fs::recursive_directory_iterator();
         it.increment(error))
        if (std::error_code other; it->is_regular_file(other)) bytes += it->file_size(other);
    return bytes;
}

Clock::time_point timeOf(const fs::path& path) {
    struct stat info {};
    if (::stat(path.c_str(), &info) != 0) return {};
    return Clock::from_time_t(info.st_mtim.tv_sec) +
           std::chrono::duration_cast<Clock::duration>(std::chrono::nanoseconds(info.st_mtim.tv_nsec));
}

/// Does a build write there? (It has a lock on its part of a store, and on the journal in its folder.)
bool isBeingWritten(const fs::path& path) {
    std::error_code error;
    const fs::path file = fs::is_directory(path, error) ? path / "journal" : path;
    const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    if (descriptor < 0) return false;
    const bool isLocked = ::flock(descriptor, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;
    ::close(descriptor);
    return isLocked;
}

std::vector<std::string> utf8(std::vector<std::string> texts) {
    for (std::string& text : texts) text = toUtf8(text);
    return texts;
}

tl::unexpected<Error> interrupted(const std::string& path) {
    return fail(ErrorKind::interrupted, "interrupted", path, "nothing was built");
}

double secondsOf(Clock::time_point t) { return std::chrono::duration<double>(t.time_since_epoch()).count(); }

}  // namespace

std::string CacheFolder::path() {
    const char* const cache = std::getenv("XDG_CACHE_HOME");
    const char* const home = std::getenv("HOME");
    return ((cache != nullptr && *cache != 0 ? fs::path(cache) : fs::path(home != nullptr ? home : ".") / ".cache") /
            "stipple")
        .string();
}

std::string CacheFolder::pipelinesPath() {
    const std::string folder = path();
    return fs::path(folder).is_absolute() ? folder + "/pipelines" : std::string();
}

Result<CacheFolder> CacheFolder::open() {
    const std::string folder = path();
    std::error_code error;
    fs::create_directories(folder, error);
    if (error)
        return fail(ErrorKind::output, "cannot be created: " + error.message(), folder,
                    "set XDG_CACHE_HOME to a folder that can be written");
    Result<LockFile> locks = LockFile::open(folder + "/locks");
    if (!locks) {
        locks.error().hint = "set XDG_CACHE_HOME to a folder that can be written";
        return tl::unexpected(locks.error());
    }
    return CacheFolder(folder, std::move(*locks));
}

Result<void> CacheFolder::use(const std::string& key, const std::function<bool()>& isStopped) const {
    // Only who removes it holds it alone, for a moment (unless it was stopped just then).
    while (!locks_.tryShare(usePlace(key))) {
        if (isStopped()) return interrupted(storePath(key));
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    return {};
}

Result<void> CacheFolder::lockBuild(const std::string& key, const std::function<void()>& waits,
                                    const std::function<bool()>& isStopped) const {
    for (bool isFirst = true; !locks_.tryTake(buildPlace(key)); isFirst = false) {
        if (isFirst) waits();
        if (isStopped()) return interrupted(storePath(key));
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    return {};
}
void CacheFolder::unlockBuild(const std::string& key) const { locks_.release(buildPlace(key)); }

void CacheFolder::writeRecord(const std::string& key, const CacheRecord& record) const {
    const nlohmann::json j = {{"inputs", utf8(record.inputs)},
                              {"part", record.part},
                              {"notes", utf8(record.notes)},
                              {"made", secondsOf(record.made)}};
    const std::string text = j.dump(1, ' ', false, nlohmann::json::error_handler_t::replace);
    // Without it the store is as good.
    (void)writeWholeFile(path_ + "/" + key + ".json", text.data(), text.size());
}

std::optional<CacheRecord> CacheFolder::readRecord(const std::string& key) const {
    const auto text = readTextFile(path_ + "/" + key + ".json", kMostRecordBytes);
    if (!text) return {};
    try {
        const auto j = nlohmann::json::parse(*text);
        CacheRecord record;
        record.inputs = j.at("inputs").get<std::vector<std::string>>();
        record.part = j.at("part").get<std::string>();
        record.notes = j.at("notes").get<std::vector<std::string>>();
        const std::chrono::duration<double> made(j.at("made").get<double>());
        record.made = Clock::time_point(std::chrono::duration_cast<Clock::duration>(made));
        return record;
    } catch (const std::exception&) {
        return {};
    }
}

void CacheFolder::touch(const std::string& key) const {
    for (const char* suffix : {".json", ".stipple"})
        if (::utimensat(AT_FDCWD, (path_ + "/" + key + suffix).c_str(), nullptr, 0) == 0) return;
}

void CacheFolder::removeRecord(const std::string& key) const {
    std::error_code error;
    fs::remove(path_ + "/" + key + ".json", error);
}

void CacheFolder::removeStore(const std::string& key) const {
    std::error_code error;
    fs::remove(storePath(key), error);
}

std::vector<std::string> CacheFolder::filesOf(const std::string& key) const {
    std::vector<std::string> files;
    std::error_code error;
    for (auto it = fs::directory_iterator(path_, error); !error && it != fs::directory_iterator(); it.increment(error))
        if (keyOf(it->path().filename().string()) == key) files.push_back(it->path().string());
    return files;
}

bool CacheFolder::removeLeftovers(const std::string& key) const {
    const std::string store = storePath(key);
    bool isGone = true;
    for (const std::string& path : filesOf(key)) {
        const bool isLeft = path == store + ".build" || path.rfind(store + ".partial", 0) == 0;
        if (!isLeft) continue;
        std::error_code error;
        if (!isBeingWritten(path)) fs::remove_all(path, error);
        isGone = isGone && !fs::exists(fs::symlink_status(path, error));
    }
    return isGone;
}

std::vector<CacheEntry> CacheFolder::sizes() const {
    std::map<std::string, CacheEntry> found;
    std::error_code error;
    for (auto it = fs::directory_iterator(path_, error); !error && it != fs::directory_iterator();
         it.increment(error)) {
        const std::string name = it->path().filename().string(), key = keyOf(name);
        if (key.empty()) continue;
        CacheEntry& entry = found[key];
        entry.bytes += bytesBelow(it->path());
        entry.used = std::max(entry.used, timeOf(it->path()));
        entry.isWhole = entry.isWhole || name == key + ".stipple";
    }
    std::vector<CacheEntry> entries;
    for (auto& [key, entry] : found) {
        entry.key = key;
        entry.path = storePath(key);
        entries.push_back(std::move(entry));
    }
    std::stable_sort(entries.begin(), entries.end(), [](const auto& a, const auto& b) { return a.used > b.used; });
    return entries;
}

std::vector<CacheEntry> CacheFolder::entries() const {
    std::vector<CacheEntry> entries = sizes();
    const auto strangers = LockFile::open(path_ + "/locks");  // what this program holds is in use as well
    for (CacheEntry& entry : entries)
        entry.isInUse =
            strangers && (strangers->isHeld(usePlace(entry.key)) || strangers->isHeld(buildPlace(entry.key)));
    return entries;
}

bool CacheFolder::remove(const CacheEntry& entry) const {
    const auto locks = LockFile::open(path_ + "/locks");
    if (!locks || !locks->tryTake(buildPlace(entry.key)) || !locks->tryTake(usePlace(entry.key))) return false;
    std::error_code error;
    fs::remove(entry.path, error);
    bool isGone = !error;
    for (const std::string& path : filesOf(entry.key)) {
        fs::remove_all(path, error);
        isGone = isGone && !error;
    }
    return isGone;
}

std::vector<CacheEntry> CacheFolder::shrinkTo(uint64_t bytes) const {
    std::vector<CacheEntry> all = sizes(), removed;
    uint64_t sum = 0;
    for (const CacheEntry& entry : all) sum += entry.bytes;
    for (auto entry = all.rbegin(); entry != all.rend() && sum > bytes; ++entry) {
        if (!remove(*entry)) continue;
        sum -= entry->bytes;
        removed.push_back(std::move(*entry));
    }
    return removed;
}

Result<uint64_t> cacheLimit(const std::string& option) {
    const char* const variable = std::getenv("STIPPLE_CACHE_LIMIT");
    const bool isSet = variable != nullptr && *variable != 0;
    if (!option.empty() || isSet) {
        const std::string text = isSet && option.empty() ? variable : option;
        if (const uint64_t bytes = parseBytes(text); bytes > 0 || text == "0") return bytes;
        return fail(ErrorKind::usage, fmt::format("'{}' is not a size", text),
                    option.empty() ? "STIPPLE_CACHE_LIMIT" : "--cache-limit", "e.g. 20G");
    }
    constexpr uint64_t kMost = uint64_t{20} << 30, kShareOfDisk = 5;
    fs::path existing = CacheFolder::path();
    std::error_code error;
    while (!fs::exists(existing, error) && existing.has_relative_path()) existing = existing.parent_path();
    const fs::space_info disk = fs::space(existing, error);
    return error ? kMost : std::min<uint64_t>(kMost, disk.capacity / kShareOfDisk);
}

}  // namespace stipple::scene
