#include "engine/render/backend.h"

#include <fmt/format.h>

namespace stipple::render {

Result<Ticket> DrawsAtOnce::submit(const RenderRequest& request) {
    draw(request, image_);
    isRead_ = false;
    return Ticket{++submitted_};
}

Result<void> DrawsAtOnce::read(Ticket ticket, Image& image) {
    if (ticket.number != submitted_ || isRead_) return noSuchPicture(ticket);
    std::swap(image, image_);
    isRead_ = true;
    return {};
}

Result<void> DrawsAtOnce::render(const RenderRequest& request, Image& image) {
    draw(request, image);
    return {};
}

tl::unexpected<Error> noSuchPicture(Ticket ticket) {
    return fail(ErrorKind::device, "has been read, or given up for later ones",
                fmt::format("picture {}", ticket.number),
                "read each picture once, before more are handed in than can be in flight");
}

}  // namespace stipple::render
