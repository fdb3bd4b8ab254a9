// Pictures of scenes, on a device.
#pragma once

#include <stipple/image.h>
#include <stipple/scene.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace stipple::v1 {

/// What draws; any number of renderers share one. It lives as long as any of them does. Only one thread at a time may
/// draw on it: a second one gets an error (usage).
class STIPPLE_API Device {
  public:
    /// Copies share what they are of; what has been moved from is a copy, too.
    Device(const Device&) = default;
    Device& operator=(const Device&) = default;
    /// auto (a GPU if there is one), cpu, gpu, gpu:NAME, or reference (fp64, slow: what the others are held to).
    static Result<Device> open(const std::string& name = "auto", unsigned threads = 0);
    std::string name() const;

    struct Held;

  private:
    friend class Renderer;
    explicit Device(std::shared_ptr<Held> held) : held_(std::move(held)) {}
    std::shared_ptr<Held> held_;
};

struct RenderSettings {
    double errorPixels = 1;                 ///< tolerated screen-space error
    uint64_t budgetRecords = 0;             ///< drawn at most: the error rises to meet it. 0: no limit
    std::string mode = "surface";           ///< surface, pullpush, pullpush-exact, points, splat or ewa
    std::string effects = "scene";          ///< as `stipple render --effects`: scene, auto, none, or names with commas
    std::vector<std::string> effectValues;  ///< NAME.PARAMETER=VALUE
    std::string shade = "auto";             ///< auto, lit or unlit
    std::array<uint8_t, 3> background{39, 39, 44};  ///< sRGB
    std::string environment;      ///< HDR picture all around that lights the scene (equirectangular); empty: none
    double environmentScale = 1;  ///< factor of its light
    bool environmentIsBackground = false;  ///< it is seen behind the scene, too, instead of `background`
    double windShare = 0;                  ///< how far tops of plants move at most, share of their height
    double seconds = 0;                    ///< of the wind
    bool wantDepthAndNormal = false;       ///< and linear colours
};

/// What became of a frame.
struct FrameInfo {
    bool isComplete = false;              ///< nothing that the view wants is missing
    double errorPixels = 0;               ///< what the picture keeps; infinite: nothing states it yet
    uint64_t records = 0, triangles = 0;  ///< drawn
    uint64_t nodes = 0;                   ///< drawn
    uint64_t residentBytes = 0;           ///< of what is kept on the device
    double milliseconds = 0;              ///< of drawing
};

class STIPPLE_API Renderer {
  public:
    /// `residentBytes`: of what it keeps on the device. Where that does not suffice, `render` is an error (budget), and
    /// `renderFrame` draws coarser.
    static Result<Renderer> create(const Device& device, const Scene& scene,
                                   uint64_t residentBytes = uint64_t{1} << 30);
    Renderer(Renderer&&) noexcept;
    Renderer& operator=(Renderer&&) noexcept;
    ~Renderer();

    /// Waits for what the view wants: the same picture, whatever was drawn before and however slow the disk is. Never
    /// less than that: an error (input: it cannot be read; budget: it does not fit).
    Result<Image> render(const Camera& camera, uint32_t width, uint32_t height, const RenderSettings& settings = {});
    /// Draws at once, with what is there, and asks for the rest: call it once a frame. `image` keeps its memory.
    Result<FrameInfo> renderFrame(const Camera& camera, uint32_t width, uint32_t height, Image& image,
                                  const RenderSettings& settings = {});
    /// Of the last frame.
    FrameInfo info() const;

    struct Held;

  private:
    explicit Renderer(std::unique_ptr<Held> held);
    std::unique_ptr<Held> held_;
};

}  // namespace stipple::v1
