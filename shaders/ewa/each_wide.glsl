// The same for the list of discs of many pixels: workgroup (x, y) works on the rows of band y of every 64th of them.
layout(local_size_x = 256) in;

void eachOfList() {
    const uint count = discCount <= kDiscCapacity ? discCount : 0u;
    const int firstRow = int(gl_WorkGroupID.y) * int(kBandRows);
    for (uint i = gl_WorkGroupID.x; i < count; i += gl_NumWorkGroups.x) {
        DrawNode node;
        const PointRecord r = recordOf(discs[i].id, node);
        const KernelDisc p = kernelDisc(discs[i], node, r);
        const PixelBox box = boxOf(p.disc, p.kernel);
        const ivec2 rows = ivec2(max(box.first.y, firstRow), min(box.last.y, firstRow + int(kBandRows) - 1));
        const int width = box.last.x - box.first.x + 1;
        if (width <= 0 || rows.y < rows.x) continue;
        const int pixels = width * (rows.y - rows.x + 1);
        for (int at = int(gl_LocalInvocationID.x); at < pixels; at += 256)
            useDisc(p, ivec2(box.first.x + at % width, rows.x + at / width));
    }
}
