#include "apps/stipple/usage.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>

#include "apps/stipple/options.h"

namespace stipple::app {
namespace {

const CLI::App* subcommandOf(const CLI::App& app, const std::string& name) {
    for (const CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; }))
        if (!sub->get_name().empty() && sub->get_name() == name) return sub;
    return nullptr;
}

std::vector<std::string> commandsOf(const CLI::App& app) {
    std::vector<std::string> names;
    for (const CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; }))
        if (!sub->get_name().empty()) names.push_back(sub->get_name());
    return names;
}

/// The subcommand that was reached.
const CLI::App& deepest(const CLI::App& app) {
    const auto parsed = app.get_subcommands();
    return parsed.empty() ? app : deepest(*parsed.front());
}

std::string fullName(const CLI::App& app) {
    const CLI::App* parent = app.get_parent();
    return parent == nullptr ? "stipple" : fullName(*parent) + " " + app.get_name();
}

/// "render", "grow forest"; empty for the program itself.
std::string shortName(const CLI::App& app) { return app.get_parent() == nullptr ? "" : fullName(app).substr(8); }

/// Of a command and its groups of options; of several names the first.
std::vector<std::string> optionsOf(const CLI::App& app) {
    std::vector<std::string> names;
    for (const CLI::Option* option : app.get_options())
        if (!option->get_lnames().empty()) names.push_back("--" + option->get_lnames().front());
    for (const CLI::App* group : app.get_subcommands([](const CLI::App* sub) { return sub->get_name().empty(); }))
        for (std::string& name : optionsOf(*group)) names.push_back(std::move(name));
    return names;
}

std::string didYouMean(const std::string& text, const std::vector<std::string>& words, const std::string& otherwise) {
    const std::string nearest = nearestWord(text, words);
    return nearest.empty() ? otherwise : fmt::format("did you mean '{}'?", nearest);
}

/// What is left over. A misspelt option is also why a value is too many, and a misspelt command why its options are.
Error leftOver(const CLI::App& at, std::vector<std::string> rest) {
    const auto commands = commandsOf(at);
    std::stable_partition(rest.begin(), rest.end(),
                          [&](const std::string& s) { return (s.rfind('-', 0) == 0) == commands.empty(); });
    std::string first = rest.front();
    if (first.rfind('-', 0) == 0) {
        first = first.substr(0, first.find('='));
        return {ErrorKind::usage, "there is no option " + first, shortName(at), didYouMean(first, optionsOf(at), "")};
    }
    if (!commands.empty())
        return {ErrorKind::usage, fmt::format("there is no '{}'", first), shortName(at),
                didYouMean(first, commands, "")};
    return {ErrorKind::usage, fmt::format("'{}' is one argument too many", first), shortName(at), ""};
}

/// "NAME<separator>REST" of the parser's message.
std::pair<std::string, std::string> splitAt(const std::string& message, const std::string& separator) {
    const size_t at = message.find(separator);
    if (at == std::string::npos) return {"", message};
    return {message.substr(0, at), message.substr(at + separator.size())};
}

Error wrongValue(const std::string& name, const std::string& value) {
    return {ErrorKind::usage, fmt::format("'{}' is not a number", value), name, ""};
}

/// (The parser's own name for an error is sometimes the command's.)
template <typename T>
bool is(const CLI::ParseError& error) {
    return dynamic_cast<const T*>(&error) != nullptr;
}

/// How many values an option was given, of a command or of its groups.
size_t valuesOf(const CLI::App& app, const std::string& name) {
    if (const CLI::Option* option = app.get_option_no_throw(name)) return option->results().size();
    return 0;
}

