// What a reader asks of a study first.
#pragma once

#include "apps/study/sweep/summary.h"

namespace stipple::study {

using Panel = std::vector<const Summary*>;

/// Of `a` and `b`, visit by visit: b's time over a's, 95 %.
Interval timesOf(const Summary& a, const Summary& b);

/// Which of a panel nothing else beats: another one that is nearer to the truth (dB, foreground) and whose time is
/// smaller with its whole interval.
std::vector<bool> frontOf(const Panel& panel);

/// The quickest of a mode that has at least so many dB; null: none has.
const Summary* quickestWith(const Panel& panel, render::Mode mode, double decibels);
/// The one of a mode nearest to the truth whose band ends below `ms`.
const Summary* bestWithin(const Panel& panel, render::Mode mode, double ms);

/// Modes of which neither is quicker at one error asked for.
struct Alike {
    const Summary *a = nullptr, *b = nullptr;
    Interval ratio;
};
std::vector<Alike> alikeOf(const Panel& panel);

/// Where a mode loses: sentences.
std::vector<std::string> lossesOf(const Panel& panel);

}  // namespace stipple::study
