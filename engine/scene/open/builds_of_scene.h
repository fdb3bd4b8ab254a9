// The cached builds of one scene as one job to who waits: one bar, one time left.
#pragma once

#include <algorithm>
#include <map>
#include <numeric>
#include <string>
#include <vector>

#include "engine/base/progress.h"

namespace stipple::scene {

class BuildsOfScene {
  public:
    /// `notes`: what who opens the scene says of its file.
    BuildsOfScene(ProgressStyle style, const ProgressCall& call, std::vector<std::string> notes)
        : progress_(style, call), notes_(std::move(notes)) {}
    bool says(const std::string& note) const { return std::find(notes_.begin(), notes_.end(), note) != notes_.end(); }
    /// A part that may have to be built, and about how long that takes, in any unit.
    void expect(const std::string& part, double work) { ahead_[part] = work; }
    /// Its build begins; what was not expected counts as one unit.
    Progress& begin(const std::string& part) {
        const auto found = ahead_.find(part);
        own_ = found != ahead_.end() ? found->second : 1;
        if (found != ahead_.end()) ahead_.erase(found);
        building_ = part;
        progress_.beginPart(done_, own_, ahead());
        return progress_;
    }
    /// It is there, built or found: it is not waited for any more.
    void settle(const std::string& part) {
        ahead_.erase(part);
        if (building_ != part) return;
        done_ += own_;
        building_.clear();
        progress_.rest();
    }

  private:
    double ahead() const {
        return std::accumulate(ahead_.begin(), ahead_.end(), 0.0,
                               [](double sum, const auto& part) { return sum + part.second; });
    }
    Progress progress_;
    std::vector<std::string> notes_;
    std::map<std::string, double> ahead_;
    double done_ = 0, own_ = 0;
    std::string building_;
};

}  // namespace stipple::scene
