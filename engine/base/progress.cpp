#include "engine/base/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>

#include "engine/base/process.h"
#include "engine/base/text.h"

namespace stipple {

Progress::Progress(bool enabled, bool json)
    : enabled_(enabled), terminal_(!json && ::isatty(STDERR_FILENO) != 0), startSeconds_(nowSeconds()) {
    lastPrintSeconds_ = startSeconds_;
}

Progress::~Progress() {
    if (dirty_ && terminal_) std::fputs("\r\033[K", stderr);
}

void Progress::say(const std::string& line) {
    if (!enabled_) return;
    const std::lock_guard lock(mutex_);
    if (dirty_ && terminal_) std::fputs("\r\033[K", stderr);
    const std::string shown = printable(line);
    if (terminal_) {
        fmt::print(stderr, "{}\n", shown);
    } else {
        std::string text;
        for (const char c : shown) text += c == '"' || c == '\\' ? std::string{'\\', c} : std::string{c};
        fmt::print(stderr, "{{\"note\": \"{}\"}}\n", text);
    }
    dirty_ = false;
}

void Progress::update(const std::string& stage, uint64_t done, uint64_t total) {
    if (!enabled_) return;
    const std::lock_guard lock(mutex_);
    const double now = nowSeconds();
    if (stage != stage_) {
        stage_ = stage;
        stageSeconds_ = now;
    }
    if (now - lastPrintSeconds_ < (terminal_ ? 0.1 : 1.0)) return;
    lastPrintSeconds_ = now;
    const double fraction = total ? static_cast<double>(done) / static_cast<double>(total) : 0;
    const double elapsed = now - stageSeconds_;
    const double rate = elapsed > 0 ? static_cast<double>(done) / elapsed : 0;
    const double left = fraction > 0 ? elapsed * (1 - fraction) / fraction : 0;
    if (terminal_) {
        constexpr int kBar = 24;
        const int full = static_cast<int>(fraction * kBar + 0.5);
        fmt::print(stderr, "\r\033[K{:<10} [{:#<{}}{:<{}}] {:3.0f} %  {:.2f} M/s  {}{}  {:.0f} s left", stage, "", full,
                   "", kBar - full, 100 * fraction, rate * 1e-6, humanBytes(peakRssBytes()),
                   temporaryBytes_ > 0 ? fmt::format(" + {} on disk", humanBytes(temporaryBytes_)) : "", left);
        std::fflush(stderr);
        dirty_ = true;
    } else {
        fmt::print(
            stderr,
            "{{\"progress\": \"{}\", \"done\": {}, \"total\": {}, \"per_second\": {:.0f}, \"peak_rss_bytes\": {}, "
            "\"temporary_bytes\": {}, \"seconds\": {:.1f}, \"seconds_left\": {:.1f}}}\n",
            stage, done, total, rate, peakRssBytes(), temporaryBytes_.load(), now - startSeconds_, left);
    }
}

}  // namespace stipple
