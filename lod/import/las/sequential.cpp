// Chunks of point formats 0 to 5 (item versions 1 and 2): one arithmetic stream through all items of all points. Also
// files of LASzip 1.0, whose points are a single chunk.
#include <fmt/format.h>

#include "lod/import/las/chunk_reader.h"

namespace stipple::las {
namespace {

/// Return number and number of returns to one of 16 contexts, which separate single, first, middle and last returns.
constexpr uint8_t kReturnContext[8][8] = {
    {15, 14, 13, 12, 11, 10, 9, 8},  {14, 0, 1, 3, 6, 10, 10, 9},    {13, 1, 2, 4, 7, 11, 11, 10},
    {12, 3, 4, 5, 8, 12, 12, 11},    {11, 6, 7, 8, 9, 13, 13, 12},   {10, 10, 11, 12, 13, 14, 14, 13},
    {9, 10, 11, 12, 13, 14, 15, 14}, {8, 9, 10, 11, 12, 13, 14, 15},
};

struct Point10 {
    int32_t x, y, z;
    uint16_t intensity;
    uint8_t returns, classification, scanAngle, userData;
    uint16_t source;
    void load(const uint8_t* from) { std::memcpy(this, from, 20); }
    void store(uint8_t* to) const { std::memcpy(to, this, 20); }
};
static_assert(sizeof(Point10) == 20);

/// One item of a record: begins at its raw value in the chunk's first point, then decodes in place.
class Item {
  public:
    virtual ~Item() = default;
    virtual void begin(const uint8_t* raw) = 0;
    /// False: the stream holds what no encoder writes.
    virtual bool decode(Decoder& in, uint8_t* to) = 0;
};

class Point10Version1 : public Item {
  public:
    Point10Version1() {
        changed_.make(64);
        x_.make(32, 1);
        y_.make(32, 20);
        z_.make(32, 20);
        intensity_.make(16, 1);
        scanAngle_.make(8, 2);
        source_.make(16, 1);
    }
    void begin(const uint8_t* raw) override {
        last_.load(raw);
        changed_.reset();
        for (IntegerModel* m : {&x_, &y_, &z_, &intensity_, &scanAngle_, &source_}) m->reset();
        for (ModelTable* t : {&returns_, &classification_, &userData_}) t->reset();
        stepX_ = stepY_ = {};
        slot_ = 0;
    }
    bool decode(Decoder& in, uint8_t* to) override {
        const int32_t dx = x_.decode(in, median(stepX_), 0);
        last_.x = plus(last_.x, dx);
        uint32_t bits = x_.lastBits();
        const int32_t dy = y_.decode(in, median(stepY_), std::min(bits, 19u));
        last_.y = plus(last_.y, dy);
        bits = (bits + y_.lastBits()) / 2;
        last_.z = z_.decode(in, last_.z, std::min(bits, 19u));
        const uint32_t changed = in.symbol(changed_);
        if ((changed & 32) != 0) last_.intensity = static_cast<uint16_t>(intensity_.decode(in, last_.intensity, 0));
        if ((changed & 16) != 0) last_.returns = static_cast<uint8_t>(in.symbol(returns_[last_.returns]));
        if ((changed & 8) != 0)
            last_.classification = static_cast<uint8_t>(in.symbol(classification_[last_.classification]));
        if ((changed & 4) != 0)
            last_.scanAngle = static_cast<uint8_t>(scanAngle_.decode(in, last_.scanAngle, bits < 3 ? 1 : 0));
        if ((changed & 2) != 0) last_.userData = static_cast<uint8_t>(in.symbol(userData_[last_.userData]));
        if ((changed & 1) != 0) last_.source = static_cast<uint16_t>(source_.decode(in, last_.source, 0));
        stepX_.at(slot_) = dx;
        stepY_.at(slot_) = dy;
        slot_ = (slot_ + 1) % 3;
        last_.store(to);
        return true;
    }

