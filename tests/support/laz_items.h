// Items that both forms of LAZ chunks have: time, colour, waveform.
#pragma once

#include "engine/base/rng.h"
#include "tests/support/laz_coder.h"
#include "tests/support/laz_encoder.h"

namespace stipple::test::laz {

/// Item versions 2 and later of the GPS time.
struct Time {
    uint32_t first, full;
    Model multiple, fresh;
    Integer difference{32, 9};
    uint32_t last = 0, next = 0;
    std::array<int32_t, 4> step{}, extremes{};
    std::array<int64_t, 4> time{};
    Time(bool layered, int64_t t)
        : first(layered ? 0 : 1),
          full(layered ? 511 : 512),
          multiple(full + 4),
          fresh(layered ? 5 : 6),
          time{t, 0, 0, 0} {}

    void encode(Encoder& out, int64_t t, Rng& rng) {
        const auto jump = static_cast<uint32_t>(rng.below(6));
        if (jump >= 1 && jump <= 3) {  // to another remembered sequence
            if (step[last] == 0)
                out.symbol(fresh, first + 1 + jump);
            else
                out.symbol(multiple, full + jump);
            last = (last + jump) & 3;
        }
        const int64_t d = static_cast<int64_t>(static_cast<uint64_t>(t) - static_cast<uint64_t>(time[last]));
        const bool fits = d == static_cast<int32_t>(d);
        const auto d32 = static_cast<int32_t>(d);
        if (step[last] == 0) {
            if (d == 0 && first == 1) return out.symbol(fresh, 0);
            if (!fits) {
                out.symbol(fresh, first + 1);
                return newSequence(out, t);
            }
            out.symbol(fresh, first);
            difference.encode(out, 0, d32, 0);
            step[last] = d32;
            extremes[last] = 0;
            time[last] = t;
            return;
        }
        if (!fits) {
            out.symbol(multiple, full);
            return newSequence(out, t);
        }
        if (d == 0 && first == 1) return out.symbol(multiple, 511);
        static constexpr std::array<uint32_t, 9> codes{0, 1, 5, 9, 10, 499, 500, 505, 510};
        const uint32_t code = codes.at(rng.below(codes.size()));
        out.symbol(multiple, code);
        const auto times = [&](int32_t m) {
            return static_cast<int32_t>(static_cast<uint32_t>(m) * static_cast<uint32_t>(step[last]));
        };
        const auto m = static_cast<int32_t>(code);
        bool extreme = false;
        if (m == 0) {
            difference.encode(out, 0, d32, 7);
            extreme = true;
        } else if (m == 1) {
            difference.encode(out, step[last], d32, 1);
            extremes[last] = 0;
        } else if (m < 500) {
            difference.encode(out, times(m), d32, m < 10 ? 2 : 3);
        } else if (m == 500) {
            difference.encode(out, times(500), d32, 4);
            extreme = true;
        } else if (500 - m > -10) {
            difference.encode(out, times(500 - m), d32, 5);
        } else {
            difference.encode(out, times(-10), d32, 6);
            extreme = true;
        }
        if (extreme && ++extremes[last] > 3) {
            step[last] = d32;
            extremes[last] = 0;
        }
        time[last] = t;
    }
    void newSequence(Encoder& out, int64_t t) {
        const auto high = [](int64_t v) { return static_cast<int32_t>(static_cast<uint64_t>(v) >> 32); };
        difference.encode(out, high(time[last]), high(t), 8);
        out.word(static_cast<uint32_t>(t));
        next = (next + 1) & 3;
        last = next;
        time[last] = t;
        step[last] = extremes[last] = 0;
    }
};

struct Colour {
    Model used{128};
    std::vector<Model> byte{6, Model(256)};
    void encode(Encoder& out, const uint8_t* was, const uint8_t* is) {
        const auto low = [](const uint8_t* p, int c) { return int{p[2 * c]}; };
        const auto high = [](const uint8_t* p, int c) { return int{p[2 * c + 1]}; };
        const bool grey = load<uint16_t>(is) == load<uint16_t>(is + 2) && load<uint16_t>(is) == load<uint16_t>(is + 4);
        uint32_t changed = 0;
        for (int c = 0; c < 3; ++c) {
            if (low(was, c) != low(is, c)) changed |= 1u << (2 * c);
            if (high(was, c) != high(is, c)) changed |= 2u << (2 * c);
        }
        changed = grey ? changed & 3u : changed | 64u;
        out.symbol(used, changed);
        const auto clamp = [](int v) { return std::clamp(v, 0, 255); };
        const auto send = [&](uint32_t bit, int is8, int predicted) {
            if ((changed >> bit & 1u) != 0) out.symbol(byte[bit], static_cast<uint32_t>(is8 - predicted) & 255u);
        };
        send(0, low(is, 0), low(was, 0));
        send(1, high(is, 0), high(was, 0));
        if (grey) return;
        int d = low(is, 0) - low(was, 0);
        send(2, low(is, 1), clamp(d + low(was, 1)));
        send(4, low(is, 2), clamp((d + low(is, 1) - low(was, 1)) / 2 + low(was, 2)));
        d = high(is, 0) - high(was, 0);
        send(3, high(is, 1), clamp(d + high(was, 1)));
        send(5, high(is, 2), clamp((d + high(is, 1) - high(was, 1)) / 2 + high(was, 2)));
    }
};

struct Wave {
    Model index{256};
    std::vector<Model> kind{4, Model(4)};
    Integer offset{32, 1}, size{32, 1}, point{32, 1}, direction{32, 3};
    uint32_t lastKind = 0;
    int32_t lastStep = 0;
    void encode(Encoder& out, const uint8_t* was, const uint8_t* is) {
        out.symbol(index, is[0]);
        const auto o = load<uint64_t>(is + 1), before = load<uint64_t>(was + 1);
        const auto step = static_cast<int64_t>(o - before);
        const uint32_t code = o == before                             ? 0
                              : o == before + load<uint32_t>(was + 9) ? 1
                              : step == static_cast<int32_t>(step)    ? 2
                                                                      : 3;
        out.symbol(kind[lastKind], code);
        lastKind = code;
        if (code == 2) {
            offset.encode(out, lastStep, static_cast<int32_t>(step), 0);
            lastStep = static_cast<int32_t>(step);
        } else if (code == 3) {
            out.word(static_cast<uint32_t>(o));
            out.word(static_cast<uint32_t>(o >> 32));
        }
        const auto field = [](const uint8_t* p, size_t i) { return load<int32_t>(p + 9 + 4 * i); };
        size.encode(out, field(was, 0), field(is, 0), 0);
        point.encode(out, field(was, 1), field(is, 1), 0);
        for (uint32_t a = 0; a < 3; ++a) direction.encode(out, field(was, 2 + a), field(is, 2 + a), a);
    }
};

std::vector<uint8_t> encodeSequential(const LazSpec& spec, const uint8_t* records, size_t count, Rng& rng);
std::vector<uint8_t> encodeLayered(const LazSpec& spec, const uint8_t* records, size_t count, Rng& rng);

}  // namespace stipple::test::laz
