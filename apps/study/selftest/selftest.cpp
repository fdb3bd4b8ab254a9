#include "apps/study/selftest/selftest.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "apps/study/models.h"
#include "engine/base/process.h"
#include "engine/reference/reference.h"

namespace stipple::study {
namespace {

using glm::dvec3;
using render::Mode;

constexpr uint32_t kSize = 160;
constexpr uint64_t kPoints = 20'000;
constexpr uint32_t kSide = 128;  ///< of the plane, points

/// Coordinates in whole steps of 2^-20, so that no offset rounds them.
lod::PointBlock onGrid(lod::PointBlock block, const dvec3& offset) {
    for (dvec3& p : block.position) p = glm::round(p * 0x1p20) * 0x1p-20 + offset;
    return block;
}
lod::View movedBy(lod::View view, const dvec3& offset) {
    view.eye += offset;
    return view;
}

/// The worst of several pictures.
struct Worst {
    double value;
    bool isAtLeast = false;
    std::string of;
    void take(double v, const std::string& name) {
        if (of.empty() || (isAtLeast ? v < value : v > value) || std::isnan(v)) {
            value = v;
            of = name;
        }
    }
};

struct Scenes {
    StorePtr sphere, plane, heap, withOutlier;
    std::vector<std::pair<const char*, StorePtr>> far;
};
const std::vector<std::pair<const char*, dvec3>>& farPlaces() {
    static const std::vector<std::pair<const char*, dvec3>> places{
        {"UTM", {452'300, 5'411'900, 400}}, {"ECEF", {4'100'000, 520'000, 4'900'000}}, {"1e8", {1e8, -1e8, 1e8}}};
    return places;
}
constexpr double kOutlier = 2e6;

Result<Scenes> buildScenes(const std::string& folder, Executor& executor) {
    Scenes s;
    const auto build = [&](lod::PointBlock block, const std::string& name) {
        return pointStore(std::move(block), folder + "/" + name + ".stipple", executor);
    };
    STIPPLE_ASSIGN(s.sphere, build(onGrid(unitSphere(kPoints), {}), "sphere"));
    STIPPLE_ASSIGN(s.plane, build(onGrid(checkerPlane(kSide, 8), {}), "plane"));
    for (const auto& [name, at] : farPlaces()) {
        STIPPLE_ASSIGN(StorePtr store, build(onGrid(unitSphere(kPoints), at), std::string("sphere-") + name));
        s.far.emplace_back(name, std::move(store));
    }
    lod::PointBlock more = onGrid(unitSphere(kPoints), {});
    more.position.emplace_back(kOutlier, kOutlier, 0);
    more.normal.emplace_back(0, 0, 1);
    more.colour.push_back(lod::kPlainColour);
    STIPPLE_ASSIGN(s.withOutlier, build(std::move(more), "outlier"));
    // 4,000 discs that share a plane and a place, of one colour.
    lod::PointBlock heap;
    for (int i = 0; i < 4000; ++i) {
        heap.position.emplace_back(0, 0, 0);
        heap.normal.emplace_back(0, 0, 1);
        heap.colour.push_back(lod::kPlainColour);
        heap.radius.push_back(1);
    }
    STIPPLE_ASSIGN(s.heap, build(std::move(heap), "heap"));
    return s;
}

/// Share of the pixels of which a channel is more than 1 of 255 apart.
double shareApart(const render::Image& a, const render::Image& b) {
    size_t apart = 0;
    for (size_t i = 0; i < a.rgba.size(); ++i) {
        int largest = 0;
        for (int shift = 0; shift < 32; shift += 8)
            largest = std::max(largest, std::abs(static_cast<int>(a.rgba[i] >> shift & 255u) -
                                                 static_cast<int>(b.rgba[i] >> shift & 255u)));
        apart += largest > 1;
    }
    return static_cast<double>(apart) / static_cast<double>(a.rgba.size());
}

/// All checks of one device.
class DeviceChecks {
  public:
    DeviceChecks(const Scenes& scenes, const Host& host, std::string device, std::vector<SelfCheck>& out)
        : scenes_(scenes), host_(host), device_(std::move(device)), out_(out) {}

