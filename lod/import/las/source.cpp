// LAS and LAZ files as point sources: records to blocks, chunk by chunk.
#include <fmt/format.h>

#include <memory>

#include "engine/base/byte_source.h"
#include "lod/import/import.h"
#include "lod/import/las/header.h"

namespace stipple::lod {
namespace {

constexpr size_t kBlockBytes = size_t{4} << 20;         ///< of records held at once by one reader
constexpr uint64_t kLasPartPoints = uint64_t{1} << 20;  ///< uncompressed files: what one reader takes

las::Bytes bytesOf(const ByteSource& file) {
    return {file.sizeBytes(),
            [&file](uint64_t offset, void* to, size_t count) { return file.readAt(offset, to, count); }};
}

/// What the readers of one file share.
struct LasFile {
    las::LasHeader header;
    std::vector<las::LazChunk> chunks;  ///< of LAZ files with a chunk table; of LAS files, made up
    std::vector<las::Field> wanted;     ///< offset 0 and no part: the file does not have it
    std::vector<bool> has;
    uint32_t parts = las::kLazPosition;
};

/// Copies what is wanted out of records.
void extract(const LasFile& file, const uint8_t* records, size_t count, PointBlock& block) {
    const size_t stride = file.header.recordBytes;
    const size_t first = block.lattice.size();
    block.lattice.resize(first + count);
    for (size_t i = 0; i < count; ++i) std::memcpy(&block.lattice[first + i], records + i * stride, 12);
    if (file.header.colourOffset != 0) {
        block.colour16.resize(first + count);
        const uint8_t* from = records + file.header.colourOffset;
        uint64_t any = 0;
        for (size_t i = 0; i < count; ++i) {
            uint32_t redGreen = 0;
            uint16_t blue = 0;
            std::memcpy(&redGreen, from + i * stride, 4);
            std::memcpy(&blue, from + i * stride + 4, 2);
            const uint64_t c = redGreen | uint64_t{blue} << 32;
            any |= c;
            block.colour16[first + i] = c;
        }
        // Only whether it is above 255 matters.
        block.colourMax = std::max(block.colourMax, static_cast<uint32_t>((any | any >> 16 | any >> 32) & 0xffffu));
    }
    block.attributes.resize(file.wanted.size());
    for (size_t k = 0; k < file.wanted.size(); ++k) {
        if (!file.has[k]) continue;
        const las::Field& f = file.wanted[k];
        const size_t width = lod::bytesOf(f.info.type);
        block.attributes[k].resize((first + count) * width);
        uint8_t* to = block.attributes[k].data() + first * width;
        const uint8_t* from = records + f.offset;
        if (f.mask != 0)
            for (size_t i = 0; i < count; ++i) to[i] = static_cast<uint8_t>((from[i * stride] & f.mask) >> f.shift);
        else
            for (size_t i = 0; i < count; ++i) std::memcpy(to + i * width, from + i * stride, width);
    }
}

/// Reads one part: a run of records, one chunk, or (without a chunk table) all chunks in order.
class PartReader {
  public:
    PartReader(std::shared_ptr<const LasFile> file, std::shared_ptr<const ByteSource> input, const las::LazChunk& part,
               bool endKnown)
        : file_(std::move(file)),
          input_(std::move(input)),
          bytes_(bytesOf(*input_)),
          part_(part),
          endKnown_(endKnown),
          next_(part.begin) {
        if (file_->header.laz) decoder_.emplace(*file_->header.laz, file_->parts);
    }

    Result<size_t> read(PointBlock& block, size_t limit) {
        const size_t stride = file_->header.recordBytes;
        auto count = static_cast<size_t>(std::min<uint64_t>({limit, part_.count - done_, kBlockBytes / stride}));
        if (count == 0) return size_t{0};
        records_.resize(count * stride);
        if (decoder_) {
            STIPPLE_ASSIGN(count, decode(count));
        } else {
            STIPPLE_TRY(input_->readAt(next_, records_.data(), records_.size()));
            next_ += records_.size();
        }
        extract(*file_, records_.data(), count, block);
        done_ += count;
        return count;
    }

  private:
    /// Names the chunk in errors of the decoder, which does not know where it is.
    template <typename T>
    Result<T> named(Result<T> result) const {
        if (!result && result.error().where.empty()) {
            result.error().where =
                fmt::format("{}: chunk at offset {} (points {} to {}, point format {})", input_->path(), chunkBegin_,
                            part_.first + done_, part_.first + chunkEnd_ - 1, file_->header.format);
            result.error().hint = "the file is damaged; --skip-bad goes on with the next chunk";
        }
        return result;
    }

