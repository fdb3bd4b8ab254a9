// The picture in regions, of which a thread holds those it writes to: what it writes there needs no atomic operations.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <thread>

namespace stipple::cpu {

class PixelRegions {
  public:
    static constexpr int kWidth = 128, kHeight = 64;  ///< px

    void resize(uint32_t width, uint32_t height) {
        const int columns = (static_cast<int>(width) + kWidth - 1) / kWidth;
        const int count = columns * ((static_cast<int>(height) + kHeight - 1) / kHeight);
        if (count > count_) regions_ = std::make_unique<Region[]>(static_cast<size_t>(count));
        if (count > count_) count_ = count;
        columns_ = columns;
    }

    /// Those that meet a box of pixels, while it lives; a thread has one at a time. All take them in the same order, so
    /// that they never wait in a circle. (Measured with two threads: on many, blocks that reach much of the picture
    /// wait more.)
    class Held {
      public:
        Held(PixelRegions& of, int firstX, int lastX, int firstY, int lastY)
            : of_(of),
              firstColumn_(firstX / kWidth),
              lastColumn_(lastX / kWidth),
              firstRow_(firstY / kHeight),
              lastRow_(lastY / kHeight) {
            forEach([](std::atomic<bool>& isHeld) {
                while (isHeld.exchange(true, std::memory_order_acquire)) wait(isHeld);
            });
        }
        ~Held() {
            forEach([](std::atomic<bool>& isHeld) { isHeld.store(false, std::memory_order_release); });
        }
        Held(const Held&) = delete;
        Held& operator=(const Held&) = delete;

      private:
        static void wait(const std::atomic<bool>& isHeld) {
            constexpr int kSpins = 256;  // then its holder may have been interrupted
            for (int k = 0; isHeld.load(std::memory_order_relaxed);) {
#ifdef __x86_64__
                __builtin_ia32_pause();
#endif
                if (k < kSpins)
                    ++k;
                else
                    std::this_thread::yield();
            }
        }
        template <typename Use>
        void forEach(const Use& use) {
            for (int row = firstRow_; row <= lastRow_; ++row)
                for (int column = firstColumn_; column <= lastColumn_; ++column)
                    use(of_.regions_[static_cast<size_t>(row) * static_cast<size_t>(of_.columns_) +
                                     static_cast<size_t>(column)]
                            .isHeld);
        }
        PixelRegions& of_;
        int firstColumn_, lastColumn_, firstRow_, lastRow_;
    };

  private:
    struct alignas(64) Region {
        std::atomic<bool> isHeld = false;
    };
    std::unique_ptr<Region[]> regions_;
    int count_ = 0, columns_ = 0;
};

}  // namespace stipple::cpu
