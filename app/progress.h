#pragma once

#include <chrono>
#include <cstdint>
#include <string>

namespace strata {

/// A progress line on standard error with rate and time left; nothing when that is no terminal or `quiet` is set.
/// One thread at a time.
class ProgressLine {
public:
    explicit ProgressLine(bool quiet);
    ~ProgressLine() { clear(); }

    /// stage  what is going on; a new one starts the clock anew
    /// done, total  points
    void update(const char* stage, uint64_t done, uint64_t total);
    /// Wipes the line, before other text is printed.
    void clear();

private:
    using Clock = std::chrono::steady_clock;

    bool shown_;
    bool dirty_ = false;
    std::string stage_;
    Clock::time_point stage_start_, last_update_;
};

}  // namespace strata
