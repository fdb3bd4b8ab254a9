// The input of a build, read as often as it takes: first surveyed, then delivered as points on one lattice. Scanner
// integers stay what they are: the lattice unit is the files' scale. For floating-point input the unit is a power of
// two, 2^-21 of the extent; where that is no small part of the spacing (objects far apart, a point far outside of all
// others) it follows from the spacing and from the extent without what is far out.
#pragma once

#include <functional>
#include <memory>
#include <optional>

#include "engine/base/numbers.h"
#include "lod/builder/build.h"
#include "lod/builder/lattice.h"
#include "lod/builder/octree/bytes.h"
#include "lod/builder/points/kept_points.h"
#include "lod/builder/points/outliers.h"
#include "lod/builder/points/points.h"

namespace stipple::lod {

inline constexpr size_t kBlockPoints = 8192;  ///< that a reader gives at once: what they take stays in the second cache

class PointInput {
  public:
    static Result<PointInput> open(const std::vector<std::string>& inputs, const BuildSettings& settings,
                                   BuildReport& report);

    /// What is known before a point is read.
    uint64_t declared() const { return declared_; }
    const std::vector<AttributeInfo>& attributes() const { return attributes_; }
    const std::string& firstPath() const { return sources_.front().info.path; }

    /// Of names, sizes and times of the files: does a build that was interrupted go on with the same input?
    uint64_t identity() const;

    /// Reads everything once: bounds, which parts are corrupt, what the colours mean. Fills `report`. `keepsPoints`: of
    /// points on a lattice the places stay in memory (12 bytes a point), of compressed ones in parts that are not large
    /// all that was read (6 for a colour, and what attributes take), so that read() need not decompress them again.
    Result<void> survey(BuildReport& report, Executor& executor, Progress& progress, bool keepsPoints = false);
    /// Nobody asks for places alone any more.
    void dropPlaces();
    /// One for each worker, to be given to one whole read() and then to concludeOutliers(); none where nothing is far
    /// or outliers are known.
    std::vector<FarCubes> farCubes(int workers) const;
    void concludeOutliers(const std::vector<FarCubes>& far, BuildReport& report);
    /// Outliers that were kept lie outside of this; lattice units.
    Bounds withoutOutliers() const;
    /// What the survey found, for a build that was interrupted: load instead of survey.
    void save(ByteWriter& to);
    Result<void> load(ByteReader& from, BuildReport& report);

    // After that:
    glm::dvec3 origin{0};
    double unit = 1;
    double resolution = 0;  ///< how near to each other points lie where they are dense, lattice units; 0: not known
    std::array<uint64_t, 3> greatest{};  ///< of the coordinates; the least are 0
    uint64_t span = 0;                   ///< that the root's cell covers: all coordinates, and the narrowest given disc
    uint64_t points = 0;                 ///< that can be used
    Points sample;                       ///< places of every sampleShare-th point, about
    uint64_t sampleShare = 1;
    std::vector<PointMaterial> materials;  ///< of all; several: the last of attributes() counts them
    bool hasColour = false, hasNormal = false, hasRadius = false, isReflectance = false;
    UpAxis up = UpAxis::z;
    Crs crs;
    std::string source;

    /// Calls sink(points) for all points, in blocks, from several threads at once; a thread has one `worker` number
    /// below `workers`. Fails if the input is not what was surveyed. Returns the largest rounding of a coordinate,
    /// world units. What all was kept of is given once: then it goes.
    using Sink = std::function<Result<void>(int worker, const Points& block)>;
    /// Parts [begin, end), before which lie that many points.
    struct Range {
        size_t begin = 0, end = ~size_t{0};
        uint64_t before = 0;
    };
    size_t parts() const { return parts_.size(); }
    /// The parts after `range` that hold `points` points or a little more.
    Range nextRange(const Range& range, uint64_t points) const;
    enum class Wanted { all, places };
    Result<double> read(Executor& executor, int workers, Progress& progress, const std::string& stage,
                        const Range& range, const Sink& sink, Wanted wanted = Wanted::all,
                        std::vector<FarCubes>* far = nullptr) const;

  private:
    struct Part {
        size_t source = 0, index = 0;
        uint64_t count = 0;  ///< declared
        // Found by the survey.
        std::optional<Error> error;
        uint64_t usable = 0, notFinite = 0, beyond = 0;  ///< beyond: kFarthestPlace
        glm::ivec3 lo{INT32_MAX}, hi{INT32_MIN};
        glm::dvec3 least{1e300}, greatest{-1e300};
        float narrowest = 0;  ///< of the radii that are given, file units; 0: none is
        uint32_t colourMax = 0;
        uint64_t firstColour = 0;
        bool hasColour = false, isVaried = false;
        std::vector<glm::dvec3> sample;  ///< as in the file: steps or world units
        std::vector<glm::dvec3> places;  ///< likewise, each once
        Bounds near;                     ///< of what is not far, where outliers are left out; common coordinates
        uint64_t far = 0;
    };