  private:
    static int32_t median(const std::array<int32_t, 3>& v) {
        return std::max(std::min(v[0], v[1]), std::min(std::max(v[0], v[1]), v[2]));
    }
    Point10 last_{};
    SymbolModel changed_;
    IntegerModel x_, y_, z_, intensity_, scanAngle_, source_;
    ModelTable returns_{256, 256}, classification_{256, 256}, userData_{256, 256};
    std::array<int32_t, 3> stepX_{}, stepY_{};
    size_t slot_ = 0;
};

class Point10Version2 final : public Item {
  public:
    Point10Version2() {
        changed_.make(64);
        x_.make(32, 2);
        y_.make(32, 22);
        z_.make(32, 20);
        intensity_.make(16, 4);
        source_.make(16, 1);
        for (SymbolModel& m : scanAngle_) m.make(256);
    }
    void begin(const uint8_t* raw) override {
        last_.load(raw);
        last_.intensity = 0;
        changed_.reset();
        for (IntegerModel* m : {&x_, &y_, &z_, &intensity_, &source_}) m->reset();
        for (SymbolModel& m : scanAngle_) m.reset();
        for (ModelTable* t : {&returns_, &classification_, &userData_}) t->reset();
        stepX_ = {};
        stepY_ = {};
        intensityOf_ = {};
        heightOf_ = {};
    }
    bool decode(Decoder& in, uint8_t* to) override {
        const uint32_t changed = in.symbol(changed_);
        if ((changed & 32) != 0) last_.returns = static_cast<uint8_t>(in.symbol(returns_[last_.returns]));
        const uint32_t r = last_.returns & 7u, n = last_.returns >> 3 & 7u;
        const uint32_t context = kReturnContext[n][r], level = n > r ? n - r : r - n;
        if (changed != 0) {
            if ((changed & 16) != 0)
                intensityOf_[context] =
                    static_cast<uint16_t>(intensity_.decode(in, intensityOf_[context], std::min(context, 3u)));
            last_.intensity = intensityOf_[context];
            if ((changed & 8) != 0)
                last_.classification = static_cast<uint8_t>(in.symbol(classification_[last_.classification]));
            if ((changed & 4) != 0)
                last_.scanAngle = foldByte(in.symbol(scanAngle_[last_.returns >> 6 & 1u]) + last_.scanAngle);
            if ((changed & 2) != 0) last_.userData = static_cast<uint8_t>(in.symbol(userData_[last_.userData]));
            if ((changed & 1) != 0) last_.source = static_cast<uint16_t>(source_.decode(in, last_.source, 0));
        }
        const uint32_t single = n == 1 ? 1 : 0;
        const int32_t dx = x_.decode(in, stepX_[context].get(), single);
        last_.x = plus(last_.x, dx);
        stepX_[context].add(dx);
        uint32_t bits = x_.lastBits();
        const int32_t dy = y_.decode(in, stepY_[context].get(), single + std::min(bits & ~1u, 20u));
        last_.y = plus(last_.y, dy);
        stepY_[context].add(dy);
        bits = (bits + y_.lastBits()) / 2;
        last_.z = z_.decode(in, heightOf_[level], single + std::min(bits & ~1u, 18u));
        heightOf_[level] = last_.z;
        last_.store(to);
        return true;
    }

  private:
    Point10 last_{};
    SymbolModel changed_;
    IntegerModel x_, y_, z_, intensity_, source_;
    std::array<SymbolModel, 2> scanAngle_;
    ModelTable returns_{256, 256}, classification_{256, 256}, userData_{256, 256};
    std::array<RunningMedian, 16> stepX_, stepY_;
    std::array<uint16_t, 16> intensityOf_{};
    std::array<int32_t, 8> heightOf_{};
};

class Time11Version1 final : public Item {
  public:
    Time11Version1() {
        multiple_.make(kMultiples);
        fresh_.make(3);
        difference_.make(32, 6);
    }
    void begin(const uint8_t* raw) override {
        std::memcpy(&time_, raw, 8);
        multiple_.reset();
        fresh_.reset();
        difference_.reset();
        step_ = 0;
        extremes_ = 0;
    }
    bool decode(Decoder& in, uint8_t* to) override {
        if (step_ == 0) {
            const uint32_t code = in.symbol(fresh_);
            if (code == 1) {
                step_ = difference_.decode(in, 0, 0);
                add(step_);
            } else if (code == 2) {
                time_ = in.doubleWord();
            }
        } else {
            decodeMultiple(in);
        }
        std::memcpy(to, &time_, 8);
        return true;
    }

