// Chunks of point formats 6 to 10.
#include <memory>

#include "tests/support/laz_items.h"

namespace stipple::test::laz {
namespace {

/// Six contexts by number of returns (row, as digits) and return number.
constexpr const char* kNewContext[16] = {
    "0123453445555555", "1013333333333333", "2124444444433333", "3345444444444444",
    "4344544444444444", "5344454444444444", "3344445444444444", "4344444544444444",
    "4344444454444444", "5344444445444444", "5344444444544444", "5334444444455444",
    "5334444444455544", "5334444444445554", "5334444444444555", "5334444444444455",
};

struct NewPoint {
    std::vector<Model> changed{8, Model(128)};
    Model channel{3}, same{13};
    Table count{16, {}}, number{16, {}}, classes{256, {}}, flags{64, {}}, user{256, {}};
    Integer x{32, 2}, y{32, 22}, z{32, 20}, intensity{16, 4}, angle{16, 2}, source{16, 1};
    Time time;
    std::array<Median, 12> stepX, stepY;
    std::array<int32_t, 8> height{};
    std::array<uint16_t, 8> intensityOf{};
    std::vector<uint8_t> last;
    bool timeChanged = false;
    explicit NewPoint(const std::vector<uint8_t>& first) : time(true, load<int64_t>(first.data() + 22)), last(first) {
        height.fill(load<int32_t>(first.data() + 8));
        intensityOf.fill(load<uint16_t>(first.data() + 12));
    }
};

/// Models and last value of one item of one channel.
template <typename M>
struct Side {
    M models;
    std::vector<uint8_t> last;
};
struct Infrared {
    Colour colour;
    Model used{4};
    std::vector<Model> byte{2, Model(256)};
};
struct Bytes {
    Table table{256, {}};
};

/// Which channel's models and whose last value an item uses; version 3 of the items has two slips (see the decoder).
template <typename M>
class Sides {
  public:
    Sides(uint16_t version, uint32_t channel, const uint8_t* first, size_t bytes) : slip_(version == 3), now_(channel) {
        sides_[channel] = std::make_unique<Side<M>>(Side<M>{M(), std::vector<uint8_t>(first, first + bytes)});
    }
    std::pair<M*, std::vector<uint8_t>*> at(uint32_t channel) {
        std::vector<uint8_t>* last = &sides_[now_]->last;
        if (channel != now_) {
            const bool isNew = !sides_[channel];
            if (isNew) sides_[channel] = std::make_unique<Side<M>>(Side<M>{M(), *last});
            now_ = channel;
            if (isNew || !slip_) last = &sides_[channel]->last;
        }
        return {&sides_[channel]->models, last};
    }

