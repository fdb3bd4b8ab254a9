#include "lod/build/octree/reduction.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "engine/base/hash.h"
#include "engine/base/ordered.h"
#include "engine/base/queue.h"
#include "lod/build/octree/bytes.h"

namespace stipple::lod {

Result<Reduction> Reduction::open(const std::string& output, const BuildLimits& limits, uint64_t identity,
                                  bool isOnDisk) {
    Reduction r(output, limits);
    if (!isOnDisk) return r;
    STIPPLE_ASSIGN(Journal journal, Journal::open(Journal::folderOf(output, limits.tempFolder), output, identity));
    r.journal_.emplace(std::move(journal));
    r.isResumed_ = !r.journal_->entries().empty();
    if (!r.isResumed_) return r;
    ByteReader from(r.journal_->entries().front());
    from.get(r.facts_);
    return r;
}

std::unique_ptr<Spill> Reduction::spill(const std::string& name) const {
    return std::make_unique<Spill>(journal_ ? fmt::format("{}/{}", journal_->folder(), name) : "");
}

void Reduction::plan(std::vector<Atom> atoms) {
    atoms_ = std::move(atoms);
    for (size_t a = 0; a < atoms_.size(); ++a) {
        inputs_.push_back(spill(fmt::format("in-{}", a)));
        allInput_ += atoms_[a].count;
    }
}

Result<void> Reduction::seal(const std::vector<uint8_t>& facts, Executor& executor) {
    for (const auto& input : inputs_) temporary_ += input->bytes();
    mostTemporary_ = temporary_;
    if (!journal_) return {};
    CompletionQueue<Error> errors;
    executor.parallelFor(inputs_.size(), 1, [&](size_t begin, size_t end) {
        for (size_t a = begin; a < end; ++a)
            if (const auto sealed = inputs_[a]->seal(); !sealed) errors.push(sealed.error());
    });
    if (const auto found = errors.takeAll(); !found.empty()) return tl::unexpected(found.front());
    ByteWriter to;
    to.put(facts);
    to.put(atoms_);
    for (const auto& input : inputs_) {
        to.put(input->bytes());
        to.put(input->hash());
    }
    return journal_->append(to.bytes());
}

Result<void> Reduction::restore(Progress& progress) {
    ByteReader from(journal_->entries().front());
    std::vector<Atom> atoms;
    from.get(facts_);
    from.get(atoms);
    plan(std::move(atoms));
    for (const auto& input : inputs_) {
        uint64_t bytes = 0, hash = 0;
        from.get(bytes);
        from.get(hash);
        input->restore(bytes, hash);
        temporary_ += bytes;
    }
    mostTemporary_ = temporary_;
    if (!from.isWhole())
        return fail(ErrorKind::input, "holds a damaged journal", journal_->folder(), "delete the folder");
    progress.say(fmt::format("going on with the interrupted build: {} cells are done, {} have their input",
                             journal_->entries().size() - 1, atoms_.size()));
    return {};
}

namespace {

/// What the journal says of a cell.
struct Entry {
    uint64_t at = 0, bytes = 0, hash = 0;
    std::vector<uint8_t> table;
    std::vector<std::array<uint64_t, 3>> up;  ///< key, bytes, hash
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

}  // namespace

Result<void> Reduction::openWriter(Executor& executor) {
    if (!journal_) {
        STIPPLE_ASSIGN(StoreWriter writer, StoreWriter::create(output_));
        writer_.emplace(std::move(writer));
        return {};
    }
    const auto& entries = journal_->entries();
    std::vector<Entry> written(entries.empty() ? 0 : entries.size() - 1);
    uint64_t end = 0;
    for (size_t e = 0; e < written.size(); ++e) {
        if (!written[e].read(entries[e + 1]))
            return fail(ErrorKind::input, "holds a damaged journal", journal_->folder(), "delete the folder");
        end = written[e].at + written[e].bytes;
    }
    if (!written.empty()) {  // are the chunks still what was written?
        STIPPLE_ASSIGN(const InputFile file, InputFile::open(journal_->partialPath()));
        CompletionQueue<Error> errors;
        executor.parallelFor(written.size(), 1, [&](size_t begin, size_t last) {
            std::vector<uint8_t> bytes;
            for (size_t i = begin; i < last; ++i) {
                bytes.resize(written[i].bytes);
                const auto read = file.readAt(written[i].at, bytes.data(), bytes.size());
                if (read && hashBytes(bytes.data(), bytes.size()) == written[i].hash) continue;
                errors.push({ErrorKind::input, "is not what was written", journal_->partialPath(),
                             "delete it and the folder " + journal_->folder()});
                return;
            }
        });
        if (const auto found = errors.takeAll(); !found.empty()) return tl::unexpected(found.front());
    }
    STIPPLE_ASSIGN(StoreWriter writer, StoreWriter::resume(output_, journal_->partialPath(), end));
    writer_.emplace(std::move(writer));
    return {};
}

Reduction::LevelCells Reduction::takeLevel(int level) {
    LevelCells out;
    for (uint32_t a = 0; a < atoms_.size(); ++a)
        if (atoms_[a].level == level) {
            out.cells.push_back({level, atoms_[a].key, a, false});
            out.waiting.emplace_back();
        }
    for (auto& [key, waiting] : above_) {
        out.cells.push_back({level, key, WorkCell::kNone, false});
        out.waiting.push_back(std::move(waiting));
    }
    above_.clear();
    const bool isMore = std::any_of(atoms_.begin(), atoms_.end(), [&](const Atom& a) { return a.level < level; });
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
                        journal_ ? journal_->folder() : output_, "delete the folder and build again");
        at += piece.bytes;
        out.push_back({piece.label, std::move(bytes)});
    }
    return out;
}

