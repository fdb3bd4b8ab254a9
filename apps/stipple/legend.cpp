#include "apps/stipple/legend.h"

#include <fmt/format.h>
#include <imgui.h>

#include <algorithm>
#include <cmath>

#include "engine/base/numbers.h"

namespace stipple::app {
namespace {

constexpr size_t kTicks = 5, kMostCategories = 24;
constexpr int kMargin = 12, kPad = 8, kSwatch = 14, kBar = 160;

/// The font that Dear ImGui carries, as coverage; used without a window.
class Font {
  public:
    Font() {
        font_ = atlas_.AddFontDefault();
        atlas_.GetTexDataAsAlpha8(&pixels_, &width_, &height_);
    }
    int lineHeight() const { return static_cast<int>(font_->FontSize) + 3; }
    int widthOf(const std::string& text) const {
        float x = 0;
        for (const char c : text) x += font_->FindGlyph(static_cast<ImWchar>(c))->AdvanceX;
        return static_cast<int>(std::ceil(x));
    }
    template <typename Blend>
    void draw(const std::string& text, int x, int y, Blend blend) const {
        auto pen = static_cast<float>(x);
        for (const char c : text) {
            const ImFontGlyph& g = *font_->FindGlyph(static_cast<ImWchar>(c));
            const int w = static_cast<int>(g.X1 - g.X0), h = static_cast<int>(g.Y1 - g.Y0);
            const int u = static_cast<int>(std::lround(g.U0 * static_cast<float>(width_)));
            const int v = static_cast<int>(std::lround(g.V0 * static_cast<float>(height_)));
            for (int j = 0; j < h; ++j)
                for (int i = 0; i < w; ++i)
                    blend(static_cast<int>(pen + g.X0) + i, y + static_cast<int>(g.Y0) + j,
                          pixels_[(v + j) * width_ + u + i]);
            pen += g.AdvanceX;
        }
    }

  private:
    ImFontAtlas atlas_;
    ImFont* font_ = nullptr;
    unsigned char* pixels_ = nullptr;
    int width_ = 0, height_ = 0;
};

/// sRGB pixels of a picture with bounds; what is drawn is enlarged by a whole factor, so that letters stay sharp.
class Canvas {
  public:
    Canvas(render::Image& image, int scale) : image_(image), scale_(scale) {}
    int height() const { return static_cast<int>(image_.height) / scale_; }
    void blend(int x, int y, uint32_t rgb, uint32_t alpha) {
        for (int j = 0; j < scale_; ++j)
            for (int i = 0; i < scale_; ++i) blendPixel(x * scale_ + i, y * scale_ + j, rgb, alpha);
    }
    void fill(int x, int y, int w, int h, uint32_t rgb, uint32_t alpha) {
        for (int j = 0; j < h; ++j)
            for (int i = 0; i < w; ++i) blend(x + i, y + j, rgb, alpha);
    }

  private:
    void blendPixel(int x, int y, uint32_t rgb, uint32_t alpha) {
        if (x < 0 || y < 0 || x >= static_cast<int>(image_.width) || y >= static_cast<int>(image_.height)) return;
        uint32_t& to = image_.rgba[static_cast<size_t>(y) * image_.width + static_cast<size_t>(x)];
        uint32_t out = 0xff000000u;
        for (uint32_t shift = 0; shift < 24; shift += 8) {
            const uint32_t a = to >> shift & 255u, b = rgb >> shift & 255u;
            out |= (a * (255 - alpha) + b * alpha + 127) / 255 << shift;
        }
        to = out;
    }

