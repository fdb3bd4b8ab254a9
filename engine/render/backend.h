// Backend: what draws. The cpu and gpu backends (and the fp64 reference) take the same draw list and the same list of
// passes, and give the same kind of image.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "engine/base/result.h"
#include "engine/render/draw_list.h"
#include "engine/render/reconstructions/table.h"
#include "streaming/streamer.h"

namespace stipple::render {

struct PassTime {
    std::string name;
    double ms = 0;
    bool isBeside = false;  ///< ran beside passes of the frame before: no part of their sum
};

/// A finished image. Row-major, top row first.
struct Image {
    uint32_t width = 0, height = 0;
    std::vector<uint32_t> rgba;  ///< r | g << 8 | b << 16 | coverage << 24; sRGB
    std::vector<float> depth;    ///< linear, world units; 0: background. Only if asked for.
    std::vector<float> normal;   ///< x y z per pixel, world space, eye-facing. Only if asked for.
    std::vector<float> linear;   ///< r g b per pixel, linear, background included. Only if asked for.
};

struct RenderRequest {
    const DrawList* draws = nullptr;
    Mode mode = Mode::pullpush;
    std::vector<Pass> passes;  ///< of the mode, for what the draw list calls for
    bool wantDepthAndNormal = false;
    /// What a light meets first, drawn before the frame that it lights: depths, and as colours what leaves let through.
    /// The image has no normals and no linear colours then.
    bool isOfCasters = false;
    /// Points that are hidden behind others need not be drawn, as far as that changes no bit of the picture.
    bool mayHideNodes = false;
    /// Which of them are hidden is wanted (Backend::hiddenNodes), also where that makes nothing faster.
    bool tellsHiddenNodes = false;
    /// The picture is to be shown by the device that draws it (gpu::Window): where there is such a device it is not
    /// copied to the host, and read has none.
    bool staysOnDevice = false;
};

/// Of points, what was not drawn because it is hidden behind what was.
struct HiddenCounts {
    uint64_t nodes = 0, records = 0;
};

/// What a backend holds for one effect.
struct EffectResources {
    uint64_t pipelines = 0;  ///< compiled for its passes (cpu: none ever are)
    uint64_t bytes = 0;      ///< of its tables and planes, and of what is kept between passes because of it
    bool operator==(const EffectResources&) const = default;
};

/// What a backend holds beyond what every frame needs: 0 for what no scene has called for yet.
struct BackendResources {
    uint64_t meshPipelines = 0;            ///< compiled for triangles
    uint64_t meshBytes = 0;                ///< per-pixel and per-frame buffers for triangles
    uint64_t emissiveBytes = 0;            ///< per-pixel buffer for emissive materials
    uint64_t textureTiles = 0;             ///< resident
    uint64_t curvePipelines = 0;           ///< compiled for ribbons and tubes
    uint64_t curveBytes = 0;               ///< per-frame buffers for them
    uint64_t lightPipelines = 0;           ///< compiled for light
    uint64_t effectBytes = 0;              ///< tables and planes that only effects need
    std::vector<EffectResources> effects;  ///< of each of the table of effects
};

/// A frame that was handed in; numbers rise.
struct Ticket {
    uint64_t number = 0;
};

class Backend : public streaming::ChunkSink {
  public:
    virtual std::string name() const = 0;    ///< "cpu", "gpu", "reference"
    virtual std::string device() const = 0;  ///< for a person
    /// Hands in a frame, which may be drawn while the caller goes on: nothing of the request must outlive the call.
    /// Where too many are in flight it waits for the oldest, whose picture, if nobody has read it, is given up.
    virtual Result<Ticket> submit(const RenderRequest& request) = 0;
    /// True if read would not wait.
    virtual bool isDone(Ticket ticket) const = 0;
    /// Waits for a frame and hands over its picture, once, into `image`, whose storage is reused.
    virtual Result<void> read(Ticket ticket, Image& image) = 0;
    /// Both; where nothing is gained by waiting, straight into `image`.
    virtual Result<void> render(const RenderRequest& request, Image& image) {
        STIPPLE_ASSIGN(const Ticket ticket, submit(request));
        return read(ticket, image);
    }
    /// Waits until a frame is drawn, whose picture stays where it is.
    virtual Result<void> finish(Ticket) { return {}; }
    virtual BackendResources resources() const { return {}; }
    /// Of the frame that was read or finished last; nothing of backends that draw all that is handed in.
    virtual HiddenCounts hidden() const { return {}; }
    /// Likewise the nodes of points, as numbers in its draw list, that are hidden with all that they stand for: no
    /// pixel would change if they were refined, either. Null: that was not looked for.
    virtual const std::vector<uint32_t>* hiddenNodes() const { return nullptr; }
    /// Of the frame that was read or finished last.
    virtual const std::vector<PassTime>& passTimes() const = 0;

    /// Numbers of `count` sources of chunks that nobody else has who draws with this backend: the first of them.
    uint32_t claimSources(uint32_t count) {
        claimed_ += count;
        return claimed_ - count;
    }
    /// Ends with the backend: whoever may outlive it asks before going on.
    std::weak_ptr<const void> life() const { return life_; }

  private:
    uint32_t claimed_ = 0;
    std::shared_ptr<const int> life_ = std::make_shared<const int>(0);
};

/// A backend that draws where a frame is handed in: nothing is in flight.
class DrawsAtOnce : public Backend {
  public:
    Result<Ticket> submit(const RenderRequest& request) final;
    bool isDone(Ticket) const final { return true; }
    Result<void> read(Ticket ticket, Image& image) final;
    Result<void> render(const RenderRequest& request, Image& image) final;
    const std::vector<PassTime>& passTimes() const final { return times_; }

  protected:
    virtual void draw(const RenderRequest& request, Image& image) = 0;
    std::vector<PassTime> times_;  ///< of draw

  private:
    Image image_;  ///< of the last frame, until it is read
    bool isRead_ = true;
    uint64_t submitted_ = 0;
};

/// What read says of a picture that was read or given up.
tl::unexpected<Error> noSuchPicture(Ticket ticket);

}  // namespace stipple::render
