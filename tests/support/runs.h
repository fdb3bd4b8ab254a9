// The program as a process of its own.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace stipple::test {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool isSanitized = true;  ///< memory means nothing, and everything takes longer
inline constexpr double kSlower = 8;
#else
inline constexpr bool isSanitized = false;
inline constexpr double kSlower = 1;
#endif

/// Runs the program and kills it after a while, counted from when `isUnderWay` is true (none: from the start); true if
/// it ended before.
bool runAndKill(const std::vector<std::string>& arguments, int milliseconds, int signal,
                const std::function<bool()>& isUnderWay = {});
/// Kills every process that has this among its arguments, and waits until they are gone.
void killAllWith(const std::string& argument);
/// Runs it in a shell under `limits`; its exit code. What it says is in `folder`/out and /err.
int shell(const std::string& limits, const std::string& arguments, const std::string& folder);

}  // namespace stipple::test
