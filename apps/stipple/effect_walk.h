// Which effects came and went along a camera path.
#pragma once

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "engine/render/effect_status.h"

namespace stipple::app {

struct EffectChange {
    size_t picture = 0;  ///< the first that has it, or has it no more
    std::string effect, calledForBy;
    bool came = true;
};

class EffectWalk {
  public:
    /// After picture number `picture`; one after another. Of the first, all that it shows came.
    void look(size_t picture, const std::vector<render::EffectStatus>& status);
    const std::vector<EffectChange>& changes() const { return changes_; }

  private:
    std::map<std::string, std::string> shown_;  ///< by name, who called for it
    std::vector<EffectChange> changes_;
};

/// picture, effect, change (came or went), called_for_by.
nlohmann::json changesJson(const std::vector<EffectChange>& changes);
/// A line for each.
std::string changesText(const std::vector<EffectChange>& changes);

}  // namespace stipple::app