  private:
    static constexpr uint32_t kMultiples = 512;
    void add(int32_t d) { time_ += static_cast<uint64_t>(int64_t{d}); }
    void extreme(int32_t d) {
        if (++extremes_ > 3) {
            step_ = d;
            extremes_ = 0;
        }
    }
    void decodeMultiple(Decoder& in) {
        const uint32_t multiple = in.symbol(multiple_);
        if (multiple == kMultiples - 2) {
            time_ = in.doubleWord();
        } else if (multiple < kMultiples - 2) {
            int32_t d = 0;
            const auto predicted = static_cast<int32_t>(multiple * static_cast<uint32_t>(step_));
            if (multiple == 1) {
                step_ = d = difference_.decode(in, step_, 1);
                extremes_ = 0;
            } else if (multiple == 0) {
                d = difference_.decode(in, step_ / 4, 2);
                extreme(d);
            } else if (multiple < 10) {
                d = difference_.decode(in, predicted, 3);
            } else if (multiple < 50) {
                d = difference_.decode(in, predicted, 4);
            } else {
                d = difference_.decode(in, predicted, 5);
                if (multiple == kMultiples - 3) extreme(d);
            }
            add(d);
        }
    }
    uint64_t time_ = 0;
    SymbolModel multiple_, fresh_;
    IntegerModel difference_;
    int32_t step_ = 0, extremes_ = 0;
};

class Time11Version2 final : public Item {
  public:
    void begin(const uint8_t* raw) override {
        int64_t time = 0;
        std::memcpy(&time, raw, 8);
        model_.reset(time);
    }
    bool decode(Decoder& in, uint8_t* to) override {
        const bool good = model_.decode(in);
        const int64_t time = model_.last();
        std::memcpy(to, &time, 8);
        return good;
    }

  private:
    TimeModel model_{false};
};

class Rgb12Version1 final : public Item {
  public:
    Rgb12Version1() {
        used_.make(64);
        byte_.make(8, 6);
    }
    void begin(const uint8_t* raw) override {
        std::memcpy(last_.data(), raw, 6);
        used_.reset();
        byte_.reset();
    }
    bool decode(Decoder& in, uint8_t* to) override {
        const uint32_t changed = in.symbol(used_);
        for (uint32_t i = 0; i < 6; ++i)
            if ((changed >> i & 1u) != 0) last_.at(i) = static_cast<uint8_t>(byte_.decode(in, last_.at(i), i));
        std::memcpy(to, last_.data(), 6);
        return true;
    }

  private:
    std::array<uint8_t, 6> last_{};  ///< little-endian: low byte first, as the six contexts are
    SymbolModel used_;
    IntegerModel byte_;
};

class Rgb12Version2 final : public Item {
  public:
    void begin(const uint8_t* raw) override {
        std::memcpy(last_.data(), raw, 6);
        model_.reset();
    }
    bool decode(Decoder& in, uint8_t* to) override {
        model_.decode(in, last_);
        std::memcpy(to, last_.data(), 6);
        return true;
    }

  private:
    std::array<uint16_t, 3> last_{};
    ColourModel model_;
};

class Wave13 final : public Item {
  public:
    void begin(const uint8_t* raw) override {
        std::memcpy(last_.data(), raw, last_.size());
        model_.reset();
    }
    bool decode(Decoder& in, uint8_t* to) override {
        model_.decode(in, last_.data());
        std::memcpy(to, last_.data(), last_.size());
        return true;
    }

  private:
    std::array<uint8_t, 29> last_{};
    WaveModel model_;
};

class Bytes1 final : public Item {
  public:
    explicit Bytes1(uint32_t count) : last_(count) { byte_.make(8, count); }
    void begin(const uint8_t* raw) override {
        std::copy_n(raw, last_.size(), last_.begin());
        byte_.reset();
    }
    bool decode(Decoder& in, uint8_t* to) override {
        for (uint32_t i = 0; i < last_.size(); ++i) last_[i] = static_cast<uint8_t>(byte_.decode(in, last_[i], i));
        std::copy(last_.begin(), last_.end(), to);
        return true;
    }