    render::Image& image_;
    int scale_;
};

/// With as many digits as tell the ticks of a bar apart that spans `span`; short, however large or small the values.
std::string number(double v, double span) {
    constexpr double kLong = 1e10, kSmall = 1e-4;
    const double size = std::max(std::abs(v), std::abs(span));
    if (size > kLong || std::abs(span) < kSmall) {
        const int digits = toWhole<int>(std::ceil(std::log10(size / std::abs(span)))) + 4;
        return fmt::format("{:.{}g}", v, std::clamp(digits, 4, 17));
    }
    const int digits = std::clamp(toWhole<int>(3 - std::floor(std::log10(std::abs(span)))), 0, 9);
    return fmt::format("{:.{}f}", v, std::min(digits, 8));
}

}  // namespace

Legend makeLegend(const lod::ColourBy& by, const lod::StoreDescription& d) {
    Legend legend;
    if (by.mode == lod::ColourMode::own) return legend;
    legend.title = by.title;
    if (by.mode == lod::ColourMode::normal) {
        legend.title = "normal";
        legend.entries = {{0x8080ffu, "+x"}, {0x80ff80u, "+y"}, {0xff8080u, "+z"}};
        return legend;
    }
    if (by.isCategorical) {
        for (const auto& [value, count] : d.attributes.at(by.attribute).counts) {
            if (legend.entries.size() == kMostCategories) {
                legend.entries.push_back({0, "and more"});
                break;
            }
            legend.entries.push_back({lod::colourOf(by, value), lod::categoryName(by, value)});
        }
        return legend;
    }
    if (by.mode == lod::ColourMode::attribute && !d.attributes.at(by.attribute).description.empty())
        legend.title += ", " + d.attributes.at(by.attribute).description;
    if (by.mode == lod::ColourMode::attribute && d.attributes.at(by.attribute).withoutData > 0)
        legend.noData = {lod::kNoDataColour, "no data"};
    // Where no point has data there is no range, where all have the same value no bar.
    if (by.mode == lod::ColourMode::attribute && d.attributes.at(by.attribute).withoutData >= d.points) return legend;
    if (by.isConstant) {
        legend.entries = {{lod::colourOf(by, by.low), number(by.low, std::max(std::abs(by.low), 1.0))}};
        return legend;
    }
    for (int j = 0; j < kBar; ++j)
        legend.bar.push_back(lod::colourOf(by, by.low + (by.high - by.low) * (j + 0.5) / kBar));
    for (size_t i = 0; i < kTicks; ++i) {
        const double v = by.low + (by.high - by.low) * static_cast<double>(i) / (kTicks - 1);
        legend.entries.push_back({lod::colourOf(by, v), number(v, by.high - by.low)});
    }
    return legend;
}

void drawLegend(const Legend& legend, render::Image& image) {
    if ((legend.entries.empty() && legend.noData.label.empty()) || image.rgba.empty()) return;
    const bool isBar = !legend.bar.empty();
    const Font font;
    const int line = font.lineHeight();
    int labelWidth = font.widthOf(legend.title) - kSwatch - kPad;
    for (const LegendEntry& e : legend.entries) labelWidth = std::max(labelWidth, font.widthOf(e.label));
    labelWidth = std::max(labelWidth, font.widthOf(legend.noData.label));
    const int rows = static_cast<int>(legend.entries.size());
    const int below = legend.noData.label.empty() ? 0 : line + 4;
    const int body = (isBar ? kBar + line : rows * line) + below;
    const int w = 3 * kPad + kSwatch + labelWidth, h = 2 * kPad + line + 4 + body;
    // As large a part of a large picture as of one of 720 rows.
    constexpr double kRows = 720;
    Canvas canvas(image, std::max(1, static_cast<int>(std::lround(image.height / kRows))));
    const int x = kMargin, y = canvas.height() - kMargin - h;
    canvas.fill(x, y, w, h, 0x181410u, 190);
    const auto text = [&](const std::string& s, int tx, int ty) {
        font.draw(s, tx, ty, [&](int px, int py, uint32_t alpha) { canvas.blend(px, py, 0xf0f0f0u, alpha); });
    };
    text(legend.title, x + kPad, y + kPad);
    const int top = y + kPad + line + 4;
    for (int i = 0; i < rows; ++i) {
        const LegendEntry& e = legend.entries[static_cast<size_t>(i)];
        const int at = isBar ? top + kBar - kBar * i / (rows - 1) : top + i * line;
        if (!isBar) canvas.fill(x + kPad, at, kSwatch, line - 3, e.rgb, 255);
        text(e.label, x + 2 * kPad + kSwatch, at);
    }
    if (below > 0) {
        canvas.fill(x + kPad, top + body - line, kSwatch, line - 3, legend.noData.rgb, 255);
        text(legend.noData.label, x + 2 * kPad + kSwatch, top + body - line);
    }
    for (int j = 0; isBar && j < kBar; ++j)
        canvas.fill(x + kPad, top + line / 2 + j, kSwatch, 1, legend.bar[static_cast<size_t>(kBar - 1 - j)], 255);
}

}  // namespace stipple::app
