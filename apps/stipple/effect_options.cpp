#include "apps/stipple/effect_options.h"

#include "apps/stipple/options.h"
#include "engine/render/effects/table.h"

namespace stipple::app {

void addEffects(CLI::App& sub, std::vector<std::string>& effects) {
    std::vector<std::string> names;
    std::string help;
    for (const render::Effect* e : render::effects()) {
        if (e->isRequested != nullptr) continue;
        names.emplace_back(e->name);
        help += std::string(help.empty() ? "" : "; ") + e->name + ": " + e->summary;
    }
    if (!names.empty()) sub.add_option("--effect", effects, help)->check(oneOf(names))->type_name("NAME");
}

}  // namespace stipple::app
