// Facts about this process: memory, time since its start, a clock.
#pragma once

#include <cstdint>
#include <string>

namespace stipple {

uint64_t peakRssBytes();
/// Gives freed memory back to the system, where the allocator would keep it (after a scene was read, it is much).
void releaseFreeMemory();
/// For a process that takes and gives back large blocks again and again on `threads` threads and may use `memoryBytes`:
/// a share of them is kept, as pages that the system gives anew are cleared first. (Measured: a tenth of a build.)
/// Before the first thread starts.
void keepFreeMemory(uint64_t memoryBytes, int threads);
/// Does `ulimit -v` hold?
bool isAddressSpaceLimited();
/// Milliseconds since the kernel started this process (10 ms resolution at worst, Linux), so that "first image" counts
/// the loading of libraries too.
double millisecondsSinceProcessStart();
/// From now on Ctrl-C and SIGTERM ask a long job to stop cleanly; a second one ends the program at once.
void catchStopSignals();
bool isStopRequested();
/// Monotonic seconds, for intervals.
double nowSeconds();
/// "1.5 GiB", "312 B".
std::string humanBytes(uint64_t bytes);

}  // namespace stipple
