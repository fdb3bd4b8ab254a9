// The oracle, fp64 and scalar; it shares no formula with the backends.
//   restate: each mode once more, plainly, on a given cut: what a backend's implementation error is measured against.
//   trace:   discs and triangles of the full detail hit by rays: what the reconstruction error is measured against.
//   metrics: how far two images are apart.
#pragma once

#include <memory>

#include "engine/base/executor.h"
#include "engine/render/frame.h"
#include "lod/store/store.h"

namespace stipple::reference {

/// A backend that restates modes pullpush and points in fp64.
std::unique_ptr<render::Backend> makeReferenceBackend(Executor& executor);

struct TraceSettings {
    uint32_t samplesPerAxis = 4;  ///< N x N rays per pixel
    render::DrawSettings draw;
};
/// Rays against the full detail of a scene. A triangle shows its own surface, textured at the width of a ray; at a
/// front disc, colours and normals of the discs within the front thickness are blended with the kernel (1 - rho^2)^2.
/// Samples are averaged in linear light, alpha is coverage; depth (linear, along the view axis) and normal (world
/// space, towards the eye) are those of the ray through the pixel's centre, not averaged. Points have the colours of
/// PlacedStore::colour, stray ones are as small as in other modes; proxies are not looked at.
Result<render::Image> trace(const std::vector<render::PlacedStore>& placed, const lod::View& view,
                            const TraceSettings& settings, Executor& executor);

/// The full detail of a scene, read once for any number of pictures.
class FullScene {
  public:
    virtual ~FullScene() = default;
    /// As reference::trace.
    virtual Result<render::Image> trace(const lod::View& view, const TraceSettings& settings,
                                        Executor& executor) const = 0;
};
/// The stores must outlive what is read of them.
Result<std::unique_ptr<FullScene>> readFullScene(const std::vector<render::PlacedStore>& placed, Executor& executor);

struct ImageDifference {
    double psnr = 0;               ///< dB over all pixels (colour over black where transparent); infinity if equal
    double foregroundPsnr = 0;     ///< dB where either image has coverage
    int maxDiff = 0;               ///< largest channel difference
    double differingFraction = 0;  ///< pixels with a channel more than `threshold` apart
    bool hasCoverage = false;      ///< either image has pixels that nothing covers: else the next two tell nothing
    double silhouetteIou = 1;      ///< of the pixels with coverage >= 1/2
    uint64_t holes = 0;            ///< pixels empty in A whose 5 x 5 neighbourhood is covered in B
};
/// `b` is the reference. Sizes must agree.
Result<ImageDifference> compareImages(const render::Image& a, const render::Image& b, int threshold,
                                      render::Image* difference);

}  // namespace stipple::reference
