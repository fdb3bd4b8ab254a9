// Modes by name, as tables and charts call them.
#pragma once

#include "engine/render/reconstructions/table.h"

namespace stipple::study {

inline const char* nameOf(render::Mode mode) { return render::reconstructionOf(mode).name; }

}  // namespace stipple::study
