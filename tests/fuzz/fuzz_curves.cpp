// libFuzzer: any bytes as SWC, cylinder model, TrackVis or hair end in clean curves or in an error.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <string_view>
#include <vector>

#include "lod/import/curves/curve_readers.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    const std::vector<uint8_t> bytes(data, data + size);
    const std::string_view text(reinterpret_cast<const char*>(data), size);
    const auto take = [](stipple::Result<stipple::lod::CurveSet> set) {
        if (!set) return;
        const stipple::lod::CurveSet clean = stipple::lod::cleanCurves(std::move(*set), 0);
        for (size_t s = 0; s < clean.curves(); ++s)
            if (clean.first[s + 1] < clean.first[s] + 2 || clean.first[s + 1] > clean.position.size()) std::abort();
    };
    take(stipple::lod::readSwc(text, "fuzz"));
    take(stipple::lod::readQsm(text, "fuzz"));
    stipple::lod::CurveSource source;
    source.read = [&](const stipple::lod::CurveSource::Take& to) {
        return stipple::lod::readTrk(stipple::Cursor(bytes), "fuzz", to);
    };
    take(stipple::lod::collect(source));
    source.read = [&](const stipple::lod::CurveSource::Take& to) {
        const auto open = [&](uint64_t at) {
            return stipple::Cursor(std::vector<uint8_t>(data + std::min<uint64_t>(at, size), data + size));
        };
        return stipple::lod::readHair(open, "fuzz", to);
    };
    take(stipple::lod::collect(source));
    return 0;
}
