// What a store is drawn as where it is small in a picture: levels of ever fewer records above those of its root, in the
// root's own chunk (a sequential point tree of its own, Dachsbacher et al. 2003). Each level has cells at least twice
// as large, down to one for all. Where normals of a cell look one way it has one record; otherwise one for each way
// along the axes from which much of it is seen: as large as what is seen from there, half way to the front of what the
// cell holds, and in the mean colour of all of it. (In colours of their own those that are seen edgewise would speckle
// the others: where all of a cell is a pixel, which of them is in front is chance.)
//
// All records of a level have one error, which is that of the next finer one's parents: so a view draws one level or
// the root's own records, never both. Codes of the overview are larger than the root's errorCode; what records of a
// chunk are of it, its counts tell (Hierarchy::overviewOf).
#pragma once

#include "lod/builder/points/levels.h"

namespace stipple::lod {

/// Of a root of many records or points; the errors are bounds as those of inner nodes are (levels.h).
void addOverview(const Frame& frame, PendingNode& root);

}  // namespace stipple::lod
