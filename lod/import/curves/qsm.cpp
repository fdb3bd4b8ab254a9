#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <map>

#include "lod/import/curves/curve_readers.h"
#include "lod/import/curves/rows.h"

namespace stipple::lod {

namespace {

struct Cylinder {
    float radius = 0;
    glm::dvec3 from{0}, to{0};
    uint32_t extension = 0;  ///< number of the cylinder that goes on from here, from 1
};

/// Where the columns stand: of TreeQSM, unless a line of names says otherwise.
struct Columns {
    size_t radius = 0, length = 1, start = 2, axis = 5, parent = 8, extension = 9, id = SIZE_MAX;
    bool axisIsEnd = false;
    size_t count() const {
        size_t most = std::max({radius, length, start + 2, axis + 2, parent});
        for (const size_t c : {extension, id})
            if (c != SIZE_MAX) most = std::max(most, c);
        return most + 1;
    }
};

/// Cells of a line between commas, semicolons, tabs or spaces; quotes are taken off.
std::vector<std::string_view> cellsOf(std::string_view row) {
    const char* const between = row.find_first_of(",;\t") != std::string_view::npos ? ",;\t" : " ";
    std::vector<std::string_view> cells;
    for (size_t at = 0; at <= row.size();) {
        const size_t end = std::min(row.find_first_of(between, at), row.size());
        std::string_view cell = row.substr(at, end - at);
        at = end + 1;
        while (!cell.empty() && (cell.front() == ' ' || cell.front() == '"')) cell.remove_prefix(1);
        while (!cell.empty() && (cell.back() == ' ' || cell.back() == '"')) cell.remove_suffix(1);
        if (between[0] != ' ' || !cell.empty()) cells.push_back(cell);
    }
    if (!cells.empty() && cells.back().empty()) cells.pop_back();  // lines may end with a tab
    return cells;
}

/// False where some cell is no number; empty cells count as 0.
bool numbersOf(const std::vector<std::string_view>& cells, std::vector<double>& numbers) {
    numbers.clear();
    for (const std::string_view cell : cells) {
        double value = 0;
        const auto parsed = std::from_chars(cell.data(), cell.data() + cell.size(), value);
        const bool isNumber =
            cell.empty() || cell == "NA" || (parsed.ec == std::errc() && parsed.ptr == cell.data() + cell.size());
        if (!isNumber) return false;
        numbers.push_back(value);
    }
    return true;
}

/// "Start_X (m)" as "startx".
std::string plainName(std::string_view cell) {
    std::string name;
    for (const char c : cell.substr(0, cell.find('(')))
        if (std::isalnum(static_cast<unsigned char>(c)) != 0)
            name += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return name;
}

/// The columns that a line of names tells, if it names all that is needed one by one.
Columns columnsOf(const std::vector<std::string_view>& names) {
    const auto find = [&](std::initializer_list<const char*> wanted) {
        for (const char* name : wanted)
            for (size_t i = 0; i < names.size(); ++i)
                if (plainName(names[i]) == name) return i;
        return SIZE_MAX;
    };
    Columns c;
    c.radius = find({"radius", "radiuscyl", "radiusm"});
    c.length = find({"length", "lengthm"});
    c.start = find({"startx", "start1", "startpointx", "x"});
    c.axis = find({"axisx", "axis1", "axisdirectionx"});
    c.parent = find({"parent", "parentid"});
    c.extension = find({"extension", "extensionid"});
    c.id = find({"id", "cylid", "cylinderid"});
    if (c.axis == SIZE_MAX) {
        c.axis = find({"endx", "end1", "endpointx"});
        c.axisIsEnd = true;
    }
    const bool isComplete = c.radius != SIZE_MAX && c.length != SIZE_MAX && c.start != SIZE_MAX && c.axis != SIZE_MAX &&
                            c.parent != SIZE_MAX && c.start + 2 < names.size() && c.axis + 2 < names.size();
    return isComplete ? c : Columns();
}

/// Reads the lines one by one.
class Table {
  public:
    /// An error is the text of what is wrong with the line.
    std::string take(size_t line, std::string_view row) {
        const std::vector<std::string_view> cells = cellsOf(row);
        if (!numbersOf(cells, numbers_)) {
            if (!cylinders.empty() || width_ > 0)
                return fmt::format("line {} ('{}') is not all numbers", line, row.substr(0, 40));
            columns_ = columnsOf(cells);
            names_ = cells.size();
            return "";
        }
        // Tables of R have a column of row names without a name.
        const size_t shift = names_ > 0 && cells.size() == names_ + 1 ? 1 : 0;
        if (width_ == 0) width_ = cells.size();
        if (cells.size() < columns_.count() + shift || cells.size() != width_) {
            if (cylinders.empty() && cells.size() >= 3 && cells.size() < columns_.count())
                return fmt::format("line {} ('{}') has {} numbers, a cylinder at least 10: these look like points",
                                   line, row.substr(0, 40), cells.size());
            return fmt::format(
                "line {} ('{}') has {} numbers: a cylinder has at least 10 (radius, length, start x y z, axis x y z, "
                "parent, extension), and all lines as many",
                line, row.substr(0, 40), cells.size());
        }
        return addCylinder(line, shift);
    }
    /// Where no column says which cylinder goes on from one: the first of its children does.
    void followParents() {
        if (columns_.extension != SIZE_MAX) return;
        for (size_t i = 0; i < cylinders.size(); ++i) {
            uint32_t parent = parents_[i];
            if (const auto found = byId_.find(parent); columns_.id != SIZE_MAX)
                parent = found == byId_.end() ? 0 : found->second;
            if (parent == 0 || parent > cylinders.size() || parent == i + 1) continue;
            uint32_t& next = cylinders[parent - 1].extension;
            if (next == 0) next = static_cast<uint32_t>(i + 1);
        }
    }

