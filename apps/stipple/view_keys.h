// What the keys of the window do: one table for the help on the screen and on the command line, and pure functions from
// what was pressed to what changes.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "apps/stipple/navigation.h"
#include "engine/gpu/window.h"
#include "engine/render/frame.h"

namespace stipple::app {

struct KeyHelp {
    std::string key, what;
};
/// `names`: of the keys that steer, see gpu::Input.
std::vector<KeyHelp> keyHelp(const std::array<char, gpu::kSteerCount>& names);
/// The same for `stipple view --help`, with the names of a US keyboard.
std::string keyHelpText();

enum class Detail : uint8_t { off, brief, full };
constexpr std::array<const char*, 5> kDebugNames{"none", "level", "screen-space error", "holes", "normals"};

/// What the keys change, but for what needs the scene.
struct ViewSettings {
    render::FrameSettings frame;
    Detail detail = Detail::brief;
    bool help = false;
};
struct KeyRequests {
    bool fly = false, colours = false, up = false, picture = false, pause = false, quit = false;
};
KeyRequests applyKeys(const std::string& pressed, ViewSettings& settings);

/// Hands on mouse and keys to a motion. A key at a steering position that is a command by its letter does not steer.
Motion motionOf(const gpu::Input& input);

}  // namespace stipple::app
