#include "apps/study/plots/svg.h"

#include <fmt/format.h>

namespace stipple::study {
namespace {

std::string withTip(const std::string& element, const std::string& tip, const char* name) {
    if (tip.empty()) return element + "/>\n";
    return fmt::format("{}><title>{}</title></{}>\n", element, escaped(tip), name);
}

}  // namespace

std::string escaped(const std::string& text) {
    std::string out;
    for (const char c : text) switch (c) {
            case '&':
                out += "&amp;";
                break;
            case '<':
                out += "&lt;";
                break;
            case '>':
                out += "&gt;";
                break;
            case '"':
                out += "&quot;";
                break;
            default:
                out += static_cast<unsigned char>(c) < 32 && c != '\n' ? ' ' : c;
        }
    return out;
}

std::string shortNumber(double value) {
    std::string text = fmt::format("{:.2f}", value);
    text.erase(text.find_last_not_of('0') + 1);
    if (text.back() == '.') text.pop_back();
    return text == "-0" ? "0" : text;
}

Svg::Svg(double width, double height, const std::string& title)
    : body_(
          fmt::format("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" "
                      "font-family=\"sans-serif\" font-size=\"12\" role=\"img\" aria-label=\"{2}\">\n<rect "
                      "width=\"{0}\" height=\"{1}\" fill=\"#fff\"/>\n",
                      shortNumber(width), shortNumber(height), escaped(title))) {}

void Svg::line(double x1, double y1, double x2, double y2, const std::string& style) {
    body_ += fmt::format("<line x1=\"{}\" y1=\"{}\" x2=\"{}\" y2=\"{}\" {}/>\n", shortNumber(x1), shortNumber(y1),
                         shortNumber(x2), shortNumber(y2), style);
}

void Svg::rect(double x, double y, double w, double h, const std::string& style, const std::string& tip) {
    body_ += withTip(fmt::format("<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" {}", shortNumber(x),
                                 shortNumber(y), shortNumber(w), shortNumber(h), style),
                     tip, "rect");
}

void Svg::circle(double x, double y, double r, const std::string& style, const std::string& tip) {
    body_ += withTip(
        fmt::format("<circle cx=\"{}\" cy=\"{}\" r=\"{}\" {}", shortNumber(x), shortNumber(y), shortNumber(r), style),
        tip, "circle");
}

void Svg::polyline(const std::vector<std::pair<double, double>>& points, const std::string& style) {
    std::string list;
    for (const auto& [x, y] : points)
        list += fmt::format("{}{},{}", list.empty() ? "" : " ", shortNumber(x), shortNumber(y));
    body_ += fmt::format("<polyline points=\"{}\" fill=\"none\" {}/>\n", list, style);
}

void Svg::text(double x, double y, const std::string& what, Anchor anchor, const std::string& style) {
    const char* const at = anchor == Anchor::start ? "start" : anchor == Anchor::middle ? "middle" : "end";
    body_ += fmt::format("<text x=\"{}\" y=\"{}\" text-anchor=\"{}\" {}>{}</text>\n", shortNumber(x), shortNumber(y),
                         at, style, escaped(what));
}

void Svg::textUp(double x, double y, const std::string& what) {
    body_ += fmt::format("<text transform=\"translate({} {}) rotate(-90)\" text-anchor=\"middle\">{}</text>\n",
                         shortNumber(x), shortNumber(y), escaped(what));
}

}  // namespace stipple::study
