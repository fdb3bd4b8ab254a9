#include "apps/stipple/picture_loader.h"

#include <chrono>
#include <new>
#include <system_error>

#include "engine/base/process.h"
#include "engine/base/stop.h"
#include "engine/image/image_io.h"

namespace stipple::app {

Result<void> PictureLoader::start() {
    static constexpr std::chrono::seconds kLong{2};
    // Libraries that find no memory end the program: work must not take what they were promised.
    if (isAddressSpaceLimited()) return image::checkModule(true);
    STIPPLE_TRY(image::checkModule(false));
    try {
        thread_ = std::jthread([this, over = over_.get_future()] {
            if (over.wait_for(kLong) == std::future_status::timeout) load();
        });
    } catch (const std::system_error&) {  // no thread is to be had
        return image::checkModule(true);
    }
    return {};
}

void PictureLoader::load() {
    try {
        const auto loaded = image::checkModule(true);
        if (loaded) return;
        problem_ = loaded.error();
    } catch (const std::bad_alloc&) {  // whoever needs it next says so
        return;
    }
    hasFailed_ = true;
    askToStop();
}

Error PictureLoader::told(Error error) const {
    return hasFailed_ && error.kind == ErrorKind::interrupted ? problem_ : error;
}

}  // namespace stipple::app
