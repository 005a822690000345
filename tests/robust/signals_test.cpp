// The program is asked to end, or killed, at seeded moments of its run: the target is whole or absent.
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <random>

#include "tests/support/scan_files.h"

namespace strata::robust {
namespace {

namespace fs = std::filesystem;
using namespace test;

constexpr double kMostSecondsToEnd = 2.0;

class Ending : public testing::TestWithParam<std::tuple<int, ConvertedOutput>> {
protected:
    void SetUp() override {
        write_sheet(scan_, is_potree_ ? 100'000 : 300'000);  // plain files are written in no time
        for (const std::string name : {"whole", "earlier", "target"}) fs::create_directory(folder_.file(name));
        const test::ProgramResult whole = convert(scan_, "whole", {});
        ASSERT_EQ(whole.exit_code, 0) << whole.err;
        seconds_ = whole.seconds;
        // An earlier output of another input.
        write_sheet(folder_.file("other.las"), 500);
        ASSERT_EQ(convert(folder_.file("other.las"), "earlier", {}).exit_code, 0);
    }

    std::string output_in(const std::string& folder) const { return folder_.file(folder + "/" + output_.name); }
    test::ProgramResult convert(const std::string& scan, const std::string& folder, const test::ProgramLimits& limits) {
        std::vector<std::string> words = output_.command(scan, output_in(folder));
        words.insert(words.end(), {"--overwrite", "--no-sync"});
        return test::run_strata(words, limits);
    }
    /// Of `full` runs in a full run; every build runs a tenth, of outputs that share most code a twentieth.
    int times(int full) const { return full_run() ? full : is_potree_ ? full / 10 : full / 20; }
    void reset_target() {
        fs::remove_all(folder_.file("target"));
        fs::copy(folder_.file("earlier"), folder_.file("target"), fs::copy_options::recursive);
    }
    bool whole() const { return same_output(output_in("target"), output_in("whole")); }
    bool earlier() const { return same_output(output_in("target"), output_in("earlier")); }
    /// A time within the run, and a bit beyond: drawn from a seed.
    double moment() { return 1.1 * seconds_ * std::uniform_real_distribution<double>()(random_); }

