// A LAZ encoder for the tests: written from the format, sharing no code with the decoder that it tests. Where the
// format leaves a choice (by which multiple of the last step a time is coded, which remembered sequence it belongs to),
// it chooses at random, so that every branch of a decoder is taken.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "engine/base/rng.h"

namespace stipple::test {

/// What a file is made of. `version`: of the items; 2 for point formats 0 to 5, 3 or 4 for 6 to 10.
struct LazSpec {
    unsigned format = 2;
    uint16_t version = 2;
    uint32_t extraBytes = 0;
    uint32_t chunkPoints = 1000;  ///< 0xffffffff: chunks of random sizes
    bool hasTable = true;
    double scale = 0.01;
    double offset = 0;
};

uint32_t lazRecordBytes(const LazSpec& spec);
/// Records such as scanners write, and some that no scanner does: `count` of them, lazRecordBytes() each.
std::vector<uint8_t> makeRecords(const LazSpec& spec, size_t count, Rng& rng);
/// One chunk.
std::vector<uint8_t> encodeLazChunk(const LazSpec& spec, const uint8_t* records, size_t count, Rng& rng);
/// Payload of the `laszip encoded` record.
std::vector<uint8_t> lazPayload(const LazSpec& spec);
/// A whole file: header, record, chunks, chunk table. `compressed` false: the same as LAS.
std::vector<uint8_t> encodeLas(const LazSpec& spec, const std::vector<uint8_t>& records, bool compressed, Rng& rng);

}  // namespace stipple::test
