// One build: from input files to a verified store.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "engine/base/executor.h"
#include "engine/base/process.h"
#include "engine/base/progress.h"
#include "engine/base/ranks.h"
#include "lod/primitives/primitives.h"
#include "lod/store/description.h"

namespace stipple::lod {

enum class NormalsMode { automatic, keep, none };

/// What happens to what an interrupted build to the same output left.
enum class Leftovers {
    goOn,           ///< the build goes on with it; refused if it is of other input or has other settings
    goOnOrReplace,  ///< likewise, but then it goes
    replace,        ///< it goes
};

/// What any build may use.
struct BuildLimits {
    uint64_t memoryBytes = uint64_t{2} << 30;  ///< never needs more; refuses if it would have to
    std::string tempFolder;                    ///< for what does not fit in memory; empty: beside the output
    std::function<bool()> isStopped;  ///< asked now and then, by any thread; true: stop with ErrorKind::interrupted
    Leftovers leftovers = Leftovers::goOn;
    /// Others that build the same with the same settings; each builds its share, the first one writes. What they have
    /// for each other lies in `tempFolder`, which all must see.
    Ranks* ranks = nullptr;
    bool surfelWeights =
        false;  ///< measured and kept with the points (weights/add.h); refused for what has other records
};

struct BuildSettings : BuildLimits {
    NormalsMode normals = NormalsMode::automatic;
    bool estimateRadii = true;  ///< where the file has none; false: half the lattice unit is all a point gets
    std::optional<UpAxis> up;   ///< instead of the format's own
    uint32_t leafRecords = 8192;
    std::vector<std::string> attributes;  ///< kept as named streams
    bool allAttributes = false;           ///< every attribute of the input, beside `attributes`
    bool leaveOutUnlike = false;          ///< of those: what files store in different ways is left out, with a note
    /// Opens one input; empty: openPointSource. For inputs that this library does not know (scenes with meshes).
    std::function<Result<PointSource>(const std::string& path, const ReadOptions& options)> open;
    bool skipBad = false;                   ///< go on past corrupt chunks and files, and count what is lost
    std::optional<PointMaterial> material;  ///< of all points, instead of what the input says
    bool fineNormals = false;               ///< of points: each from its own twelve nearest, at three times the time
    bool mergeDuplicates = false;           ///< of points at one place keep one
    bool dropOutliers = false;              ///< of points: leave out what points/outliers.h finds
};

struct BuildReport {
    std::string primitive = "point";  ///< what the numbers below count: point, triangle or segment
    uint64_t pointsIn = 0, pointsOut = 0;
    std::map<std::string, uint64_t> dropped;  ///< reason -> points
    std::map<std::string, uint64_t> added;    ///< likewise: pointsIn + added = pointsOut + dropped
    uint64_t skippedFiles = 0;                ///< inputs that could not be opened (only with skipBad)
    std::vector<std::string> notes;           ///< what was odd about the input
    std::vector<std::string> coarseNotes;     ///< what coarse levels are: of pictures, each says what it shows of them
    uint64_t nodes = 0, records = 0, bytesOut = 0, contentHash = 0;
    PatchCounts patches;
    double seconds = 0;
    /// Of the stages one after the other; "threads: ...": of all threads together, within "build", but for what those
    /// do that help with the bucket of another.
    std::map<std::string, double> stageSeconds;
    uint64_t temporaryBytes = 0;  ///< on disk, at most
    bool isResumed = false;
};

/// Seconds of each stage of a build, into its report.
class StageClock {
  public:
    explicit StageClock(BuildReport& report) : report_(report), start_(nowSeconds()), last_(start_) {}
    void ends(const char* stage) {
        const double now = nowSeconds();
        report_.stageSeconds[stage] += now - last_;
        last_ = now;
    }
    double seconds() const { return nowSeconds() - start_; }

  private:
    BuildReport& report_;
    double start_, last_;
};

/// Reads `inputs`, writes `output` (whole or not at all). The same input and settings give the same bytes for any
/// number of threads.
Result<BuildReport> buildStore(const std::vector<std::string>& inputs, const std::string& output,
                               const BuildSettings& settings, Executor& executor, Progress& progress);

}  // namespace stipple::lod
