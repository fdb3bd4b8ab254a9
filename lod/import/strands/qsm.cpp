#include <fmt/format.h>

#include <cmath>

#include "lod/import/strands/rows.h"
#include "lod/import/strands/strand_readers.h"

namespace stipple::lod {

// Columns: radius, length, start x y z, axis x y z, parent, extension (both from 1; 0: none), and others.
Result<StrandSet> readQsm(std::string_view text, const std::string& path) {
    struct Cylinder {
        float radius;
        glm::dvec3 from, to;
        uint32_t extension;
    };
    std::vector<Cylinder> cylinders;
    std::string problem;
    size_t columns = 0;
    forRows(text, [&](size_t line, const std::vector<double>& n, std::string_view row) {
        if (!problem.empty() || (cylinders.empty() && n.empty())) return;  // a line of names
        if (columns == 0) columns = n.size();
        if (n.size() < 10 || n.size() != columns) {
            problem = fmt::format(
                "line {} ('{}') has {} numbers: a cylinder has at least 10 (radius, length, start x y "
                "z, axis x y z, parent, extension), and all lines as many",
                line, row.substr(0, 40), n.size());
            return;
        }
        const glm::dvec3 from(n[2], n[3], n[4]), axis(n[5], n[6], n[7]);
        const double length = glm::length(axis);
        const bool isIndex = n[9] >= 0 && n[9] < 4e9 && n[9] == std::floor(n[9]);
        if (!isIndex) {
            problem = fmt::format("line {}: the extension {} is no number of a cylinder; is this a cylinder model?",
                                  line, n[9]);
            return;
        }
        cylinders.push_back({static_cast<float>(n[0]), from, from + axis * (length > 0 ? n[1] / length : 0),
                             static_cast<uint32_t>(n[9])});
    });
    if (!problem.empty()) return fail(ErrorKind::input, problem, path);
    if (cylinders.empty()) return fail(ErrorKind::input, "holds no cylinder", path);
    StrandSet out;
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
        out.endStrand(false);
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
