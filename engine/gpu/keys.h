// What a key press stands for. Commands are letters as they are printed on the keys, so that M is M on every layout;
// moving is by position, so that the hand lies where it lies on a US keyboard.
#pragma once

#include <array>
#include <string>
#include <string_view>

namespace stipple::gpu {

/// Positions that move the camera, named as on a US keyboard.
constexpr std::string_view kSteerPositions = "WASDQE";
enum Steer : size_t { kSteerForward, kSteerLeft, kSteerBack, kSteerRight, kSteerDown, kSteerUp, kSteerCount };

/// The command (an upper-case letter or a digit) of the key at `position` (its US character) on which the keyboard's
/// layout prints `printed` (UTF-8, without Shift); 0: none. Digits go by position, as many layouts print other signs
/// there; so do letters where the layout is of another script (Cyrillic, Greek ...).
inline char commandOf(int position, std::string_view printed) {
    const auto isLetter = [](int c) { return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z'); };
    if (position >= '0' && position <= '9') return static_cast<char>(position);
    if (printed.size() == 1) return isLetter(printed[0]) ? static_cast<char>(printed[0] & ~0x20) : char{0};
    // U+0250 and above begin with 0xC9 0x90: no Latin letter with or without an accent.
    const auto byte = [&](size_t i) { return i < printed.size() ? static_cast<unsigned char>(printed[i]) : 0u; };
    const bool isOtherScript = byte(0) > 0xc9 || (byte(0) == 0xc9 && byte(1) >= 0x90);
    if ((printed.empty() || isOtherScript) && isLetter(position)) return static_cast<char>(position & ~0x20);
    return 0;
}

/// What to call the key at a position: the letter or sign printed on it if ASCII has it, else the US one.
inline char nameOf(int position, std::string_view printed) {
    if (const char letter = commandOf(position, printed); letter != 0) return letter;
    return printed.size() == 1 && printed[0] > ' ' && printed[0] < 127 ? printed[0] : static_cast<char>(position);
}

}  // namespace stipple::gpu
