// The effects, one a line: STIPPLE_EFFECT(name), in the order in which they are asked, and in which those of one stage
// run. Each has its manifest here (`nameEffect`), and an entry of the oracle (`nameRestated`,
// engine/reference/effects), which the linker asks for; its passes have theirs as any pass (../passes.inl).
//
// Light and what stands in its place are in every build; a build with -DSTIPPLE_EFFECTS=OFF leaves the others out, with
// all files and folders of their names, and the passes of ../passes.inl that are left out likewise.
#ifndef STIPPLE_ONLY_LIGHT
STIPPLE_EFFECT(shadow)
#endif
STIPPLE_EFFECT(light)
STIPPLE_EFFECT(environment)
STIPPLE_EFFECT(refraction)
STIPPLE_EFFECT(transparency)
#ifndef STIPPLE_ONLY_LIGHT
STIPPLE_EFFECT(wind)
STIPPLE_EFFECT(occlusion)
STIPPLE_EFFECT(edl)
STIPPLE_EFFECT(reflection)
STIPPLE_EFFECT(fog)
STIPPLE_EFFECT(tone)
STIPPLE_EFFECT(background)
#endif
