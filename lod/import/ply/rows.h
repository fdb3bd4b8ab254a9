// Rows of a PLY file, all three encodings: a property of any type may feed x y z nx ny nz red green blue radius; what
// is not known is stepped over, lists included.
#pragma once

#include <functional>
#include <memory>

#include "engine/base/cursor.h"
#include "lod/import/ply/header.h"
#include "lod/primitives/primitives.h"

namespace stipple::lod {

constexpr size_t kPlyBlockBytes = size_t{4} << 20;
/// How many of the 255 steps of a channel one unit of a file's colours is. Bytes are what they are. Wider integers are
/// bytes too, unless one is above 255 (as LAS has it); floats are shares of 1, bytes or 16 bits, by the largest there
/// is. (Largest: a little beyond 1 or 255 still counts as that, rendered colours overshoot.)
double plyColourScale(PlyType type, double largest);

/// Kept as f64, as f32 would not be exact.
inline bool isWide(PlyType type) { return type == PlyType::f64 || type == PlyType::i32 || type == PlyType::u32; }

class PlyReader {
  public:
    /// `wanted`: how many attributes the properties' slots ask for; `colourScale`: see plyColourScale.
    PlyReader(std::shared_ptr<const ByteSource> file, PlyHeader header, size_t wanted, double colourScale = 1);
    /// The scale of a file's colours; its vertices are read for that where their type leaves it open. As far as the
    /// file can be read: what is wrong with it is told by who reads it.
    static double colourScaleOf(const std::shared_ptr<const ByteSource>& file, const PlyHeader& header);
    /// The next rows of the element 'vertex', at most `limit`; 0 at the end.
    Result<size_t> read(PointBlock& block, size_t limit);
    /// After the last vertex: where the elements behind it begin.
    uint64_t offset() const { return cursor_.offset(); }

    /// Corners of one row of an element behind the vertices, or a part of them, the first part of a row first; or of
    /// several rows of three corners each.
    struct Corners {
        bool isStrip = false, isFirst = false, areTriangles = false;
        const std::vector<double>& list;
    };
    /// Rows of the elements behind the vertices that have corners; `offset`: where they begin.
    Result<void> readCorners(uint64_t offset, const std::function<Result<void>(const Corners&)>& take);

  private:
    Result<void> begin();
    tl::unexpected<Error> truncated() const;
    Result<void> readRow(const PlyElement& element, double* values);
    Result<void> readAsciiRow(const PlyElement& element, double* values);
    tl::unexpected<Error> badNumber(const PlyElement& element) const;
    Result<void> flushCorners(bool areTriangles = false);
    Result<uint64_t> readTriangles(const PlyElement& element, uint64_t most);

    std::shared_ptr<const ByteSource> file_;
    PlyHeader header_;
    Cursor cursor_;
    size_t wanted_;
    double colourScale_;
    std::vector<std::pair<size_t, bool>> attributes_;  ///< slot, stored as f64
    const PlyElement* vertex_ = nullptr;
    uint64_t next_ = 0;
    bool started_ = false;
    const PlyElement* rowsOf_ = nullptr;       ///< whose corners are read
    uint64_t row_ = 0;                         ///< of those
    const PlyProperty* cornerList_ = nullptr;  ///< of the element that is read
    const std::function<Result<void>(const Corners&)>* take_ = nullptr;
    std::vector<double> list_;
    bool isStrip_ = false, isFirst_ = false;
};

}  // namespace stipple::lod
