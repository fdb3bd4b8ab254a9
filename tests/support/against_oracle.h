// Pictures of the backends that a test program is about, held to those of the oracle.
#pragma once

#include "engine/reference/reference.h"
#include "tests/support/backends_here.h"

namespace stipple::test {

class AgainstOracle : public BackendsHere {
  protected:
    void SetUp() override {
        BackendsHere::SetUp();
        backends_.erase("fp64");  // the oracle itself
    }
    /// PSNR of all of both pictures, dB.
    static double likeness(const render::Image& a, const render::Image& b) {
        const auto d = reference::compareImages(a, b, 4, nullptr);
        EXPECT_TRUE(d);
        return d ? d->psnr : 0;
    }
    std::unique_ptr<render::Backend> oracle_ = reference::makeReferenceBackend(*executor_);
};

}  // namespace stipple::test
