// One driver for all faults: the rows are tables of cases, the program under test is the real one.
// STRATA_ROBUST_FULL=1 in the environment runs all cases instead of a tenth.
#include "tests/robust/fault.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/scan_files.h"

namespace strata::robust {
namespace {

// Hang limits are far above the usual time of some 10 ms: they are no speed tests.
const FaultRow kRows[] = {
    {"damaged_las", {.seconds = 20.0, .address_space_bytes = uint64_t{1} << 30}, damaged_las},
    {"odd_las", {.seconds = 20.0, .address_space_bytes = uint64_t{1} << 30}, odd_las},
    // A picture is drawn by threads with stacks of their own: address space is no memory.
    {"damaged_potree", {.seconds = 20.0, .address_space_bytes = uint64_t{2} << 30}, damaged_potree},
    {"lying_potree", {.seconds = 20.0, .address_space_bytes = uint64_t{2} << 30}, lying_potree},
    {"damaged_volumes", {.seconds = 20.0, .address_space_bytes = uint64_t{1} << 30}, damaged_volumes},
    {"adversarial_clouds", {.seconds = 120.0}, adversarial_clouds},
};

// What holds for every answer to every fault: an end of its own, and one line when something is wrong.
std::string general_verdict(const test::ProgramResult& result) {
    if (result.timed_out) return "hang";
    if (result.signal != 0) return "crash: signal " + std::to_string(result.signal);
    if (result.exit_code == 0) return result.err.empty() ? "" : "message with exit code 0: " + result.err;
    if (result.exit_code != 1) return "exit code " + std::to_string(result.exit_code) + ": " + result.err;
    if (result.err.find("out of memory") != std::string::npos) return "out of memory";
    if (!result.err.starts_with("strata: ") || std::count(result.err.begin(), result.err.end(), '\n') != 1) return "not one line: " + result.err;
    return result.out.empty() ? "" : "output beside an error";
}

class Fault : public ::testing::TestWithParam<FaultRow> {};

TEST_P(Fault, EveryCaseIsAnsweredRight) {
    const FaultRow& row = GetParam();
    test::ProgramLimits limits = row.limits;
    if (test::built_with_sanitizer()) limits.address_space_bytes = 0;  // they reserve terabytes
    size_t cases = 0, refused = 0;
    for (const FaultCase& fault : row.cases(test::full_run())) {
        const TemporaryFolder folder;
        const test::ProgramResult result = test::run_strata(fault.prepare(folder), limits);
        std::string verdict = general_verdict(result);
        if (verdict.empty()) verdict = fault.verdict(result, folder);
        EXPECT_EQ(verdict, "") << fault.name;
        ++cases;
        refused += result.exit_code != 0;
    }
    RecordProperty("cases", int(cases));
    std::printf("%s: %zu cases, %zu refused\n", row.name.c_str(), cases, refused);
    EXPECT_GT(cases, 0u);
}

INSTANTIATE_TEST_SUITE_P(Robust, Fault, ::testing::ValuesIn(kRows), [](const auto& row) { return row.param.name; });

}  // namespace
}  // namespace strata::robust
