// Result<T>: everything that the outside world can make fail (files, devices, arguments). An Error is one line for a
// person: what is wrong, where, and what to do about it. Its kind is the exit code of the program.
#pragma once

#include <string>
#include <tl/expected.hpp>
#include <utility>

namespace stipple {

/// Values are the exit codes (0 is "fine").
enum class ErrorKind : int { usage = 2, input = 3, output = 4, device = 5, budget = 6, interrupted = 7 };

struct Error {
    ErrorKind kind = ErrorKind::input;
    std::string what;   ///< what is wrong, with the values
    std::string where;  ///< file, section, offset
    std::string hint;   ///< what to do

    /// "where: what (hint)" on one line.
    std::string line() const {
        std::string text = where.empty() ? what : where + ": " + what;
        if (!hint.empty()) text += " (" + hint + ")";
        return text;
    }
};

template <typename T>
using Result = tl::expected<T, Error>;

inline tl::unexpected<Error> fail(ErrorKind kind, std::string what, std::string where = "", std::string hint = "") {
    return tl::unexpected<Error>(Error{kind, std::move(what), std::move(where), std::move(hint)});
}

}  // namespace stipple

/// Return the error of `expression` to the caller, if it has one.
#define STIPPLE_TRY(expression)                                                       \
    do {                                                                              \
        auto tryResult_ = (expression);                                               \
        if (!tryResult_) return tl::unexpected<::stipple::Error>(tryResult_.error()); \
    } while (false)

#define STIPPLE_CONCAT2(a, b) a##b
#define STIPPLE_CONCAT(a, b) STIPPLE_CONCAT2(a, b)
/// `STIPPLE_ASSIGN(auto x, f())`: take the value out of a Result or return its error.
#define STIPPLE_ASSIGN(target, expression)                                                  \
    auto STIPPLE_CONCAT(assign_, __LINE__) = (expression);                                  \
    if (!STIPPLE_CONCAT(assign_, __LINE__))                                                 \
        return tl::unexpected<::stipple::Error>(STIPPLE_CONCAT(assign_, __LINE__).error()); \
    target = std::move(*STIPPLE_CONCAT(assign_, __LINE__))
