// One more flag of records (record.h): a record that stands on the border of exact surfaces, as which what it belongs
// to goes on (Marroquim, Kraus & Cavalcanti 2008, 5.2). Sources whose colours are of the material
// (SourceInfo::isReflectance) tell it in the upper byte of PointBlock::colour.
#ifndef STIPPLE_SHARED_BORDER_H
#define STIPPLE_SHARED_BORDER_H
#include "types.h"
SHARED_BEGIN

const uint kFlagBorder = 32u;  // blends with the exact surface where it lies within what its own may be rough

SHARED_END
#endif
