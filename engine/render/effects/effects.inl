// The effects, one a line: STIPPLE_EFFECT(name), in the order in which they are asked, and in which those of one stage
// run. Each has its manifest here (`nameEffect`), and an entry of the oracle (`nameRestated`, engine/reference/effects),
// which the linker asks for; its passes have theirs as any pass (../passes.inl).
STIPPLE_EFFECT(wind)
STIPPLE_EFFECT(light)
STIPPLE_EFFECT(shadow)
STIPPLE_EFFECT(environment)
STIPPLE_EFFECT(refraction)
