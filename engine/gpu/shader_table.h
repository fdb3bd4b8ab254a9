// The compiled shaders, and what each of them says of itself (shaders/reflect): nothing of it is typed here.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>

#include "shaders/shared/bindings.h"

namespace stipple::gpu {

/// A buffer that a shader touches.
struct BindingUse {
    uint32_t binding;
    bool reads, writes;
    uint32_t offset, stride;  ///< where the array at its end begins, and of its elements; without one: 0, bytes of all
};

struct Shader {
    const char* name;
    std::span<const uint32_t> code;
    std::span<const BindingUse> uses;
    std::array<uint32_t, 3> group;    ///< threads of a workgroup
    uint32_t pushBytes, sharedBytes;  ///< the latter: of a workgroup
};

std::span<const Shader> shaders();
/// Null where there is none of that name.
const Shader* shaderNamed(std::string_view name);
/// Of a buffer whose array has `count` elements, as the shaders lay it out.
uint64_t bytesOf(uint32_t binding, uint64_t count);

}  // namespace stipple::gpu
