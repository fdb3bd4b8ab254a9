// When the window draws: only while something changes. Pure functions and small values, so that tests need no window.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/scene/camera.h"

namespace stipple::app {

/// What goes on between two looks at the user's hands.
struct Activity {
    bool isHidden = false;     ///< minimised
    bool hasChanged = false;   ///< camera, settings, the window itself
    bool isMoving = false;     ///< wind, a camera path: every frame differs
    bool hasArrived = false;   ///< chunks are there that were not drawn yet
    bool isStreaming = false;  ///< chunks are on their way
    bool isOpening = false;    ///< another scene is being opened
    double untilNotice = 1e9;  ///< seconds until a line on the screen goes
};
struct Pace {
    bool draws = false;
    double waitSeconds = 0;  ///< for events, before the next look
};
inline Pace paceOf(const Activity& a) {
    constexpr double kIdle = 0.5, kOpening = 0.25, kStreaming = 0.004;
    if (a.isHidden) return {false, kIdle};
    const bool draws = a.hasChanged || a.isMoving || a.hasArrived;
    if (a.isMoving) return {draws, 0};
    const double wait = a.isStreaming ? kStreaming : a.isOpening ? kOpening : kIdle;
    return {draws, std::clamp(a.untilNotice, 1e-3, wait)};
}

/// A picture that is drawn in a quicker way while something moves, and once more when it rests.
class Refinement {
  public:
    /// Before a picture is drawn; `canBeQuick`: it has such a way. True: draw it that way.
    bool isQuick(bool canBeQuick, bool moves) {
        isOwed_ = canBeQuick && moves;
        return isOwed_;
    }
    /// Has nothing changed for so long that it is to be drawn once more? `isAtRest`: at this look.
    bool isDue(bool isAtRest) {
        looks_ = isAtRest ? looks_ + 1 : 0;
        return isOwed_ && looks_ >= kLooks;
    }
    static constexpr int kLooks = 2;

  private:
    bool isOwed_ = false;
    int looks_ = 0;
};

/// Frames that are added up while nothing changes; what changes drops them.
class Accumulating {
  public:
    explicit Accumulating(uint32_t most) : most_(most) {}
    /// Is one more to be drawn? `isAtRest`: at this look.
    bool isDue(bool isAtRest) {
        looks_ = isAtRest ? looks_ + 1 : 0;
        return most_ > 1 && count_ < most_ && looks_ >= Refinement::kLooks;
    }
    void add() { ++count_; }
    void clear() { count_ = 0; }
    /// Is their mean shown? A few would move the picture by a part of a pixel.
    bool isShown() const { return count_ >= std::min(kLeast, most_); }
    uint32_t count() const { return count_; }
    uint32_t most() const { return most_; }
    static constexpr uint32_t kLeast = 8;

  private:
    uint32_t most_, count_ = 0;
    int looks_ = 0;
};

/// Lines on the screen that go after a while.
class Notices {
  public:
    struct Notice {
        std::string text;
        bool isError = false;
        double until = 0;
    };
    static constexpr double kSeconds = 8;
    static constexpr size_t kMost = 5;

    void add(std::string text, bool isError, double now) {
        lines_.push_back({std::move(text), isError, now + kSeconds});
        if (lines_.size() > kMost) lines_.erase(lines_.begin());
    }
    /// True if a line went.
    bool expire(double now) {
        return std::erase_if(lines_, [now](const Notice& n) { return n.until <= now; }) > 0;
    }
    double untilNext(double now) const {
        double seconds = 1e9;
        for (const Notice& n : lines_) seconds = std::min(seconds, n.until - now);
        return seconds;
    }
    const std::vector<Notice>& lines() const { return lines_; }

  private:
    std::vector<Notice> lines_;
};

/// Goes along a camera path.
class PathPlayer {
  public:
    PathPlayer() = default;
    /// `speed`: seconds of the path in a second. One that `loops` begins again at its end.
    PathPlayer(scene::CameraPath path, double speed, bool loops)
        : path_(std::move(path)), speed_(speed), loops_(loops), isPlaying_(!path_.keys.empty()) {}
    bool hasPath() const { return !path_.keys.empty(); }
    bool isPlaying() const { return isPlaying_; }
    void pause() { isPlaying_ = false; }
    /// Pauses, or goes on; from the start if it was at the end.
    void toggle() {
        if (!hasPath()) return;
        isPlaying_ = !isPlaying_;
        if (isPlaying_ && seconds_ >= path_.duration()) seconds_ = 0;
    }
    void advance(double seconds) {
        if (!isPlaying_) return;
        seconds_ += seconds * speed_;
        if (seconds_ < path_.duration()) return;
        isPlaying_ = loops_ && path_.duration() > 0;
        seconds_ = isPlaying_ ? std::fmod(seconds_, path_.duration()) : path_.duration();
    }
    scene::Camera camera() const { return path_.at(path_.keys.front().t + seconds_); }

  private:
    scene::CameraPath path_;
    double speed_ = 1, seconds_ = 0;
    bool loops_ = false, isPlaying_ = false;
};

}  // namespace stipple::app
