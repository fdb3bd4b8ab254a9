#include "apps/stipple/exhaustion.h"

#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <new>
#include <string_view>
#include <system_error>

#include "engine/base/result.h"

namespace stipple::app {
namespace {

constexpr std::string_view kLine = "stipple: out of memory (give a smaller --memory or --budget-points)\n";

/// Takes no memory.
bool isExhausted(const std::exception& e) {
    if (dynamic_cast<const std::bad_alloc*>(&e) != nullptr) return true;
    if (const auto* system = dynamic_cast<const std::system_error*>(&e))
        return system->code() == std::errc::not_enough_memory ||
               system->code() == std::errc::resource_unavailable_try_again;
    // TBB says it in words: a thread's stack is memory, too.
    return std::strstr(e.what(), "pthread_create has failed") != nullptr;
}

void say(std::string_view text) {
    while (!text.empty()) {
        const ssize_t written = ::write(2, text.data(), text.size());
        if (written <= 0) return;
        text.remove_prefix(static_cast<size_t>(written));
    }
}

[[noreturn]] void endHere() {
    try {
        if (const std::exception_ptr current = std::current_exception()) std::rethrow_exception(current);
    } catch (const std::exception& e) {
        if (isExhausted(e)) {
            say(kLine);
            ::_exit(static_cast<int>(ErrorKind::budget));
        }
        say("stipple: a fault of the program: ");
        say(e.what());
        say("\n");
    } catch (...) {
        say("stipple: a fault of the program\n");
    }
    std::abort();
}

}  // namespace

int reportThrown(const std::exception& thrown) {
    if (isExhausted(thrown)) {
        say(kLine);
        return static_cast<int>(ErrorKind::budget);
    }
    say("stipple: ");
    say(thrown.what());
    say("\n");
    return static_cast<int>(ErrorKind::input);
}

void exitWhereNothingCatches() { std::set_terminate(endHere); }

}  // namespace stipple::app
