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

class FailingCall : public testing::TestWithParam<Failure> {
protected:
    void SetUp() override {
        test::write_sheet(scan_, 10'000);
        fs::create_directory(folder_.file("whole"));
        ASSERT_EQ(test::run_strata({"convert", scan_, folder_.file("whole/out"), "--quiet"}).exit_code, 0);
        fs::create_directory(target_folder_);
    }

    /// Converts into an empty folder with the k-th call failing.
    test::ProgramResult convert(long k) {
        fs::remove_all(target_folder_);
        fs::create_directory(target_folder_);
        return test::run_program(
            {"/usr/bin/env", "LD_PRELOAD=" STRATA_FAILING_CALLS, "STRATA_FAULT_COUNT=" + folder_.file("count"),
             std::string("STRATA_FAULT=") + GetParam().call + ":" + std::to_string(k) + ":" + GetParam().how,
             STRATA_PROGRAM, "convert", scan_, target_folder_ + "/out", "--quiet"});
    }

    void expect_whole() const {
        EXPECT_TRUE(test::same_potree(folder_.file("whole/out"), target_folder_ + "/out"));
    }
    size_t entries() const { return test::entries(target_folder_); }

    TemporaryFolder folder_;
    const std::string scan_ = folder_.file("scan.las");
    const std::string target_folder_ = folder_.file("target");
};

TEST_P(FailingCall, LeavesTheOutputWholeOrAbsent) {
    if (test::built_with_sanitizer()) GTEST_SKIP() << "sanitizers bring their own malloc";
    ASSERT_EQ(convert(0).exit_code, 0);
    expect_whole();
    const long calls = std::stol(test::file_contents(folder_.file("count")));
    ASSERT_GT(calls, 0) << "nothing to fail: the fault library was not loaded or strata makes no such call";

    const long step = test::full_run() ? 1 : std::max(1L, calls / GetParam().most_runs);
    for (long k = 1; k <= calls; k += step) {
        SCOPED_TRACE(std::string(GetParam().call) + " " + std::to_string(k) + " of " + std::to_string(calls) + ": " +
                     GetParam().how);
        const test::ProgramResult result = convert(k);
        const bool killed = std::string_view(GetParam().how) == "kill";
        if (result.exit_code == 0 || (killed && fs::exists(target_folder_ + "/out"))) {
            expect_whole();
        } else if (killed) {
            EXPECT_EQ(result.signal, 9);
            EXPECT_LE(entries(), 1u);  // a stale temporary, which the next run removes
            EXPECT_EQ(test::run_strata({"convert", scan_, target_folder_ + "/out", "--quiet"}).exit_code, 0);
            expect_whole();
            EXPECT_EQ(entries(), 1u);
        } else {
            EXPECT_EQ(result.exit_code, 1) << "signal " << result.signal;
            EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
            EXPECT_TRUE(result.err.starts_with("strata: ")) << result.err;
            // What follows the rename, such as the sync of the folder above, may fail too: the output is whole then.
            const bool renamed = fs::exists(target_folder_ + "/out");
            if (renamed) expect_whole();
            EXPECT_EQ(entries(), renamed ? 1u : 0u);
        }
        if (HasFailure()) break;
    }
}

INSTANTIATE_TEST_SUITE_P(Calls, FailingCall,
                         testing::Values(Failure{"malloc", "ENOMEM", 60}, Failure{"pwrite", "ENOSPC", 10}, Failure{"pwrite", "EINTR", 10},
                                         Failure{"pwrite", "short", 10}, Failure{"pwrite", "kill", 10},
                                         Failure{"pread", "EIO", 10}, Failure{"pread", "EINTR", 10},
                                         Failure{"pread", "short", 10}, Failure{"fsync", "EIO", 10},
                                         Failure{"fsync", "kill", 10}, Failure{"rename", "EACCES", 10},
                                         Failure{"rename", "kill", 10}, Failure{"open", "EIO", 20},
                                         Failure{"open", "EINTR", 20}, Failure{"mkdir", "ENOSPC", 10}),
                         [](const auto& fault) { return std::string(fault.param.call) + "_" + fault.param.how; });

}  // namespace
}  // namespace strata
