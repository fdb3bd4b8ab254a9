// The other half of a record's error: how far places of its disc are from the leaves. (The first half, how far the
// leaves are from the disc, is its slab: see levels.h.)
//
// A leaf within the error E of all places of a circle of the disc's plane lets that circle be drawn. The disc keeps E
// if such circles cover it:
//
//        ___-----___        o o  leaves, each with the circle that is within E of it: of a leaf at height h over the
//      /  o  .  o    \           plane that is its own disc, wider by sqrt(E^2 - h^2)
//     |  .       . o  |      .   what none of them reaches: the inside of a ring, the window of a wall
//      \  o . o     /
//        ---_____---
//
// Whether they do is seen along rays from the disc's centre (fan.h), which errs towards larger errors only.
#pragma once

#include "lod/builder/points/aggregate.h"

namespace stipple::lod {

/// What of one node lies where: its points, or where those are not at hand its children's records. Nothing where none
/// has a normal: all records are balls, which are held against what they stand for alone. One at a time in a thread.
class Around {
  public:
    /// `key`: of the node's corner; `leaves` may be null.
    Around(const RecordGrid& grid, Key key, uint32_t keyBits, const Leaves* leaves,
           std::span<const PendingNode> children);
    Around(const Around&) = delete;
    Around& operator=(const Around&) = delete;

    struct Run {
        uint32_t begin = 0, end = 0;
    };
    /// In the cluster's cell of that key, in those beside it, and in the one that holds a place.
    Run at(Key key) const;
    uint32_t cellAt(const glm::dvec3& place) const;
    Run inCell(uint32_t cell) const;
    template <typename Use>
    void forBeside(Key key, const Use& use) const;

    RecordGrid grid;
    const Leaves* leaves = nullptr;
    std::vector<AggregateRecord> parts;  ///< without leaves
    // Otherwise of the leaves, beside the node's corner: place, normal (zero: none), radius.
    const float *x = nullptr, *y = nullptr, *z = nullptr, *nx = nullptr, *ny = nullptr, *nz = nullptr,
                *radius = nullptr;
    glm::dvec3 corner{0};

  private:
    /// Cells of the thread's table that hold something; empty again when this ends, however it does.
    struct UsedCells {
        std::vector<uint32_t> cells;
        ~UsedCells();
    };
    void number(std::span<const Key> keys);
    Key firstCell_ = 0;
    double cellsPerUnit_ = 0;
    std::array<std::vector<float>, 7> columns_;
    UsedCells used_;
};

/// Code of an error not below that of `code` which all places of the record's disc keep to the nearest leaf of its
/// node. Of a record without a normal: `code`.
uint32_t coveringCode(const AggregateRecord& record, const Around& around, uint32_t code);
/// The same of records without a normal, which are balls: lattice units, at least the radius. `parts`: what they stand
/// for, where `leaves` is null.
double coveringErrorOfBall(const AggregateRecord& record, std::span<const AggregateRecord> parts, const Leaves* leaves);
/// Sets `core` and `hole` of a record. `isAll`: no other record stands for leaves in its cell.
void measureCore(AggregateRecord& record, const Around& around, bool isAll);
/// Of all records of a node, in order: those above want to know, whose leaves are not at hand there.
void measureCores(std::span<AggregateRecord> records, const Around& around);

}  // namespace stipple::lod