    Result<size_t> decode(size_t limit) {
        if (done_ == chunkEnd_) {  // a new chunk
            const las::LazPlan& plan = *file_->header.laz;
            const bool isWhole = endKnown_ || plan.form == las::LazForm::pointwise;
            chunkBegin_ = next_;
            const uint64_t points =
                isWhole ? part_.count : std::min<uint64_t>(plan.chunkPoints, part_.count - chunkEnd_);
            chunkEnd_ += points;
            STIPPLE_TRY(named(decoder_->begin(bytes_, chunkBegin_, part_.end, points)));
        }
        STIPPLE_ASSIGN(const size_t count, named(decoder_->decode(records_.data(), limit)));
        if (done_ + count == chunkEnd_) {
            STIPPLE_TRY(named(decoder_->finish(endKnown_)));
            next_ = decoder_->endOfChunk();
        }
        return count;
    }

    std::shared_ptr<const LasFile> file_;
    std::shared_ptr<const ByteSource> input_;
    las::Bytes bytes_;
    las::LazChunk part_;
    bool endKnown_;
    std::optional<las::LazDecoder> decoder_;
    std::vector<uint8_t> records_;
    uint64_t next_, done_ = 0, chunkBegin_ = 0, chunkEnd_ = 0;
};

/// The parts of a file, and whether their ends are known.
Result<bool> findParts(const las::Bytes& bytes, LasFile& file, bool tolerant) {
    las::LasHeader& h = file.header;
    if (h.points == 0) return true;
    if (!h.laz) {
        for (uint64_t first = 0; first < h.points; first += kLasPartPoints) {
            const uint64_t count = std::min(kLasPartPoints, h.points - first);
            const uint64_t begin = h.dataOffset + first * h.recordBytes;
            file.chunks.push_back({begin, begin + count * h.recordBytes, first, count});
        }
        return true;
    }
    auto table = las::readChunkTable(bytes, *h.laz, h.dataOffset, h.points);
    if (!table) {
        table.error().where = h.path;
        if (!tolerant || h.laz->chunkPoints == las::LazPlan::kVariableChunks) {
            if (h.laz->chunkPoints != las::LazPlan::kVariableChunks && table.error().hint.empty())
                table.error().hint = "--skip-bad reads the chunks one after the other";
            return tl::unexpected(table.error());
        }
        h.notes.push_back(table.error().what);
    } else if (!table->empty()) {
        file.chunks = std::move(*table);
        return true;
    }
    const bool isPointwise = h.laz->form == las::LazForm::pointwise;
    if (!isPointwise) h.notes.emplace_back("has no chunk table: its chunks are read one after the other");
    file.chunks = {{h.dataOffset + (isPointwise ? 0u : 8u), h.fileBytes, 0, h.points}};
    return false;
}

}  // namespace

Result<PointSource> openLas(const std::string& path, const ReadOptions& options) {
    return openLas(fromFile(path), options);
}

Result<PointSource> openLas(const OpenBytes& open, const ReadOptions& options) {
    STIPPLE_ASSIGN(const std::shared_ptr<const ByteSource> input, open());
    const std::string& path = input->path();
    const las::Bytes bytes = bytesOf(*input);
    auto file = std::make_shared<LasFile>();
    STIPPLE_ASSIGN(file->header, las::readLasHeader(bytes, path, options.skipBad));
    las::LasHeader& h = file->header;
    if (!h.laz && h.dataOffset + h.points * h.recordBytes > h.fileBytes)
        h.points = (h.fileBytes - h.dataOffset) / h.recordBytes;  // only when told to skip what is bad
    STIPPLE_ASSIGN(const bool endKnown, findParts(bytes, *file, options.skipBad));
    if (h.colourOffset != 0) file->parts |= las::kLazColour;
    for (const std::string& name : options.attributes) {
        las::Field found;
        bool has = false;
        for (const las::Field& f : h.fields)
            if (f.info.name == name) {
                found = f;
                has = true;
            }
        file->parts |= found.lazPart;
        file->wanted.push_back(found);
        file->has.push_back(has);
    }
    PointSource source;
    SourceInfo& info = source.info;
    info.path = path;
    info.format = h.describe();
    info.points = h.points;
    info.isLattice = true;
    info.isCompressed = h.laz.has_value();
    info.up = UpAxis::z;
    info.scale = h.scale;
    info.offset = h.offset;
    info.declaredMin = h.least;
    info.declaredMax = h.greatest;
    info.hasDeclaredBounds = true;
    info.hasColour = h.colourOffset != 0;
    info.crs = h.crs;
    info.notes = h.notes;
    for (const las::Field& f : h.fields) info.attributes.push_back(f.info);
    for (const las::LazChunk& c : file->chunks) source.parts.push_back(c.count);
    const std::shared_ptr<const LasFile> shared = file;
    source.openPart = [open, shared, endKnown](size_t part) -> Result<PointReader> {
        STIPPLE_ASSIGN(std::shared_ptr<const ByteSource> opened, open());
        auto reader = std::make_shared<PartReader>(shared, std::move(opened), shared->chunks.at(part), endKnown);
        return PointReader([reader](PointBlock& block, size_t limit) { return reader->read(block, limit); });
    };
    return source;
}

}  // namespace stipple::lod