    std::vector<Cylinder> cylinders;

  private:
    static bool isIndex(double value) { return value >= 0 && value < 4e9 && value == std::floor(value); }

    std::string addCylinder(size_t line, size_t shift) {
        const auto at = [&](size_t column) { return numbers_[column + shift]; };
        const auto vectorAt = [&](size_t column) { return glm::dvec3(at(column), at(column + 1), at(column + 2)); };
        Cylinder c;
        c.radius = static_cast<float>(at(columns_.radius));
        c.from = vectorAt(columns_.start);
        const glm::dvec3 axis = vectorAt(columns_.axis);
        const double length = glm::length(axis);
        c.to = columns_.axisIsEnd ? axis : c.from + axis * (length > 0 ? at(columns_.length) / length : 0);
        if (columns_.extension != SIZE_MAX) {
            const double extension = at(columns_.extension);
            if (!isIndex(extension))
                return fmt::format("line {}: the extension {} is no number of a cylinder; is this a cylinder model?",
                                   line, extension);
            c.extension = static_cast<uint32_t>(extension);
        } else {
            const double parent = std::max(at(columns_.parent), 0.0);  // (roots may have -1)
            parents_.push_back(isIndex(parent) ? static_cast<uint32_t>(parent) : 0);
            if (columns_.id != SIZE_MAX && isIndex(at(columns_.id)))
                byId_.emplace(static_cast<uint32_t>(at(columns_.id)), static_cast<uint32_t>(cylinders.size() + 1));
        }
        cylinders.push_back(c);
        return "";
    }

    Columns columns_;
    size_t names_ = 0, width_ = 0;
    std::vector<double> numbers_;
    std::vector<uint32_t> parents_;
    std::map<uint32_t, uint32_t> byId_;
};

}  // namespace

// A line for each cylinder: radius, length, start x y z, axis x y z, parent, extension (both from 1; 0: none), and
// others; a line of names may come first, and then say which column is which.
Result<CurveSet> readQsm(std::string_view text, const std::string& path) {
    Table table;
    std::string problem;
    forLines(text, [&](size_t line, std::string_view row) {
        if (problem.empty()) problem = table.take(line, row);
    });
    if (!problem.empty()) {
        const bool isPoints = problem.find("look like points") != std::string::npos;
        return fail(
            ErrorKind::input, problem, path,
            isPoints ? "points are read from .las, .laz and .ply; `pdal translate` or CloudCompare convert them" : "");
    }
    table.followParents();
    std::vector<Cylinder>& cylinders = table.cylinders;
    if (cylinders.empty()) return fail(ErrorKind::input, "holds no cylinder", path);
    CurveSet out;
    std::vector<uint8_t> isExtension(cylinders.size()), isSeen(cylinders.size());
    for (Cylinder& c : cylinders) {
        if (c.extension > cylinders.size()) {
            ++out.mended["extensions that do not exist"];
            c.extension = 0;
        }
        if (c.extension > 0) isExtension[c.extension - 1] = 1;
    }
    constexpr uint32_t kBark = 0x4f6b86;  // r in the low byte
    const auto follow = [&](uint32_t first) {
        uint32_t last = first;
        for (uint32_t at = first; isSeen[at] == 0;) {
            isSeen[at] = 1;
            last = at;
            out.addVertex(cylinders[at].from, cylinders[at].radius, glm::vec3(0), kBark);
            if (cylinders[at].extension == 0) break;
            at = cylinders[at].extension - 1;
        }
        out.addVertex(cylinders[last].to, cylinders[last].radius, glm::vec3(0), kBark);
        out.endCurve(false);
    };
    for (uint32_t i = 0; i < cylinders.size(); ++i)
        if (isExtension[i] == 0) follow(i);
    for (uint32_t i = 0; i < cylinders.size(); ++i)
        if (isSeen[i] == 0) {
            ++out.mended["extensions that lead round in a circle (cut)"];
            follow(i);
        }
    return out;
}

}  // namespace stipple::lod
