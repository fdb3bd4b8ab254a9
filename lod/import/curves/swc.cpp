#include <fmt/format.h>

#include <unordered_map>

#include "lod/import/curves/curve_readers.h"
#include "lod/import/curves/rows.h"

namespace stipple::lod {
namespace {

struct Sample {
    glm::dvec3 p;
    float radius;
    int kind;
    int64_t parentId;
    uint32_t parent = ~0u;
    std::vector<uint32_t> children;
};

/// Anything else; soma grey, axon blue, basal dendrites green, apical ones violet (red in the low byte).
uint32_t colourOf(int kind) {
    constexpr std::array<uint32_t, 5> kColours{0x9a9a9a, 0x505050, 0xe08f4f, 0x50b06a, 0xd060c0};
    return kColours.at(kind >= 1 && kind <= 4 ? static_cast<size_t>(kind) : 0);
}

}  // namespace

Result<CurveSet> readSwc(std::string_view text, const std::string& path) {
    std::vector<Sample> samples;
    std::unordered_map<int64_t, uint32_t> byId;
    CurveSet out;
    out.up = {0, 1, 0};
    out.hasColour = true;
    std::string problem;
    forRows(text, [&](size_t line, const std::vector<double>& n, std::string_view) {
        if (!problem.empty()) return;
        if (n.size() < 7) {
            problem = fmt::format("line {} has {} numbers: a sample has 7 (id, type, x, y, z, radius, parent)", line,
                                  n.size());
            return;
        }
        if (!byId.emplace(static_cast<int64_t>(n[0]), static_cast<uint32_t>(samples.size())).second) {
            ++out.mended["samples whose id is taken"];
            return;
        }
        samples.push_back({{n[2], n[3], n[4]},
                           static_cast<float>(n[5]),
                           static_cast<int>(n[1]),
                           static_cast<int64_t>(n[6]),
                           ~0u,
                           {}});
    });
    if (!problem.empty()) return fail(ErrorKind::input, problem, path);
    if (samples.empty()) return fail(ErrorKind::input, "holds no sample", path);
    std::vector<uint32_t> roots;
    for (uint32_t i = 0; i < samples.size(); ++i) {
        const auto parent = byId.find(samples[i].parentId);
        if (samples[i].parentId >= 0 && parent == byId.end()) ++out.mended["parents that do not exist (made roots)"];
        if (samples[i].parentId < 0 || parent == byId.end()) {
            roots.push_back(i);
            continue;
        }
        samples[i].parent = parent->second;
        samples[parent->second].children.push_back(i);
    }
    // A section runs from a branching to the next; its first vertex is the branching's own.
    std::vector<uint8_t> isSeen(samples.size());
    std::vector<std::pair<uint32_t, uint32_t>> starts;  // where a section begins, and its first step
    const auto branch = [&](uint32_t at) {
        for (const uint32_t child : samples[at].children) starts.emplace_back(at, child);
    };
    // (No sample is copied: one may have as many children as there are samples.)
    const auto add = [&](const glm::dvec3& p, float radius, int kind) {
        out.addVertex(p, radius, glm::vec3(0), colourOf(kind));
    };
    for (const uint32_t root : roots) {
        isSeen[root] = 1;
        if (samples[root].children.empty() || samples[root].kind == 1) {  // a ball
            const Sample& ball = samples[root];
            add(ball.p, ball.radius, ball.kind);
            add(ball.p + glm::dvec3(0.01 * ball.radius, 0, 0), ball.radius, ball.kind);
            out.endCurve(false);
        }
        branch(root);
    }
    while (!starts.empty()) {
        const auto [from, first] = starts.back();
        starts.pop_back();
        const int kind = samples[first].kind;
        // Dendrites do not begin at a soma's middle with its radius.
        const Sample& begin = samples[from];
        add(begin.p, begin.kind == 1 && kind != 1 ? samples[first].radius : begin.radius, kind);
        for (uint32_t at = first;;) {
            isSeen[at] = 1;
            add(samples[at].p, samples[at].radius, kind);
            if (samples[at].children.size() != 1 || samples[samples[at].children[0]].kind != kind) {
                branch(at);
                break;
            }
            at = samples[at].children[0];
        }
        out.endCurve(false);
    }
    for (const uint8_t seen : isSeen)
        if (seen == 0) ++out.mended["samples whose parents lead round in a circle"];
    return out;
}

}  // namespace stipple::lod
