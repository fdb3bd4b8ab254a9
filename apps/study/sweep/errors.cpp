#include "apps/study/sweep/errors.h"

#include <algorithm>
#include <cmath>

#include "apps/study/metrics/flip.h"
#include "apps/study/metrics/masks.h"
#include "apps/study/metrics/ssim.h"
#include "apps/study/pictures.h"
#include "apps/study/statistics/intervals.h"
#include "engine/reference/reference.h"

namespace stipple::study {
namespace {

constexpr uint32_t kCrop = 48, kZoom = 4;  // px

/// Where a window of kCrop has most of what is seen to differ.
glm::uvec2 worstPlace(const Plane& seen) {
    glm::uvec2 worst(0);
    double most = -1;
    for (uint32_t y = 0; y + kCrop <= seen.height; y += 8)
        for (uint32_t x = 0; x + kCrop <= seen.width; x += 8) {
            double sum = 0;
            for (uint32_t v = y; v < y + kCrop; v += 2)
                for (uint32_t u = x; u < x + kCrop; u += 2) sum += seen.values[size_t{v} * seen.width + u];
            if (sum <= most) continue;
            most = sum;
            worst = {x, y};
        }
    return worst;
}

/// Dark violet by red to light yellow.
uint32_t heatOf(double share) {
    const double s = std::clamp(share, 0.0, 1.0);
    const auto channel = [](double v) { return static_cast<uint32_t>(std::lround(255 * std::clamp(v, 0.0, 1.0))); };
    return channel(1.6 * s) | channel(2.2 * s - 1.0) << 8 | channel(s < 0.5 ? 0.15 + s : 1.3 - 1.3 * s) << 16 |
           0xff000000u;
}

render::Image cropOf(const render::Image& image, const render::Image& traced, const Plane& seen) {
    render::Image heat;
    heat.width = seen.width;
    heat.height = seen.height;
    for (const float v : seen.values) heat.rgba.push_back(heatOf(v));
    const glm::uvec2 at = worstPlace(seen);
    const uint32_t w = std::min(kCrop, seen.width), h = std::min(kCrop, seen.height);
    std::vector<render::Image> panels;
    for (const render::Image* of : {&image, &traced, static_cast<const render::Image*>(&heat)})
        panels.push_back(cropped(*of, at.x, at.y, w, h, kZoom));
    return sideBySide(panels);
}

Result<void> compareWithTruth(const CellTools& tools, const render::Image& image, CellErrors& e,
                              const KeepCrop& keepCrop) {
    const render::Image& traced = tools.truth.traced;
    STIPPLE_ASSIGN(const auto difference, reference::compareImages(image, traced, 4, nullptr));
    e.psnr = difference.psnr;
    e.psnrForeground = difference.foregroundPsnr;
    STIPPLE_ASSIGN(e.ssim, ssim(image, traced));
    STIPPLE_ASSIGN(const Plane seen, flip(image, traced));
    double sum = 0;
    std::vector<double> values(seen.values.begin(), seen.values.end());
    for (const double v : values) sum += v;
    e.flipMean = sum / static_cast<double>(values.size());
    e.flipP95 = quantile(std::move(values), 0.95);
    const MaskErrors masks = compareMasks(image, traced);
    e.overlap = masks.overlap;
    e.boundary = masks.boundaryPixels;
    e.holes = static_cast<double>(masks.holes);
    e.spill = static_cast<double>(masks.spill);
    e.depthRmse = masks.depthRmse;
    e.depthP99 = masks.depthP99;
    e.normalMean = masks.normalMean;
    e.normalP95 = masks.normalP95;
    if (keepCrop) STIPPLE_TRY(keepCrop(cropOf(image, traced, seen)));
    return {};
}

void auditCell(const CellTools& tools, const render::Image& image, CellErrors& e) {
    if (tools.full == nullptr) return;
    const Audit audit = auditDepths(image, tools.truth.traced, tools.truth.view, *tools.full, e.stated, tools.executor);
    const auto number = [](uint64_t n) { return static_cast<double>(n); };
    e.lodMedian = audit.p50;
    e.lodP99 = audit.p99;
    e.lodMost = audit.worst;
    e.audited = number(audit.drawn);
    e.beyond = number(audit.beyond());
    e.outline = number(audit.outline);
    e.gap = number(audit.gap);
    e.between = number(audit.between);
    e.other = number(audit.other);
}

}  // namespace

Pop popOf(const render::Image& frame, const render::Image& next) {
    std::vector<double> changes;
    for (size_t i = 0; i < frame.rgba.size(); ++i) {
        const bool isCovered = frame.depth.empty() || frame.depth[i] > 0 || next.depth[i] > 0;
        if (!isCovered) continue;
        int most = 0;
        for (uint32_t shift = 0; shift < 24; shift += 8)
            most = std::max(most, std::abs(static_cast<int>(frame.rgba[i] >> shift & 255u) -
                                           static_cast<int>(next.rgba[i] >> shift & 255u)));
        changes.push_back(most);
    }
    if (changes.empty()) return {};
    const double most = *std::max_element(changes.begin(), changes.end());
    return {quantile(std::move(changes), 0.999), most};
}

lod::View turnedBy(const lod::View& view, double pixels) {
    lod::View v = view;
    if (view.isOrthographic) {
        v.eye += view.right * (pixels / view.focalPixels);
        return v;
    }
    const double angle = pixels / view.focalPixels;
    v.forward = std::cos(angle) * view.forward + std::sin(angle) * view.right;
    v.right = std::cos(angle) * view.right - std::sin(angle) * view.forward;
    return v;
}

Flicker flickerOf(const render::Image& frame, const render::Image& moved, const render::Image& traced,
                  const render::Image& tracedMoved) {
    std::vector<double> changes;
    double sum = 0;
    for (size_t i = 0; i < frame.rgba.size(); ++i) {
        const uint32_t a = frame.rgba[i], b = moved.rgba[i], c = traced.rgba[i], d = tracedMoved.rgba[i];
        if ((a | b | c | d) >> 24 == 0) continue;
        int most = 0;
        for (uint32_t shift = 0; shift < 24; shift += 8) {
            const auto of = [shift](uint32_t pixel) { return static_cast<int>(pixel >> shift & 255u); };
            most = std::max(most, std::abs((of(b) - of(a)) - (of(d) - of(c))));
        }
        changes.push_back(most);
        sum += most;
    }
    if (changes.empty()) return {};
    const double mean = sum / static_cast<double>(changes.size());
    return {mean, quantile(std::move(changes), 0.99)};
}

std::span<const ErrorColumn> errorColumns() {
    using E = CellErrors;
    static constexpr std::array<ErrorColumn, 42> kColumns{{{"stated_px", &E::stated},
                                                           {"records", &E::records},
                                                           {"triangles", &E::triangles},
                                                           {"nodes", &E::nodes},
                                                           {"cut_bytes", &E::bytes},
                                                           {"lod_px_median", &E::lodMedian},
                                                           {"lod_px_p99", &E::lodP99},
                                                           {"lod_px_max", &E::lodMost},
                                                           {"audited_pixels", &E::audited},
                                                           {"beyond_pixels", &E::beyond},
                                                           {"beyond_outline", &E::outline},
                                                           {"beyond_gap", &E::gap},
                                                           {"beyond_between", &E::between},
                                                           {"beyond_other", &E::other},
                                                           {"lod_db", &E::lodDecibels},
                                                           {"implementation_db", &E::backendDecibels},
                                                           {"implementation_differing", &E::backendDiffering},
                                                           {"psnr_db", &E::psnr},
                                                           {"psnr_foreground_db", &E::psnrForeground},
                                                           {"reconstruction_db", &E::leavesDecibels},
                                                           {"ssim", &E::ssim},
                                                           {"flip_mean", &E::flipMean},
                                                           {"flip_p95", &E::flipP95},
                                                           {"silhouette_iou", &E::overlap},
                                                           {"boundary_px", &E::boundary},
                                                           {"holes", &E::holes},
                                                           {"spill", &E::spill},
                                                           {"depth_rmse", &E::depthRmse},
                                                           {"depth_p99", &E::depthP99},
                                                           {"normal_deg_mean", &E::normalMean},
                                                           {"normal_deg_p95", &E::normalP95},
                                                           {"pop_p999", &E::popP999},
                                                           {"pop_max", &E::popMost},
                                                           {"pop_faded_p999", &E::popFaded},
                                                           {"flicker_mean", &E::flickerMean},
                                                           {"flicker_p99", &E::flickerP99},
                                                           {"shadow_pixels", &E::shadowPixels},
                                                           {"shadow_dark", &E::shadowDark},
                                                           {"shadow_wrong", &E::shadowWrong},
                                                           {"shadow_beyond", &E::shadowBeyond},
                                                           {"shadow_px_max", &E::shadowMost},
                                                           {"shadow_stated_px", &E::shadowStated}}};
    return kColumns;
}

Result<CellErrors> measureCell(const CellTools& tools, const Cell& cell, const render::Image& leaves,
                               const KeepCrop& keepCrop) {
    CellErrors e;
    STIPPLE_ASSIGN(const render::Image* drawn,
                   tools.drawer.draw(tools.truth.view, cell.mode, cell.target, cell.records));
    const FrameCounters& c = tools.drawer.counters();
    e.stated = c.budgetTruncated ? std::numeric_limits<double>::infinity() : c.tauEffectivePixels;
    e.records = static_cast<double>(c.recordsDrawn);
    e.triangles = static_cast<double>(c.trianglesDrawn);
    e.nodes = static_cast<double>(c.nodesDrawn);
    e.bytes = static_cast<double>(tools.drawer.cutBytes());
    auditCell(tools, *drawn, e);
    STIPPLE_ASSIGN(const auto detail, reference::compareImages(*drawn, leaves, 4, nullptr));
    e.lodDecibels = detail.foregroundPsnr;
    STIPPLE_ASSIGN(const auto reconstruction, reference::compareImages(leaves, tools.truth.traced, 4, nullptr));
    e.leavesDecibels = reconstruction.foregroundPsnr;
    STIPPLE_TRY(compareWithTruth(tools, *drawn, e, keepCrop));
    const render::Image frame = *drawn;
    STIPPLE_ASSIGN(const render::Image* moved,
                   tools.drawer.draw(tools.truth.moved, cell.mode, cell.target, cell.records));
    const Flicker flicker = flickerOf(frame, *moved, tools.truth.traced, tools.truth.tracedMoved);
    e.flickerMean = flicker.mean;
    e.flickerP99 = flicker.p99;
    if (cell.hasBudget()) return e;
    STIPPLE_ASSIGN(const render::Image* next, tools.drawer.draw(tools.truth.view, cell.mode, kPopStep * cell.target));
    const Pop pop = popOf(frame, *next);
    e.popP999 = pop.p999;
    e.popMost = pop.most;
    if (tools.oracle == nullptr) return e;
    STIPPLE_ASSIGN(const render::Image* restated, tools.oracle->draw(tools.truth.small, cell.mode, cell.target));
    STIPPLE_ASSIGN(const render::Image* own, tools.drawer.draw(tools.truth.small, cell.mode, cell.target));
    STIPPLE_ASSIGN(const auto implementation, reference::compareImages(*own, *restated, 4, nullptr));
    e.backendDecibels = implementation.foregroundPsnr;
    e.backendDiffering = implementation.differingFraction;
    STIPPLE_ASSIGN(const render::Image faded,
                   tools.drawer.drawFaded(tools.truth.small, cell.mode, cell.target, kFadeFrames));
    STIPPLE_ASSIGN(const render::Image fadedNext,
                   tools.drawer.drawFaded(tools.truth.small, cell.mode, kPopStep * cell.target, kFadeFrames));
    e.popFaded = popOf(faded, fadedNext).p999;
    return e;
}

}  // namespace stipple::study
