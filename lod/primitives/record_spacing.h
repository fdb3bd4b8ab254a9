// How far records of a node lie from each other.
#pragma once

#include <cstdint>
#include <span>

#include "shaders/shared/record.h"

namespace stipple::lod {

/// The spacing of records on their surface, in steps of their lattice: that of a square grid of as many. The median
/// over some of them, each from its sixth neighbour, about which half of a grid's lie; 0 of fewer than 7 records, and
/// where most lie on top of each other. Within a tenth of the true one on even samples (RecordSpacing tests).
float recordSpacing(std::span<const shared::PointRecord> records);

/// As a store keeps it: eighths of octaves from one step on, rounded up; 0: not known.
uint8_t spacingCodeUp(float steps);
/// Steps; 0: not known.
float spacingOfCode(uint8_t code);

}  // namespace stipple::lod
