// Without Vulkan there is no window: the command exists and says so.
#include "apps/stipple/common.h"
#include "apps/stipple/options.h"

namespace stipple::app {

void setupView(CLI::App& app, int& status) {
    CLI::App* sub = app.add_subcommand("view", "walk through a scene in a window (not in this build)");
    sub->allow_extras();
    sub->callback([&status] {
        status = report(Error{ErrorKind::device, "this program was built without Vulkan, so it has no window",
                              "stipple view", "use stipple render"});
    });
}

}  // namespace stipple::app
