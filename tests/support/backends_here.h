// The backends that a test program is about: all of the cpu and the oracle, or, in programs compiled with
// STIPPLE_ON_GPU, the gpu's, under validation.
#pragma once

#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <string>

#include "engine/cpu/cpu_backend.h"
#ifdef STIPPLE_ON_GPU
#include "engine/gpu/gpu_backend.h"
#endif
#include "tests/support/support.h"

namespace stipple::test {

/// What the validation layer says of the gpu's backend fails the test.
class BackendsHere : public testing::Test {
  protected:
    void SetUp() override {
#ifdef STIPPLE_ON_GPU
        gpu::GpuSettings settings;
        settings.validation = true;
        auto backend = gpu::makeGpuBackend(settings);
        ASSERT_TRUE(backend) << backend.error().line();
        backends_["gpu"] = std::move(*backend);
#else
        backends_ = cpuBackendsAndOracle(*executor_);
#endif
    }
    /// The one that a picture is drawn by unless somebody asks for another.
    render::Backend& usual() {
#ifndef STIPPLE_ON_GPU
        if (!backends_.contains("usual")) backends_["usual"] = cpu::makeCpuBackend(*executor_);
        return *backends_.at("usual");
#else
        return *backends_.at("gpu");
#endif
    }
    void TearDown() override {
#ifdef STIPPLE_ON_GPU
        if (backends_.empty()) return;  // SetUp failed
        for (const std::string& message : gpu::validationMessages(*backends_.at("gpu"))) ADD_FAILURE() << message;
#endif
    }

    TempFolder folder_;
    std::unique_ptr<Executor> executor_ = makeTbbExecutor(0);
    std::map<std::string, std::unique_ptr<render::Backend>> backends_;
};

}  // namespace stipple::test
