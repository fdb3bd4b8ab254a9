#include "lod/primitives/curve_source.h"

#include <memory>

#include "engine/base/hash.h"

namespace stipple::lod {

CurveSource sourceOf(CurveSet given) {
    const auto set = std::make_shared<const CurveSet>(std::move(given));
    CurveSource source;
    source.vertices = set->position.size();
    source.identity = [set] {
        return hashBytes(set->position.data(), set->position.size() * sizeof(glm::dvec3)) ^
               hashBytes(set->first.data(), set->first.size() * sizeof(uint32_t));
    };
    source.read = [set](const CurveSource::Take& take) { return take(*set); };
    return source;
}

Result<CurveSet> collect(const CurveSource& source) {
    CurveSet out;
    bool isFirst = true;
    STIPPLE_TRY(source.read([&](const CurveSet& block) -> Result<void> {
        if (isFirst) {
            isFirst = false;
            out = block;
            return {};
        }
        const auto base = static_cast<uint32_t>(out.position.size());
        const auto append = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
        append(out.position, block.position);
        append(out.radius, block.radius);
        append(out.normal, block.normal);
        append(out.colour, block.colour);
        append(out.isRibbon, block.isRibbon);
        append(out.notes, block.notes);
        for (size_t s = 1; s < block.first.size(); ++s) out.first.push_back(base + block.first[s]);
        for (const auto& [what, count] : block.dropped) out.dropped[what] += count;
        for (const auto& [what, count] : block.mended) out.mended[what] += count;
        out.segmentsIn += block.segmentsIn;
        out.segmentsAdded += block.segmentsAdded;
        return {};
    }));
    return out;
}

}  // namespace stipple::lod
