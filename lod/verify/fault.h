// What to say of a store that is not what its build should have made.
#pragma once

#include <fmt/format.h>

#include <string>
#include <utility>

#include "lod/store/store.h"

namespace stipple::lod {

inline tl::unexpected<Error> wrong(const Store& store, uint32_t node, std::string what) {
    return fail(ErrorKind::input, std::move(what), fmt::format("{}: node {}", store.path, node),
                "this is a fault of the build; build the scene again, and please report it with the input if that does "
                "not help");
}

}  // namespace stipple::lod
