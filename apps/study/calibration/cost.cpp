#include "apps/study/calibration/cost.h"

#include <algorithm>
#include <array>

#include "apps/study/statistics/intervals.h"

namespace stipple::study {
namespace {

constexpr size_t kTerms = 4;
using Terms = std::array<double, kTerms>;

Terms termsOf(const Load& load) { return {1, load.pixels, load.records, load.triangles}; }

/// Least squares of rows . x = 1 with x >= 0, by descent along one coordinate after the other.
Terms solve(const std::vector<Terms>& rows) {
    std::array<Terms, kTerms> squares{};
    Terms sums{}, x{};
    for (const Terms& row : rows)
        for (size_t i = 0; i < kTerms; ++i) {
            sums[i] += row[i];
            for (size_t k = 0; k < kTerms; ++k) squares[i][k] += row[i] * row[k];
        }
    for (int round = 0; round < 20'000; ++round)
        for (size_t i = 0; i < kTerms; ++i) {
            if (!(squares[i][i] > 0)) continue;
            double rest = sums[i];
            for (size_t k = 0; k < kTerms; ++k)
                if (k != i) rest -= squares[i][k] * x[k];
            x[i] = std::max(0.0, rest / squares[i][i]);
        }
    return x;
}

}  // namespace

CostModel fitCost(std::span<const CostSample> samples) {
    CostModel model;
    std::vector<Terms> rows;
    Terms most{};
    for (const CostSample& s : samples) {
        if (!(s.ms > 0)) continue;
        rows.push_back(termsOf(s.load()));
        for (double& term : rows.back()) term /= s.ms;
        for (size_t i = 0; i < kTerms; ++i) most[i] = std::max(most[i], rows.back()[i]);
    }
    if (rows.empty()) return model;
    for (Terms& row : rows)
        for (size_t i = 0; i < kTerms; ++i) row[i] /= most[i] > 0 ? most[i] : 1;
    Terms x = solve(rows);
    for (size_t i = 0; i < kTerms; ++i) x[i] /= most[i] > 0 ? most[i] : 1;
    model = {x[0], x[1], x[2], x[3], 1, 1};
    std::vector<double> off;
    for (const CostSample& s : samples)
        if (const double said = model.msOf(s.load()); s.ms > 0 && said > 0) off.push_back(s.ms / said);
    model.low = quantile(off, 0.05);
    model.high = quantile(std::move(off), 0.95);
    return model;
}

}  // namespace stipple::study
