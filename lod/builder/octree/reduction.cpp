#include "lod/builder/octree/reduction.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>

#include "engine/base/file.h"
#include "engine/base/hash.h"
#include "engine/base/ordered.h"
#include "engine/base/queue.h"

namespace stipple::lod {
namespace {

/// What the journal says of a cell.
struct Entry {
    uint64_t at = 0, bytes = 0, hash = 0;
    std::vector<uint8_t> table;
    struct Up {
        Key key = 0;
        uint64_t bytes = 0, hash = 0;
    };
    std::vector<Up> up;
    bool read(const std::vector<uint8_t>& payload) {
        ByteReader from(payload);
        from.get(at);
        from.get(bytes);
        from.get(hash);
        from.get(table);
        from.get(up);
        return from.isWhole();
    }
    std::vector<uint8_t> write() const {
        ByteWriter to;
        to.put(at);
        to.put(bytes);
        to.put(hash);
        to.put(table);
        to.put(up);
        return to.bytes();
    }
};

// A product on its way from one rank to the first.
Result<void> saveProduct(const std::string& path, const CellProduct& product) {
    ByteWriter to;
    to.put(product.chunks);
    to.put(product.table);
    to.put(uint64_t{product.up.size()});
    for (const GoingUp& up : product.up) {
        to.put(up.key);
        to.put(up.bytes);
    }
    ::unlink(path.c_str());  // what a killed run may have left
    return writeFileAt(path, 0, to.bytes().data(), to.bytes().size());
}
Result<CellProduct> loadProduct(const std::string& path) {
    STIPPLE_ASSIGN(const std::vector<uint8_t> bytes, readWhole(path));
    ByteReader from(bytes);
    CellProduct product;
    uint64_t ups = 0;
    from.get(product.chunks);
    from.get(product.table);
    from.get(ups);
    for (uint64_t u = 0; u < ups && !from.isBroken(); ++u) {
        GoingUp& up = product.up.emplace_back();
        from.get(up.key);
        from.get(up.bytes);
    }
    if (!from.isWhole()) return fail(ErrorKind::input, "is not what a rank wrote", path, "run the same command again");
    ::unlink(path.c_str());
    return product;
}

}  // namespace

Result<void> Reduction::openWriter(Executor& executor) {
    if (!workspace_.isFirst()) return {};
    if (!workspace_.isOnDisk()) {
        STIPPLE_ASSIGN(StoreWriter writer, StoreWriter::create(workspace_.output()));
        writer_.emplace(std::move(writer));
        return {};
    }
    std::vector<Entry> written(done_.size());
    uint64_t end = 0;
    for (size_t e = 0; e < written.size(); ++e) {
        if (!written[e].read(done_[e].payload)) return tl::unexpected(workspace_.damaged());
        end = written[e].at + written[e].bytes;
    }
    if (!written.empty()) {  // are the chunks still what was written?
        STIPPLE_ASSIGN(const InputFile file, InputFile::open(workspace_.partialPath()));
        CompletionQueue<Error> errors;
        executor.parallelFor(written.size(), 1, [&](size_t begin, size_t last) {
            std::vector<uint8_t> bytes;
            for (size_t i = begin; i < last; ++i) {
                bytes.resize(written[i].bytes);
                const auto read = file.readAt(written[i].at, bytes.data(), bytes.size());
                if (read && hashBytes(bytes.data(), bytes.size()) == written[i].hash) continue;
                errors.push({ErrorKind::input, "is not what was written", workspace_.partialPath(),
                             "begin anew with --restart"});
                return;
            }
        });
        if (const auto found = errors.takeAll(); !found.empty()) return tl::unexpected(found.front());
    }
    STIPPLE_ASSIGN(StoreWriter writer, StoreWriter::resume(workspace_.output(), workspace_.partialPath(), end));
    writer_.emplace(std::move(writer));
    return {};
}

std::unique_ptr<Spill> Reduction::upSpill(int level, Key key) const {
    return workspace_.spill(
        fmt::format("up-{}-{:x}-{:x}", level, static_cast<uint64_t>(key >> 64), static_cast<uint64_t>(key)));
}

Reduction::LevelCells Reduction::takeLevel(int level) {
    LevelCells out;
    const std::vector<Subtree>& subtrees = inputs_.subtrees();
    for (uint32_t a = 0; a < subtrees.size(); ++a)
        if (subtrees[a].level == level) {
            out.cells.push_back({level, subtrees[a].key, a, false});
            out.waiting.emplace_back();
        }
    for (auto& [key, waiting] : above_) {
        out.cells.push_back({level, key, WorkCell::kNone, false});
        out.waiting.push_back(std::move(waiting));
    }
    above_.clear();
    const bool isMore =
        std::any_of(subtrees.begin(), subtrees.end(), [&](const Subtree& a) { return a.level < level; });
    if (out.cells.size() == 1) out.cells[0].isLast = !isMore;
    return out;
}

Result<std::vector<FromBelow>> Reduction::readBelow(const Waiting& waiting) const {
    std::vector<FromBelow> out;
    uint64_t at = 0;
    for (const Piece& piece : waiting.pieces) {
        STIPPLE_ASSIGN(std::vector<uint8_t> bytes, waiting.spill->part(at, piece.bytes));
        if (hashBytes(bytes.data(), bytes.size()) != piece.hash)
            return fail(ErrorKind::input, "holds a file that is not what was written",
                        workspace_.isOnDisk() ? workspace_.folder() : workspace_.output(), "begin anew with --restart");
        at += piece.bytes;
        out.push_back({piece.label, std::move(bytes)});
    }
    return out;
}

Result<CellProduct> Reduction::makeCell(const LevelCells& level, size_t i, const Make& make) const {
    STIPPLE_TRY(workspace_.checkStopped());
    std::vector<uint8_t> input;
    std::vector<FromBelow> below;
    if (level.cells[i].subtree != WorkCell::kNone) {
        STIPPLE_ASSIGN(input, inputs_.take(level.cells[i].subtree));
    } else {
        STIPPLE_ASSIGN(below, readBelow(level.waiting[i]));
    }
    STIPPLE_ASSIGN(CellProduct product, make(level.cells[i], input, below));
    if (product.isCutShort) STIPPLE_TRY(workspace_.checkStopped());
    return product;
}

Result<void> Reduction::hand(LevelCells& level, size_t i, CellProduct product, const Take& take, Progress& progress) {
    const WorkCell& cell = level.cells[i];
    Entry entry;
    STIPPLE_ASSIGN(entry.at, writer_->appendEncoded(product.chunks));
    entry.bytes = product.chunks.size();
    entry.hash = hashBytes(product.chunks.data(), product.chunks.size());
    const uint64_t label = take(entry.at, product.table);
    for (const GoingUp& up : product.up) {
        Waiting& to = above_[up.key];
        if (!to.spill) to.spill = upSpill(cell.level - 1, up.key);
        STIPPLE_TRY(to.spill->append(up.bytes));
        to.pieces.push_back({label, up.bytes.size(), hashBytes(up.bytes.data(), up.bytes.size())});
        entry.up.push_back({up.key, to.pieces.back().bytes, to.pieces.back().hash});
        temporary_ += up.bytes.size();
    }
    mostTemporary_ = std::max(mostTemporary_, temporary_);
    if (workspace_.isOnDisk()) {
        entry.table = std::move(product.table);
        STIPPLE_TRY(workspace_.note(Journal::What::done, entry.write()));
    }
    finishCell(cell, level.waiting[i]);
    progress.update("build", doneInput_, allInput_);
    progress.setTemporaryBytes(workspace_.isOnDisk() ? temporary_ : 0);
    return {};
}

void Reduction::finishCell(const WorkCell& cell, Waiting& waiting) {
    if (cell.subtree == WorkCell::kNone) {
        temporary_ -= waiting.spill->bytes();
        waiting.spill->remove();
        waiting = {};
        return;
    }
    doneInput_ += inputs_.subtrees()[cell.subtree].count;
    temporary_ -= inputs_.remove(cell.subtree);
}

/// What an earlier run finished of a level; returns how many of its cells.
size_t Reduction::replay(LevelCells& level, const Take& take) {
    size_t i = 0;
    for (; i < level.cells.size() && replayed_ < done_.size(); ++i, ++replayed_) {
        Entry entry;
        entry.read(done_[replayed_].payload);
        const uint64_t label = take(entry.at, entry.table);
        for (const auto& [key, bytes, hash] : entry.up) {
            Waiting& to = above_[key];
            if (!to.spill) to.spill = upSpill(level.cells[i].level - 1, key);
            to.pieces.push_back({label, bytes, hash});
            to.spill->restore({{to.spill->bytes() + bytes, 0}});
            temporary_ += bytes;
        }
        finishCell(level.cells[i], level.waiting[i]);
    }
    return i;
}

Result<void> Reduction::runLevel(LevelCells& level, Executor& executor, int workers, const Make& make, const Take& take,
                                 Progress& progress) {
    const size_t first = replay(level, take);
    if (workspace_.ranks() != nullptr) return runTogether(level, first, executor, workers, make, take, progress);
    return inOrder<CellProduct>(
        executor, workers, first, level.cells.size(), [&](size_t i) { return makeCell(level, i, make); },
        [&](size_t i, CellProduct product) { return hand(level, i, std::move(product), take, progress); });
}

std::string Reduction::productPath(const LevelCells& level, size_t i) const {
    return fmt::format("{}/made-{}-{}", workspace_.folder(), level.cells[i].level, i);
}

/// The ranks make cells in turn; while the first one hands those of a window on, the others are at the next. (Windows
/// bound what lies in the folder between making and handing on.)
Result<void> Reduction::runTogether(LevelCells& level, size_t first, Executor& executor, int workers, const Make& make,
                                    const Take& take, Progress& progress) {
    Ranks& ranks = *workspace_.ranks();
    const auto kWindow = size_t{32} * static_cast<size_t>(ranks.count());
    ByteWriter done;
    done.put(uint64_t{first});
    const std::vector<uint8_t> told = workspace_.ofFirst(done.bytes());
    uint64_t begin = 0;
    ByteReader(told).get(begin);
    Result<void> handed;
    for (; begin < level.cells.size(); begin += kWindow) {
        const size_t end = std::min<size_t>(begin + kWindow, level.cells.size());
        std::vector<size_t> own;
        for (size_t i = begin; i < end; ++i)
            if (workspace_.isOwn(i)) own.push_back(i);
        const Result<void> made = inOrder<CellProduct>(
            executor, workers, 0, own.size(), [&](size_t k) { return makeCell(level, own[k], make); },
            [&](size_t k, const CellProduct& product) { return saveProduct(productPath(level, own[k]), product); });
        STIPPLE_TRY(agree(&ranks, handed ? made : handed));
        if (!workspace_.isFirst()) continue;
        const auto handAll = [&]() -> Result<void> {
            for (size_t i = begin; i < end; ++i) {
                STIPPLE_ASSIGN(CellProduct product, loadProduct(productPath(level, i)));
                STIPPLE_TRY(hand(level, i, std::move(product), take, progress));
            }
            return {};
        };
        handed = handAll();
    }
    STIPPLE_TRY(agree(&ranks, handed));
    tellAbove(level.cells.empty() ? 0 : level.cells.front().level);
    return {};
}

/// The first rank knows what waits for the next level; then all do.
void Reduction::tellAbove(int level) {
    ByteWriter mine;
    for (const auto& [key, waiting] : above_) {
        mine.put(key);
        mine.put(waiting.pieces);
    }
    const std::vector<uint8_t> bytes = workspace_.ofFirst(mine.bytes());
    for (ByteReader from(bytes); !workspace_.isFirst() && !from.isWhole();) {
        Key key = 0;
        from.get(key);
        Waiting& to = above_[key];
        from.get(to.pieces);
        if (from.isBroken()) return;
        to.spill = upSpill(level - 1, key);
        uint64_t sum = 0;
        for (const Piece& piece : to.pieces) sum += piece.bytes;
        to.spill->restore({{sum, 0}});
    }
}

Result<void> Reduction::run(Executor& executor, int workers, const Make& make, const Take& take, Progress& progress) {
    STIPPLE_TRY(agree(workspace_.ranks(), openWriter(executor)));
    temporary_ = mostTemporary_ = inputs_.bytes();
    const std::vector<Subtree>& subtrees = inputs_.subtrees();
    int deepest = 0;
    for (const Subtree& a : subtrees) {
        deepest = std::max<int>(deepest, a.level);
        allInput_ += a.count;
    }
    for (int at = deepest; at > -2; --at) {
        LevelCells level = takeLevel(at);
        STIPPLE_TRY(runLevel(level, executor, workers, make, take, progress));
        const bool isMore =
            std::any_of(subtrees.begin(), subtrees.end(), [&](const Subtree& a) { return a.level < at; });
        if (above_.empty() && !isMore) break;
    }
    return {};
}

}  // namespace stipple::lod
