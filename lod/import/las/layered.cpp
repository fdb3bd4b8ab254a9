// Chunks of point formats 6 to 10 (item versions 3 and 4): each field is an arithmetic stream of its own (a layer), and
// each of the four scanner channels has its own models. Layers that nobody wants are not read.
#include <fmt/format.h>

#include "lod/import/las/chunk_reader.h"

namespace stipple::las {
namespace {

constexpr uint32_t kChannels = 4;

/// Number of returns (row) and return number to one of six contexts.
constexpr uint8_t kReturnContext[16][16] = {
    {0, 1, 2, 3, 4, 5, 3, 4, 4, 5, 5, 5, 5, 5, 5, 5}, {1, 0, 1, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3},
    {2, 1, 2, 4, 4, 4, 4, 4, 4, 4, 4, 3, 3, 3, 3, 3}, {3, 3, 4, 5, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4},
    {4, 3, 4, 4, 5, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4}, {5, 3, 4, 4, 4, 5, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4},
    {3, 3, 4, 4, 4, 4, 5, 4, 4, 4, 4, 4, 4, 4, 4, 4}, {4, 3, 4, 4, 4, 4, 4, 5, 4, 4, 4, 4, 4, 4, 4, 4},
    {4, 3, 4, 4, 4, 4, 4, 4, 5, 4, 4, 4, 4, 4, 4, 4}, {5, 3, 4, 4, 4, 4, 4, 4, 4, 5, 4, 4, 4, 4, 4, 4},
    {5, 3, 4, 4, 4, 4, 4, 4, 4, 4, 5, 4, 4, 4, 4, 4}, {5, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4, 5, 5, 4, 4, 4},
    {5, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4, 5, 5, 5, 4, 4}, {5, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4, 4, 5, 5, 5, 4},
    {5, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 5, 5, 5}, {5, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 5, 5},
};

struct Point14 {
    int32_t x, y, z;
    uint16_t intensity;
    uint8_t returns;  ///< return number 4 | number of returns 4
    uint8_t flags;    ///< classification flags 4 | scanner channel 2 | scan direction 1 | edge of flight line 1
    uint8_t classification, userData;
    int16_t scanAngle;
    uint16_t source;
    void load(const uint8_t* from) { std::memcpy(this, from, kBytes); }
    void store(uint8_t* to) const { std::memcpy(to, this, kBytes); }
    static constexpr size_t kBytes = 22;  ///< then the time
};

/// One layer: its bytes in the chunk and its decoder. `used`: wanted and not empty.
struct Layer {
    uint32_t bytes = 0;
    bool wanted = true, used = false;
    uint64_t end = 0;
    Decoder in;
};

/// An item of the layered form: layers, and per-channel models that are made when a channel first occurs.
class LayeredItem {
  public:
    explicit LayeredItem(size_t count) : layers(count) {}
    virtual ~LayeredItem() = default;
    virtual void begin(const uint8_t* raw, uint32_t channel) = 0;
    /// `channel` is set by the point item, and used by all others.
    virtual bool decode(uint8_t* to, uint32_t& channel) = 0;
    std::vector<Layer> layers;
};

class Point14Item final : public LayeredItem {
  public:
    Point14Item(uint32_t parts, uint16_t version) : LayeredItem(9), slip_(version == 3) {
        const std::array<uint32_t, 9> part{kLazAll,       kLazPosition, kLazClassification, kLazFlags, kLazIntensity,
                                           kLazScanAngle, kLazUserData, kLazSource,         kLazTime};
        for (size_t i = 0; i < part.size(); ++i) layers[i].wanted = (part.at(i) & parts) != 0;
    }
    void begin(const uint8_t* raw, uint32_t channel) override {
        for (Channel& c : channels_) c.used = false;
        Point14 first{};
        first.load(raw);
        int64_t time = 0;
        std::memcpy(&time, raw + Point14::kBytes, 8);
        start(channel, first, time, false);
        channel_ = channel;
    }

