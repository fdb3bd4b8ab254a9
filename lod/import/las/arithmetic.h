// The adaptive arithmetic decoder of LAZ (A. Said's FastAC, HP Labs 2004, as used by M. Isenburg, "LASzip: lossless
// compression of LiDAR data", 2013) and the integer coder on top of it. Bit-exact: every constant is part of the
// format.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <vector>

#include "lod/import/las/bytes.h"

namespace stipple::las {

constexpr uint32_t kLeastLength = 1u << 24;

/// Probabilities of symbols 0..n-1, adapted every so often (never at every symbol).
class SymbolModel {
  public:
    bool made() const { return symbols_ != 0; }
    void make(uint32_t symbols) {
        symbols_ = symbols;
        // A share may reach 2^15 + 63 (what a division by the rounded unit leaves over), which must fall into the one
        // cell beyond the last.
        cells_ = std::min(std::bit_ceil(symbols), 512u);
        cellShift_ = 15u - static_cast<uint32_t>(std::countr_zero(cells_));
        memory_.resize(2 * size_t{symbols} + 1 + cells_ + 1);
        reset();
    }
    /// As after make().
    void reset() {
        std::fill(counts(), counts() + symbols_, uint16_t{1});
        total_ = 0;
        cycle_ = symbols_;
        update();
        untilUpdate_ = cycle_ = (symbols_ + 6) >> 1;
    }

  private:
    friend class Decoder;
    // One block: where each symbol's share of 2^15 begins (and a sentinel), how often each was seen, and for equal
    // steps of the share the last symbol that begins at or before the step: where to begin to look.
    uint16_t* begins() { return memory_.data(); }
    uint16_t* counts() { return memory_.data() + symbols_ + 1; }
    uint16_t* cells() { return memory_.data() + 2 * size_t{symbols_} + 1; }

    void update() {
        uint16_t* const count = counts();
        uint16_t* const begin = begins();
        uint16_t* const cell = cells();
        if ((total_ += cycle_) > (1u << 15)) {
            total_ = 0;
            for (uint32_t k = 0; k < symbols_; ++k) {
                count[k] = static_cast<uint16_t>((count[k] + 1) >> 1);
                total_ += count[k];
            }
        }
        const uint32_t scale = 0x80000000u / total_;
        uint32_t sum = 0, filled = 0;
        for (uint32_t k = 0; k < symbols_; ++k) {
            const uint32_t b = (scale * sum) >> 16;
            begin[k] = static_cast<uint16_t>(b);
            sum += count[k];
            const uint32_t upTo = (b + (1u << cellShift_) - 1) >> cellShift_;
            for (; filled < upTo; ++filled) cell[filled] = static_cast<uint16_t>(k - 1);
        }
        for (; filled <= cells_; ++filled) cell[filled] = static_cast<uint16_t>(symbols_ - 1);
        begin[symbols_] = 0xffff;
        cycle_ = std::min((5 * cycle_) >> 2, (symbols_ + 6) << 3);
        untilUpdate_ = cycle_;
    }

    std::vector<uint16_t> memory_;
    uint32_t symbols_ = 0, cells_ = 0, cellShift_ = 0;
    uint32_t total_ = 0, cycle_ = 0, untilUpdate_ = 0;
};

class BitModel {
  public:
    void reset() { *this = BitModel(); }

  private:
    friend class Decoder;
    void update() {
        if ((total_ += cycle_) > (1u << 13)) {
            total_ = (total_ + 1) >> 1;
            zeros_ = (zeros_ + 1) >> 1;
            if (zeros_ == total_) ++total_;
        }
        share_ = (zeros_ * (0x80000000u / total_)) >> 18;
        cycle_ = std::min((5 * cycle_) >> 2, 64u);
        untilUpdate_ = cycle_;
    }
    uint32_t zeros_ = 1, total_ = 2, share_ = 1u << 12, cycle_ = 4, untilUpdate_ = 4;
};

/// One arithmetic stream. After begin() on corrupt bytes every call still ends and stays inside its arrays; `corrupt()`
/// then tells.
class Decoder {
  public:
    CodeStream stream;

    /// Takes the first four bytes of the opened stream.
    void begin() {
        length_ = 0xffffffffu;
        value_ = loadBigEndian(stream.next);
        stream.next += 4;
        corrupt_ = value_ == length_;
        if (corrupt_) value_ = 0;
    }
    bool corrupt() const { return corrupt_ || stream.overrun(); }

    uint32_t symbol(SymbolModel& m) {
        const uint32_t unit = length_ >> 15;
        const uint32_t share = value_ / unit;
        const uint16_t* const begin = m.begins();
        uint32_t s = m.cells()[share >> m.cellShift_];
        while (begin[s + 1] <= share) ++s;
        const uint32_t low = begin[s] * unit;
        const uint32_t high = s + 1 == m.symbols_ ? length_ : begin[s + 1] * unit;
        value_ -= low;
        length_ = high - low;
        renormalise();
        ++m.counts()[s];
        if (--m.untilUpdate_ == 0) m.update();
        return s;
    }

    uint32_t bit(BitModel& m) {
        const uint32_t split = m.share_ * (length_ >> 13);
        const bool one = value_ >= split;
        if (one) {
            value_ -= split;
            length_ -= split;
        } else {
            length_ = split;
            ++m.zeros_;
        }
        renormalise();
        if (--m.untilUpdate_ == 0) m.update();
        return one ? 1u : 0u;
    }

