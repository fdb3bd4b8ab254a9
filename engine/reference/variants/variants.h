// Comparison variants: what the papers compare themselves with, and what they leave out.
#pragma once

#include <memory>
#include <span>
#include <string_view>

#include "engine/base/executor.h"
#include "engine/render/backend.h"

namespace stipple::reference {

struct Variant {
    const char* name;
    render::Mode mode;   ///< that it departs from; pictures are asked for in that mode
    const char* source;  ///< paper and section or figure
    const char* shows;
};
std::span<const Variant> variants();

/// A backend that draws points by a variant, in fp64, scalar; other kinds are as in the variant's mode. Null where
/// there is none of that name.
std::unique_ptr<render::Backend> makeVariantBackend(std::string_view name, Executor& executor);

/// The places that a picture (with depth) shows, as one pixel each in another view of the same size or not: the nearest
/// wins, what nothing falls on is background (Botsch & Kobbelt 2003, Fig 6).
render::Image seenFrom(const render::Image& image, const lod::View& own, const lod::View& other);

}  // namespace stipple::reference
