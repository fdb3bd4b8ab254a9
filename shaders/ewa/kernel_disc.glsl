// A disc with all that blending it takes.
#include "../filtered.glsl"

struct KernelDisc {
    WideDisc disc;
    EwaKernel kernel;
    DepthRange range;
    vec3 colour;
    TexelSurface surface;
    float scale;
    float rough;
    float side;  // roughSide
};
KernelDisc kernelDisc(WideDisc d, DrawNode node, PointRecord r) {
    KernelDisc p;
    const float sigma = d.radius / kOpaqueSigmas;
    p.disc = d;
    p.kernel = ewaKernel(d, sigma, frame.kernelSupport, frame.lowPass, frameLensHere());
    p.range = depthRange(d, sigma, frame.kernelSupport, frame.lowPass, frameLensHere());
    p.colour = pointColour(node, r);
    p.surface = surfaceOf(d.id, node);
    p.scale = scaleOf(d.id, node);
    p.rough = roughness(d, r);
    p.side = roughSide(recordFlags(r));
    return p;
}
