#include "engine/render/backdrop.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/render/draw_list.h"
#include "shaders/shared/lens.h"

namespace stipple::render {
namespace {

/// Cosine of the elevation of a row's middle.
double cosineOf(uint32_t row, uint32_t height) { return std::sin((row + 0.5) / height * std::numbers::pi); }

/// The mean of what [begin, end) covers of cells of width 1, each times `weightOf` it; `add(cell, weight)`.
template <typename WeightOf, typename Add>
void overCells(double begin, double end, uint32_t cells, const WeightOf& weightOf, const Add& add) {
    double sum = 0;
    const auto first = static_cast<uint32_t>(begin), last = std::min(static_cast<uint32_t>(std::ceil(end)), cells);
    const auto weightAt = [&](uint32_t c) {
        return (std::min<double>(end, c + 1.0) - std::max<double>(begin, c)) * weightOf(c);
    };
    for (uint32_t c = first; c < last; ++c) sum += weightAt(c);
    for (uint32_t c = first; c < last; ++c) add(c, static_cast<float>(weightAt(c) / sum));
}

/// The picture with fewer texels, each the mean of what it covers, by solid angle.
HdrImage smaller(const HdrImage& from, uint32_t width, uint32_t height, Executor& executor) {
    HdrImage to{width, height, std::vector<float>(size_t{3} * width * height)};
    executor.parallelFor(height, 8, [&](size_t begin, size_t end) {
        std::vector<float> row(size_t{3} * from.width);
        for (size_t y = begin; y < end; ++y) {
            std::fill(row.begin(), row.end(), 0.0f);
            const double high = double(from.height) / height, wide = double(from.width) / width;
            overCells(
                static_cast<double>(y) * high, (static_cast<double>(y) + 1) * high, from.height,
                [&](uint32_t r) { return cosineOf(r, from.height); },
                [&](uint32_t r, float weight) {
                    const float* const light = &from.rgb[size_t{3} * r * from.width];
                    for (size_t i = 0; i < row.size(); ++i) row[i] += weight * light[i];
                });
            float* const out = &to.rgb[size_t{3} * y * width];
            for (uint32_t x = 0; x < width; ++x)
                overCells(
                    x * wide, (x + 1) * wide, from.width, [](uint32_t) { return 1.0; },
                    [&](uint32_t c, float weight) {
                        for (size_t k = 0; k < 3; ++k) out[size_t{3} * x + k] += weight * row[size_t{3} * c + k];
                    });
        }
    });
    return to;
}

/// A row as means of `wide` texels about each, around the closed row.
void spread(const float* from, uint32_t width, double wide, std::vector<double>& sums, std::vector<float>& to) {
    sums.resize(width + size_t{1});
    wide = std::min<double>(wide, width);
    for (size_t k = 0; k < 3; ++k) {
        for (size_t x = 0; x < width; ++x) sums[x + 1] = sums[x] + double{from[3 * x + k]};
        const auto upTo = [&](double at) {
            const double turns = std::floor(at / width), within = at - turns * width;
            const auto whole = std::min(static_cast<size_t>(within), size_t{width} - 1);
            return turns * sums[width] + sums[whole] +
                   (within - static_cast<double>(whole)) * (sums[whole + 1] - sums[whole]);
        };
        for (size_t x = 0; x < width; ++x) {
            const double middle = static_cast<double>(x) + 0.5;
            to[3 * x + k] = static_cast<float>((upTo(middle + 0.5 * wide) - upTo(middle - 0.5 * wide)) / wide);
        }
    }
}

uint32_t packed(const float* light) {
    const float most = std::max({light[0], light[1], light[2]});
    if (!(most > 0)) return 0;
    int exponent = std::max(std::ilogb(most) + 16, 0);
    if (std::lround(std::ldexp(most, 24 - exponent)) > 511) ++exponent;
    uint32_t word = static_cast<uint32_t>(exponent) << 27;
    for (size_t k = 0; k < 3; ++k)
        word |= static_cast<uint32_t>(std::lround(std::ldexp(std::max(light[k], 0.0f), 24 - exponent))) << (9 * k);
    return word;
}

void addLevel(const HdrImage& level, Executor& executor, Backdrop& out) {
    const size_t first = out.texels.size();
    out.first.at(out.levels++) = static_cast<uint32_t>(first);
    out.texels.resize(first + size_t{level.width} * level.height);
    executor.parallelFor(level.height, 16, [&](size_t begin, size_t end) {
        std::vector<double> sums;
        std::vector<float> row(size_t{3} * level.width);
        for (size_t y = begin; y < end; ++y) {
            spread(&level.rgb[3 * y * level.width], level.width, 1 / cosineOf(static_cast<uint32_t>(y), level.height),
                   sums, row);
            for (size_t x = 0; x < level.width; ++x) out.texels[first + y * level.width + x] = packed(&row[3 * x]);
        }
    });
}

glm::vec3 meanOf(const HdrImage& image) {
    glm::dvec3 sum(0);
    double weights = 0;
    for (uint32_t y = 0; y < image.height; ++y) {
        const double weight = cosineOf(y, image.height);
        for (size_t x = 0; x < image.width; ++x)
            for (size_t k = 0; k < 3; ++k)
                sum[static_cast<int>(k)] += weight * double{image.rgb[3 * (size_t{y} * image.width + x) + k]};
        weights += weight * image.width;
    }
    return glm::vec3(sum / weights);
}

glm::vec3 lightAt(const Backdrop& backdrop, const shared::BackgroundConstants& c, uint32_t level, shared::vec2 place) {
    const shared::BackdropTaps t = shared::backdropTaps(c.first[level], shared::backdropSize(c.width, level),
                                                        shared::backdropSize(c.height, level), place);
    const auto look = [&](uint32_t at) { return shared::backdropLight(backdrop.texels[at]); };
    return shared::mixTaps(t, look(t.at00), look(t.at10), look(t.at01), look(t.at11));
}

}  // namespace

Backdrop makeBackdrop(HdrImage image, float scale, Executor& executor) {
    constexpr uint32_t kMostWide = 8192;
    for (float& v : image.rgb) v = std::isfinite(v) ? std::clamp(v, 0.0f, 6e4f) : 0.0f;
    if (image.width > kMostWide)
        image =
            smaller(image, kMostWide,
                    std::max(1u, static_cast<uint32_t>(uint64_t{image.height} * kMostWide / image.width)), executor);
    Backdrop out;
    out.width = image.width;
    out.height = std::min(image.height, 1u << (shared::kBackdropLevels - 1));
    if (out.height != image.height) image = smaller(image, out.width, out.height, executor);
    out.scale = scale;
    out.mean = scale * meanOf(image);
    for (;;) {
        addLevel(image, executor, out);
        if (image.height == 1) break;
        image = smaller(image, shared::backdropSize(out.width, out.levels),
                        shared::backdropSize(out.height, out.levels), executor);
    }
    return out;
}

bool showsBackdrop(const DrawSettings& settings) {
    return settings.backdrop != nullptr && settings.debugView == shared::kDebugNone;
}

shared::BackgroundConstants backgroundConstants(const DrawSettings& settings, const glm::dmat3& cameraFromWorld,
                                                const lod::View& view) {
    const Backdrop& b = *settings.backdrop;
    const glm::dmat3 axes = cameraFromWorld * environmentAxes(settings.worldUp);
    shared::BackgroundConstants c{};
    c.axisX = glm::vec3(axes[0]);
    c.axisY = glm::vec3(axes[1]);
    c.axisZ = glm::vec3(axes[2]);
    c.scale = b.scale;
    // Rays that are parallel meet one place of it.
    c.level =
        view.isOrthographic ? -100.0f : static_cast<float>(std::log2(b.height / (std::numbers::pi * view.focalPixels)));
    c.width = b.width;
    c.height = b.height;
    c.levels = b.levels;
    std::copy(b.first.begin(), b.first.end(), std::begin(c.first));
    c.tone.exposure = 1;
    const bool hasTone = std::any_of(settings.effects.begin(), settings.effects.end(),
                                     [](const EffectRequest& r) { return r.name == "tone"; });
    if (hasTone)
        c.tone = {static_cast<float>(settings.parameters.tone.exposure), settings.parameters.tone.curve != 0 ? 1u : 0u};
    return c;
}

Behind::Behind(const DrawSettings& settings, const lod::View& view) : colour_(settings.background) {
    if (!showsBackdrop(settings)) return;
    backdrop_ = settings.backdrop.get();
    constants_ = backgroundConstants(settings, glm::transpose(glm::dmat3(view.right, view.down, view.forward)), view);
    constants_.tone = {1, 0};
    view_ = view;
}

glm::vec3 Behind::at(size_t pixel) const {
    if (backdrop_ == nullptr) return colour_;
    const auto focal = static_cast<float>(view_.focalPixels);
    const glm::vec2 at =
        (glm::vec2(pixel % view_.width, pixel / view_.width) + 0.5f - glm::vec2(view_.principal())) / focal;
    const shared::vec3 ray =
        shared::rayDirection(shared::pixelRay(shared::lensOf(focal, view_.isOrthographic), at.x, at.y));
    const float level = shared::backdropLevel(constants_, shared::dot(ray, ray));
    const auto fine = static_cast<uint32_t>(level), coarse = std::min(fine + 1, constants_.levels - 1);
    const shared::vec2 place = shared::backdropPlace(shared::backdropDirection(constants_, ray));
    return shared::backdropShown(constants_, lightAt(*backdrop_, constants_, fine, place),
                                 lightAt(*backdrop_, constants_, coarse, place), level - static_cast<float>(fine));
}

}  // namespace stipple::render