    Result<void> openAll(const std::vector<std::string>& inputs, const BuildSettings& settings, BuildReport& report);
    Result<PointSource> openInput(const std::string& path, const ReadOptions& options) const;
    Result<void> collectNames(const std::vector<std::string>& files, ReadOptions& options, BuildReport& report) const;
    Result<void> adopt(PointSource source, const ReadOptions& options, std::vector<bool>& found, BuildReport& report);
    void findMaterials();
    bool isOwnPart(size_t part) const;
    void exchangeParts();
    void putPart(size_t i, ByteWriter& to);
    void getPart(size_t i, ByteReader& from);
    Result<void> conclude(BuildReport& report);
    Result<void> checkParts() const;
    void tally(BuildReport& report);
    Result<void> surveyPart(Part& part, PointBlock& block) const;
    size_t numberOf(const Part& part) const { return static_cast<size_t>(&part - parts_.data()); }
    std::unique_ptr<KeptPoints> roomToKeep(bool keepsPoints) const;
    bool isKept(const Part& part, KeptPoints::What what) const { return kept_ && kept_->has(numberOf(part), what); }
    Result<PointReader> openPart(const Part& part, Wanted wanted) const;
    void surveyBounds(const PointBlock& block, size_t count, Part& part) const;
    void surveyColours(const PointBlock& block, size_t count, Part& part) const;
    void findSpan();
    void findDenseBox();
    Result<void> findOutliers(Executor& executor);
    Result<void> findFar(Part& part, PointBlock& block, FarCubes& cubes) const;
    FarCubes together(const std::vector<FarCubes>& far) const;
    void sayOutliers(BuildReport& report) const;
    bool isLeavingOut() const { return settings_.dropOutliers || outliersRuin_; }
    bool leavesOut() const { return isLeavingOut() && outliers_.any(); }
    glm::dvec3 commonOf(size_t from, const PointBlock& block, size_t i) const;
    Bounds boundsOf(const Part& part) const;
    Bounds bounds() const;
    Bounds worldBounds(const Part& part) const;
    std::vector<std::string> notesOnPlaces() const;
    Result<void> placeIntegers(BuildReport& report);
    Result<void> placeFloats();
    void findColours(BuildReport& report);
    void placeSample();
    bool isWide() const { return span >> 32 != 0; }
    Result<void> readPart(const Part& part, Wanted wanted, PointBlock& block, Points& points, double& rounding,
                          FarCubes* far, const std::function<Result<void>(const Points&)>& sink) const;
    size_t leaveOut(const Part& part, PointBlock& block, size_t count, uint64_t& far) const;
    void place(const Part& part, const PointBlock& block, size_t count, Points& out, double& rounding) const;
    void placeWide(const Part& part, const PointBlock& block, size_t count, Points& out, double& rounding) const;
    template <typename Put>
    void placeEach(const Part& part, const PointBlock& block, size_t count, Points& out, const Put& put) const;
    bool isWithin(const Points& block) const;
    void fill(const Part& part, const PointBlock& block, Points& out) const;
    void fillMaterials(const Part& part, const PointBlock& block, size_t count, std::vector<uint8_t>& out) const;

    BuildSettings settings_;
    std::vector<PointSource> sources_;
    std::vector<Part> parts_;
    std::unique_ptr<KeptPoints> kept_;
    std::vector<AttributeInfo> attributes_;
    std::vector<std::vector<uint8_t>> materialOf_;  ///< of each source: its materials' numbers in `materials`
    CommonLattice lattice_;                         ///< where all sources are lattices
    Outliers outliers_;
    std::vector<bool> isWide_;  ///< colours of a source have 16 bits
    std::vector<uint32_t> sourceColourMax_;
    /// Of the points without the farthest, in the coordinates that all share: see spacing.h.
    struct Dense {
        double spacing = 0, extent = 0, farthest = 0;
    };
    Dense dense_;
    glm::dvec3 least_{0};  ///< steps of the common lattice
    double step_ = 1;      ///< of the common lattice, for what 32 bits cannot hold
    uint64_t declared_ = 0;
    bool allLattice_ = true, isBlack_ = false;
    bool outliersRuin_ = false;  ///< the places of all others
    std::string crsPath_;
};

}  // namespace stipple::lod
