// Quantiles of frame times and how sure they are. Frames of one block follow each other and are alike, so blocks are
// what is drawn again (block bootstrap: Efron & Tibshirani 1993, chapter 8), not frames.
#pragma once

#include <cstdint>
#include <vector>

namespace stipple::study {

/// Frame times, ms, by repeat block.
using Blocks = std::vector<std::vector<double>>;

struct Interval {
    double low = 0, middle = 0, high = 0;
    bool overlaps(const Interval& other) const { return low <= other.high && other.low <= high; }
};

/// Of values in any order, between the two nearest ranks in proportion (type 7 of Hyndman & Fan 1996). `q` 0 to 1. No
/// values: nan.
double quantile(std::vector<double> values, double q);
std::vector<double> pooled(const Blocks& blocks);

/// The quantile of all frames with the interval that holds `confidence` of what `draws` bootstraps of the blocks give.
/// The same seed gives the same interval. One block: low and high are its quantile, which says nothing.
Interval bootstrapQuantile(const Blocks& blocks, double q, double confidence, uint64_t seed, int draws = 400);

}  // namespace stipple::study
