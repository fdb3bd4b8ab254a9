#include "apps/study/sweep/summary.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

namespace stipple::study {
namespace {

enum class Together { mean, most, sum, decibels };

Together howOf(double CellErrors::*column) {
    using E = CellErrors;
    for (const auto decibels : {&E::lodDecibels, &E::backendDecibels, &E::psnr, &E::psnrForeground, &E::leavesDecibels})
        if (column == decibels) return Together::decibels;
    for (const auto sum : {&E::audited, &E::beyond, &E::outline, &E::gap, &E::between, &E::other, &E::holes, &E::spill,
                           &E::shadowPixels, &E::shadowDark, &E::shadowWrong, &E::shadowBeyond})
        if (column == sum) return Together::sum;
    for (const auto most : {&E::stated, &E::lodMost, &E::lodP99, &E::depthP99, &E::bytes, &E::popP999, &E::popMost,
                            &E::popFaded, &E::flickerP99, &E::shadowMost, &E::shadowStated})
        if (column == most) return Together::most;
    return Together::mean;
}

double together(const std::vector<double>& values, Together how) {
    if (values.empty()) return CellErrors::kNone;
    double sum = 0, most = values.front();
    for (const double v : values) {
        sum += how == Together::decibels ? std::pow(10.0, -0.1 * v) : v;
        most = std::max(most, v);
    }
    const double mean = sum / static_cast<double>(values.size());
    switch (how) {
        case Together::mean:
            return mean;
        case Together::most:
            return most;
        case Together::sum:
            return sum;
        case Together::decibels:
            return -10 * std::log10(mean);
    }
    return CellErrors::kNone;
}

using Key = std::tuple<uint32_t, uint32_t, render::Mode, double, uint64_t>;
Key keyOf(const Cell& c) { return {c.scene, c.size, c.mode, c.target, c.records}; }

void addErrors(const StudyResult& result, const std::vector<uint32_t>& cells, Summary& s) {
    for (const ErrorColumn& column : errorColumns()) {
        std::vector<double> values;
        for (const uint32_t c : cells)
            if (const double v = result.errors[c].*column.value; !std::isnan(v)) values.push_back(v);
        s.errors.*column.value = together(values, howOf(column.value));
    }
    if (s.of.target != cropTarget(result.settings) || s.of.hasBudget()) return;
    for (const uint32_t c : cells)
        if (s.worst == ~0u || result.errors[c].psnrForeground < result.errors[s.worst].psnrForeground) s.worst = c;
}

void addTimes(const StudyResult& result, const std::vector<const Visit*>& visits, Summary& s) {
    s.blocks.resize(result.settings.blocks);
    std::vector<std::pair<std::string, std::pair<double, size_t>>> passes;
    for (const Visit* v : visits) {
        auto& block = s.blocks[v->block];
        block.insert(block.end(), v->ms.begin(), v->ms.end());
        s.visits.push_back(v->ms);
        for (const auto& [name, ms] : v->passes) {
            auto at = std::find_if(passes.begin(), passes.end(), [&, n = name](const auto& p) { return p.first == n; });
            if (at == passes.end()) at = passes.insert(passes.end(), {name, {0.0, 0}});
            at->second.first += ms;
        }
    }
    for (const auto& [name, sum] : passes) s.passes.emplace_back(name, sum.first / static_cast<double>(visits.size()));
    const uint64_t seed = result.settings.seed;
    s.ms = bootstrapQuantile(s.blocks, 0.5, kBandConfidence, seed);
    s.p95 = bootstrapQuantile(s.blocks, 0.95, kBandConfidence, seed);
    s.p99 = bootstrapQuantile(s.blocks, 0.99, kBandConfidence, seed);
}

}  // namespace

std::vector<Summary> summarise(const StudyResult& result) {
    std::vector<Summary> all;
    std::map<Key, size_t> at;
    std::vector<std::vector<uint32_t>> cells;
    std::vector<std::vector<const Visit*>> visits;
    for (uint32_t c = 0; c < result.cells.size(); ++c) {
        const Key key = keyOf(result.cells[c]);
        if (!at.count(key)) {
            at[key] = all.size();
            all.push_back({});
            all.back().of = result.cells[c];
        }
        cells.resize(all.size());
        cells[at[key]].push_back(c);
    }
    visits.resize(all.size());
    for (const Visit& v : result.visits) visits[at[keyOf(result.cells[v.cell])]].push_back(&v);
    for (size_t i = 0; i < all.size(); ++i) {
        // Blocks hold frames by cells, whatever order they were drawn in.
        std::sort(visits[i].begin(), visits[i].end(), [](const Visit* a, const Visit* b) {
            return std::pair(a->block, a->cell) < std::pair(b->block, b->cell);
        });
        addErrors(result, cells[i], all[i]);
        addTimes(result, visits[i], all[i]);
    }
    std::stable_sort(all.begin(), all.end(), [](const Summary& a, const Summary& b) {
        return std::pair(a.of.scene, a.of.size) < std::pair(b.of.scene, b.of.size);
    });
    return all;
}

std::vector<std::vector<const Summary*>> panelsOf(const std::vector<Summary>& all) {
    std::vector<std::vector<const Summary*>> panels;
    for (const Summary& s : all) {
        if (s.of.hasBudget()) continue;
        if (panels.empty() || panels.back().front()->of.scene != s.of.scene ||
            panels.back().front()->of.size != s.of.size)
            panels.emplace_back();
        panels.back().push_back(&s);
    }
    return panels;
}

std::vector<const Summary*> budgetsOf(const std::vector<Summary>& all, uint32_t scene, uint32_t size) {
    std::vector<const Summary*> out;
    for (const Summary& s : all)
        if (s.of.hasBudget() && s.of.scene == scene && s.of.size == size) out.push_back(&s);
    return out;
}

}  // namespace stipple::study
