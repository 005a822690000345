#pragma once

#include <functional>
#include <string>
#include <vector>

#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace strata::robust {

/// One fault: what is prepared, which command meets it, and what a right answer is.
struct FaultCase {
    std::string name;  // says how to make it again: a seed, a field
    /// Puts files into an empty folder. returns  the words of the command line after "strata"
    std::function<std::vector<std::string>(const TemporaryFolder& folder)> prepare;
    /// What is wrong with the answer, "wrong-accept: ..."; empty: nothing. Crashes, hangs, lack of memory and messages that
    /// are not one line are found before it is asked.
    std::function<std::string(const test::ProgramResult& result, const TemporaryFolder& folder)> verdict;
};

/// One row of the table of faults.
struct FaultRow {
    std::string name;
    test::ProgramLimits limits;
    std::vector<FaultCase> (*cases)(bool full);  // full: all of them; else a tenth, for every build
};

std::vector<FaultCase> damaged_las(bool full);
std::vector<FaultCase> odd_las(bool full);
std::vector<FaultCase> damaged_potree(bool full);
std::vector<FaultCase> lying_potree(bool full);
std::vector<FaultCase> adversarial_clouds(bool full);
std::vector<FaultCase> damaged_volumes(bool full);

}  // namespace strata::robust
