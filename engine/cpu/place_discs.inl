// Records as discs in camera space, with the boxes of pixels that they reach. Included by kernels.inl, once per
// instruction set.

/// Normals of what wind bends are not as long as they were.
inline void makeUnit(size_t count, float* __restrict x, float* __restrict y, float* __restrict z) {
#pragma GCC ivdep
    for (size_t i = 0; i < count; ++i) {
        const float shorten = 1.0f / std::sqrt(max(x[i] * x[i] + y[i] * y[i] + z[i] * z[i], 1.0e-37f));
        x[i] *= shorten;
        y[i] *= shorten;
        z[i] *= shorten;
    }
}

/// Boxes of discs that are not wholly before the eye, one by one.
void boxNearDiscs(const FrameConstants& f, uint32_t count, const SplatReach& reach, SplatBlock& out) {
    const float around = reach.sigmas * reach.support;
    const int margin = int(reach.support * std::sqrt(reach.lowPass) + 1.0f);
    const int lastX = int(f.width) - 1, lastY = int(f.height) - 1;
    for (size_t i = 0; i < count; ++i) {
        if (out.keep[i] != 2u) continue;
        const WideDisc d{
            {out.cx[i], out.cy[i], out.cz[i]}, {out.nx[i], out.ny[i], out.nz[i]}, out.radius[i] * around, 0u};
        const CentrePixel c = centrePixel(d, f);
        const DiscBox box = discBox(d, f);
        const bool isEmpty = box.x.last < box.x.first || box.y.last < box.y.first || reachesPicture(d, f) < 0.5f;
        out.keep[i] = !isEmpty || c.x >= 0 ? 1u : 0u;
        const int wider = reach.lowPass > 0.0f ? margin : 0;
        out.firstX[i] = isEmpty ? c.x : box.x.first > wider ? box.x.first - wider : 0;
        out.lastX[i] = isEmpty ? c.x : box.x.last < lastX - wider ? box.x.last + wider : lastX;
        out.firstY[i] = isEmpty ? c.y : box.y.first > wider ? box.y.first - wider : 0;
        out.lastY[i] = isEmpty ? c.y : box.y.last < lastY - wider ? box.y.last + wider : lastY;
    }
}

