// Fails the k-th call of each kind under `strata convert`: the output is whole or absent, and the reason is one line.
// STRATA_ROBUST_FULL=1 takes every k; otherwise a spread of them.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>

#include "tests/support/run_program.h"
#include "tests/support/scan_files.h"
#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

namespace fs = std::filesystem;

struct Failure {
    const char* call;
    const char* how;
    long most_runs;  // of a run that is not full
};

class FailingCall : public testing::TestWithParam<std::tuple<Failure, test::ConvertedOutput>> {
protected:
    void SetUp() override {
        test::write_sheet(scan_, 10'000);
        fs::create_directory(folder_.file("whole"));
        ASSERT_EQ(test::run_strata(words(folder_.file("whole"))).exit_code, 0);
        fs::create_directory(target_folder_);
    }

    /// Converts into an empty folder with the k-th call failing.
    test::ProgramResult convert(long k) {
        fs::remove_all(target_folder_);
        fs::create_directory(target_folder_);
        std::vector<std::string> words = {"/usr/bin/env", "LD_PRELOAD=" STRATA_FAILING_CALLS, "STRATA_FAULT_COUNT=" + folder_.file("count"),
                                          std::string("STRATA_FAULT=") + failure_.call + ":" + std::to_string(k) + ":" + failure_.how, STRATA_PROGRAM};
        const std::vector<std::string> convert = this->words(target_folder_);
        words.insert(words.end(), convert.begin(), convert.end());
        return test::run_program(words);
    }
    std::vector<std::string> words(const std::string& folder) const {
        return output_.command(scan_, folder + "/" + output_.name);
    }

    void expect_whole() const {
        EXPECT_TRUE(test::same_output(folder_.file("whole/") + output_.name, target_));
    }
    size_t entries() const { return test::entries(target_folder_); }

    const Failure failure_ = std::get<0>(GetParam());
    const test::ConvertedOutput output_ = std::get<1>(GetParam());
    TemporaryFolder folder_;
    const std::string scan_ = folder_.file("scan.las");
    const std::string target_folder_ = folder_.file("target"), target_ = target_folder_ + "/" + output_.name;
};

TEST_P(FailingCall, LeavesTheOutputWholeOrAbsent) {
    if (test::built_with_sanitizer()) GTEST_SKIP() << "sanitizers bring their own malloc";
    ASSERT_EQ(convert(0).exit_code, 0);
    expect_whole();
    const long calls = std::stol(test::file_contents(folder_.file("count")));
    ASSERT_GT(calls, 0) << "nothing to fail: the fault library was not loaded or strata makes no such call";

    const long most_runs = output_.label == std::string("potree") ? failure_.most_runs : std::max(2L, failure_.most_runs / 6);
    const long step = test::full_run() ? 1 : std::max(1L, calls / most_runs);
    for (long k = 1; k <= calls; k += step) {
        SCOPED_TRACE(std::string(failure_.call) + " " + std::to_string(k) + " of " + std::to_string(calls) + ": " +
                     failure_.how);
        const test::ProgramResult result = convert(k);
        const bool killed = std::string_view(failure_.how) == "kill";
        if (result.exit_code == 0 || (killed && fs::exists(target_))) {
            expect_whole();
        } else if (killed) {
            EXPECT_EQ(result.signal, 9);
            EXPECT_LE(entries(), 1u);  // a stale temporary, which the next run removes
            EXPECT_EQ(test::run_strata(words(target_folder_)).exit_code, 0);
            expect_whole();
            EXPECT_EQ(entries(), 1u);
        } else {
            EXPECT_EQ(result.exit_code, 1) << "signal " << result.signal;
            EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
            EXPECT_TRUE(result.err.starts_with("strata: ")) << result.err;
            // What follows the rename, such as the sync of the folder above, may fail too: the output is whole then.
            const bool renamed = fs::exists(target_);
            if (renamed) expect_whole();
            EXPECT_EQ(entries(), renamed ? 1u : 0u);
        }
        if (HasFailure()) break;
    }
}

constexpr Failure kFailures[] = {{"malloc", "ENOMEM", 60}, {"pwrite", "ENOSPC", 10}, {"pwrite", "EINTR", 10}, {"pwrite", "short", 10}, {"pwrite", "kill", 10},
                                 {"pread", "EIO", 10},     {"pread", "EINTR", 10},   {"pread", "short", 10},  {"fsync", "EIO", 10},    {"fsync", "kill", 10},
                                 {"rename", "EACCES", 10}, {"rename", "kill", 10},   {"open", "EIO", 20},     {"open", "EINTR", 20},   {"mkdir", "ENOSPC", 10}};

// Every build takes those that share least: the others use the same files and folders.
std::vector<std::tuple<Failure, test::ConvertedOutput>> cases() {
    std::vector<std::tuple<Failure, test::ConvertedOutput>> all;
    for (const test::ConvertedOutput& output : test::converted_outputs())
        for (const Failure& failure : kFailures) {
            if (!output.is_folder() && std::string_view(failure.call) == "mkdir") continue;  // a file makes no folder
            const std::string_view label = output.label;
            if (test::full_run() || label == "potree" || label == "copc" || label == "laz" || label == "svo" || label == "ply") all.emplace_back(failure, output);
        }
    return all;
}
std::string name_of(const testing::TestParamInfo<std::tuple<Failure, test::ConvertedOutput>>& at) {
    const auto& [failure, output] = at.param;
    return std::string(output.label) + "_" + failure.call + "_" + failure.how;
}
INSTANTIATE_TEST_SUITE_P(Calls, FailingCall, testing::ValuesIn(cases()), name_of);

}  // namespace
}  // namespace strata
