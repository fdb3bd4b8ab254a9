// The pages of a node table, version 10: each is read when somebody needs it. A store that is opened for drawing has
// its first page and those that its views looked at; what is not there is drawn by its parent.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <set>
#include <vector>

#include "engine/base/byte_source.h"
#include "engine/base/one_at_a_time.h"
#include "lod/store/tables.h"

namespace stipple::lod {

class NodePages {
  public:
    /// Reads the directory and checks what memory it asks for.
    static Result<std::shared_ptr<NodePages>> open(std::shared_ptr<const ByteSource> file, const layout::Head& head,
                                                   bool isGraph);
    size_t count() const { return pages_.size(); }
    /// As the directory says (layout::kTable...).
    uint32_t flags() const { return table_.flags; }
    /// Of the file, compressed.
    uint64_t bytesOf(uint32_t page) const { return pages_[page].section.bytes; }
    /// All streams of payloads end before it.
    uint64_t chunksEnd() const { return pages_.front().section.offset; }

    /// Reads all pages into `h`; nothing but their lengths is checked.
    Result<void> readAll(Hierarchy& h) const;
    /// Makes room for all pages in `h`, which may be moved but not copied from then on as long as pages come. Leaves of
    /// patches that state no code of their own (kTableOneSourceCode) get `sourceCode`.
    void prepare(Hierarchy& h, uint8_t sourceCode);
    /// Reads a page into the hierarchy that was prepared, after those with the parents of its nodes, and checks it;
    /// others may look at the hierarchy meanwhile, or load, too. Nothing where it is there. What was read for it:
    struct Loaded {
        uint64_t pages = 0, bytes = 0;
    };
    Result<Loaded> load(const Hierarchy& h, uint32_t page);

  private:
    NodePages() = default;
    Result<void> checkDirectory(const layout::Head& head) const;
    std::set<uint32_t> missingFor(const Hierarchy& h, uint32_t page) const;
    /// A page whose nodes' parents are there.
    Result<void> loadAlone(const Hierarchy& h, uint32_t page);
    Result<TablePart> read(uint32_t page) const;
    /// Into its place.
    void place(const TablePart& part, const layout::Places& first);
    layout::Places placesOf(size_t page) const { return page < pages_.size() ? pages_[page].first : table_.total; }
    /// The one that holds the parent of that node, which is not the root.
    uint32_t pageOfParent(uint64_t node) const;

    std::shared_ptr<const ByteSource> file_;
    uint32_t version_ = 0;  ///< of the file
    bool isGraph_ = false;
    layout::TableHead table_{};
    Names names_;
    std::vector<layout::PageOnDisk> pages_;
    /// Where the arrays of the hierarchy stand: moving it leaves them where they are.
    struct Room {
        Node* nodes = nullptr;
        FurtherPayload* further = nullptr;
        Stream* streams = nullptr;
        uint32_t *greaterThan = nullptr, *parents = nullptr, *groupTextures = nullptr;
        MeshGroup* groups = nullptr;
        MeshRun* runs = nullptr;
        std::atomic<bool>* isThere = nullptr;
    } room_;
    uint8_t sourceCode_ = 0;
    OneAtATime placing_;
};

/// A table on its way into a file, page by page: write(bytes) is told each section, uncompressed, and gives its place.
using WriteSection = std::function<Result<layout::Section>(const std::vector<uint8_t>& bytes)>;
/// Writes all pages, and says where the directory is.
Result<layout::Section> writePages(const Hierarchy& h, uint32_t log2Nodes, const WriteSection& write);

}  // namespace stipple::lod