void placeSplats(const FrameConstants& frame, const DrawNode& drawNode, const PointRecord* records, uint32_t count,
                 const SplatReach& reach, SplatBlock& out) {
    const FrameConstants f = frame;
    const DrawNode node = drawNode;
    const float focal = f.focal, nearPlane = f.nearPlane, midX = f.centre.x, midY = f.centre.y;
    const float lastX = float(f.width) - 1.0f, lastY = float(f.height) - 1.0f;
    const float bx = node.base.x, by = node.base.y, bz = node.base.z, ax = node.axisX.x, ay = node.axisX.y,
                az = node.axisX.z, bbx = node.axisY.x, bby = node.axisY.y, bbz = node.axisY.z, ccx = node.axisZ.x,
                ccy = node.axisZ.y, ccz = node.axisZ.z;
    const NormalAxes m = normalAxes(node);
    const float least = node.spacing * reach.leastSpacings, sigmas = reach.sigmas, support = reach.support,
                lowPass = reach.lowPass;
    const float edge = node.edge * f.supportScale, scattered = largestSplat(kFlagScattered, focal, f.height);
    const uint32_t errorCode = node.errorCode, octantMask = node.octantMask;
    const Lens lens = lensHere(focal);
    const uint* __restrict const words = &records->positionXY;  // four words a record
#pragma GCC ivdep
    for (size_t i = 0; i < count; ++i) {
        const PointRecord r{words[4 * i], words[4 * i + 1], words[4 * i + 2], words[4 * i + 3]};
        const float qx = float(int(recordX(r))), qy = float(int(recordY(r))), qz = float(int(recordZ(r)));
        const float cx = bx + ax * qx + bbx * qy + ccx * qz;
        const float cy = by + ay * qx + bby * qy + ccy * qz;
        const float cz = bz + az * qx + bbz * qy + ccz * qz;
        const vec3 d = octDecode(r.normal);
        const vec3 sight = sightTo(lens, vec3(cx, cy, cz));
        const float away = -1.0f / std::sqrt(max(dot(sight, sight), 1.0e-37f));
        const bool isFree = (recordFlags(r) & kFlagNoNormal) != 0u;
        const float nx = isFree ? sight.x * away : (m.x.x * d.x + m.y.x * d.y + m.z.x * d.z) * m.scale;
        const float ny = isFree ? sight.y * away : (m.x.y * d.x + m.y.y * d.y + m.z.y * d.z) * m.scale;
        const float nz = isFree ? sight.z * away : (m.x.z * d.x + m.y.z * d.y + m.z.z * d.z) * m.scale;
        const float cap =
            (recordFlags(r) & kFlagScattered) != 0u ? max(lensDepth(lens, cz), 0.0f) * scattered : 3.0e38f;
        const float stored = edge * radiusFractionFast(recordRadiusCode(r));
        const float radius = min(max(stored, min(least, kOpaqueRadii * stored)), cap);
        out.cx[i] = cx;
        out.cy[i] = cy;
        out.cz[i] = cz;
        out.nx[i] = nx;
        out.ny[i] = ny;
        out.nz[i] = nz;
        out.radius[i] = radius;
        out.colour[i] = r.colour;
        const float isLoose = (recordFlags(r) & (kFlagScattered | kFlagLeaf)) != 0u ? 1.0f : 0.0f;
        out.alone[i] = max(isLoose, kAloneDiameters * stored >= node.spacing ? 0.0f : 1.0f) > 0.5f ? kAlone : 0u;
        const float drawnHere = float(int(octantMask >> recordOctant(r) & 1u));  // a bool would keep GCC from SIMD
        const bool fine = (recordErrorCode(r) <= errorCode) | (drawnHere > 0.5f);
        const bool seen = ((recordFlags(r) & (kFlagTwoSided | kFlagNoNormal)) != 0u) |
                          (nx * sight.x + ny * sight.y + nz * sight.z < 0.0f);
        const bool faces = !isFree | (cz > nearPlane);
        out.keep[i] = fine & seen & faces & (cz + radius * sigmas * support > nearPlane) ? 1u : 0u;
    }
    if ((node.octantMask & kNodeBent) != 0u) makeUnit(count, out.nx, out.ny, out.nz);
        // The pixels whose centres lie in the box of its image, and the one that holds its centre.
#pragma GCC ivdep
    for (size_t i = 0; i < count; ++i) {
        const vec3 centre(out.cx[i], out.cy[i], out.cz[i]);
        const WideDisc d{centre, vec3(out.nx[i], out.ny[i], out.nz[i]), out.radius[i], 0u};
        const EwaKernel k = ewaKernel(d, d.radius * sigmas, support, lowPass, lens);
        const float toImage = focal / lensDepth(lens, centre.z);
        const float atX = std::floor(centre.x * toImage + midX), atY = std::floor(centre.y * toImage + midY);
        // A hundredth is for rounding.
        const float x0 = min(std::ceil(k.x - k.halfX + (midX - 0.51f)), atX),
                    x1 = max(std::floor(k.x + k.halfX + (midX - 0.49f)), atX);
        const float y0 = min(std::ceil(k.y - k.halfY + (midY - 0.51f)), atY),
                    y1 = max(std::floor(k.y + k.halfY + (midY - 0.49f)), atY);
        const bool isNear = k.isNear > 0.5f;
        const bool isInside = isNear | ((x1 >= 0.0f) & (x0 <= lastX) & (y1 >= 0.0f) & (y0 <= lastY));
        out.firstX[i] = int(min(max(x0, 0.0f), lastX));
        out.lastX[i] = int(min(max(x1, 0.0f), lastX));
        out.firstY[i] = int(min(max(y0, 0.0f), lastY));
        out.lastY[i] = int(min(max(y1, 0.0f), lastY));
        out.keep[i] = isInside ? (isNear ? 2u * out.keep[i] : out.keep[i]) : 0u;
    }
    boxNearDiscs(f, count, reach, out);
}
