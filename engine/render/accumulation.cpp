#include "engine/render/accumulation.h"

#include <algorithm>
#include <cmath>

#include "engine/base/check.h"

namespace stipple::render {
namespace {

constexpr size_t kGrain = 1 << 14;  // pixels

/// NaN shows nothing.
float shown(float linear) { return linear > 0 ? std::min(linear, 1.0f) : 0.0f; }

}  // namespace

void Accumulation::add(const Image& image, Executor& executor) {
    const size_t pixels = image.rgba.size();
    STIPPLE_CHECK(image.linear.size() == 3 * pixels, "a picture with linear colours");
    if (count_ == 0 || image.width != width_ || image.height != height_) {
        sum_.assign(4 * pixels, 0.0f);
        width_ = image.width;
        height_ = image.height;
        count_ = 0;
    }
    executor.parallelFor(pixels, kGrain, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) {
            for (size_t c = 0; c < 3; ++c) sum_[4 * i + c] += shown(image.linear[3 * i + c]);
            sum_[4 * i + 3] += static_cast<float>(image.rgba[i] >> 24);
        }
    });
    ++count_;
}

void Accumulation::mean(Image& out, Executor& executor) const {
    STIPPLE_CHECK(count_ > 0, "a mean of nothing");
    out.width = width_;
    out.height = height_;
    out.rgba.resize(sum_.size() / 4);
    out.linear.resize(3 * out.rgba.size());
    const float share = 1.0f / static_cast<float>(count_);
    executor.parallelFor(out.rgba.size(), kGrain, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) {
            uint32_t rgba = static_cast<uint32_t>(sum_[4 * i + 3] * share + 0.5f) << 24;
            for (size_t c = 0; c < 3; ++c) {
                const float linear = sum_[4 * i + c] * share;
                out.linear[3 * i + c] = linear;
                rgba |= static_cast<uint32_t>(shared::srgbFromLinear(linear) * 255.0f + 0.5f) << (8 * c);
            }
            out.rgba[i] = rgba;
        }
    });
}

FrameSettings settingsOf(const FrameSettings& settings, uint32_t index, const Exposure& exposure) {
    FrameSettings s = settings;
    s.wantDepthAndNormal = true;  // for linear colours
    s.staysOnDevice = false;
    s.draw.coverageSeed = index;
    const FrameSample sample = sampleOf(index);
    if (exposure.shutter > 0) s.draw.wind.seconds += exposure.shutter * sample.time;
    if (exposure.fade > 0) s.budgets.errorPixels *= std::exp2(-exposure.fade * sample.fade);
    return s;
}

lod::View viewOf(const ViewAfter& after, uint32_t index, const Exposure& exposure) {
    const FrameSample sample = sampleOf(index);
    return viewOf(after(exposure.shutter > 0 ? exposure.shutter * sample.time : 0), sample, exposure.lens);
}

Result<void> expose(const Exposure& exposure, const ViewAfter& after, const FrameSettings& settings,
                    const DrawFrame& draw, Image& image, Executor& executor) {
    if (exposure.isPlain()) return {};
    Image middle = std::move(image);
    image = {};
    Accumulation sum;
    for (uint32_t i = 0; i < exposure.samples; ++i) {
        STIPPLE_TRY(draw(viewOf(after, i, exposure), settingsOf(settings, i, exposure)));
        sum.add(image, executor);
    }
    sum.mean(middle, executor);
    image = std::move(middle);
    return {};
}

}  // namespace stipple::render
