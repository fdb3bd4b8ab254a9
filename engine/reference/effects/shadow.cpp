// Shadows: light asks for them (../past_maps.cpp).
#include "engine/reference/effects/effects.h"

namespace stipple::reference {

constinit const RestatedEffect shadowRestated{};

}  // namespace stipple::reference