Result<void> Reduction::hand(const WorkCell& cell, Waiting& waiting, CellProduct product, const Take& take) {
    Entry entry;
    STIPPLE_ASSIGN(entry.at, writer_->appendEncoded(product.chunks));
    entry.bytes = product.chunks.size();
    entry.hash = hashBytes(product.chunks.data(), product.chunks.size());
    const uint64_t label = take(entry.at, product.table);
    for (const GoingUp& up : product.up) {
        Waiting& to = above_[up.key];
        if (!to.spill) to.spill = spill(fmt::format("up-{}-{:x}", cell.level - 1, up.key));
        STIPPLE_TRY(to.spill->append(up.bytes));
        to.pieces.push_back({label, up.bytes.size(), hashBytes(up.bytes.data(), up.bytes.size())});
        entry.up.push_back({up.key, to.pieces.back().bytes, to.pieces.back().hash});
        temporary_ += up.bytes.size();
    }
    mostTemporary_ = std::max(mostTemporary_, temporary_);
    if (journal_) {
        entry.table = std::move(product.table);
        STIPPLE_TRY(journal_->append(entry.write()));
    }
    finishCell(cell, waiting);
    return {};
}

void Reduction::finishCell(const WorkCell& cell, Waiting& waiting) {
    Spill* const used = cell.atom != WorkCell::kNone ? inputs_[cell.atom].get() : waiting.spill.get();
    temporary_ -= used->bytes();
    used->remove();
    if (cell.atom == WorkCell::kNone) {
        waiting = {};
        return;
    }
    doneInput_ += atoms_[cell.atom].count;
    inputs_[cell.atom].reset();
}

/// What an earlier run finished of a level.
Result<void> Reduction::replay(LevelCells& level, const Take& take) {
    for (size_t i = 0; i < level.cells.size() && replayed_ + 1 < journal_->entries().size(); ++i, ++replayed_) {
        Entry entry;
        entry.read(journal_->entries()[replayed_ + 1]);
        const uint64_t label = take(entry.at, entry.table);
        for (const auto& [key, bytes, hash] : entry.up) {
            Waiting& to = above_[key];
            if (!to.spill) to.spill = spill(fmt::format("up-{}-{:x}", level.cells[i].level - 1, key));
            to.pieces.push_back({label, bytes, hash});
            to.spill->restore(to.spill->bytes() + bytes, 0);
            temporary_ += bytes;
        }
        finishCell(level.cells[i], level.waiting[i]);
    }
    return {};
}

Result<void> Reduction::checkStopped() const {
    if (!limits_.isStopped || !limits_.isStopped()) return {};
    return fail(ErrorKind::interrupted, "interrupted", output_,
                journal_ ? "run the same command again to go on" : "nothing was written");
}

Result<void> Reduction::runLevel(LevelCells& level, Executor& executor, int workers, const Make& make, const Take& take,
                                 Progress& progress) {
    const size_t before = replayed_;
    if (journal_) STIPPLE_TRY(replay(level, take));
    return inOrder<CellProduct>(
        executor, workers, replayed_ - before, level.cells.size(),
        [&](size_t i) -> Result<CellProduct> {
            STIPPLE_TRY(checkStopped());
            std::vector<uint8_t> input;
            std::vector<FromBelow> below;
            if (level.cells[i].atom != WorkCell::kNone) {
                STIPPLE_ASSIGN(input, inputs_[level.cells[i].atom]->take());
            } else {
                STIPPLE_ASSIGN(below, readBelow(level.waiting[i]));
            }
            return make(level.cells[i], input, below);
        },
        [&](size_t i, CellProduct product) -> Result<void> {
            STIPPLE_TRY(hand(level.cells[i], level.waiting[i], std::move(product), take));
            progress.update("build", doneInput_, allInput_);
            progress.setTemporaryBytes(journal_ ? temporary_ : 0);
            return {};
        });
}

Result<void> Reduction::run(Executor& executor, int workers, const Make& make, const Take& take, Progress& progress) {
    STIPPLE_TRY(openWriter(executor));
    int deepest = 0;
    for (const Atom& a : atoms_) deepest = std::max<int>(deepest, a.level);
    for (int at = deepest; at > -2; --at) {
        LevelCells level = takeLevel(at);
        STIPPLE_TRY(runLevel(level, executor, workers, make, take, progress));
        const bool isMore = std::any_of(atoms_.begin(), atoms_.end(), [&](const Atom& a) { return a.level < at; });
        if (above_.empty() && !isMore) break;
    }
    return {};
}

void Reduction::finish() {
    if (journal_) journal_->remove();
}

}  // namespace stipple::lod
