// What the two forms of LAZ chunks have in common.
#pragma once

#include "lod/import/las/arithmetic.h"
#include "lod/import/las/laz.h"

namespace stipple::las {

class LazChunkReader {
  public:
    virtual ~LazChunkReader() = default;
    virtual Result<void> begin(const Bytes& in, uint64_t begin, uint64_t end, uint64_t points) = 0;
    virtual Result<void> decode(uint8_t* records, size_t count) = 0;
    virtual Result<void> finish(bool endKnown) const = 0;
    virtual uint64_t endOfChunk() const = 0;
};

std::unique_ptr<LazChunkReader> makeSequentialReader(const LazPlan& plan);
std::unique_ptr<LazChunkReader> makeLayeredReader(const LazPlan& plan, uint32_t parts);

/// The most bytes one point can take from one stream: some hundred symbols of at most three bytes.
inline size_t reachOf(const LazPlan& plan) { return 1024 + 4 * size_t{plan.recordBytes}; }

/// Jumps between the four remembered time sequences in a row; an encoder makes at most one.
constexpr int kMostTimeJumps = 8;

/// Sums wrap around, as the format's do.
inline int32_t plus(int32_t a, int32_t b) {
    return static_cast<int32_t>(static_cast<uint32_t>(a) + static_cast<uint32_t>(b));
}
inline uint8_t foldByte(uint32_t v) { return static_cast<uint8_t>(v); }
inline int32_t clampByte(int32_t v) { return v < 0 ? 0 : v > 255 ? 255 : v; }

/// A set of 256-symbol (or smaller) models of which few are used: made when first met.
class ModelTable {
  public:
    ModelTable(uint32_t entries, uint32_t symbols) : models_(entries), symbols_(symbols) {}
    SymbolModel& operator[](uint32_t i) {
        SymbolModel& m = models_[i];
        if (!m.made()) {
            m.make(symbols_);
            used_.push_back(i);
        }
        return m;
    }
    void reset() {
        for (const uint32_t i : used_) models_[i].reset();
    }

  private:
    std::vector<SymbolModel> models_;
    std::vector<uint32_t> used_;
    uint32_t symbols_;
};

/// Red, green, blue: which of the six bytes changed, then each against what the ones before it did. The same in
/// RGB12 version 2 and RGB14.
class ColourModel {
  public:
    ColourModel() {
        used_.make(128);
        for (SymbolModel& m : byte_) m.make(256);
    }
    void reset() {
        used_.reset();
        for (SymbolModel& m : byte_) m.reset();
    }
    void decode(Decoder& in, std::array<uint16_t, 3>& rgb) {
        const uint32_t changed = in.symbol(used_);
        const int32_t lowWas = rgb[0] & 255, highWas = rgb[0] >> 8;
        int32_t low = lowWas, high = highWas;
        if ((changed & 1) != 0) low = foldByte(in.symbol(byte_[0]) + static_cast<uint32_t>(low));
        if ((changed & 2) != 0) high = foldByte(in.symbol(byte_[1]) + static_cast<uint32_t>(high));
        const auto red = static_cast<uint16_t>(high << 8 | low);
        if ((changed & 64) == 0) {
            rgb = {red, red, red};
            return;
        }
        const int32_t greenLowWas = rgb[1] & 255, greenHighWas = rgb[1] >> 8;
        const int32_t blueLowWas = rgb[2] & 255, blueHighWas = rgb[2] >> 8;
        int32_t greenLow = greenLowWas, greenHigh = greenHighWas, blueLow = blueLowWas, blueHigh = blueHighWas;
        int32_t d = low - lowWas;
        if ((changed & 4) != 0)
            greenLow = foldByte(in.symbol(byte_[2]) + static_cast<uint32_t>(clampByte(d + greenLowWas)));
        if ((changed & 16) != 0) {
            d = (d + greenLow - greenLowWas) / 2;
            blueLow = foldByte(in.symbol(byte_[4]) + static_cast<uint32_t>(clampByte(d + blueLowWas)));
        }
        d = high - highWas;
        if ((changed & 8) != 0)
            greenHigh = foldByte(in.symbol(byte_[3]) + static_cast<uint32_t>(clampByte(d + greenHighWas)));
        if ((changed & 32) != 0) {
            d = (d + greenHigh - greenHighWas) / 2;
            blueHigh = foldByte(in.symbol(byte_[5]) + static_cast<uint32_t>(clampByte(d + blueHighWas)));
        }
        rgb = {red, static_cast<uint16_t>(greenHigh << 8 | greenLow), static_cast<uint16_t>(blueHigh << 8 | blueLow)};
    }

