#include "engine/render/backend.h"

#include <fmt/format.h>

namespace stipple::render {

tl::unexpected<Error> noSuchPicture(Ticket ticket) {
    return fail(ErrorKind::device, "has been read, or given up for later ones",
                fmt::format("picture {}", ticket.number),
                "read each picture once, before more are handed in than can be in flight");
}

}  // namespace stipple::render
