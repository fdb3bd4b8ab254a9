// The passes of a frame, one a line: STIPPLE_PASS(name, the planes that it reads, those that it writes, does it read of
// what the pass before wrote nothing but its own pixel: then both may run in the same tile). Each backend has an entry
// for each of them (engine/cpu/passes, engine/gpu/passes: `namePass`), which the linker asks for.
STIPPLE_PASS(clear, (Planes{}), (Planes{visibility, discList}), false)
STIPPLE_PASS(smooth, (Planes{visibility}), (Planes{visibility, discList, smooth}), false)
STIPPLE_PASS(project, (Planes{}), (Planes{visibility, discList}), false)
STIPPLE_PASS(discs, (Planes{discList}), (Planes{visibility, discList}), false)
STIPPLE_PASS(splat, (Planes{}), (Planes{visibility, discList}), false)
STIPPLE_PASS(exact, (Planes{visibility}), (Planes{visibility, discList, texels}), false)
STIPPLE_PASS(ewa, (Planes{visibility}), (Planes{visibility, discList, filtered}), false)
STIPPLE_PASS(curves, (Planes{}), (Planes{visibility}), false)
STIPPLE_PASS(rasterise, (Planes{}), (Planes{visibility}), false)
STIPPLE_PASS(patches, (Planes{}), (Planes{visibility}), false)
STIPPLE_PASS(resolve, (Planes{visibility, discList, filtered}), (Planes{texels}), false)
STIPPLE_PASS(pull, (Planes{texels}), (Planes{coarse}), false)
STIPPLE_PASS(push, (Planes{texels, coarse}), (Planes{coarse}), false)
STIPPLE_PASS(surface, (Planes{visibility, texels, coarse, smooth}), (Planes{surface}), false)
STIPPLE_PASS(light, (Planes{surface, shadows}), (Planes{surface}), true)
STIPPLE_PASS(refract, (Planes{surface}), (Planes{surface}), true)
STIPPLE_PASS(output, (Planes{surface, filtered, behind}), (Planes{image}), true)
STIPPLE_PASS(cast, (Planes{surface}), (Planes{image}), true)
#ifndef STIPPLE_ONLY_LIGHT
STIPPLE_PASS(occlusion, (Planes{surface}), (Planes{surface}), false)
STIPPLE_PASS(shadow, (Planes{surface}), (Planes{shadows}), true)
STIPPLE_PASS(edl, (Planes{surface}), (Planes{surface}), false)
STIPPLE_PASS(fog, (Planes{surface}), (Planes{surface}), true)
STIPPLE_PASS(tone, (Planes{surface}), (Planes{surface}), true)
STIPPLE_PASS(background, (Planes{surface}), (Planes{behind}), true)
#endif
