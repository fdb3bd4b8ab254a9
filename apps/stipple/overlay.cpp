#include "apps/stipple/overlay.h"

#include <fmt/format.h>
#include <imgui.h>

#include <algorithm>
#include <cmath>

#include "apps/stipple/effect_options.h"
#include "engine/base/process.h"
#include "engine/base/units.h"
#include "engine/render/content.h"

namespace stipple::app {
namespace {

const ImVec4 kWarning{1, 0.45f, 0.35f, 1};

/// Everything is laid out for letters of 13 pixels.
float unit() { return ImGui::GetFontSize() / 13; }

/// A window of text at a place of the screen (shares of its width and height).
void beginPanel(const char* name, float x, float y) {
    const ImVec2 size = ImGui::GetIO().DisplaySize;
    const float margin = 10 * unit();
    ImGui::SetNextWindowPos(ImVec2(margin + x * (size.x - 2 * margin), margin + y * (size.y - 2 * margin)),
                            ImGuiCond_Always, ImVec2(x, y));
    ImGui::SetNextWindowBgAlpha(0.7f);
    ImGui::Begin(name, nullptr,
                 ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoMove |
                     ImGuiWindowFlags_NoNav | ImGuiWindowFlags_NoInputs | ImGuiWindowFlags_NoFocusOnAppearing);
}

std::string roughly(uint64_t count) {
    const auto value = static_cast<double>(count);
    return count < 10'000      ? std::to_string(count)
           : count < 1'000'000 ? fmt::format("{:.0f} k", value * 1e-3)
                               : fmt::format("{:.2f} M", value * 1e-6);
}

/// What the records of a frame are.
std::string drawnText(const render::FrameState& state) {
    const FrameCounters& c = state.counters;
    const render::FrameContent content = render::contentOf(state.draws);
    const bool hasCurves = content.has(lod::Kind::curves), hasPoints = content.has(lod::Kind::points);
    const std::string records = roughly(c.recordsDrawn) + (!hasCurves   ? " points"
                                                           : !hasPoints ? " segments"
                                                                        : " points and segments"),
                      triangles = roughly(c.trianglesDrawn) + " triangles";
    return c.trianglesDrawn == 0 ? records : c.recordsDrawn == 0 ? triangles : records + ", " + triangles;
}

/// Where even the coarsest level exceeds the budget, there is no error to state.
std::string errorText(const FrameCounters& c) {
    return c.budgetTruncated ? "only a part is drawn: --budget-points"
                             : fmt::format("error {:.2f} px", c.tauEffectivePixels);
}

/// While it moves a picture is one frame.
std::string accumulatedText(const OverlayFacts& f) {
    return f.accumulated == 0 ? "" : fmt::format("mean of {} of {} frames   ", f.accumulated, f.accumulates);
}

void drawBrief(const OverlayFacts& f) {
    const FrameCounters& c = f.state.counters;
    ImGui::TextUnformatted(fmt::format("{:.1f} ms   {}   {}   {}{}   H: keys", frameMsOf(f.state), errorText(c),
                                       drawnText(f.state), accumulatedText(f), f.hands)
                               .c_str());
}

void drawFull(const OverlayFacts& f) {
    const FrameCounters& c = f.state.counters;
    const lod::Budgets& budgets = f.settings.frame.budgets;
    const auto line = [](const std::string& text) { ImGui::TextUnformatted(text.c_str()); };
    line(fmt::format("{}: {}", f.state.backend->name(), f.state.backend->device()));
    if (f.state.onDevice)
        line(fmt::format("{:.1f} ms a frame, {:.1f} ms to hand it in and show it   {}", frameMsOf(f.state), f.windowMs,
                         f.hands));
    else
        line(fmt::format("{:.1f} ms a frame, {:.1f} ms with the window   {}", c.frameMs, f.windowMs, f.hands));
    for (const render::PassTime& p : f.state.backend->passTimes())
        line(fmt::format("  {:<8} {:6.2f} ms", p.name, p.ms));
    if (f.accumulated > 0) line(accumulatedText(f));
    if (const std::string text = effectsText(render::effectStatus(f.state, f.settings.frame.draw)); !text.empty())
        line("effects: " + text);
    line(fmt::format("delivered {} (asked for {:.2f} px)", errorText(c), budgets.errorPixels));
    line(fmt::format("{} nodes, {} missing, {} hidden, {} chunks on their way", c.nodesDrawn, c.nodesMissing,
                     c.nodesHidden, c.requestsInFlight));
    ImGui::ProgressBar(static_cast<float>(c.recordsDrawn + c.trianglesDrawn) / static_cast<float>(budgets.records),
                       ImVec2(300 * unit(), 0),
                       fmt::format("{} of {}", drawnText(f.state), roughly(budgets.records)).c_str());
    line(fmt::format("resident {}", humanBytes(c.residentBytes)));
    line(fmt::format("debug view: {}   H: keys", kDebugNames.at(f.settings.frame.draw.debugView)));
}

void drawHelp(const std::vector<KeyHelp>& keys) {
    beginPanel("keys", 0.5f, 0.4f);
    float widest = 0;
    for (const KeyHelp& k : keys) widest = std::max(widest, ImGui::CalcTextSize(k.key.c_str()).x);
    const float start = ImGui::GetCursorPosX();
    for (const KeyHelp& k : keys) {
        ImGui::TextUnformatted(k.key.c_str());
        ImGui::SameLine(start + widest + 16 * unit());
        ImGui::TextUnformatted(k.what.c_str());
    }
    ImGui::End();
}

void drawNotices(const Notices& notices, const std::string& opening) {
    if (notices.lines().empty() && opening.empty()) return;
    const float width = ImGui::GetIO().DisplaySize.x - 40 * unit();
    beginPanel("notices", 0.5f, 1);
    const auto line = [&](const std::string& text, bool isError) {
        ImGui::PushStyleColor(ImGuiCol_Text, isError ? kWarning : ImVec4(1, 1, 1, 1));
        ImGui::PushTextWrapPos(ImGui::GetCursorPosX() + width);
        ImGui::TextUnformatted(text.c_str());
        ImGui::PopTextWrapPos();
        ImGui::PopStyleColor();
    };
    if (!opening.empty()) line(opening, false);
    for (const Notices::Notice& n : notices.lines()) line(n.text, n.isError);
    ImGui::End();
}

void swatch(uint32_t rgb, float width, float height) {
    const ImVec2 at = ImGui::GetCursorScreenPos();
    ImGui::GetWindowDrawList()->AddRectFilled(at, ImVec2(at.x + width, at.y + height), rgb | 0xff000000u);
}

void drawBar(const Legend& legend) {
    const float u = unit();
    ImGui::Dummy(ImVec2(1, 6 * u));
    const ImVec2 start = ImGui::GetCursorPos();
    for (size_t j = legend.bar.size(); j-- > 0;) {
        swatch(legend.bar[j], 13 * u, std::ceil(u));
        ImGui::SetCursorPosY(ImGui::GetCursorPosY() + u);
    }
    const float step = u * static_cast<float>(legend.bar.size()) / static_cast<float>(legend.entries.size() - 1);
    for (size_t i = 0; i < legend.entries.size(); ++i) {
        const float up = step * static_cast<float>(legend.entries.size() - 1 - i);
        ImGui::SetCursorPos(ImVec2(start.x + 20 * u, start.y + up - 7 * u));
        ImGui::TextUnformatted(legend.entries[i].label.c_str());
    }
}

void drawLegendPanel(const Legend& legend) {
    if (legend.entries.empty()) return;
    beginPanel("legend", 0, 1);
    ImGui::TextUnformatted(legend.title.c_str());
    if (!legend.bar.empty()) drawBar(legend);
    for (const LegendEntry& e : legend.entries) {
        if (!legend.bar.empty()) break;
        swatch(e.rgb, 13 * unit(), 13 * unit());
        ImGui::Indent(20 * unit());
        ImGui::TextUnformatted(e.label.c_str());
        ImGui::Unindent(20 * unit());
    }
    if (!legend.noData.label.empty()) {
        swatch(legend.noData.rgb, 13 * unit(), 13 * unit());
        ImGui::Indent(20 * unit());
        ImGui::TextUnformatted(legend.noData.label.c_str());
        ImGui::Unindent(20 * unit());
    }
    ImGui::End();
}

}  // namespace

double frameMsOf(const render::FrameState& state) {
    double onDevice = 0;
    for (const render::PassTime& p : state.backend->passTimes()) onDevice += p.isBeside ? 0 : p.ms;
    return state.onDevice ? std::max(state.counters.frameMs, onDevice) : state.counters.frameMs;
}

void drawOverlay(const OverlayFacts& f) {
    if (f.settings.detail != Detail::off) {
        beginPanel("figures", 0, 0);
        if (f.settings.detail == Detail::full)
            drawFull(f);
        else
            drawBrief(f);
        if (f.state.counters.failures > 0) ImGui::TextColored(kWarning, "%s", f.state.streamer->lastFailure().c_str());
        ImGui::End();
        drawLegendPanel(f.legend);
    }
    if (f.settings.help) drawHelp(keyHelp(f.keyNames));
    drawNotices(f.notices, f.opening);
}

}  // namespace stipple::app