  private:
    std::vector<uint8_t> last_;
    IntegerModel byte_;
};

class Bytes2 final : public Item {
  public:
    explicit Bytes2(uint32_t count) : last_(count), byte_(count) {
        for (SymbolModel& m : byte_) m.make(256);
    }
    void begin(const uint8_t* raw) override {
        std::copy_n(raw, last_.size(), last_.begin());
        for (SymbolModel& m : byte_) m.reset();
    }
    bool decode(Decoder& in, uint8_t* to) override {
        for (size_t i = 0; i < last_.size(); ++i) to[i] = last_[i] = foldByte(in.symbol(byte_[i]) + last_[i]);
        return true;
    }

  private:
    std::vector<uint8_t> last_;
    std::vector<SymbolModel> byte_;
};

std::unique_ptr<Item> makeItem(const LazItem& item) {
    const bool first = item.version == 1;
    switch (static_cast<LazItemType>(item.type)) {
        case LazItemType::point10:
            if (first) return std::make_unique<Point10Version1>();
            return std::make_unique<Point10Version2>();
        case LazItemType::gpsTime11:
            if (first) return std::make_unique<Time11Version1>();
            return std::make_unique<Time11Version2>();
        case LazItemType::rgb12:
            if (first) return std::make_unique<Rgb12Version1>();
            return std::make_unique<Rgb12Version2>();
        case LazItemType::wavePacket13:
            return std::make_unique<Wave13>();
        default:
            if (first) return std::make_unique<Bytes1>(item.bytes);
            return std::make_unique<Bytes2>(item.bytes);
    }
}

class SequentialReader final : public LazChunkReader {
  public:
    explicit SequentialReader(const LazPlan& plan) : recordBytes_(plan.recordBytes), reach_(reachOf(plan)) {
        for (const LazItem& item : plan.items) {
            items_.push_back({makeItem(item), item.bytes});
        }
    }
    Result<void> begin(const Bytes& in, uint64_t begin, uint64_t end, uint64_t points) override {
        end_ = end;
        isFirst_ = true;
        onlyOne_ = points == 1;
        first_.resize(recordBytes_);
        if (end - begin < recordBytes_)
            return fail(ErrorKind::input, fmt::format("a chunk of {} bytes does not hold its first point ({} bytes)",
                                                      end - begin, recordBytes_));
        STIPPLE_TRY(in.readAt(begin, first_.data(), recordBytes_));
        size_t at = 0;
        for (Part& part : items_) {
            part.item->begin(first_.data() + at);
            at += part.bytes;
        }
        STIPPLE_TRY(in_.stream.open(in, begin + recordBytes_, end, reach_));
        in_.begin();
        return {};
    }
    Result<void> decode(uint8_t* records, size_t count) override {
        size_t i = 0;
        if (isFirst_) {
            std::copy(first_.begin(), first_.end(), records);
            isFirst_ = false;
            i = 1;
        }
        bool good = true;
        for (; i < count; ++i) {
            STIPPLE_TRY(in_.stream.ensure());
            uint8_t* to = records + i * recordBytes_;
            for (const Part& part : items_) {
                good &= part.item->decode(in_, to);
                to += part.bytes;
            }
        }
        if (in_.stream.overrun()) return fail(ErrorKind::input, "the compressed bytes end before the points do");
        if (!good || in_.corrupt())
            return fail(ErrorKind::input, "the compressed bytes are not what an encoder writes");
        return {};
    }
    Result<void> finish(bool endKnown) const override {
        if (endKnown && endOfChunk() != end_ && !onlyOne_)
            return fail(ErrorKind::input, fmt::format("the chunk's points end {} bytes before its bytes do",
                                                      static_cast<int64_t>(end_ - endOfChunk())));
        return {};
    }
    uint64_t endOfChunk() const override { return in_.stream.position(); }

  private:
    struct Part {
        std::unique_ptr<Item> item;
        uint32_t bytes;
    };
    std::vector<Part> items_;
    uint32_t recordBytes_;
    size_t reach_;
    std::vector<uint8_t> first_;
    bool isFirst_ = false, onlyOne_ = false;
    Decoder in_;
    uint64_t end_ = 0;
};

}  // namespace

std::unique_ptr<LazChunkReader> makeSequentialReader(const LazPlan& plan) {
    return std::make_unique<SequentialReader>(plan);
}

}  // namespace stipple::las
