#include "apps/stipple/view_keys.h"

#include <fmt/format.h>

#include <cmath>

namespace stipple::app {
namespace {

constexpr std::string_view kCommands = "FMVLCUPH";
constexpr std::string_view kRender = "FMVLCU123456789";

bool isCommand(char letter) { return kCommands.find(letter) != std::string_view::npos; }

}  // namespace

std::vector<KeyHelp> keyHelp(const std::array<char, gpu::kSteerCount>& names) {
    const auto pick = [&](std::initializer_list<gpu::Steer> which, const char* arrows) {
        std::string text;
        for (const gpu::Steer s : which)
            if (!isCommand(names[s])) text += std::string(1, names[s]) + " ";
        return text + arrows;
    };
    return {{"drag, right drag, wheel", "orbit: turn, move, nearer; flying: look, -, speed"},
            {"F", "fly, or orbit about what is in the middle"},
            {pick({gpu::kSteerForward, gpu::kSteerLeft, gpu::kSteerBack, gpu::kSteerRight}, "or arrows"),
             "fly ahead, left, back, right (Shift: faster)"},
            {pick({gpu::kSteerDown, gpu::kSteerUp}, "or page down, up"), "fly down, up"},
            {"1 to 9", "tolerated error, 0.25 to 64 pixels"},
            {"M", "the next mode (--mode)"},
            {"C", "next colours"},
            {"L", "light on, off"},
            {"U", "another axis is up: z or y, x, back"},
            {"V", "debug views"},
            {"P", "picture of this view: stipple_001.png ..."},
            {"Space", "pause, go on along the camera path"},
            {"Tab", "figures: brief, all, none"},
            {"H or F1", "these keys"},
            {"Esc", "quit"}};
}

std::string keyHelpText() {
    std::array<char, gpu::kSteerCount> names{};
    std::copy(gpu::kSteerPositions.begin(), gpu::kSteerPositions.end(), names.begin());
    std::string text = "Keys (letters as printed on the keyboard; those that fly by their place on it):\n";
    for (const KeyHelp& k : keyHelp(names)) text += fmt::format("  {:<26}{}\n", k.key, k.what);
    return text + "Files that are dropped on the window are opened.";
}

KeyRequests applyKeys(const std::string& pressed, ViewSettings& settings) {
    KeyRequests asked;
    render::FrameSettings& frame = settings.frame;
    for (const char key : pressed) {
        if (key == 'F') asked.fly = true;
        if (key == 'C') asked.colours = true;
        if (key == 'U') asked.up = true;
        if (key == 'P') asked.picture = true;
        if (key == ' ') asked.pause = true;
        if (key == 'H') settings.help = !settings.help;
        if (key == 'M') frame.mode = render::nextMode(frame.mode);
        if (key == 'V') frame.draw.debugView = (frame.draw.debugView + 1) % static_cast<uint32_t>(kDebugNames.size());
        if (key == 'L') {
            frame.draw.lit = !frame.draw.lit;
            frame.draw.unlitTriangles = !frame.draw.lit;
        }
        if (key == '\t')
            settings.detail = settings.detail == Detail::off     ? Detail::brief
                              : settings.detail == Detail::brief ? Detail::full
                                                                 : Detail::off;
        asked.rendersAnew = asked.rendersAnew || kRender.find(key) != std::string_view::npos;
        if (key >= '1' && key <= '9') frame.budgets.errorPixels = 0.25 * std::exp2(key - '1');
        if (key == 27) {  // closes what is open, the help first
            asked.quit = !settings.help;
            settings.help = false;
        }
    }
    return asked;
}

Motion motionOf(const gpu::Input& in) {
    Motion motion;
    motion.seconds = in.seconds;
    motion.width = std::max(1u, in.width);
    motion.height = std::max(1u, in.height);
    motion.scroll = in.scroll;
    motion.fast = in.fast;
    motion.turn = in.leftDrag;
    motion.slide = in.rightDrag;
    const auto pressed = [&](gpu::Steer s) {
        return in.arrows[s] || (in.held[s] && !isCommand(in.names[s])) ? 1.0 : 0.0;
    };
    motion.step = {pressed(gpu::kSteerRight) - pressed(gpu::kSteerLeft),
                   pressed(gpu::kSteerUp) - pressed(gpu::kSteerDown),
                   pressed(gpu::kSteerForward) - pressed(gpu::kSteerBack)};
    // The first look after a rest: a key that was only touched moves by a frame too.
    if (motion.step != glm::dvec3(0) && motion.seconds <= 0) motion.seconds = 1.0 / 60;
    return motion;
}

}  // namespace stipple::app
