#include "lod/import/survey.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>

#include "engine/base/numbers.h"
#include "engine/base/process.h"
#include "lod/store/attributes.h"

namespace stipple::lod {
namespace {

struct Tally {
    double least = std::numeric_limits<double>::infinity(), greatest = -least;
    uint64_t withoutData = 0;
    std::vector<uint64_t> counts;  ///< of 8-bit categories
};

struct PartSurvey {
    uint64_t points = 0, notFinite = 0;
    glm::dvec3 least{std::numeric_limits<double>::infinity()}, greatest{-std::numeric_limits<double>::infinity()};
    glm::ivec3 leastStep{INT32_MAX}, greatestStep{INT32_MIN};
    uint32_t colourMax = 0;
    std::vector<Tally> attributes;
    std::string problem;
};

bool isCategory(const AttributeInfo& a) { return a.aggregate == Aggregate::mode && bytesOf(a.type) == 1; }

void take(const SourceInfo& info, const PointBlock& block, size_t count, PartSurvey& s) {
    s.points += count;
    s.colourMax = std::max(s.colourMax, block.colourMax);
    for (const glm::ivec3& p : block.lattice) {
        s.leastStep = glm::min(s.leastStep, p);
        s.greatestStep = glm::max(s.greatestStep, p);
    }
    for (const glm::dvec3& p : block.position) {
        if (!isFinite(p)) {
            ++s.notFinite;
            continue;
        }
        s.least = glm::min(s.least, p);
        s.greatest = glm::max(s.greatest, p);
    }
    for (size_t k = 0; k < block.attributes.size(); ++k) {
        const AttributeInfo& a = info.attributes[k];
        const std::vector<uint8_t>& values = block.attributes[k];
        Tally& t = s.attributes[k];
        if (isCategory(a)) {
            for (const uint8_t v : values) ++t.counts[v];
            continue;
        }
        const size_t width = bytesOf(a.type);
        for (size_t i = 0; i < values.size(); i += width) {
            if (isNoData(a, values.data() + i)) {
                ++t.withoutData;
                continue;
            }
            const double v = attributeValue(a, values.data() + i);
            t.least = std::min(t.least, v);
            t.greatest = std::max(t.greatest, v);
        }
    }
}

PartSurvey surveyPart(const PointSource& source, size_t part) {
    PartSurvey s;
    s.attributes.resize(source.info.attributes.size());
    for (Tally& t : s.attributes) t.counts.assign(256, 0);
    const auto fail = [&](const Error& error) {
        PartSurvey failed;
        failed.attributes.resize(s.attributes.size());
        failed.problem = error.line();
        return failed;
    };
    const auto reader = source.openPart(part);
    if (!reader) return fail(reader.error());
    PointBlock block;
    for (;;) {
        block.clear();
        const auto count = (*reader)(block, 65536);
        if (!count) return fail(count.error());
        if (*count == 0) return s;
        take(source.info, block, *count, s);
    }
}

void finishAttribute(const std::vector<PartSurvey>& parts, size_t k, AttributeInfo& a) {
    Tally all;
    all.counts.assign(256, 0);
    for (const PartSurvey& s : parts) {
        all.least = std::min(all.least, s.attributes[k].least);
        all.greatest = std::max(all.greatest, s.attributes[k].greatest);
        a.withoutData += s.attributes[k].withoutData;
        for (size_t v = 0; v < s.attributes[k].counts.size(); ++v) all.counts[v] += s.attributes[k].counts[v];
    }
    for (size_t v = 0; isCategory(a) && v < all.counts.size(); ++v)
        if (all.counts[v] > 0) a.counts.emplace_back(static_cast<double>(v), all.counts[v]);
    if (!a.counts.empty()) {
        all.least = a.counts.front().first;
        all.greatest = a.counts.back().first;
    }
    a.least = std::isfinite(all.least) ? all.least : 0;
    a.greatest = std::isfinite(all.greatest) ? all.greatest : 0;
}

}  // namespace

Survey surveySource(const PointSource& source, Executor& executor, Progress& progress) {
    std::vector<PartSurvey> parts(source.parts.size());
    std::atomic<uint64_t> done{0};
    executor.parallelFor(parts.size(), 1, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end && !isStopRequested(); ++i) {
            parts[i] = surveyPart(source, i);
            progress.update("read", done += source.parts[i], source.info.points);
        }
    });
    Survey survey;
    PartSurvey all;
    for (size_t i = 0; i < parts.size(); ++i) {
        const PartSurvey& s = parts[i];
        survey.points += s.points;
        survey.notFinite += s.notFinite;
        survey.colourMax = std::max(survey.colourMax, s.colourMax);
        all.least = glm::min(all.least, s.least);
        all.greatest = glm::max(all.greatest, s.greatest);
        all.leastStep = glm::min(all.leastStep, s.leastStep);
        all.greatestStep = glm::max(all.greatestStep, s.greatestStep);
        if (s.problem.empty()) continue;
        survey.problems.push_back(s.problem);
        survey.lostPoints += source.parts[i];
    }
    survey.attributes = source.info.attributes;
    for (size_t k = 0; k < survey.attributes.size(); ++k) finishAttribute(parts, k, survey.attributes[k]);
    if (survey.points == survey.notFinite) return survey;
    if (source.info.isLattice) {
        survey.leastStep = all.leastStep;
        survey.greatestStep = all.greatestStep;
        survey.least = glm::dvec3(all.leastStep) * source.info.scale + source.info.offset;
        survey.greatest = glm::dvec3(all.greatestStep) * source.info.scale + source.info.offset;
    } else {
        survey.least = all.least;
        survey.greatest = all.greatest;
    }
    return survey;
}

}  // namespace stipple::lod