    bool decode(uint8_t* to, uint32_t& channel) override {
        Decoder& in = layers[kXy].in;
        Channel* c = &channels_[channel_];
        uint32_t lastN = c->last.returns >> 4, lastR = c->last.returns & 15u;
        const uint32_t before = (lastR == 1 ? 1u : 0u) | (lastR >= lastN ? 2u : 0u) | (c->timeChanged ? 4u : 0u);
        const uint32_t changed = in.symbol(c->models->changed[before]);
        if ((changed & 64) != 0) {
            const uint32_t step = in.symbol(c->models->channel);
            const uint32_t next = (channel_ + step + 1) % kChannels;
            if (!channels_[next].used) start(next, c->last, c->lastTime(), c->timeChanged);
            channel_ = next;
            c = &channels_[channel_];
            c->last.flags = static_cast<uint8_t>((c->last.flags & 0xcfu) | channel_ << 4);
            lastN = c->last.returns >> 4;
            lastR = c->last.returns & 15u;
        }
        // Item version 3 has a slip that is part of the format: unless the channel changed at this very point, the
        // other items are told that it is 0.
        channel = slip_ && (changed & 64) == 0 ? 0 : channel_;
        Models& m = *c->models;
        Point14& p = c->last;
        const bool sourceChanged = (changed & 32) != 0, angleChanged = (changed & 8) != 0;
        const uint32_t timeChanged = (changed & 16) != 0 ? 1 : 0;
        const uint32_t n = (changed & 4) != 0 ? in.symbol(m.returnCount[lastN]) : lastN;
        uint32_t r = lastR;
        if ((changed & 3) == 1)
            r = (lastR + 1) & 15u;
        else if ((changed & 3) == 2)
            r = (lastR + 15) & 15u;
        else if ((changed & 3) == 3)
            r = timeChanged != 0 ? in.symbol(m.returnNumber[lastR]) : (lastR + in.symbol(m.returnSame) + 2) & 15u;
        p.returns = static_cast<uint8_t>(n << 4 | r);
        const uint32_t context = uint32_t{kReturnContext[n][r]} << 1 | timeChanged;
        const uint32_t level = std::min(n > r ? n - r : r - n, 7u);
        const uint32_t ends = (r == 1 ? 2u : 0u) + (r >= n ? 1u : 0u);
        const uint32_t single = n == 1 ? 1 : 0;

        const int32_t dx = m.x.decode(in, m.stepX[context].get(), single);
        p.x = plus(p.x, dx);
        m.stepX[context].add(dx);
        uint32_t bits = m.x.lastBits();
        const int32_t dy = m.y.decode(in, m.stepY[context].get(), single + std::min(bits & ~1u, 20u));
        p.y = plus(p.y, dy);
        m.stepY[context].add(dy);
        if (layers[kZ].used) {
            bits = (bits + m.y.lastBits()) / 2;
            p.z = m.z.decode(layers[kZ].in, m.height[level], single + std::min(bits & ~1u, 18u));
            m.height[level] = p.z;
        }
        if (layers[kClass].used) {
            const uint32_t k = (p.classification & 31u) << 1 | (ends == 3 ? 1u : 0u);
            p.classification = static_cast<uint8_t>(layers[kClass].in.symbol(m.classification[k]));
        }
        if (layers[kFlags].used) {
            const uint32_t was = (p.flags & 15u) | (p.flags >> 6 & 1u) << 4 | (p.flags >> 7 & 1u) << 5;
            const uint32_t f = layers[kFlags].in.symbol(m.flags[was]);
            p.flags = static_cast<uint8_t>((f & 15u) | (p.flags & 0x30u) | (f >> 4 & 1u) << 6 | (f >> 5 & 1u) << 7);
        }
        if (layers[kIntensity].used) {
            uint16_t& was = m.intensityOf[ends << 1 | timeChanged];
            p.intensity = was = static_cast<uint16_t>(m.intensity.decode(layers[kIntensity].in, was, ends));
        }
        if (layers[kAngle].used && angleChanged)
            p.scanAngle = static_cast<int16_t>(m.scanAngle.decode(layers[kAngle].in, p.scanAngle, timeChanged));
        if (layers[kUser].used) p.userData = static_cast<uint8_t>(layers[kUser].in.symbol(m.userData[p.userData / 4u]));
        if (layers[kSource].used && sourceChanged)
            p.source = static_cast<uint16_t>(m.source.decode(layers[kSource].in, p.source, 0));
        bool good = true;
        if (layers[kTime].used && timeChanged != 0) good = m.time.decode(layers[kTime].in);
        c->timeChanged = timeChanged != 0;
        p.store(to);
        const int64_t time = m.time.last();
        std::memcpy(to + Point14::kBytes, &time, 8);
        return good;
    }

