#include "lod/builder/patches/gaps.h"

namespace stipple::lod {

void fillGaps(PatchSet&) {}

}  // namespace stipple::lod
