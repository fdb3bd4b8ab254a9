#include "engine/api/devices.h"

#include <fmt/format.h>

#include <cstdlib>

#include "engine/cpu/cpu_backend.h"
#include "engine/reference/reference.h"
#include "engine/scene/open/cache_folder.h"
#ifdef STIPPLE_WITH_GPU
#include "engine/gpu/gpu_backend.h"
#endif

namespace stipple {

Result<std::unique_ptr<render::Backend>> makeBackend(const std::string& device, Executor& executor) {
    if (device == "cpu") return cpu::makeCpuBackend(executor);
    if (device == "reference") return reference::makeReferenceBackend(executor);
#ifdef STIPPLE_WITH_GPU
    if (device == "auto") {
        // A real GPU if there is one; software Vulkan only when asked for.
        if (gpu::hasHardwareDevice()) {
            gpu::GpuSettings settings;
            settings.cacheFolder = scene::CacheFolder::pipelinesPath();
            auto backend = gpu::makeGpuBackend(settings);
            if (backend) return backend;
        }
        return cpu::makeCpuBackend(executor);
    }
    if (device == "gpu" || device.rfind("gpu:", 0) == 0) {
        gpu::GpuSettings settings;
        settings.deviceName = device.size() > 4 ? device.substr(4) : "";
        settings.validation = std::getenv("STIPPLE_VALIDATION") != nullptr;
        settings.cacheFolder = scene::CacheFolder::pipelinesPath();
        return gpu::makeGpuBackend(settings);
    }
#else
    if (device == "auto") return cpu::makeCpuBackend(executor);
    if (device.rfind("gpu", 0) == 0)
        return fail(ErrorKind::device, "this program was built without Vulkan", "--device " + device,
                    "use --device cpu");
#endif
    return fail(ErrorKind::usage, fmt::format("'{}' is not a device", device), "--device",
                "auto, cpu, gpu, gpu:NAME or reference");
}

std::string listDevices() {
    const auto executor = makeTbbExecutor(0);
    std::string text = "  cpu        " + cpu::makeCpuBackend(*executor)->device() + "\n";
#ifdef STIPPLE_WITH_GPU
    for (const std::string& name : gpu::deviceNames()) text += "  gpu        " + name + "\n";
#else
    text += "  gpu        not built in\n";
#endif
    return text + "  reference  fp64, scalar, slow: the oracle of the tests\n";
}

}  // namespace stipple