Error valueMissing(const CLI::App& at, const std::string& message) {
    for (const std::string& name : optionsOf(at)) {
        // (Not --ortho where it is --ortho-width.)
        const size_t found = message.find(name);
        if (found == std::string::npos || std::isalnum(static_cast<unsigned char>(message[found + name.size()])) ||
            message[found + name.size()] == '-')
            continue;
        const bool isTwice = valuesOf(at, name) > 1;
        if (isTwice || message.find("issing") != std::string::npos || message.find("equired") != std::string::npos)
            return {ErrorKind::usage, isTwice ? "is given more than once" : "needs a value", name, ""};
        return {ErrorKind::usage, "takes no value", name, ""};
    }
    return {ErrorKind::usage, "there are too few or too many arguments", shortName(at), ""};
}

}  // namespace

namespace {

/// "render scan.las out.png": the last of several inputs that looks like an output.
std::string meantAsOutput(const CLI::App& at) {
    for (const CLI::Option* option : at.get_options()) {
        const std::vector<std::string>& given = option->results();
        if (!option->get_positional() || given.size() < 2) continue;
        const std::string extension = std::filesystem::path(given.back()).extension().string();
        for (const char* written : {".png", ".exr", ".stipple"})
            if (extension == written) return fmt::format("did you mean '-o {}'?", given.back());
    }
    return "";
}

}  // namespace

Result<void> checkValues(const std::vector<std::string>& arguments) {
    for (const std::string& argument : arguments) {
        if (argument == "--") break;
        if (argument.rfind("--", 0) == 0 && argument.find('=') == argument.size() - 1)
            return fail(ErrorKind::usage, "needs a value", argument.substr(0, argument.size() - 1));
    }
    return {};
}

std::string commandOf(const CLI::App& app, const std::vector<std::string>& arguments) {
    const CLI::App* at = &app;
    for (const std::string& argument : arguments) {
        const CLI::App* next = subcommandOf(*at, argument);
        if (next == nullptr) break;
        at = next;
    }
    return fullName(*at);
}

Result<void> completeCommand(const CLI::App& app, std::vector<std::string>& arguments) {
    const std::string& first = arguments.front();
    if (first.rfind('-', 0) == 0 || subcommandOf(app, first) != nullptr) return {};
    std::error_code error;
    const bool isPattern = first.find_first_of("*?") != std::string::npos;
    if (isPattern || std::filesystem::exists(first, error)) {
        arguments.insert(arguments.begin(), "view");
        return {};
    }
    return fail(ErrorKind::usage, "is neither a command nor a file", first, didYouMean(first, commandsOf(app), ""));
}

Error usageError(const CLI::App& app, const CLI::ParseError& error) {
    const CLI::App& at = deepest(app);
    const std::string message = error.what();
    const bool isRequired = is<CLI::RequiredError>(error), isExcluded = is<CLI::ExcludesError>(error);
    std::vector<std::string> rest = at.remaining(true);
    const bool hasOption = std::any_of(rest.begin(), rest.end(), [](const auto& s) { return s.rfind("--", 0) == 0; });
    const bool needsCommand = isRequired && message.find("subcommand") != std::string::npos;
    if (!rest.empty() && (is<CLI::ExtrasError>(error) || hasOption || needsCommand))
        return leftOver(at, std::move(rest));
    if (needsCommand)
        return {ErrorKind::usage, fmt::format("needs one of {}", fmt::join(commandsOf(at), ", ")), shortName(at), ""};
    if (isRequired) {
        const std::string what = splitAt(message, " is required").first;
        return {ErrorKind::usage, what + " is missing", shortName(at), what == "--output" ? meantAsOutput(at) : ""};
    }
    if (is<CLI::ValidationError>(error)) {
        const auto [option, what] = splitAt(message, ": ");
        return {ErrorKind::usage, what, option, ""};
    }
    if (is<CLI::ConversionError>(error)) {
        const auto [option, value] = splitAt(splitAt(message, ": ").second, " = ");
        return wrongValue(option, value);
    }
    if (isExcluded || is<CLI::RequiresError>(error)) {
        const auto [one, other] = splitAt(message, isExcluded ? " excludes " : " requires ");
        return {ErrorKind::usage,
                isExcluded ? "cannot be given together with " + other : fmt::format("needs {} as well", other), one,
                ""};
    }
    return valueMissing(at, message);
}

}  // namespace stipple::app
