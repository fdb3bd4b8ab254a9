// One workgroup per block of 256 draw ids: every disc and each pixel that it may matter at; those of many pixels are in the
// list (ewa_front.comp), or, where it is full, the workgroup's. useDisc(disc, pixel): of the pass that includes this.
#include "../left_discs.glsl"
layout(local_size_x = 256) in;

const int kMostPixels = 1024;

void eachOwn() {
    const uint block = gl_WorkGroupID.x + gl_WorkGroupID.y * kGroupsPerDimension;
    if (block >= frame.firstBlock.of[kKindCurves]) return;
    const DrawBlock source = blocks[block];
    if (source.first + gl_LocalInvocationID.x >= nodes[source.node].count) return;
    DrawNode node;
    const uint id = block * kBlockLanes + gl_LocalInvocationID.x;
    const PointRecord r = recordOf(id, node);
    const WideDisc d = opaqueDisc(node, r, id);
    if (isSplatSeen(node, r, d, frame.nearPlane, frameLensHere()) < 0.5) return;
    const KernelDisc p = kernelDisc(d, node, r);
    WideDisc reach = d;
    reach.radius = d.radius / kOpaqueSigmas * frame.kernelSupport;
    if (p.kernel.isNear > 0.5 && reachesPicture(reach, frame) < 0.5) return;
    const PixelBox box = boxOf(d, p.kernel);
    const ivec2 size = box.last - box.first + 1;
    if (size.x <= 0 || size.y <= 0) return;
    if (size.x * size.y > kMostPixels) {
        if (discCount > kDiscCapacity) leave(id);  // else the list holds all
        return;
    }
    for (int y = box.first.y; y <= box.last.y; ++y)
        for (int x = box.first.x; x <= box.last.x; ++x) useDisc(p, ivec2(x, y));
}

void eachOfBlock() {
    leaveNone();
    eachOwn();
    barrier();
    for (uint i = 0u; i < leftCount; ++i) {
        DrawNode node;
        const PointRecord r = recordOf(leftIds[i], node);
        const KernelDisc p = kernelDisc(opaqueDisc(node, r, leftIds[i]), node, r);
        const PixelBox box = boxOf(p.disc, p.kernel);
        const int pixels = pixelsOf(box.first, box.last);
        for (int at = int(gl_LocalInvocationID.x); at < pixels; at += 256) useDisc(p, pixelOf(at, box.first, box.last));
    }
}
