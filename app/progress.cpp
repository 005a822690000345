#include "app/progress.h"

#include <unistd.h>

#include <cstdio>

namespace strata {

ProgressLine::ProgressLine(bool quiet) : shown_(!quiet && ::isatty(STDERR_FILENO) == 1) {}

void ProgressLine::update(const char* stage, uint64_t done, uint64_t total) {
    if (!shown_) return;
    const Clock::time_point now = Clock::now();
    if (stage_ != stage) {
        stage_ = stage;
        stage_start_ = now;
    } else if (now - last_update_ < std::chrono::milliseconds(100)) {
        return;
    }
    last_update_ = now;
    const double seconds = std::chrono::duration<double>(now - stage_start_).count();
    const double rate = seconds > 0.0 ? double(done) / seconds : 0.0;
    const double left = rate > 0.0 ? double(total - done) / rate : 0.0;
    std::fprintf(stderr, "\r%-10s %3d %%  %6.1f M points/s  %d:%02d left\x1b[K", stage,
                 total > 0 ? int(100.0 * double(done) / double(total)) : 100, rate / 1e6, int(left) / 60, int(left) % 60);
    std::fflush(stderr);
    dirty_ = true;
}

void ProgressLine::clear() {
    if (dirty_) std::fputs("\r\x1b[K", stderr);
    dirty_ = false;
}

}  // namespace strata
