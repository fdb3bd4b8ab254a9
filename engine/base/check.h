// CHECK: our own mistakes. Always on; prints the condition, the place and the values, then aborts.
#pragma once

#include <cstdio>
#include <cstdlib>
#include <string>

namespace stipple {

[[noreturn]] inline void checkFailed(const char* condition, const char* file, int line, const std::string& values) {
    std::fprintf(stderr, "stipple: internal error: %s does not hold at %s:%d %s\n", condition, file, line,
                 values.c_str());
    std::abort();
}

}  // namespace stipple

#define STIPPLE_CHECK(condition, ...) \
    ((condition) ? void(0) : ::stipple::checkFailed(#condition, __FILE__, __LINE__, std::string("" __VA_ARGS__)))
