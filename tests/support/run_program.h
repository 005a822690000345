#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace strata::test {

/// What a program did.
struct ProgramResult {
    int exit_code = -1;  // -1: it was ended by a signal
    int signal = 0;      // that ended it, or 0
    bool timed_out = false;  // and was killed for it
    std::string out, err;    // what it wrote, at most 1 MiB each
    double seconds = 0.0;
    uint64_t peak_memory_bytes = 0;  // resident
};

struct ProgramLimits {
    double seconds = 60.0;
    uint64_t address_space_bytes = 0;  // 0: as it is; sanitizers need it so
    uint64_t file_size_bytes = 0;      // of each file it writes; 0: as it is
    std::string out_path;              // where its standard output goes; empty: to the caller, "-": closed
    unsigned user = 0;                 // who runs it; 0: the caller
    int signal = 0;                    // sent to it after `signal_after` seconds; 0: none
    double signal_after = 0.0;
};

/// Runs a program and waits for its end. words  the program's path, then its arguments; no shell sees them
ProgramResult run_program(const std::vector<std::string>& words, const ProgramLimits& limits = {});

/// Runs strata itself.
ProgramResult run_strata(std::vector<std::string> words, const ProgramLimits& limits = {});

/// Whether this build carries a sanitizer that reserves address space without bound.
bool built_with_sanitizer();

}  // namespace strata::test
