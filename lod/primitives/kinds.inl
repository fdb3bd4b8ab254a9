// The kinds of primitives, one a line: STIPPLE_KIND(name). Draw ids are in this order, so that of what is equally deep
// the earlier kind is seen; shaders/shared/visibility.h has the same order. Each has an entry wherever something is
// known of kinds, which the linker asks for: `nameKind` and `nameCodec` (lod/primitives/kinds), `nameDrawn`
// (engine/render/kinds), `nameOnCpu` and `nameOnGpu` (engine/cpu/passes, engine/gpu/passes), `nameRestated`
// (engine/reference).
STIPPLE_KIND(points)
STIPPLE_KIND(curves)
STIPPLE_KIND(triangles)
STIPPLE_KIND(patches)