  private:
    enum { kXy, kZ, kClass, kFlags, kIntensity, kAngle, kUser, kSource, kTime };

    struct Models {
        std::array<SymbolModel, 8> changed;
        SymbolModel channel, returnSame;
        ModelTable returnCount{16, 16}, returnNumber{16, 16};
        ModelTable classification{64, 256}, flags{64, 64}, userData{64, 256};
        IntegerModel x, y, z, intensity, scanAngle, source;
        TimeModel time{true};
        std::array<RunningMedian, 12> stepX, stepY;
        std::array<int32_t, 8> height{};
        std::array<uint16_t, 8> intensityOf{};
        Models() {
            for (SymbolModel& m : changed) m.make(128);
            channel.make(3);
            returnSame.make(13);
            x.make(32, 2);
            y.make(32, 22);
            z.make(32, 20);
            intensity.make(16, 4);
            scanAngle.make(16, 2);
            source.make(16, 1);
        }
        void reset(const Point14& first, int64_t firstTime) {
            for (SymbolModel& m : changed) m.reset();
            channel.reset();
            returnSame.reset();
            for (ModelTable* t : {&returnCount, &returnNumber, &classification, &flags, &userData}) t->reset();
            for (IntegerModel* i : {&x, &y, &z, &intensity, &scanAngle, &source}) i->reset();
            time.reset(firstTime);
            stepX = {};
            stepY = {};
            height.fill(first.z);
            intensityOf.fill(first.intensity);
        }
    };
    struct Channel {
        bool used = false, timeChanged = false;
        Point14 last{};
        std::unique_ptr<Models> models;
        int64_t lastTime() const { return models->time.last(); }
    };

    void start(uint32_t channel, const Point14& first, int64_t time, bool timeChanged) {
        Channel& c = channels_[channel];
        if (!c.models) c.models = std::make_unique<Models>();
        const Point14 copy = first;
        c.models->reset(copy, time);
        c.last = copy;
        c.timeChanged = timeChanged;
        c.used = true;
    }

    bool slip_;
    std::array<Channel, kChannels> channels_;
    uint32_t channel_ = 0;
};

/// The items beside the point: their models and last value for each channel. Item version 3 has
/// a second slip that is part of the format: at a change to a channel that was met before, the last value is still that
/// of the channel left.
template <typename Models>
class ChannelItem : public LayeredItem {
  public:
    ChannelItem(size_t layerCount, uint32_t bytes, uint16_t version)
        : LayeredItem(layerCount), bytes_(bytes), slip_(version == 3) {}
    void begin(const uint8_t* raw, uint32_t channel) override {
        for (Channel& c : channels_) c.used = false;
        start(channel, raw);
        channel_ = channel;
    }
    bool decode(uint8_t* to, uint32_t& channel) override {
        uint8_t* last = channels_[channel_].last.data();
        if (channel != channel_) {
            channel_ = channel;
            const bool isNew = !channels_[channel].used;
            if (isNew) start(channel, last);
            if (isNew || !slip_) last = channels_[channel].last.data();
        }
        decodeWith(*channels_[channel_].models, last);
        std::copy_n(last, bytes_, to);
        return true;
    }

  protected:
    virtual std::unique_ptr<Models> makeModels() const = 0;
    virtual void decodeWith(Models& models, uint8_t* last) = 0;
    uint32_t bytes_;