    /// `count` raw bits, at most 32.
    uint32_t bits(uint32_t count) {
        if (count > 19) {
            const uint32_t low = fewBits(16);
            return bits(count - 16) << 16 | low;
        }
        return fewBits(count);
    }
    uint32_t word() {
        const uint32_t low = fewBits(16);
        return fewBits(16) << 16 | low;
    }
    uint64_t doubleWord() {
        const uint64_t low = word();
        return uint64_t{word()} << 32 | low;
    }

  private:
    static uint32_t loadBigEndian(const uint8_t* p) {
        uint32_t v = 0;
        std::memcpy(&v, p, 4);
        return __builtin_bswap32(v);
    }
    uint32_t fewBits(uint32_t count) {
        const uint32_t unit = length_ >> count;
        uint32_t v = value_ / unit;
        const uint32_t most = (1u << count) - 1;
        if (v > most) {  // no encoder writes this
            corrupt_ = true;
            v = most;
            value_ = v * unit;
        }
        value_ -= v * unit;
        length_ = unit;
        renormalise();
        return v;
    }
    /// Brings the length back to 2^24 or more by whole bytes, all at once.
    void renormalise() {
        if (length_ >= kLeastLength) return;
        const auto shift = static_cast<uint32_t>(std::countl_zero(length_)) & 24u;
        const uint64_t wide = uint64_t{value_} << 32 | loadBigEndian(stream.next);
        value_ = static_cast<uint32_t>((wide << shift) >> 32);
        length_ <<= shift;
        stream.next += shift >> 3;
    }

    uint32_t value_ = 0, length_ = 0xffffffffu;
    bool corrupt_ = false;
};

/// Integers as differences from a prediction: how many bits the difference has (by context), then its upper eight bits
/// by a model of that length, then the rest raw.
class IntegerModel {
  public:
    void make(uint32_t bits, uint32_t contexts) {
        bits_ = bits;
        lengths_.resize(contexts);
        for (SymbolModel& m : lengths_) m.make(bits + 1);
        upper_.resize(bits);
        for (uint32_t k = 1; k <= bits; ++k) upper_[k - 1].make(1u << std::min(k, kUpperBits));
        zero_.reset();
    }
    void reset() {
        for (SymbolModel& m : lengths_) m.reset();
        for (SymbolModel& m : upper_) m.reset();
        zero_.reset();
    }
    bool made() const { return bits_ != 0; }
    /// Bits of the last difference: a context for what follows.
    uint32_t lastBits() const { return last_; }

    int32_t decode(Decoder& in, int32_t prediction, uint32_t context) {
        const uint32_t k = last_ = in.symbol(lengths_[context]);
        uint32_t difference = 0;
        if (k == 0) {
            difference = in.bit(zero_);
        } else if (k < 32) {
            uint32_t c = in.symbol(upper_[k - 1]);
            if (k > kUpperBits) {
                const uint32_t raw = k - kUpperBits;
                c = c << raw | in.bits(raw);
            }
            difference = c >= 1u << (k - 1) ? c + 1 : c - ((1u << k) - 1);
        } else {
            difference = 0x80000000u;
        }
        const uint32_t v = static_cast<uint32_t>(prediction) + difference;
        if (bits_ == 32) return static_cast<int32_t>(v);
        // Narrow values wrap around once.
        const auto range = int32_t{1} << bits_;
        const auto narrow = static_cast<int32_t>(v);
        return narrow < 0 ? narrow + range : narrow >= range ? narrow - range : narrow;
    }

  private:
    static constexpr uint32_t kUpperBits = 8;
    std::vector<SymbolModel> lengths_, upper_;
    BitModel zero_;
    uint32_t bits_ = 0, last_ = 0;
};

/// Median of the last five values in the format's own order of replacement.
class RunningMedian {
  public:
    int32_t get() const { return v_[2]; }
    void add(int32_t v) {
        if (high_) {
            if (v < v_[2]) {
                v_[4] = v_[3];
                v_[3] = v_[2];
                if (v < v_[0]) {
                    v_[2] = v_[1];
                    v_[1] = v_[0];
                    v_[0] = v;
                } else if (v < v_[1]) {
                    v_[2] = v_[1];
                    v_[1] = v;
                } else {
                    v_[2] = v;
                }
            } else {
                if (v < v_[3]) {
                    v_[4] = v_[3];
                    v_[3] = v;
                } else {
                    v_[4] = v;
                }
                high_ = false;
            }
        } else if (v_[2] < v) {
            v_[0] = v_[1];
            v_[1] = v_[2];
            if (v_[4] < v) {
                v_[2] = v_[3];
                v_[3] = v_[4];
                v_[4] = v;
            } else if (v_[3] < v) {
                v_[2] = v_[3];
                v_[3] = v;
            } else {
                v_[2] = v;
            }
        } else {
            if (v_[1] < v) {
                v_[0] = v_[1];
                v_[1] = v;
            } else {
                v_[0] = v;
            }
            high_ = true;
        }
    }

  private:
    int32_t v_[5] = {0, 0, 0, 0, 0};
    bool high_ = true;
};

}  // namespace stipple::las
