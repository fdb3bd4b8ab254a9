// The error that keeps frames within a time while somebody looks. Moving: damped (ALGORITHMS 2.4: at most 2 % finer and
// 10 % coarser a frame, nothing between 0.95 and 1 of the time). Still: finer until a frame takes too long, then
// coarser until none does, then at rest until the camera moves: it turns at most once, whatever the times are, so that
// it ends.
#pragma once

#include <algorithm>
#include <cmath>

namespace stipple::study {

class Steady {
  public:
    /// px; ms.
    Steady(double error, double budget) : error_(std::clamp(error, kLeast, kMost)), budget_(budget) {}
    static constexpr double kLeast = 0.25, kMost = 64;
    double error() const { return error_; }
    bool isAtRest() const { return phase_ == Phase::rest; }

    /// After a frame of `ms` at error(). `moved`: since the last one.
    void step(double ms, bool moved) {
        if (moved) phase_ = Phase::finer;
        if (phase_ == Phase::rest || !(ms > 0)) return;
        const double off = std::clamp(0.25 * std::log(ms / budget_), -0.02, 0.10);
        const bool isLong = ms > budget_, isShort = ms < 0.95 * budget_;
        const double before = error_;
        if (moved) {
            if (isLong || isShort) error_ = std::clamp(error_ * std::exp(off), kLeast, kMost);
            return;
        }
        if (isLong) phase_ = Phase::coarser;
        if (isLong || (isShort && phase_ == Phase::finer))
            error_ = std::clamp(error_ * std::exp(isLong ? std::max(off, 0.005) : off), kLeast, kMost);
        if (error_ == before) phase_ = Phase::rest;
    }

  private:
    enum class Phase { finer, coarser, rest };
    double error_, budget_;
    Phase phase_ = Phase::finer;
};

}  // namespace stipple::study