    Result<void> run() {
        STIPPLE_TRY(agreeWithFp64());
        STIPPLE_TRY(farAway());
        STIPPLE_TRY(besideAnOutlier());
        STIPPLE_TRY(grazing());
        STIPPLE_TRY(fromNearerThanTheSpacing());
        STIPPLE_TRY(closed());
        STIPPLE_TRY(anySize());
        return manyAtOnePlace();
    }

  private:
    Result<Drawer> drawerOf(const StorePtr& store) {
        STIPPLE_TRY(host_.say(device_, out_.size(), 0));
        STIPPLE_ASSIGN(auto backend, host_.backend(device_));
        return Drawer(store, std::move(backend), host_.executor);
    }
    template <typename Use>
    static Result<void> forModes(const Use& use) {
        for (const render::Reconstruction& r : render::reconstructions()) STIPPLE_TRY(use(r.mode, std::string(r.name)));
        return {};
    }
    void add(const char* name, const char* unit, std::vector<int> cases, const Worst& worst, double limit) {
        out_.push_back({device_, name, unit, std::move(cases), worst.value, limit, worst.isAtLeast, worst.of});
    }
    static lod::View atSphere() { return viewFrom({2.2, 1.4, 1.1}, {0, 0, 0}, {0, 0, 1}, kSize, kSize); }

    Result<void> agreeWithFp64() {
        STIPPLE_ASSIGN(Drawer drawer, drawerOf(scenes_.sphere));
        Drawer oracle(scenes_.sphere, reference::makeReferenceBackend(host_.executor), host_.executor);
        Worst worst{0, true, ""};
        STIPPLE_TRY(forModes([&](Mode mode, const std::string& name) -> Result<void> {
            const render::FrameSettings settings = settingsOf(mode, 1, true);
            STIPPLE_ASSIGN(const render::Image drawn, drawer.draw(atSphere(), settings));
            STIPPLE_ASSIGN(const render::Image truth, oracle.draw(atSphere(), settings));
            STIPPLE_ASSIGN(const auto difference, reference::compareImages(drawn, truth, 1, nullptr));
            worst.take(std::min(difference.foregroundPsnr, 999.0), name);
            return {};
        }));
        add("pictures against the fp64 restatement", "dB", {18, 38}, worst, 50);
        return {};
    }

    Result<void> farAway() {
        Worst worst{0, false, ""};
        STIPPLE_ASSIGN(Drawer here, drawerOf(scenes_.sphere));
        for (size_t place = 0; place < farPlaces().size(); ++place) {
            STIPPLE_ASSIGN(Drawer there, drawerOf(scenes_.far[place].second));
            STIPPLE_TRY(forModes([&](Mode mode, const std::string& name) -> Result<void> {
                const render::FrameSettings settings = settingsOf(mode, 1, true);
                STIPPLE_ASSIGN(const render::Image a, here.draw(atSphere(), settings));
                STIPPLE_ASSIGN(const render::Image b,
                               there.draw(movedBy(atSphere(), farPlaces()[place].second), settings));
                worst.take(100 * shareApart(a, b), fmt::format("{}, {}", name, farPlaces()[place].first));
                return {};
            }));
        }
        add("the same picture far from the origin", "% of pixels", {1, 2, 3}, worst, 0.01);
        return {};
    }

    Result<void> besideAnOutlier() {
        Worst worst{0, false, ""};
        STIPPLE_ASSIGN(Drawer alone, drawerOf(scenes_.sphere));
        STIPPLE_ASSIGN(Drawer beside, drawerOf(scenes_.withOutlier));
        STIPPLE_TRY(forModes([&](Mode mode, const std::string& name) -> Result<void> {
            // (All leaves: levels above them are of other cells.)
            const render::FrameSettings settings = settingsOf(mode, kLeaves, true);
            STIPPLE_ASSIGN(const render::Image a, alone.draw(atSphere(), settings));
            STIPPLE_ASSIGN(const render::Image b, beside.draw(atSphere(), settings));
            double off = 0;
            size_t both = 0;
            for (size_t i = 0; i < a.depth.size(); ++i)
                if (a.depth[i] > 0 && b.depth[i] > 0) {
                    ++both;
                    off += std::abs(a.depth[i] - b.depth[i]) / a.depth[i] * static_cast<float>(atSphere().focalPixels);
                }
            worst.take(both < 1000 ? 1e9 : off / static_cast<double>(both), name);
            return {};
        }));
        add("depth beside a point 2,800 km away", "px, mean", {3, 9}, worst, 0.1);
        return {};
    }

