// All that these headers declare is in stipple::v1, and found as stipple:: by whoever includes them.
#pragma once

#if defined(_WIN32) || !defined(__GNUC__)
#define STIPPLE_API
#else
#define STIPPLE_API __attribute__((visibility("default")))
#endif

namespace stipple {
namespace v1 {}
#ifndef STIPPLE_WITHIN  // (the engine's own names are in stipple::)
using namespace v1;
#endif
}  // namespace stipple
