// For each effect of the table: a scene and settings in which it shows, and the same where it is asked for and nothing
// calls for it. Tests over the whole table take theirs from here; an effect that is not named here is asked for by its
// name alone.
#pragma once

#include <string>
#include <vector>

#include "engine/render/frame.h"
#include "tests/support/support.h"

namespace stipple::test {

/// Points without light on them, plants that bend, and a house: what any effect may need, but glass.
std::vector<render::PlacedStore> effectStores(const std::string& folder, Executor& executor);
/// From before them; `away`: with nothing of them in the picture.
lod::View effectView(uint32_t width, uint32_t height, bool away = false);

/// Asks for the effect, and gives it what it needs to show.
void addEffect(const std::string& name, Executor& executor, render::DrawSettings& settings);
/// Asks for it as far as asking goes, where the frame has no use for it. False: such a frame is not known here.
bool addUselessly(const std::string& name, Executor& executor, render::DrawSettings& settings);
/// Does it show where nothing is in view?
bool isOfNothing(const std::string& name);

/// Places in the table, of all but glass (whose layers are frames of their own: GlassImages).
std::vector<size_t> listedEffects();

}  // namespace stipple::test