    /// Distance in space of what is drawn from the plane z = 0.
    Result<void> grazing() {
        STIPPLE_ASSIGN(Drawer drawer, drawerOf(scenes_.plane));
        const lod::View view = viewFrom({0, -1.6, 0.12}, {0, 0, 0}, {0, 0, 1}, 2 * kSize, kSize);
        Worst worst{0, false, ""};
        STIPPLE_TRY(forModes([&](Mode mode, const std::string& name) -> Result<void> {
            if (mode == Mode::points) return {};  // (a pixel a record, at the record's depth)
            STIPPLE_ASSIGN(const render::Image image, drawer.draw(view, settingsOf(mode, 1, false)));
            std::vector<double> off;
            for (size_t i = 0; i < image.depth.size(); ++i) {
                if (!(image.depth[i] > 0)) continue;
                const double x = static_cast<double>(i % image.width) + 0.5 - 0.5 * image.width,
                             y = static_cast<double>(i / image.width) + 0.5 - 0.5 * image.height, z = image.depth[i];
                const dvec3 at = view.eye + z * (view.forward + (x * view.right + y * view.down) / view.focalPixels);
                off.push_back(std::abs(at.z) * view.focalPixels / z);
            }
            std::sort(off.begin(), off.end());
            worst.take(off.size() < 1000 ? 1e9 : off[off.size() * 99 / 100], name);
            return {};
        }));
        add("depth of a plane seen at 4 degrees", "px, p99", {12}, worst, 1);
        return {};
    }

    Result<void> fromNearerThanTheSpacing() {
        STIPPLE_ASSIGN(Drawer drawer, drawerOf(scenes_.plane));
        const double spacing = 2.0 / kSide;
        const lod::View view = viewFrom({0.37 * spacing, 0.41 * spacing, 0.1 * spacing},
                                        {0.37 * spacing, 0.41 * spacing, 0}, {0, 1, 0}, kSize, kSize);
        Worst worst{0, false, ""};
        STIPPLE_TRY(forModes([&](Mode mode, const std::string& name) -> Result<void> {
            if (mode == Mode::points) return {};
            STIPPLE_ASSIGN(const render::Image image, drawer.draw(view, settingsOf(mode, 1, false)));
            worst.take(static_cast<double>(std::count(image.depth.begin(), image.depth.end(), 0.0f)), name);
            return {};
        }));
        add("a surface from nearer than its spacing", "open pixels", {10, 11, 23}, worst, 0);
        return {};
    }

    Result<void> closed() {
        STIPPLE_ASSIGN(Drawer drawer, drawerOf(scenes_.sphere));
        STIPPLE_ASSIGN(const Pinholes holes, countPinholes(drawer, 60, 64));
        Worst worst{0, false, ""};
        STIPPLE_TRY(forModes([&](Mode mode, const std::string& name) -> Result<void> {
            if (mode != Mode::points && mode != Mode::pullpush)  // (of which no such thing is stated)
                worst.take(static_cast<double>(holes.open.at(mode)), name);
            return {};
        }));
        add("a closed surface from 60 places", "open pixels", {11, 17, 40}, worst, 0);
        return {};
    }

    /// One colour in, one colour out, whatever the size.
    Result<void> anySize() {
        STIPPLE_ASSIGN(Drawer drawer, drawerOf(scenes_.sphere));
        Worst worst{0, false, ""};
        for (const auto& [w, h] : {std::pair{1u, 1u}, {1u, 7u}, {7u, 1u}, {2u, 3u}, {641u, 479u}})
            STIPPLE_TRY(forModes([&, w = w, h = h](Mode mode, const std::string& name) -> Result<void> {
                if (mode == Mode::points) return {};
                const lod::View view = viewFrom({1.02, 0, 0}, {0, 0, 0}, {0, 0, 1}, w, h);
                STIPPLE_ASSIGN(const render::Image image, drawer.draw(view, settingsOf(mode, 1, false)));
                double apart = 0;
                for (size_t i = 0; i < image.rgba.size(); ++i) {
                    if (!(image.depth[i] > 0) || !std::isfinite(image.depth[i])) apart = 255;
                    for (int shift = 0; shift < 24; shift += 8)
                        apart = std::max(apart, std::abs(static_cast<double>(image.rgba[i] >> shift & 255u) -
                                                         static_cast<double>(lod::kPlainColour >> shift & 255u)));
                }
                worst.take(apart, fmt::format("{}, {} x {}", name, w, h));
                return {};
            }));
        add("one colour at any size of pictures", "of 255", {35, 41}, worst, 1);
        return {};
    }