  private:
    struct Channel {
        bool used = false;
        std::vector<uint8_t> last;
        std::unique_ptr<Models> models;
    };
    void start(uint32_t channel, const uint8_t* raw) {
        Channel& c = channels_[channel];
        if (!c.models) c.models = makeModels();
        c.models->reset();
        c.last.assign(raw, raw + bytes_);
        c.used = true;
    }
    bool slip_;
    std::array<Channel, kChannels> channels_;
    uint32_t channel_ = 0;
};

struct ColourModels {
    ColourModel colour;
    SymbolModel infraredUsed;
    std::array<SymbolModel, 2> infrared;
    ColourModels() {
        infraredUsed.make(4);
        for (SymbolModel& m : infrared) m.make(256);
    }
    void reset() {
        colour.reset();
        infraredUsed.reset();
        for (SymbolModel& m : infrared) m.reset();
    }
};

/// RGB, or RGB and near infrared.
class ColourItem final : public ChannelItem<ColourModels> {
  public:
    ColourItem(const LazItem& item, uint32_t parts) : ChannelItem(item.bytes == 8 ? 2 : 1, item.bytes, item.version) {
        layers[0].wanted = (parts & kLazColour) != 0;
        if (layers.size() > 1) layers[1].wanted = (parts & kLazInfrared) != 0;
    }
    std::unique_ptr<ColourModels> makeModels() const override { return std::make_unique<ColourModels>(); }
    void decodeWith(ColourModels& m, uint8_t* last) override {
        if (layers[0].used) {
            std::array<uint16_t, 3> rgb{};
            std::memcpy(rgb.data(), last, 6);
            m.colour.decode(layers[0].in, rgb);
            std::memcpy(last, rgb.data(), 6);
        }
        if (layers.size() > 1 && layers[1].used) {
            Decoder& in = layers[1].in;
            const uint32_t changed = in.symbol(m.infraredUsed);
            for (uint32_t i = 0; i < 2; ++i)
                if ((changed >> i & 1u) != 0) last[6 + i] = foldByte(in.symbol(m.infrared.at(i)) + last[6 + i]);
        }
    }
};

class WaveItem final : public ChannelItem<WaveModel> {
  public:
    WaveItem(const LazItem& item, uint32_t parts) : ChannelItem(1, item.bytes, item.version) {
        layers[0].wanted = (parts & kLazWave) != 0;
    }
    std::unique_ptr<WaveModel> makeModels() const override { return std::make_unique<WaveModel>(); }
    void decodeWith(WaveModel& m, uint8_t* last) override {
        if (layers[0].used) m.decode(layers[0].in, last);
    }
};

struct ByteModels {
    ModelTable table;
    explicit ByteModels(uint32_t count) : table(count, 256) {}
    void reset() { table.reset(); }
};

class BytesItem final : public ChannelItem<ByteModels> {
  public:
    BytesItem(const LazItem& item, uint32_t parts) : ChannelItem(item.bytes, item.bytes, item.version) {
        for (Layer& layer : layers) layer.wanted = (parts & kLazExtra) != 0;
    }
    std::unique_ptr<ByteModels> makeModels() const override { return std::make_unique<ByteModels>(bytes_); }
    void decodeWith(ByteModels& m, uint8_t* last) override {
        for (uint32_t i = 0; i < bytes_; ++i)
            if (layers[i].used) last[i] = foldByte(layers[i].in.symbol(m.table[i]) + last[i]);
    }
};

std::unique_ptr<LayeredItem> makeItem(const LazItem& item, uint32_t parts) {
    switch (static_cast<LazItemType>(item.type)) {
        case LazItemType::point14:
            return std::make_unique<Point14Item>(parts, item.version);
        case LazItemType::rgb14:
        case LazItemType::rgbNir14:
            return std::make_unique<ColourItem>(item, parts);
        case LazItemType::wavePacket14:
            return std::make_unique<WaveItem>(item, parts);
        default:
            return std::make_unique<BytesItem>(item, parts);
    }
}

class LayeredReader final : public LazChunkReader {
  public:
    LayeredReader(const LazPlan& plan, uint32_t parts) : recordBytes_(plan.recordBytes), reach_(reachOf(plan)) {
        for (const LazItem& item : plan.items) {
            items_.push_back({makeItem(item, parts), item.bytes});
            layers_ += items_.back().item->layers.size();
        }
    }

