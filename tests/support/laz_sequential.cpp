// Chunks of point formats 0 to 5.
#include "tests/support/laz_items.h"

namespace stipple::test::laz {
namespace {

constexpr uint8_t kOldContext[8][8] = {
    {15, 14, 13, 12, 11, 10, 9, 8},  {14, 0, 1, 3, 6, 10, 10, 9},    {13, 1, 2, 4, 7, 11, 11, 10},
    {12, 3, 4, 5, 8, 12, 12, 11},    {11, 6, 7, 8, 9, 13, 13, 12},   {10, 10, 11, 12, 13, 14, 14, 13},
    {9, 10, 11, 12, 13, 14, 15, 14}, {8, 9, 10, 11, 12, 13, 14, 15},
};

}  // namespace

std::vector<uint8_t> encodeSequential(const LazSpec& spec, const uint8_t* records, size_t count, Rng& rng) {
    const uint32_t bytes = lazRecordBytes(spec);
    std::vector<uint8_t> out(records, records + bytes);
    Encoder e;
    Model changedModel{64};
    Integer x{32, 2}, y{32, 22}, z{32, 20}, intensity{16, 4}, source{16, 1};
    std::vector<Model> angle{2, Model(256)};
    Table returns{256, {}}, classes{256, {}}, user{256, {}};
    std::array<Median, 16> stepX, stepY;
    std::array<uint16_t, 16> intensityOf{};
    std::array<int32_t, 8> heightOf{};
    const bool hasTime = spec.format == 1 || spec.format >= 3;
    const bool hasColour = spec.format == 2 || spec.format == 3 || spec.format == 5;
    Time time(false, hasTime ? load<int64_t>(records + 20) : 0);
    Colour colour;
    Wave wave;
    std::vector<Model> extra(spec.extraBytes, Model(256));
    for (size_t i = 1; i < count; ++i) {
        const uint8_t *was = records + (i - 1) * bytes, *is = was + bytes;
        const uint32_t r = is[14] & 7u, n = is[14] >> 3 & 7u, c = kOldContext[n][r], level = n > r ? n - r : r - n;
        const auto now = load<uint16_t>(is + 12);
        uint32_t changed = 0;
        if (is[14] != was[14]) changed |= 32;
        if (intensityOf[c] != now) changed |= 16;
        if (is[15] != was[15]) changed |= 8;
        if (is[16] != was[16]) changed |= 4;
        if (is[17] != was[17]) changed |= 2;
        if (load<uint16_t>(is + 18) != load<uint16_t>(was + 18)) changed |= 1;
        e.symbol(changedModel, changed);
        if ((changed & 32) != 0) e.symbol(returns[was[14]], is[14]);
        if ((changed & 16) != 0) intensity.encode(e, intensityOf[c], now, std::min(c, 3u));
        intensityOf[c] = now;
        if ((changed & 8) != 0) e.symbol(classes[was[15]], is[15]);
        if ((changed & 4) != 0) e.symbol(angle[is[14] >> 6 & 1u], static_cast<uint8_t>(is[16] - was[16]));
        if ((changed & 2) != 0) e.symbol(user[was[17]], is[17]);
        if ((changed & 1) != 0) source.encode(e, load<uint16_t>(was + 18), load<uint16_t>(is + 18), 0);
        const uint32_t single = n == 1 ? 1 : 0;
        const int32_t dx = minus(load<int32_t>(is), load<int32_t>(was));
        x.encode(e, stepX[c].get(), dx, single);
        stepX[c].add(dx);
        const int32_t dy = minus(load<int32_t>(is + 4), load<int32_t>(was + 4));
        y.encode(e, stepY[c].get(), dy, single + std::min(x.last & ~1u, 20u));
        stepY[c].add(dy);
        z.encode(e, heightOf[level], load<int32_t>(is + 8), single + std::min((x.last + y.last) / 2 & ~1u, 18u));
        heightOf[level] = load<int32_t>(is + 8);
        size_t at = 20;
        if (hasTime) {
            time.encode(e, load<int64_t>(is + at), rng);
            at += 8;
        }
        if (hasColour) {
            colour.encode(e, was + at, is + at);
            at += 6;
        }
        if (spec.format >= 4) {
            wave.encode(e, was + at, is + at);
            at += 29;
        }
        for (size_t k = 0; k < extra.size(); ++k) e.symbol(extra[k], static_cast<uint8_t>(is[at + k] - was[at + k]));
    }
    const std::vector<uint8_t> coded = e.finish();
    out.insert(out.end(), coded.begin(), coded.end());
    return out;
}

}  // namespace stipple::test::laz