  private:
    bool slip_;
    uint32_t now_;
    std::array<std::unique_ptr<Side<M>>, 4> sides_;
};

/// Where the fields of a record lie.
struct Layout {
    uint32_t bytes, extraBytes;
    bool hasColour, hasInfrared, hasWave;
    size_t colourBytes, waveAt, extraAt;
    explicit Layout(const LazSpec& spec)
        : bytes(lazRecordBytes(spec)),
          extraBytes(spec.extraBytes),
          hasColour(spec.format == 7 || spec.format == 8 || spec.format == 10),
          hasInfrared(spec.format == 8 || spec.format == 10),
          hasWave(spec.format >= 9),
          colourBytes(hasInfrared ? 8
                      : hasColour ? 6
                                  : 0),
          waveAt(30 + colourBytes),
          extraAt(waveAt + (hasWave ? 29 : 0)) {}
    size_t layers() const {
        return size_t{9} + (hasColour ? 1 : 0) + (hasInfrared ? 1 : 0) + (hasWave ? 1 : 0) + extraBytes;
    }
};

/// A layer is left out as a whole where its field never changes.
std::vector<bool> movedLayers(const Layout& at, const uint8_t* records, size_t count) {
    std::vector<bool> moved(at.layers(), false);
    moved[0] = true;
    for (size_t i = 1; i < count; ++i) {
        const uint8_t* is = records + i * at.bytes;
        const auto differs = [&](size_t from, size_t n) { return std::memcmp(is + from, records + from, n) != 0; };
        moved[1] = moved[1] || differs(8, 4);
        moved[2] = moved[2] || is[16] != records[16];
        moved[3] = moved[3] || ((is[15] ^ records[15]) & 0xcf) != 0;
        moved[4] = moved[4] || differs(12, 2);
        moved[5] = moved[5] || differs(18, 2);
        moved[6] = moved[6] || is[17] != records[17];
        moved[7] = moved[7] || differs(20, 2);
        moved[8] = moved[8] || differs(22, 8);
        size_t k = 9;
        if (at.hasColour) moved[k] = moved[k] || differs(30, 6), ++k;
        if (at.hasInfrared) moved[k] = moved[k] || differs(36, 2), ++k;
        if (at.hasWave) moved[k] = moved[k] || differs(at.waveAt, 29), ++k;
        for (uint32_t b = 0; b < at.extraBytes; ++b)
            moved[k + b] = moved[k + b] || is[at.extraAt + b] != records[at.extraAt + b];
    }
    return moved;
}

/// What every record has; returns whether it is of another scanner channel than the one before.
bool encodePoint(const uint8_t* is, std::array<std::unique_ptr<NewPoint>, 4>& channels, uint32_t& channel,
                 const std::vector<bool>& moved, std::vector<Encoder>& layer, Rng& rng) {
    const uint32_t target = is[15] >> 4 & 3u;
    NewPoint* p = channels[channel].get();
    const uint32_t beforeN = p->last[14] >> 4, beforeR = p->last[14] & 15u;
    const uint32_t context = (beforeR == 1 ? 1u : 0u) | (beforeR >= beforeN ? 2u : 0u) | (p->timeChanged ? 4u : 0u);
    NewPoint* previous = p;
    const bool channelChanged = target != channel;
    if (channelChanged) {
        if (!channels[target]) channels[target] = std::make_unique<NewPoint>(p->last);
        p = channels[target].get();
    }
    const uint32_t lastN = p->last[14] >> 4, lastR = p->last[14] & 15u, n = is[14] >> 4, r = is[14] & 15u;
    const bool timeChanged = load<int64_t>(is + 22) != load<int64_t>(p->last.data() + 22);
    const bool angleChanged = load<int16_t>(is + 18) != load<int16_t>(p->last.data() + 18);
    const bool sourceChanged = load<uint16_t>(is + 20) != load<uint16_t>(p->last.data() + 20);
    const uint32_t step = r == lastR ? 0 : r == ((lastR + 1) & 15u) ? 1 : r == ((lastR + 15) & 15u) ? 2 : 3;
    Encoder& xy = layer[0];
    xy.symbol(previous->changed[context], (channelChanged ? 64u : 0u) | (sourceChanged ? 32u : 0u) |
                                              (timeChanged ? 16u : 0u) | (angleChanged ? 8u : 0u) |
                                              (n != lastN ? 4u : 0u) | step);
    if (channelChanged) xy.symbol(previous->channel, (target + 4 - channel - 1) & 3u);
    channel = target;
    if (n != lastN) xy.symbol(p->count[lastN], n);
    if (step == 3) {
        if (timeChanged)
            xy.symbol(p->number[lastR], r);
        else
            xy.symbol(p->same, (r + 16 - lastR - 2) & 15u);
    }
    const uint32_t t = timeChanged ? 1 : 0, single = n == 1 ? 1 : 0;
    const auto m = static_cast<uint32_t>(kNewContext[n][r] - '0') << 1 | t;
    const uint32_t level = std::min(n > r ? n - r : r - n, 7u), ends = (r == 1 ? 2u : 0u) + (r >= n ? 1u : 0u);
    const int32_t dx = minus(load<int32_t>(is), load<int32_t>(p->last.data()));
    p->x.encode(xy, p->stepX[m].get(), dx, single);
    p->stepX[m].add(dx);
    const int32_t dy = minus(load<int32_t>(is + 4), load<int32_t>(p->last.data() + 4));
    p->y.encode(xy, p->stepY[m].get(), dy, single + std::min(p->x.last & ~1u, 20u));
    p->stepY[m].add(dy);
    if (moved[1]) {
        p->z.encode(layer[1], p->height[level], load<int32_t>(is + 8),
                    single + std::min((p->x.last + p->y.last) / 2 & ~1u, 18u));
        p->height[level] = load<int32_t>(is + 8);
    }
    if (moved[2]) layer[2].symbol(p->classes[(p->last[16] & 31u) << 1 | (ends == 3 ? 1u : 0u)], is[16]);
    const auto flagsOf = [](uint8_t f) { return (f & 15u) | (f >> 6 & 1u) << 4 | (f >> 7 & 1u) << 5; };
    if (moved[3]) layer[3].symbol(p->flags[flagsOf(p->last[15])], flagsOf(is[15]));
    if (moved[4]) {
        uint16_t& was = p->intensityOf[ends << 1 | t];
        p->intensity.encode(layer[4], was, load<uint16_t>(is + 12), ends);
        was = load<uint16_t>(is + 12);
    }
    if (moved[5] && angleChanged)
        p->angle.encode(layer[5], load<int16_t>(p->last.data() + 18), load<int16_t>(is + 18), t);
    if (moved[6]) layer[6].symbol(p->user[p->last[17] / 4u], is[17]);
    if (moved[7] && sourceChanged)
        p->source.encode(layer[7], load<uint16_t>(p->last.data() + 20), load<uint16_t>(is + 20), 0);
    if (moved[8] && timeChanged) p->time.encode(layer[8], load<int64_t>(is + 22), rng);
    p->timeChanged = timeChanged;
    p->last.assign(is, is + 30);
    return channelChanged;
}

}  // namespace

std::vector<uint8_t> encodeLayered(const LazSpec& spec, const uint8_t* records, size_t count, Rng& rng) {
    const Layout at(spec);
    const auto& [bytes, extraBytes, hasColour, hasInfrared, hasWave, colourBytes, waveAt, extraAt] = at;
    std::vector<Encoder> layer(at.layers());
    const std::vector<bool> moved = movedLayers(at, records, count);
    std::array<std::unique_ptr<NewPoint>, 4> channels;
    uint32_t channel = records[15] >> 4 & 3u;
    channels[channel] = std::make_unique<NewPoint>(std::vector<uint8_t>(records, records + 30));
    Sides<Infrared> colours(spec.version, channel, records + 30, colourBytes);
    Sides<Wave> waves(spec.version, channel, records + waveAt, hasWave ? 29 : 0);
    Sides<Bytes> extras(spec.version, channel, records + extraAt, spec.extraBytes);
    for (size_t i = 1; i < count; ++i) {
        const uint8_t* is = records + i * bytes;
        const bool channelChanged = encodePoint(is, channels, channel, moved, layer, rng);
        const uint32_t told = spec.version == 3 && !channelChanged ? 0 : channel;
        size_t k = 9;
        if (hasColour) {
            const auto [models, last] = colours.at(told);
            if (moved[k]) models->colour.encode(layer[k], last->data(), is + 30);
            ++k;
            if (hasInfrared && moved[k]) {
                const uint8_t *was = last->data() + 6, *now = is + 36;
                const uint32_t changed = (was[0] != now[0] ? 1u : 0u) | (was[1] != now[1] ? 2u : 0u);
                layer[k].symbol(models->used, changed);
                for (uint32_t b = 0; b < 2; ++b)
                    if ((changed >> b & 1u) != 0)
                        layer[k].symbol(models->byte[b], static_cast<uint8_t>(now[b] - was[b]));
            }
            if (hasInfrared) ++k;
            last->assign(is + 30, is + 30 + colourBytes);
        }
        if (hasWave) {
            const auto [models, last] = waves.at(told);
            if (moved[k]) models->encode(layer[k], last->data(), is + waveAt);
            last->assign(is + waveAt, is + waveAt + 29);
            ++k;
        }
        if (spec.extraBytes > 0) {
            const auto [models, last] = extras.at(told);
            for (uint32_t b = 0; b < spec.extraBytes; ++b)
                if (moved[k + b])
                    layer[k + b].symbol(models->table[b], static_cast<uint8_t>(is[extraAt + b] - (*last)[b]));
            last->assign(is + extraAt, is + extraAt + spec.extraBytes);
        }
    }
    std::vector<uint8_t> out(records, records + bytes), body;
    put(out, static_cast<uint32_t>(count));
    for (size_t k = 0; k < layer.size(); ++k) {
        const std::vector<uint8_t> coded = moved[k] ? layer[k].finish() : std::vector<uint8_t>();
        put(out, static_cast<uint32_t>(coded.size()));
        body.insert(body.end(), coded.begin(), coded.end());
    }
    out.insert(out.end(), body.begin(), body.end());
    return out;
}

}  // namespace stipple::test::laz
