// LAZ points: compressed bytes in, LAS records out. No global state, no files; one decoder serves one thread at a time,
// any number of decoders work at once. Use:
//
//   LazPlan plan = *planLaz(items, recordBytes);           // from the `laszip encoded` record, checked
//   LazDecoder decoder(plan, kLazPosition | kLazColour);    // the parts of layered files that are wanted
//   decoder.begin(bytes, chunkBegin, chunkEnd, points);     // once per chunk
//   while (*decoder.decode(records, n) > 0) ...             // records: n * plan.recordBytes bytes
//   decoder.finish();                                       // says whether the chunk ended where it should
//
// Memory: the models (below 1 MB without extra bytes; some 700 B per extra byte and scanner channel) and 64 KB a
// stream, whatever the size of a chunk.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "engine/base/result.h"
#include "lod/import/las/bytes.h"

namespace stipple::las {

/// Item types of the `laszip encoded` record.
enum class LazItemType : uint16_t {
    bytes = 0,
    point10 = 6,
    gpsTime11 = 7,
    rgb12 = 8,
    wavePacket13 = 9,
    point14 = 10,
    rgb14 = 11,
    rgbNir14 = 12,
    wavePacket14 = 13,
    bytes14 = 14,
};

struct LazItem {
    uint16_t type = 0, bytes = 0, version = 0;
};

enum class LazForm { pointwise = 1, chunked = 2, layered = 3 };

/// How the points of one file are compressed.
struct LazPlan {
    LazForm form = LazForm::chunked;
    std::vector<LazItem> items;
    uint32_t recordBytes = 0;
    uint32_t chunkPoints = 0;  ///< points of every chunk but the last; kVariableChunks: as the chunk table says
    static constexpr uint32_t kVariableChunks = 0xffffffffu;
    /// Extra bytes that one record may have: each takes memory of its own.
    static constexpr uint32_t kMostExtraBytes = 2048;
};

/// Reads and checks the payload of the `laszip encoded` record against a file's point format and record length.
Result<LazPlan> parseLazPlan(const uint8_t* payload, size_t count, unsigned pointFormat, uint32_t recordBytes);

/// Parts of a layered chunk (point formats 6 to 10) that can be left out; their fields keep the value of the chunk's
/// first point. Older formats are one stream: everything is always decoded.
enum LazParts : uint32_t {
    kLazPosition = 1,  ///< x, y, z; x, y and the return numbers are always decoded
    kLazClassification = 2,
    kLazFlags = 4,
    kLazIntensity = 8,
    kLazScanAngle = 16,
    kLazUserData = 32,
    kLazSource = 64,
    kLazTime = 128,
    kLazColour = 256,
    kLazInfrared = 512,
    kLazWave = 1024,
    kLazExtra = 2048,
    kLazAll = 4095,
};

class LazChunkReader;

class LazDecoder {
  public:
    LazDecoder(const LazPlan& plan, uint32_t parts);
    LazDecoder(LazDecoder&&) noexcept;
    LazDecoder& operator=(LazDecoder&&) noexcept;
    ~LazDecoder();

    /// Starts a chunk of `points` > 0 points in the bytes [begin, end) of `in`, which must outlive the decoding.
    Result<void> begin(const Bytes& in, uint64_t begin, uint64_t end, uint64_t points);
    /// Writes up to `limit` records; 0 when the chunk is through. An error leaves `records` unusable.
    Result<size_t> decode(uint8_t* records, size_t limit);
    /// After the last point: an error if bytes are left over or were missing. `endKnown` false: where the chunk ends
    /// follows from its points (files without a chunk table).
    Result<void> finish(bool endKnown) const;
    /// First byte after the chunk, once all its points are decoded.
    uint64_t endOfChunk() const;

  private:
    std::unique_ptr<LazChunkReader> reader_;
    uint64_t left_ = 0;
};

/// No stream of symbols holds more: the commonest of 33 symbols still costs 0.0014 bits, and a point has four of those.
constexpr uint64_t kMostPointsPerByte = 4096;

/// One chunk of a file.
struct LazChunk {
    uint64_t begin = 0, end = 0;    ///< bytes
    uint64_t first = 0, count = 0;  ///< points
};

/// Reads the chunk table that the eight bytes at `dataBegin` point to. An empty result: the file has none (writers that
/// could not seek leave it out), its chunks follow from decoding. Errors if the table lies.
Result<std::vector<LazChunk>> readChunkTable(const Bytes& in, const LazPlan& plan, uint64_t dataBegin, uint64_t points);

}  // namespace stipple::las