    const ConvertedOutput output_ = std::get<1>(GetParam());
    const bool is_potree_ = output_.label == std::string("potree");
    const TemporaryFolder folder_;
    const std::string scan_ = folder_.file("scan.las");
    double seconds_ = 0.0;
    std::mt19937_64 random_{uint64_t(std::get<0>(GetParam()))};
};

TEST_P(Ending, LeavesNoTemporaryAndTheEarlierOutputOrTheWholeNewOne) {
    const int number = std::get<0>(GetParam()), times = this->times(100);
    int ended = 0;
    for (int i = 0; i < times || (ended == 0 && i < 10 * times); ++i) {
        reset_target();
        const double after = moment();
        SCOPED_TRACE("signal " + std::to_string(number) + " after " + std::to_string(after) + " s");
        const test::ProgramResult result = convert(scan_, "target", {.signal = number, .signal_after = after});
        // Before the program's first line, the signal does what signals do without it.
        const bool ended_by_it = result.exit_code == 128 + number || result.signal == number;
        if (!ended_by_it) EXPECT_EQ(result.exit_code, 0) << "signal " << result.signal << ": " << result.err;
        if (!ended_by_it) seconds_ = result.seconds;  // the machine may be quicker now than when it was measured
        if (ended_by_it) EXPECT_LT(result.seconds - after, kMostSecondsToEnd);
        EXPECT_EQ(result.err, "");
        EXPECT_EQ(entries(folder_.file("target")), 1u);
        if (ended_by_it) EXPECT_TRUE(earlier() || whole());  // the output may be named just before the end
        else EXPECT_TRUE(whole());
        ended += ended_by_it;
        if (HasFailure()) break;
    }
    std::printf("signal %d: ended %d of %d runs\n", number, ended, times);
    EXPECT_GT(ended, 0) << "every signal came too late: nothing was tested";
}

std::string name_of(const testing::TestParamInfo<std::tuple<int, ConvertedOutput>>& at) {
    return std::string(std::get<1>(at.param).label) + "_signal_" + std::to_string(std::get<0>(at.param));
}
const std::vector<ConvertedOutput> kPotree(converted_outputs().begin(), converted_outputs().begin() + 1), kOthers(converted_outputs().begin() + 1, converted_outputs().end());

INSTANTIATE_TEST_SUITE_P(Potree, Ending, testing::Combine(testing::Values(SIGINT, SIGTERM, SIGHUP, SIGPIPE), testing::ValuesIn(kPotree)), name_of);
INSTANTIATE_TEST_SUITE_P(Others, Ending, testing::Combine(testing::Values(SIGINT, SIGTERM), testing::ValuesIn(kOthers)), name_of);

class Killed : public Ending {};

TEST_P(Killed, LeavesTheOutputAndOneStaleTemporaryThatTheNextRunRemoves) {
    const int times = this->times(is_potree_ ? 200 : 100);
    const std::string scan_bytes = file_contents(scan_);
    int stale = 0;
    for (int i = 0; i < times || (stale == 0 && i < 20 * times); ++i) {
        reset_target();
        const double after = moment();
        SCOPED_TRACE("killed after " + std::to_string(after) + " s");
        (void)convert(scan_, "target", {.signal = SIGKILL, .signal_after = after});
        EXPECT_TRUE(earlier() || whole());
        EXPECT_LE(entries(folder_.file("target")), 2u);
        stale += entries(folder_.file("target")) == 2;
        const test::ProgramResult next = convert(scan_, "target", {});
        EXPECT_EQ(next.exit_code, 0);
        seconds_ = next.seconds;  // the machine may be quicker now than when it was measured
        EXPECT_TRUE(whole());
        EXPECT_EQ(entries(folder_.file("target")), 1u);
        EXPECT_TRUE(file_contents(scan_) == scan_bytes);
        if (HasFailure()) break;
    }
    std::printf("kill -9: %d of %d runs left a temporary\n", stale, times);
    EXPECT_GT(stale, 0) << "no run was killed in the middle: nothing was tested";
}

INSTANTIATE_TEST_SUITE_P(Signals, Killed, testing::Combine(testing::Values(SIGKILL), testing::ValuesIn(converted_outputs())), name_of);

// What the caller ignores stays ignored: nohup strata convert ... survives the end of the session.
TEST(Signals, ThoseThatTheCallerIgnoresEndNothing) {
    const TemporaryFolder folder;
    write_sheet(folder.file("scan.las"), 1000);
    const test::ProgramResult result =
        test::run_program({"/bin/sh", "-c", "trap '' HUP; \"$0\" convert \"$1\" \"$2\" --quiet & kill -HUP $!; wait $!", STRATA_PROGRAM,
                           folder.file("scan.las"), folder.file("out")});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_TRUE(fs::exists(folder.file("out/metadata.json")));
}

struct Output {
    const char* name;
    const char* path;
    const char* reason;
};
class StandardOutput : public testing::TestWithParam<Output> {};

// A closed standard output must not become a file of ours either: the first file opened gets its number.
TEST_P(StandardOutput, ThatTakesNothingIsAnError) {
    const TemporaryFolder folder;
    write_sheet(folder.file("scan.las"), 1000);
    for (const std::vector<std::string>& words :
         {std::vector<std::string>{"info", folder.file("scan.las")}, {"info", folder.file("scan.las"), "--json"},
          {"convert", folder.file("scan.las"), folder.file("out"), "--json"}, {"--version"}, {"convert", "--help"}}) {
        SCOPED_TRACE(words.front());
        const test::ProgramResult result = test::run_strata(words, {.out_path = GetParam().path});
        EXPECT_EQ(refusal_verdict(result), "");
        EXPECT_NE(result.err.find("standard output"), std::string::npos) << result.err;
        EXPECT_NE(result.err.find(GetParam().reason), std::string::npos) << result.err;
    }
    ASSERT_EQ(test::run_strata({"convert", folder.file("scan.las"), folder.file("whole"), "--quiet"}).exit_code, 0);
    EXPECT_EQ(file_contents(folder.file("out/octree.bin")), file_contents(folder.file("whole/octree.bin")));
}

INSTANTIATE_TEST_SUITE_P(Signals, StandardOutput,
                         testing::Values(Output{"full", "/dev/full", "No space left"}, Output{"closed", "-", "Bad file descriptor"}),
                         [](const auto& output) { return std::string(output.param.name); });

// `strata info ... | head -1`: the reader has gone.
TEST(Signals, AClosedPipeIsAnErrorOfOneLine) {
    const TemporaryFolder folder;
    write_sheet(folder.file("scan.las"), 1000);
    const test::ProgramResult result =
        test::run_program({"/bin/sh", "-c", "{ sleep 0.2; \"$0\" info \"$1\"; echo $? >&2; } | true", STRATA_PROGRAM, folder.file("scan.las")});
    EXPECT_TRUE(result.err.starts_with("strata: standard output: ") && result.err.ends_with("Broken pipe\n1\n")) << result.err;
}

}  // namespace
}  // namespace strata::robust
