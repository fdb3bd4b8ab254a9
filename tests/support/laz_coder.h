// The arithmetic encoder of LAZ and its models, for the tests' own encoder.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <map>
#include <vector>

namespace stipple::test::laz {

struct Model {
    std::vector<uint32_t> begin, count;
    uint32_t total = 0, cycle = 0, until = 0;
    explicit Model(uint32_t symbols) : cycle(symbols) {
        begin.assign(symbols, 0);
        count.assign(symbols, 1);
        update();
        until = cycle = (symbols + 6) >> 1;
    }
    void update() {
        const auto n = static_cast<uint32_t>(count.size());
        if ((total += cycle) > 32768) {
            total = 0;
            for (uint32_t& c : count) total += c = (c + 1) >> 1;
        }
        uint32_t sum = 0;
        for (uint32_t k = 0; k < n; ++k) {
            begin[k] = (0x80000000u / total * sum) >> 16;
            sum += count[k];
        }
        until = cycle = std::min(5 * cycle >> 2, (n + 6) << 3);
    }
};

struct Bit {
    uint32_t zeros = 1, total = 2, share = 4096, cycle = 4, until = 4;
    void update() {
        if ((total += cycle) > 8192) {
            total = (total + 1) >> 1;
            zeros = (zeros + 1) >> 1;
            if (zeros == total) ++total;
        }
        share = zeros * (0x80000000u / total) >> 18;
        until = cycle = std::min(5 * cycle >> 2, 64u);
    }
};

class Encoder {
  public:
    void symbol(Model& m, uint32_t s) {
        const uint32_t unit = length_ >> 15, low = m.begin[s] * unit;
        const uint32_t high = s + 1 == m.begin.size() ? length_ : m.begin[s + 1] * unit;
        add(low, high - low);
        ++m.count[s];
        if (--m.until == 0) m.update();
    }
    void bit(Bit& m, uint32_t b) {
        const uint32_t split = m.share * (length_ >> 13);
        if (b != 0) {
            add(split, length_ - split);
        } else {
            ++m.zeros;
            add(0, split);
        }
        if (--m.until == 0) m.update();
    }
    void bits(uint32_t v, uint32_t count) {
        if (count > 19) {
            raw(v & 0xffffu, 16);
            bits(v >> 16, count - 16);
        } else {
            raw(v, count);
        }
    }
    void word(uint32_t v) {
        raw(v & 0xffffu, 16);
        raw(v >> 16, 16);
    }
    std::vector<uint8_t> finish() {
        const bool longer = length_ > 2u << 24;
        add(longer ? 1u << 24 : 1u << 23, longer ? 1u << 23 : 1u << 15);
        out_.insert(out_.end(), longer ? 3 : 2, uint8_t{0});
        return std::move(out_);
    }

  private:
    void raw(uint32_t v, uint32_t count) {
        const uint32_t unit = length_ >> count;
        add(v * unit, unit);
    }
    void add(uint32_t low, uint32_t length) {
        if (base_ + low < base_)
            for (size_t i = out_.size(); i-- > 0 && ++out_[i] == 0;) {
            }
        base_ += low;
        for (length_ = length; length_ < 1u << 24; length_ <<= 8) {
            out_.push_back(static_cast<uint8_t>(base_ >> 24));
            base_ <<= 8;
        }
    }
    std::vector<uint8_t> out_;
    uint32_t base_ = 0, length_ = 0xffffffffu;
};

struct Integer {
    uint32_t bits = 32, last = 0;
    std::vector<Model> lengths, upper;
    Bit zero;
    Integer(uint32_t width, uint32_t contexts) : bits(width), lengths(contexts, Model(width + 1)) {
        for (uint32_t k = 1; k <= width; ++k) upper.emplace_back(1u << std::min(k, 8u));
    }
    void encode(Encoder& out, int32_t prediction, int32_t value, uint32_t context) {
        int64_t c = int64_t{value} - prediction;
        const int64_t range = int64_t{1} << bits;
        if (c < -range / 2) c += range;
        if (c > range / 2 - 1) c -= range;
        uint32_t k = 0;
        for (uint64_t v = c <= 0 ? static_cast<uint64_t>(-c) : static_cast<uint64_t>(c - 1); v != 0; v >>= 1) ++k;
        last = k;
        out.symbol(lengths[context], k);
        if (k == 0) {
            out.bit(zero, static_cast<uint32_t>(c));
        } else if (k < 32) {
            const auto v = static_cast<uint32_t>(c < 0 ? c + (int64_t{1} << k) - 1 : c - 1);
            if (k <= 8) {
                out.symbol(upper[k - 1], v);
            } else {
                out.symbol(upper[k - 1], v >> (k - 8));
                out.bits(v & ((1u << (k - 8)) - 1), k - 8);
            }
        }
    }
};

/// Models that are made when first used.
struct Table {
    uint32_t symbols;
    std::map<uint32_t, Model> models;
    Model& operator[](uint32_t i) { return models.try_emplace(i, symbols).first->second; }
};

/// Median of the last five as the format keeps it.
struct Median {
    std::array<int32_t, 5> v{};
    bool high = true;
    int32_t get() const { return v[2]; }
    void add(int32_t x) {
        if (high) {
            if (x < v[2]) {
                v[4] = v[3];
                v[3] = v[2];
                const size_t at = x < v[0] ? 0 : x < v[1] ? 1 : 2;
                for (size_t i = 2; i > at; --i) v.at(i) = v.at(i - 1);
                v.at(at) = x;
            } else {
                if (x < v[3]) v[4] = v[3];
                v.at(x < v[3] ? 3 : 4) = x;
                high = false;
            }
        } else if (v[2] < x) {
            v[0] = v[1];
            v[1] = v[2];
            const size_t at = v[4] < x ? 4 : v[3] < x ? 3 : 2;
            for (size_t i = 2; i < at; ++i) v.at(i) = v.at(i + 1);
            v.at(at) = x;
        } else {
            if (v[1] < x) v[0] = v[1];
            v.at(v[1] < x ? 1 : 0) = x;
            high = true;
        }
    }
};

template <typename T>
T load(const uint8_t* p) {
    T v{};
    std::memcpy(&v, p, sizeof(T));
    return v;
}
template <typename T>
void put(std::vector<uint8_t>& out, T v) {
    const size_t at = out.size();
    out.resize(at + sizeof(T));
    std::memcpy(out.data() + at, &v, sizeof(T));
}
template <typename T>
void store(uint8_t* p, T v) {
    std::memcpy(p, &v, sizeof(T));
}
inline int32_t minus(int32_t a, int32_t b) {
    return static_cast<int32_t>(static_cast<uint32_t>(a) - static_cast<uint32_t>(b));
}

}  // namespace stipple::test::laz
