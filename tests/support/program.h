#pragma once

#include <string>
#include <vector>

namespace strata {

/// What one run of a program left behind.
struct ProgramResult {
    int exit_code = -1;  // 128 + n where signal n ended it
    std::string output;  // standard output
    std::string errors;  // standard error
};

/// Runs a program with these words and no standard input, and waits for it. words[0] is its path.
ProgramResult run_program(const std::vector<std::string>& words);

/// Runs the strata that was built with the tests.
ProgramResult run_strata(std::vector<std::string> words);

}  // namespace strata