    Result<void> begin(const Bytes& in, uint64_t begin, uint64_t end, uint64_t points) override {
        const uint64_t headBytes = recordBytes_ + 4 + layers_ * 4;
        isFirst_ = true;
        if (points == 1 && end - begin >= recordBytes_ && end - begin < headBytes) {  // some writers stop here
            first_.resize(recordBytes_);
            STIPPLE_TRY(in.readAt(begin, first_.data(), recordBytes_));
            end_ = begin + recordBytes_;
            return {};
        }
        if (end - begin < headBytes)
            return fail(ErrorKind::input,
                        fmt::format("a chunk of {} bytes does not hold its head ({} bytes)", end - begin, headBytes));
        first_.resize(headBytes);
        STIPPLE_TRY(in.readAt(begin, first_.data(), headBytes));
        uint32_t declared = 0;
        std::memcpy(&declared, first_.data() + recordBytes_, 4);
        if (declared != points)
            return fail(ErrorKind::input,
                        fmt::format("the chunk says it has {} points, its file {}", declared, points));
        const uint8_t* size = first_.data() + recordBytes_ + 4;
        uint64_t at = begin + headBytes;
        for (Part& part : items_) {
            for (Layer& layer : part.item->layers) {
                std::memcpy(&layer.bytes, size, 4);
                size += 4;
                layer.used = layer.wanted && layer.bytes > 0;
                if (layer.bytes > end - at)
                    return fail(
                        ErrorKind::input,
                        fmt::format("a layer of {} bytes at offset {} reaches beyond its chunk", layer.bytes, at));
                layer.end = at + layer.bytes;
                if (layer.used) {
                    STIPPLE_TRY(layer.in.stream.open(in, at, layer.end, reach_));
                    layer.in.begin();
                }
                at = layer.end;
            }
        }
        end_ = at;
        chunkEnd_ = end;
        const uint32_t channel = first_[15] >> 4 & 3u;
        size_t offset = 0;
        for (Part& part : items_) {
            part.item->begin(first_.data() + offset, channel);
            offset += part.bytes;
        }
        Layer& xy = items_[0].item->layers[0];
        if (points > 1 && !xy.used) return fail(ErrorKind::input, "the chunk has no positions");
        return {};
    }

    Result<void> decode(uint8_t* records, size_t count) override {
        size_t i = 0;
        if (isFirst_) {
            std::copy_n(first_.begin(), recordBytes_, records);
            isFirst_ = false;
            i = 1;
        }
        bool good = true;
        uint32_t channel = 0;
        for (; i < count; ++i) {
            for (const Part& part : items_)
                for (Layer& layer : part.item->layers)
                    if (layer.used) STIPPLE_TRY(layer.in.stream.ensure());
            uint8_t* to = records + i * recordBytes_;
            for (const Part& part : items_) {
                good &= part.item->decode(to, channel);
                to += part.bytes;
            }
        }
        for (const Part& part : items_)
            for (const Layer& layer : part.item->layers) {
                if (!layer.used) continue;
                if (layer.in.stream.overrun())
                    return fail(ErrorKind::input, "the bytes of a layer end before the points do");
                good &= !layer.in.corrupt();
            }
        if (!good) return fail(ErrorKind::input, "the compressed bytes are not what an encoder writes");
        return {};
    }

    Result<void> finish(bool endKnown) const override {
        for (const Part& part : items_)
            for (const Layer& layer : part.item->layers)
                if (layer.used && layer.in.stream.position() != layer.end)
                    return fail(ErrorKind::input,
                                fmt::format("a layer's points end {} bytes before its bytes do",
                                            static_cast<int64_t>(layer.end - layer.in.stream.position())));
        if (endKnown && end_ != chunkEnd_)
            return fail(ErrorKind::input, fmt::format("the chunk's layers end {} bytes before the chunk",
                                                      static_cast<int64_t>(chunkEnd_ - end_)));
        return {};
    }
    uint64_t endOfChunk() const override { return end_; }

  private:
    struct Part {
        std::unique_ptr<LayeredItem> item;
        uint32_t bytes;
    };
    std::vector<Part> items_;
    size_t layers_ = 0;
    uint32_t recordBytes_;
    size_t reach_;
    std::vector<uint8_t> first_;  ///< first point, count, sizes of the layers
    bool isFirst_ = false;
    uint64_t end_ = 0, chunkEnd_ = 0;
};

}  // namespace

std::unique_ptr<LazChunkReader> makeLayeredReader(const LazPlan& plan, uint32_t parts) {
    return std::make_unique<LayeredReader>(plan, parts);
}

}  // namespace stipple::las
