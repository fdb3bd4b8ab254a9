#include "apps/study/sweep/tables.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "apps/study/mode_name.h"
#include "apps/study/plots/svg.h"
#include "apps/study/statistics/compare.h"

namespace stipple::study {
namespace {

/// Sentences on one configuration and the best of the panel at the same error asked for.
void addLosses(const Panel& panel, const Summary& s, std::vector<std::string>& out) {
    if (s.errors.beyond > 0)
        out.push_back(
            fmt::format("{} at {} px: {:.0f} of {:.0f} pixels ({:.4f} %) are farther from the full detail than stated, "
                        "{:.2f} px at "
                        "most (along outlines {:.0f}, closed gaps {:.0f}, between layers {:.0f}, other {:.0f})",
                        nameOf(s.of.mode), shortNumber(s.of.target), s.errors.beyond, s.errors.audited,
                        100 * s.errors.beyond / s.errors.audited, s.errors.lodMost, s.errors.outline, s.errors.gap,
                        s.errors.between, s.errors.other));
    const Summary* best = &s;
    for (const Summary* other : panel)
        if (other->of.target == s.of.target && other->errors.psnrForeground > best->errors.psnrForeground) best = other;
    const double behind = best->errors.psnrForeground - s.errors.psnrForeground;
    if (behind > 3)
        out.push_back(fmt::format("{} at {} px: {:.1f} dB behind {} ({:.1f} dB)", nameOf(s.of.mode),
                                  shortNumber(s.of.target), behind, nameOf(best->of.mode),
                                  best->errors.psnrForeground));
    if (s.errors.holes > 0 && s.errors.holes > 2 * best->errors.holes)
        out.push_back(
            fmt::format("{} at {} px: {:.0f} holes", nameOf(s.of.mode), shortNumber(s.of.target), s.errors.holes));
}

}  // namespace

Interval timesOf(const Summary& a, const Summary& b) { return ratioOf(a.visits, b.visits, kBandConfidence); }

std::vector<bool> frontOf(const Panel& panel) {
    std::vector<bool> is;
    for (const Summary* s : panel)
        is.push_back(std::none_of(panel.begin(), panel.end(), [&](const Summary* other) {
            return other != s && other->errors.psnrForeground > s->errors.psnrForeground && timesOf(*other, *s).low > 1;
        }));
    return is;
}

const Summary* quickestWith(const Panel& panel, render::Mode mode, double decibels) {
    const Summary* best = nullptr;
    for (const Summary* s : panel)
        if (s->of.mode == mode && s->errors.psnrForeground >= decibels && (!best || s->ms.middle < best->ms.middle))
            best = s;
    return best;
}

const Summary* bestWithin(const Panel& panel, render::Mode mode, double ms) {
    const Summary* best = nullptr;
    for (const Summary* s : panel)
        if (s->of.mode == mode && s->ms.high <= ms && (!best || s->errors.psnrForeground > best->errors.psnrForeground))
            best = s;
    return best;
}

std::vector<Alike> alikeOf(const Panel& panel) {
    std::vector<Alike> out;
    for (size_t i = 0; i < panel.size(); ++i)
        for (size_t k = i + 1; k < panel.size(); ++k) {
            if (panel[i]->of.target != panel[k]->of.target) continue;
            const Interval ratio = timesOf(*panel[i], *panel[k]);
            if (areAlike(ratio)) out.push_back({panel[i], panel[k], ratio});
        }
    return out;
}

std::vector<std::string> lossesOf(const Panel& panel) {
    std::vector<std::string> out;
    for (const Summary* s : panel) addLosses(panel, *s, out);
    const std::vector<bool> isFront = frontOf(panel);
    for (size_t i = 0; i < panel.size(); ++i) {
        const bool isFirst = i == 0 || panel[i]->of.mode != panel[i - 1]->of.mode;
        if (!isFirst) continue;
        bool isBeaten = true;
        for (size_t k = i; k < panel.size() && panel[k]->of.mode == panel[i]->of.mode; ++k)
            isBeaten = isBeaten && !isFront[k];
        if (isBeaten)
            out.push_back(
                fmt::format("{}: at every error asked for another mode is both nearer to the truth and quicker",
                            nameOf(panel[i]->of.mode)));
    }
    return out;
}

}  // namespace stipple::study
