// Discs of many pixels for which the list has no place: the workgroup of 256 that met them draws them together, one
// after the other. leaveNone(), then leave() from any thread, then a barrier, then leftIds[0 .. leftCount).
shared uint leftCount;
shared uint leftIds[256];

void leaveNone() {
    if (gl_LocalInvocationID.x == 0u) leftCount = 0u;
    barrier();
}
void leave(uint id) { leftIds[atomicAdd(leftCount, 1u)] = id; }

// The pixels of a box, shared out among the threads: number p of `first` to `last`, both in it.
ivec2 pixelOf(int p, ivec2 first, ivec2 last) {
    const int width = last.x - first.x + 1;
    return first + ivec2(p % width, p / width);
}
int pixelsOf(ivec2 first, ivec2 last) {
    const ivec2 size = max(last - first + 1, ivec2(0));
    return size.x * size.y;
}
