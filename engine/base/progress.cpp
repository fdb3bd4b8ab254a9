#include "engine/base/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <numeric>

#include "engine/base/numbers.h"
#include "engine/base/process.h"
#include "engine/base/text.h"

namespace stipple {
namespace {

void eraseLine() { std::fputs("\r\033[K", stderr); }

std::string quoted(const std::string& text) {
    std::string out = "\"";
    for (const char c : text) {
        if (c == '"' || c == '\\')
            out += {'\\', c};
        else if (static_cast<unsigned char>(c) < 0x20)
            out += fmt::format("\\u{:04x}", static_cast<unsigned>(c));
        else
            out += c;
    }
    return out + "\"";
}

}  // namespace

ProgressStyle automaticProgress() { return ::isatty(STDERR_FILENO) != 0 ? ProgressStyle::bar : ProgressStyle::notes; }

double JobPlan::advance(const std::string& stage, double done) {
    const auto ofWhole = [&] { return whole_ = std::max(whole_, from_ + share_ * reached_); };
    if (stages_.empty()) {
        reached_ = done;
        return share_ < 1 ? ofWhole() : reached_;
    }
    const double all =
        std::accumulate(stages_.begin(), stages_.end(), 0.0, [](double sum, const Stage& s) { return sum + s.share; });
    double before = 0;
    for (const Stage& s : stages_) {
        if (s.name == stage) {
            reached_ = std::max(reached_, (before + std::clamp(done, 0.0, 1.0) * s.share) / all);
            break;
        }
        before += s.share;
    }
    return ofWhole();
}

void JobPlan::setStages(std::vector<Stage> stages) {
    stages_ = std::move(stages);
    reached_ = 0;
}

void JobPlan::beginPart(double before, double own, double after) {
    const double all = std::max(before + own + after, 1e-300);
    from_ = before / all;
    share_ = own / all;
    setStages({});
}

Progress::Progress(ProgressStyle style, ProgressCall call)
    : style_(style), call_(std::move(call)), startSeconds_(nowSeconds()) {
    lastPrintSeconds_ = startSeconds_;
}

Progress::~Progress() {
    if (dirty_) eraseLine();
}

void Progress::plan(std::vector<JobPlan::Stage> stages) {
    const std::lock_guard lock(mutex_);
    plan_.setStages(std::move(stages));
}

void Progress::beginPart(double before, double own, double after) {
    const std::lock_guard lock(mutex_);
    plan_.beginPart(before, own, after);
}

void Progress::rest() {
    const std::lock_guard lock(mutex_);
    if (dirty_) eraseLine();
    dirty_ = false;
}

void Progress::say(const std::string& line) {
    if (style_ == ProgressStyle::silent) return;
    const std::lock_guard lock(mutex_);
    if (dirty_) eraseLine();
    const std::string shown = printable(line);
    dirty_ = false;
    if (style_ == ProgressStyle::json)
        fmt::print(stderr, "{{\"schema\": \"stipple.progress/1\", \"note\": {}}}\n", quoted(shown));
    else
        fmt::print(stderr, "note: {}\n", shown);
}

void Progress::update(const std::string& stage, uint64_t done, uint64_t total) {
    const bool isPrinted = style_ == ProgressStyle::bar || style_ == ProgressStyle::json;
    if (!isPrinted && !call_) return;
    const std::lock_guard lock(mutex_);
    const double now = nowSeconds();
    if (stage != stage_) {
        stage_ = stage;
        stageSeconds_ = now;
    }
    const double fraction = plan_.advance(stage, total ? static_cast<double>(done) / static_cast<double>(total) : 0);
    if (firstFraction_ < 0) firstFraction_ = fraction;
    if (now - lastPrintSeconds_ < (style_ == ProgressStyle::json ? 1.0 : 0.1)) return;
    lastPrintSeconds_ = now;
    const double elapsed = now - stageSeconds_, gone = fraction - firstFraction_;
    const double rate = elapsed > 0 ? static_cast<double>(done) / elapsed : 0;
    const double left = gone > 0 ? (now - startSeconds_) * (1 - fraction) / gone : -1;
    if (call_) call_({stage, fraction, left});
    if (style_ == ProgressStyle::bar)
        printBar(fraction, rate, left);
    else if (style_ == ProgressStyle::json)
        printJson(done, total, fraction, rate, left);
}

void Progress::printBar(double fraction, double rate, double left) {
    constexpr int kBar = 24;
    const int full = toWhole<int>(std::clamp(fraction, 0.0, 1.0) * kBar + 0.5);
    const uint64_t onDisk = temporaryBytes_;
    eraseLine();
    fmt::print(stderr, "[{:#<{}}{:<{}}] {:3.0f} %  {:<10}  {:.2f} M/s  {}{}{}", "", full, "", kBar - full,
               100 * fraction, stage_, rate * 1e-6, humanBytes(peakRssBytes()),
               onDisk > 0 ? fmt::format(" + {} on disk", humanBytes(onDisk)) : "",
               left < 0 ? "" : fmt::format("  {:.0f} s left", left));
    std::fflush(stderr);
    dirty_ = true;
}

void Progress::printJson(uint64_t done, uint64_t total, double fraction, double rate, double left) const {
    fmt::print(stderr,
               "{{\"schema\": \"stipple.progress/1\", \"progress\": {}, \"done\": {}, \"total\": {}, \"fraction\": "
               "{:.4f}, \"per_second\": {:.0f}, \"peak_rss_bytes\": {}, \"temporary_bytes\": {}, \"seconds\": {:.1f}, "
               "\"seconds_left\": {}}}\n",
               quoted(stage_), done, total, fraction, rate, peakRssBytes(), temporaryBytes_.load(),
               nowSeconds() - startSeconds_, left < 0 ? "null" : fmt::format("{:.1f}", left));
}

}  // namespace stipple
