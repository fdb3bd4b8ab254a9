// Wind once more: places bend where they are decoded (../decode.h).
#include "engine/reference/effects/effects.h"

namespace stipple::reference {

constinit const RestatedEffect windRestated{};

}  // namespace stipple::reference
