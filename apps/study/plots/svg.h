// SVG as text. Numbers have at most two decimals, so that the same drawing is the same bytes everywhere.
#pragma once

#include <string>
#include <vector>

namespace stipple::study {

/// For text and attributes of SVG and HTML.
std::string escaped(const std::string& text);
/// "12.5", "-3", at most two decimals.
std::string shortNumber(double value);

enum class Anchor { start, middle, end };

class Svg {
  public:
    Svg(double width, double height, const std::string& title);
    /// `style`: attributes, e.g. "stroke=\"#888\"".
    void line(double x1, double y1, double x2, double y2, const std::string& style);
    void rect(double x, double y, double w, double h, const std::string& style, const std::string& tip = "");
    void circle(double x, double y, double r, const std::string& style, const std::string& tip = "");
    void polyline(const std::vector<std::pair<double, double>>& points, const std::string& style);
    void text(double x, double y, const std::string& what, Anchor anchor, const std::string& style = "");
    /// Turned by 90 degrees against the clock.
    void textUp(double x, double y, const std::string& what);
    std::string finish() const { return body_ + "</svg>\n"; }

  private:
    std::string body_;
};

}  // namespace stipple::study
