// The frames of `render`: drawn, timed, and each judged by whether it shows what was asked for.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "apps/stipple/camera_options.h"
#include "apps/stipple/effect_walk.h"
#include "apps/stipple/legend.h"
#include "engine/image/coverage.h"
#include "engine/render/accumulation.h"
#include "engine/render/frame.h"
#include "engine/render/pruning.h"

namespace stipple::app {

/// What is drawn, and what may be missing.
struct FramesPlan {
    const Shot* shot = nullptr;
    std::string output, resident;  ///< as on the command line
    int repeats = 1;               ///< of a single view, for timing
    render::Exposure exposure;
    Executor* executor = nullptr;
    bool noWait = false, skipBad = false, quiet = false, printNames = false;
    image::PictureFormat format{};
    const Legend* legend = nullptr;  ///< that pictures of a path get
};

struct Timings {
    std::vector<double> frames;
    std::vector<std::string> passNames;
    std::vector<std::vector<double>> passes;
    double firstImageMs = 0, completeMs = 0;
    void add(double frameMs, const std::vector<render::PassTime>& times);
};

/// Why chunks that a view wants are not there.
struct MissingChunks {
    uint64_t unreadable = 0, noRoom = 0;
    std::string failure;  ///< of one that cannot be read
};

/// How far the pictures fall short of what was asked for: of many, the worst one.
struct Verdict {
    size_t pictures = 0, incomplete = 0;
    size_t empty = 0;               ///< complete ones that show nothing of the scene
    size_t worst = 0;               ///< its number
    bool isTruncated = false;       ///< of one even the coarsest level exceeds the budget
    double tauEffectivePixels = 0;  ///< of the worst, as all that follows; infinite where records are left out
    uint64_t leavesAround = 0;      ///< leaves of patches around the eye, whose distance from the source no error says
    MissingChunks missing;
    render::PrunedShares pruned;  ///< what the error does not speak of
    uint64_t recordsWanted = 0;   ///< by the error asked for; 0: not looked for
    bool isComplete() const { return incomplete == 0 && !isTruncated; }
    /// `view`: of what is pruned; null: they are not wanted.
    void judge(const render::FrameState& state, const lod::View* view);
    /// One more frame of the picture that was judged last: it is as complete as the least complete of its frames.
    void judgeSample(const render::FrameState& state);
    bool lastMisses = false;  ///< is the last picture one of the incomplete?
};

/// What of the pictures is there.
struct Written {
    size_t pictures = 0, of = 1;
    EffectWalk walk;  ///< what effects they show
};

/// out.png -> out_0007.png
std::string numbered(const std::string& path, size_t index);

/// Is no pixel covered by anything?
bool showsNothing(const render::Image& image);
/// One line where some pictures show nothing.
void sayEmpty(size_t empty, size_t pictures, const std::string& output);

/// Draws all views; writes a picture of each if there are several, leaves that of a single one in `state`.
Result<void> runFrames(const FramesPlan& plan, const render::FrameSettings& settings, render::FrameState& state,
                       Timings& timings, Written& written, Verdict& verdict);

/// Where the budget leaves an error that says nothing: how many records the asked one takes, and a note.
void sayIfUseless(const FramesPlan& plan, const render::FrameSettings& settings, const render::FrameState& state,
                  Verdict& verdict);

/// What becomes of pictures that are written and miss something: an error, unless the plan permits it (then a note).
Result<void> checkVerdict(const FramesPlan& plan, const Verdict& verdict);

}  // namespace stipple::app
