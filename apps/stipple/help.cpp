#include "apps/stipple/help.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <sstream>

#include "apps/stipple/options.h"
#include "apps/stipple/report.h"
#include "apps/topics.h"

namespace stipple::app {
namespace {

constexpr size_t kWidth = 96, kColumn = 30;

/// Words on lines of at most `width` characters; line breaks stay.
std::vector<std::string> wrap(const std::string& text, size_t width) {
    std::vector<std::string> lines;
    std::istringstream paragraphs(text);
    for (std::string paragraph; std::getline(paragraphs, paragraph);) {
        std::istringstream words(paragraph);
        std::string line;
        for (std::string word; words >> word;) {
            if (!line.empty() && line.size() + 1 + word.size() > width) lines.push_back(std::exchange(line, ""));
            line += (line.empty() ? "" : " ") + word;
        }
        lines.push_back(line);
    }
    return lines;
}

std::string row(const std::string& left, const std::string& right) {
    std::string out = "  " + left;
    if (left.size() + 3 > kColumn) out += "\n" + std::string(kColumn, ' ');
    out.resize(std::max(out.size(), kColumn), ' ');
    const auto lines = wrap(right, kWidth - kColumn);
    for (size_t i = 0; i < lines.size(); ++i) out += (i == 0 ? "" : std::string(kColumn, ' ')) + lines[i] + "\n";
    return lines.empty() ? out + "\n" : out;
}

/// "TEXT:{a,b}" -> "a|b", numbers by one letter.
std::string kindOf(const CLI::Option* option) {
    std::string kind = option->get_type_name();
    if (const size_t list = kind.find('{'); list != std::string::npos) {
        kind = kind.substr(list + 1, kind.find('}') - list - 1);
        std::replace(kind.begin(), kind.end(), ',', '|');
        return kind;
    }
    const std::string base = kind.substr(0, kind.find(':')), values = kind.substr(base.size());
    kind = values.find('|') != std::string::npos && values.find(' ') == std::string::npos ? values.substr(1) : base;
    if (kind == "INT" || kind == "UINT") return "N";
    if (kind == "FLOAT") return "X";
    if (kind == "TEXT") return "VALUE";
    return kind;
}

class HelpFormatter final : public CLI::Formatter {
  public:
    std::string make_usage(const CLI::App* app, std::string name) const override {
        std::string out = "Usage: " + name;
        for (const CLI::Option* o :
             app->get_options([](const CLI::Option* option) { return option->get_positional(); }))
            out += " " + make_option_usage(o);
        for (const CLI::Option* o : app->get_options([](const CLI::Option* option) { return option->nonpositional(); }))
            if (o->get_required()) out += " " + leftOf(o, true);
        const auto subs = app->get_subcommands([](const CLI::App* sub) { return !sub->get_name().empty(); });
        out += subs.empty() ? " [OPTIONS]" : " COMMAND ...";
        return out + "\n";
    }
    std::string make_option(const CLI::Option* option, bool isPositional) const override {
        std::string text = option->get_description();
        const std::string& standard = option->get_default_str();
        if (!standard.empty() && standard != "\"\"" && !isPositional) text += fmt::format(" [{}]", standard);
        std::vector<std::string> others;
        for (const CLI::Option* other : option->get_excludes()) others.push_back(other->get_name());
        std::sort(others.begin(), others.end());
        if (!others.empty()) text += fmt::format(" (not with {})", fmt::join(others, ", "));
        return row(isPositional ? make_option_usage(option) : leftOf(option, false), text);
    }
    std::string make_subcommand(const CLI::App* sub) const override {
        return row(sub->get_display_name(true), sub->get_description());
    }
    std::string make_description(const CLI::App* app) const override {
        std::string out;
        for (const std::string& line : wrap(app->get_description(), kWidth)) out += line + "\n";
        return out;
    }

  private:
    /// "-o, --output PICTURE"; of several long names the first: the others are old ones.
    static std::string leftOf(const CLI::Option* option, bool isUsage) {
        const auto& shorts = option->get_snames();
        const auto& longs = option->get_lnames();
        std::string out = shorts.empty() ? "" : "-" + shorts.front();
        if (!longs.empty() && !(isUsage && !out.empty())) out += (out.empty() ? "--" : ", --") + longs.front();
        const std::string kind = option->get_type_size() == 0 ? "" : kindOf(option);
        return kind.empty() ? out : out + " " + kind;
    }
};

std::vector<std::string> topicNames() {
    std::vector<std::string> names;
    names.reserve(std::size(kTopics));
    for (const Topic& topic : kTopics) names.emplace_back(topic.name);
    return names;
}

Result<void> showHelp(const CLI::App& app, const std::string& what) {
    for (const Topic& topic : kTopics)
        if (what == topic.name) {
            fmt::print("{}", topic.text);
            return {};
        }
    std::vector<std::string> known = topicNames();
    for (const CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; })) {
        known.push_back(sub->get_name());
        if (sub->get_name() != what) continue;
        fmt::print("{}", sub->get_formatter()->make_help(sub, "stipple " + what, CLI::AppFormatMode::Normal));
        return {};
    }
    const std::string nearest = nearestWord(what, known);
    return fail(ErrorKind::usage, "is neither a topic nor a command", what,
                nearest.empty() ? fmt::format("topics: {}", fmt::join(topicNames(), ", "))
                                : fmt::format("did you mean '{}'?", nearest));
}

}  // namespace

std::shared_ptr<CLI::FormatterBase> makeHelpFormatter() { return std::make_shared<HelpFormatter>(); }

void arrangeOptions(CLI::App& command) {
    const auto group = [&](const char* name, std::initializer_list<const char*> options) {
        for (const char* option : options)
            if (CLI::Option* o = command.get_option_no_throw(option)) o->group(name);
    };
    group("Camera", {"--eye", "--target", "--camera-up", "--fov", "--ortho", "--scene-camera", "--camera-path",
                     "--orbit", "--frames", "--aperture", "--focus", "--shutter"});
    group("Accuracy and budgets (stipple help budgets)", {"--error", "--budget-points", "--resident", "--no-wait",
                                                          "--curve-exact", "--accumulate", "--fade", "--samples"});
    group("Picture", {"--size",         "--mode",     "--lowpass",     "--kernel",
                      "--normalise",    "--patch-as", "--interpolate", "--shade",
                      "--background",   "--alpha",    "--colour",      "--colour-map",
                      "--colour-range", "--legend",   "--environment", "--environment-scale",
                      "--sun",          "--sun-size", "--refract",     "--wind",
                      "--time",         "--debug",    "--effects",     "--set",
                      "--opacity",      "--transfer"});
    group("Inputs that are not built yet",
          {"--memory", "--temp", "--duplicates", "--threads", "--normals", "--radii", "--up", "--attributes",
           "--surfels", "--curve-radius", "--only-points", "--grid", "--skip-bad", "--drop-outliers", "--allow-outside",
           "--cache-limit", "--progress"});
}

void setupHelp(CLI::App& app, int& status) {
    auto what = std::make_shared<std::string>();
    CLI::App* sub =
        app.add_subcommand("help", fmt::format("a command's help, or a page on {}", fmt::join(topicNames(), ", ")));
    sub->add_option("TOPIC", *what, "a topic or a command");
    sub->callback([what, &app, &status] {
        if (what->empty()) {
            fmt::print("{}", app.get_formatter()->make_help(&app, "stipple", CLI::AppFormatMode::Normal));
        } else if (const auto shown = showHelp(app, *what); !shown) {
            status = report(shown.error());
        }
    });
}

}  // namespace stipple::app
