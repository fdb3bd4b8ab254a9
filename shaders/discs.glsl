// The list of wide discs.
#extension GL_GOOGLE_include_directive : require
#include "bindings.glsl"
#include "shared/splat_disc.h"
#include "shared/wide_disc.h"

layout(set = 0, binding = kDiscsBinding, scalar) coherent buffer DiscBlock {
    uint discCount;
    WideDisc discs[];
};


// Does a point stand alone (splat_disc.h)?
bool standsAlone(uint id) {
    const DrawBlock source = blocks[id / kRecordsPerBlock];
    const DrawNode node = nodes[source.node];
    const PointRecord r = Records(uvec2(node.addressLow, node.addressHigh)).records[source.first + id % kRecordsPerBlock];
    return isAlone(recordFlags(r), node.edge * frame.supportScale * radiusFractionFast(recordRadiusCode(r)), node.spacing);
}