    Result<void> manyAtOnePlace() {
        STIPPLE_ASSIGN(Drawer drawer, drawerOf(scenes_.heap));
        const lod::View view = viewFrom({0.1, 0.2, 3}, {0, 0, 0}, {0, 1, 0}, kSize, kSize);
        Worst worst{0, false, ""};
        STIPPLE_TRY(forModes([&](Mode mode, const std::string& name) -> Result<void> {
            STIPPLE_ASSIGN(const render::Image image, drawer.draw(view, settingsOf(mode, kLeaves, false)));
            // (Blended with the background at the rim: of those that are whole.)
            double apart = 255;
            for (const uint32_t c : image.rgba)
                if (c >> 24 == 255u) {
                    if (apart > 254) apart = 0;
                    for (int shift = 0; shift < 24; shift += 8)
                        apart = std::max(apart, std::abs(static_cast<double>(c >> shift & 255u) -
                                                         static_cast<double>(lod::kPlainColour >> shift & 255u)));
                }
            worst.take(apart, name);
            return {};
        }));
        add("4,000 discs at one place", "of 255", {24, 36}, worst, 1);
        return {};
    }

    const Scenes& scenes_;
    const Host& host_;
    std::string device_;
    std::vector<SelfCheck>& out_;
};

}  // namespace

size_t SelfTestReport::failed() const {
    return static_cast<size_t>(std::count_if(checks.begin(), checks.end(), [](auto& c) { return !c.isPassed(); }));
}

Result<SelfTestReport> runSelfTest(const SelfTestSettings& settings, const Host& host) {
    SelfTestReport report;
    const double start = nowSeconds();
    report.machine = machineNow(settings.threads);
    std::vector<std::string> devices;
    for (const std::string& device : settings.devices) {
        if (const auto backend = host.backend(device)) {
            report.devices.push_back(device + ": " + (*backend)->device());
            devices.push_back(device);
        } else if (settings.skipAbsent) {
            report.absent.push_back(device + ": " + backend.error().what);
        } else {
            return tl::unexpected(backend.error());
        }
    }
    STIPPLE_ASSIGN(const Scenes scenes, buildScenes(settings.folder, host.executor));
    for (const std::string& device : devices) STIPPLE_TRY(DeviceChecks(scenes, host, device, report.checks).run());
    report.seconds = nowSeconds() - start;
    return report;
}

std::string describeSelfTest(const SelfTestReport& report) {
    std::string text = describeMachine(report.machine) + "\n";
    for (const std::string& device : report.devices) text += device + "\n";
    for (const std::string& absent : report.absent) text += "not there, and not tested: " + absent + "\n";
    text += fmt::format("\n{:<7}{:<8}{:<42}{:>10}  {:<12}{:<13}{}\n", "device", "", "hard case", "measured", "limit",
                        "", "worst of");
    for (const SelfCheck& c : report.checks)
        text +=
            fmt::format("{:<7}{:<8}{:<42}{:>10.4g}  {:<12}{:<13}{}\n", c.device, c.isPassed() ? "ok" : "FAILED", c.name,
                        c.measured, fmt::format("{} {:g}", c.isAtLeast ? ">=" : "<=", c.limit), c.unit, c.worst);
    return text + fmt::format("\n{} of {} as they should be, {:.0f} s\n", report.checks.size() - report.failed(),
                              report.checks.size(), report.seconds);
}

nlohmann::json jsonOfSelfTest(const SelfTestReport& report) {
    nlohmann::json checks = nlohmann::json::array();
    for (const SelfCheck& c : report.checks)
        checks.push_back({{"device", c.device},
                          {"name", c.name},
                          {"cases", c.cases},
                          {"measured", c.measured},
                          {c.isAtLeast ? "least" : "most", c.limit},
                          {"unit", c.unit},
                          {"worst_of", c.worst},
                          {"passed", c.isPassed()}});
    return {{"checks", checks},
            {"failed", report.failed()},
            {"devices", report.devices},
            {"absent", report.absent},
            {"seconds", report.seconds}};
}

}  // namespace stipple::study
