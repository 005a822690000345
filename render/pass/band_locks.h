#pragma once

#include <cstdint>
#include <memory>
#include <mutex>

namespace strata {

/// Exclusive use of rows of a picture, by bands: a thread that draws many points into a few rows takes their bands once
/// and then needs no atomic operation a pixel. Bands are taken in ascending order, so that nobody waits in a circle.
class BandLocks {
    struct alignas(64) Band {  // a cache line each
        std::mutex mutex;
    };

public:
    static constexpr uint32_t kBandRows = 32;

    explicit BandLocks(uint32_t rows) : bands_(std::make_unique<Band[]>(rows / kBandRows + 1)) {}

    /// Holds the bands of rows first to last while it lives.
    class Hold {
    public:
        Hold(const BandLocks& locks, uint32_t first_row, uint32_t last_row)
            : bands_(locks.bands_.get()), first_(first_row / kBandRows), last_(last_row / kBandRows) {
            for (uint32_t band = first_; band <= last_; ++band) take(bands_[band].mutex);
        }
        Hold(const Hold&) = delete;
        Hold& operator=(const Hold&) = delete;
        ~Hold() {
            for (uint32_t band = first_; band <= last_; ++band) bands_[band].mutex.unlock();
        }

    private:
        // Holds last a microsecond: asking again is cheaper than sleeping, unless the holder itself sleeps.
        static void take(std::mutex& mutex) {
            for (int attempt = 0; attempt < 500; ++attempt) {
                if (mutex.try_lock()) return;
                __builtin_ia32_pause();
            }
            mutex.lock();
        }

        Band* bands_;
        uint32_t first_, last_;
    };

private:
    std::unique_ptr<Band[]> bands_;
};

}  // namespace strata
