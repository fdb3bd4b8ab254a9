#include "apps/study/calibration/curve.h"

#include <cmath>

namespace stipple::study {

std::vector<CostSample> Curve::of(const std::string& mode) const {
    std::vector<CostSample> out;
    for (const CostSample& s : samples)
        if (s.mode == mode) out.push_back(s);
    return out;
}

nlohmann::json jsonOfCurve(const Curve& curve) {
    nlohmann::json list = nlohmann::json::array();
    for (const CostSample& s : curve.samples)
        list.push_back({{"mode", s.mode},
                        {"width", s.width},
                        {"height", s.height},
                        {"error_px", s.errorPixels},
                        {"records", s.records},
                        {"triangles", s.triangles},
                        {"ms", s.ms}});
    return {{"scene", curve.scene}, {"device", curve.device},   {"processor", curve.processor},
            {"date", curve.date},   {"version", curve.version}, {"threads", curve.threads},
            {"samples", list}};
}

Result<Curve> curveOf(const std::string& text, const std::string& path) {
    const auto bad = [&] {
        return fail(ErrorKind::input, "is no calibration", path, "make it again: stipple study SCENE --calibrate");
    };
    const nlohmann::json j = nlohmann::json::parse(text, nullptr, false);
    if (!j.is_object() || !j.contains("samples") || !j["samples"].is_array()) return bad();
    Curve curve;
    try {
        curve = {j.at("scene"), j.at("device"), j.at("processor"), j.at("date"), j.at("version"), j.at("threads"), {}};
        for (const auto& s : j.at("samples"))
            curve.samples.push_back({s.at("mode"), s.at("width"), s.at("height"), s.at("error_px"), s.at("records"),
                                     s.at("triangles"), s.at("ms")});
    } catch (const nlohmann::json::exception&) {
        return bad();
    }
    for (const CostSample& s : curve.samples)
        if (!(s.ms > 0) || !(s.records >= 0) || !(s.triangles >= 0)) return bad();
    return curve;
}

std::optional<double> errorWithin(const CostModel& model, const LoadAt& load, double ms) {
    const auto pixelsOf = [](int step) { return kFinestPixels * std::exp2(step / 8.0); };
    const auto fits = [&](int step) { return model.msOf(load(pixelsOf(step))) <= ms; };
    int low = 0, high = static_cast<int>(std::lround(8 * std::log2(kCoarsestPixels / kFinestPixels)));
    if (!fits(high)) return {};
    while (low < high) {
        const int middle = (low + high) / 2;
        if (fits(middle))
            high = middle;
        else
            low = middle + 1;
    }
    return pixelsOf(high);
}

}  // namespace stipple::study