  private:
    SymbolModel used_;
    std::array<SymbolModel, 6> byte_;
};

/// Full-waveform packets (29 bytes): the same in item versions 13 and 14.
class WaveModel {
  public:
    WaveModel() {
        index_.make(256);
        for (SymbolModel& m : offsetKind_) m.make(4);
        offset_.make(32, 1);
        size_.make(32, 1);
        returnPoint_.make(32, 1);
        direction_.make(32, 3);
    }
    void reset() {
        index_.reset();
        for (SymbolModel& m : offsetKind_) m.reset();
        for (IntegerModel* m : {&offset_, &size_, &returnPoint_, &direction_}) m->reset();
        lastOffsetStep_ = 0;
        lastKind_ = 0;
    }
    /// `packet`: the last one on entry, the next one on return.
    void decode(Decoder& in, uint8_t* packet) {
        uint64_t offset = 0;
        std::array<int32_t, 5> v{};  // size, return point, direction
        std::memcpy(&offset, packet + 1, 8);
        std::memcpy(v.data(), packet + 9, 20);
        packet[0] = static_cast<uint8_t>(in.symbol(index_));
        lastKind_ = in.symbol(offsetKind_.at(lastKind_));
        if (lastKind_ == 1) {
            offset += static_cast<uint32_t>(v[0]);
        } else if (lastKind_ == 2) {
            lastOffsetStep_ = offset_.decode(in, lastOffsetStep_, 0);
            offset += static_cast<uint64_t>(int64_t{lastOffsetStep_});
        } else if (lastKind_ == 3) {
            offset = in.doubleWord();
        }
        v[0] = size_.decode(in, v[0], 0);
        v[1] = returnPoint_.decode(in, v[1], 0);
        for (uint32_t a = 0; a < 3; ++a) v[2 + a] = direction_.decode(in, v[2 + a], a);
        std::memcpy(packet + 1, &offset, 8);
        std::memcpy(packet + 9, v.data(), 20);
    }

  private:
    SymbolModel index_;
    std::array<SymbolModel, 4> offsetKind_;
    IntegerModel offset_, size_, returnPoint_, direction_;
    int32_t lastOffsetStep_ = 0;
    uint32_t lastKind_ = 0;
};

/// GPS time, item versions 2 (in formats 1 to 5) and later (6 to 10): four remembered sequences, each with its last
/// time and step; a time is coded as a multiple of the step. The later form knows that the time changed.
class TimeModel {
  public:
    static constexpr int32_t kMost = 500, kLeast = -10;
    explicit TimeModel(bool layered) : firstCode_(layered ? 0u : 1u), full_(layered ? 511u : 512u) {
        multiple_.make(full_ + 4);
        fresh_.make(layered ? 5 : 6);
        difference_.make(32, 9);
    }
    void reset(int64_t time) {
        multiple_.reset();
        fresh_.reset();
        difference_.reset();
        last_ = next_ = 0;
        step_ = {};
        extremes_ = {};
        time_ = {time, 0, 0, 0};
    }
    int64_t last() const { return time_[last_]; }
    /// False: more jumps than any encoder makes.
    bool decode(Decoder& in) {
        for (int jumps = 0; jumps < kMostTimeJumps; ++jumps)
            if (step_[last_] == 0 ? decodeFresh(in) : decodeMultiple(in)) return true;
        return false;
    }

  private:
    void add(int32_t d) {
        time_[last_] = static_cast<int64_t>(static_cast<uint64_t>(time_[last_]) + static_cast<uint64_t>(int64_t{d}));
    }
    void startSequence(Decoder& in) {
        const int32_t high = difference_.decode(in, static_cast<int32_t>(static_cast<uint64_t>(time_[last_]) >> 32), 8);
        next_ = (next_ + 1) & 3;
        time_[next_] = static_cast<int64_t>(uint64_t{static_cast<uint32_t>(high)} << 32 | in.word());
        last_ = next_;
        step_[last_] = 0;
        extremes_[last_] = 0;
    }
    bool decodeFresh(Decoder& in) {
        const uint32_t code = in.symbol(fresh_);
        if (code < firstCode_) return true;  // unchanged
        if (code == firstCode_) {
            step_[last_] = difference_.decode(in, 0, 0);
            add(step_[last_]);
            extremes_[last_] = 0;
        } else if (code == firstCode_ + 1) {
            startSequence(in);
        } else {
            last_ = (last_ + code - firstCode_ - 1) & 3;
            return false;
        }
        return true;
    }
    void extreme(int32_t d) {
        if (++extremes_[last_] > 3) {
            step_[last_] = d;
            extremes_[last_] = 0;
        }
    }
    int32_t times(int32_t multiple) const {
        return static_cast<int32_t>(static_cast<uint32_t>(multiple) * static_cast<uint32_t>(step_[last_]));
    }
    bool decodeMultiple(Decoder& in) {
        const uint32_t code = in.symbol(multiple_);
        const auto multiple = static_cast<int32_t>(code);
        if (multiple == 1) {
            add(difference_.decode(in, step_[last_], 1));
            extremes_[last_] = 0;
        } else if (code < kUnchanged) {
            int32_t d = 0;
            if (multiple == 0) {
                d = difference_.decode(in, 0, 7);
                extreme(d);
            } else if (multiple < kMost) {
                d = difference_.decode(in, times(multiple), multiple < 10 ? 2 : 3);
            } else if (multiple == kMost) {
                d = difference_.decode(in, times(kMost), 4);
                extreme(d);
            } else if (kMost - multiple > kLeast) {
                d = difference_.decode(in, times(kMost - multiple), 5);
            } else {
                d = difference_.decode(in, times(kLeast), 6);
                extreme(d);
            }
            add(d);
        } else if (code == full_) {
            startSequence(in);
        } else if (code > full_) {
            last_ = (last_ + code - full_) & 3;
            return false;
        }
        return true;
    }

    static constexpr uint32_t kUnchanged = kMost - kLeast + 1;  // 511: in the layered form never unchanged
    uint32_t firstCode_, full_;
    SymbolModel multiple_, fresh_;
    IntegerModel difference_;
    uint32_t last_ = 0, next_ = 0;
    std::array<int32_t, 4> step_{}, extremes_{};
    std::array<int64_t, 4> time_{};
};

}  // namespace stipple::las
