// What can fail gives a Result: a value, or an Error that is one line for a person. Nothing of this library throws but
// std::bad_alloc, and nothing prints, but for one mistake of a program: `*` and `->` of a Result without a value end it
// with that line (std::abort).
#pragma once

#include <stipple/namespace.h>

#include <cstdio>
#include <cstdlib>
#include <optional>
#include <string>
#include <utility>

namespace stipple::v1 {

/// Also the exit codes of the program `stipple`.
enum class ErrorKind { usage = 2, input = 3, output = 4, device = 5, budget = 6, interrupted = 7 };

struct Error {
    ErrorKind kind = ErrorKind::input;
    std::string what;   ///< what is wrong, with the values
    std::string where;  ///< file, section, offset
    std::string hint;   ///< what to do
    /// "where: what (hint)".
    std::string line() const {
        return (where.empty() ? what : where + ": " + what) + (hint.empty() ? "" : " (" + hint + ")");
    }
};

template <typename T>
class Result {
  public:
    Result(T value) : value_(std::move(value)) {}      // NOLINT(google-explicit-constructor)
    Result(Error error) : error_(std::move(error)) {}  // NOLINT(google-explicit-constructor)
    explicit operator bool() const { return value_.has_value(); }
    bool has_value() const { return value_.has_value(); }
    /// Throws std::bad_optional_access where there is none.
    T& value() & { return value_.value(); }
    const T& value() const& { return value_.value(); }
    T&& value() && { return std::move(value_).value(); }
    T& operator*() & { return checked(), *value_; }
    const T& operator*() const& { return checked(), *value_; }
    T&& operator*() && { return checked(), *std::move(value_); }
    T* operator->() { return checked(), &*value_; }
    const T* operator->() const { return checked(), &*value_; }
    const Error& error() const { return error_; }

  private:
    void checked() const {
        if (value_) return;
        std::fprintf(stderr, "stipple: %s\n", error_.line().c_str());
        std::abort();
    }
    std::optional<T> value_;
    Error error_;
};

template <>
class Result<void> {
  public:
    Result() = default;
    Result(Error error) : error_(std::move(error)) {}  // NOLINT(google-explicit-constructor)
    explicit operator bool() const { return !error_.has_value(); }
    bool has_value() const { return !error_.has_value(); }
    const Error& error() const { return error_.value(); }

  private:
    std::optional<Error> error_;
};

}  // namespace stipple::v1
