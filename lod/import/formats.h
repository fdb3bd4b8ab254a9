// The table of formats: what each is called, how its files are known, and what it opens and writes. A new format is a
// folder of its own and one row of it (README.md).
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "engine/base/byte_source.h"
#include "engine/base/process.h"
#include "lod/import/kept.h"
#include "lod/primitives/mesh_source.h"
#include "lod/primitives/primitives.h"

namespace stipple::lod {

/// Gives a reader its bytes, each time that it begins to read. A file is closed in between: thousands of sources may
/// be open at once.
using OpenBytes = std::function<Result<std::shared_ptr<const ByteSource>>()>;
OpenBytes fromFile(const std::string& path);
OpenBytes fromBytes(std::shared_ptr<const ByteSource> bytes);

/// What a reader or writer may want to know beside ReadOptions.
struct FormatOptions {
    std::string part = {};        ///< of files that hold several things: the name of the one that is wanted; empty: all
    bool onlyPoints = false;      ///< of what could be triangles, too
    std::string tempFolder = {};  ///< for what is not held in memory; empty: the system's
    uint64_t memoryBytes = uint64_t{2} << 30;   ///< held as long as what was opened
    uint64_t openingBytes = uint64_t{2} << 30;  ///< only while it is opened
    std::shared_ptr<Kept> kept = {};  ///< what was made of files that are opened again; none: it is made again
    std::function<bool()> isStopped = isStopRequested;  ///< what takes long ends soon then
};

/// Triangles, and what there is to say to a person of how they came about.
struct OpenedMesh {
    MeshSource source;
    std::vector<std::string> notes;
};

/// What `stipple info` says of a file: parts, each with facts in their order.
struct Fact {
    std::string name;
    std::variant<std::string, uint64_t, double, glm::dvec3> value;
};
struct FilePart {
    std::string name;
    std::vector<Fact> facts;
};

/// What was written, in one line, and the same for programs.
struct WriteReport {
    std::string line;
    std::vector<Fact> facts;
};

struct Format {
    std::string_view name;
    std::vector<std::string_view> endings;  ///< ".ply"; the first names the format in messages
    std::vector<std::string_view> marks;    ///< what a file begins with, 8 bytes at most
    Result<PointSource> (*readPoints)(const OpenBytes& open, const ReadOptions& options) = nullptr;
    /// Of formats that are read from a file only.
    Result<PointSource> (*openPoints)(const std::string& path, const ReadOptions& options,
                                      const FormatOptions& more) = nullptr;
    /// Are there triangles that are wanted? Null: never.
    Result<bool> (*hasMesh)(const std::string& path, const FormatOptions& more) = nullptr;
    Result<OpenedMesh> (*openMesh)(const std::string& path, const FormatOptions& more) = nullptr;
    /// Of formats that hold more than one list of points. `isWhole`: read everything, however much.
    Result<std::vector<FilePart>> (*describe)(const std::string& path, bool isWhole,
                                              const FormatOptions& more) = nullptr;
    /// `points` were opened with the names of all their attributes, in their order. The file appears whole or not at
    /// all. `voxel`: the edge of a cell, in units; 0: as the points are spaced.
    Result<WriteReport> (*writePoints)(const PointSource& points, const std::string& path, double voxel,
                                       const FormatOptions& more) = nullptr;
    Result<WriteReport> (*writeMesh)(const MeshSource& triangles, const std::string& path, double voxel,
                                     const FormatOptions& more) = nullptr;
};

std::span<const Format> formats();
/// By what the file begins with, then by its ending; null: none of them.
const Format* formatOf(const std::string& path);
/// `head`: its first 8 bytes.
const Format* formatOf(const std::string& path, std::string_view head);
/// By the ending of a name, whether the file is there or not.
const Format* formatNamed(const std::string& path);
/// ".las, .laz, .ply": of all formats; `last`: " or ", before the last.
std::string allEndings(const std::string& last = ", ");

/// False also of files of no format in the table: whoever opens them says why.
Result<bool> hasMesh(const std::string& path, const FormatOptions& more);
/// Of a file that has one.
Result<OpenedMesh> openMesh(const std::string& path, const FormatOptions& more);

}  // namespace stipple::lod
