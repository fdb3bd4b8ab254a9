// The table of kinds.
#include <array>

#include "engine/render/kinds/kind.h"
#include "shaders/shared/visibility.h"

namespace stipple::render {

#define STIPPLE_KIND(name) +1
static_assert(0
#include "lod/primitives/kinds.inl"
                  == shared::kKindDiscs,
              "visibility.h has the kinds in the order of kinds.inl, then wide discs");
#undef STIPPLE_KIND

const DrawnKind& drawnKind(lod::Kind kind) {
    static constexpr std::array kTable{
#define STIPPLE_KIND(name) &name##Drawn,
#include "lod/primitives/kinds.inl"
#undef STIPPLE_KIND
    };
    return *kTable.at(static_cast<size_t>(kind));
}

}  // namespace stipple::render
