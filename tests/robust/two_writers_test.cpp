// Two programs write one target at the same time: one wins whole, and nothing of the other stays.
#include <gtest/gtest.h>

#include <filesystem>
#include <thread>

#include "tests/support/scan_files.h"

namespace strata::robust {
namespace {

namespace fs = std::filesystem;
using namespace test;

class TwoWriters : public testing::TestWithParam<ConvertedOutput> {
protected:
    void SetUp() override {
        write_sheet(folder_.file("a.las"), 60'000);
        write_sheet(folder_.file("b.las"), 50'000);
        for (const std::string name : {"a", "b", "target"}) fs::create_directory(folder_.file(name));
        for (const std::string name : {"a", "b"}) ASSERT_EQ(convert(name, name, {}).exit_code, 0);
    }

    std::string output_in(const std::string& folder) const { return folder_.file(folder + "/" + GetParam().name); }
    ProgramResult convert(const std::string& scan, const std::string& folder, std::vector<std::string> more) {
        const std::vector<std::string> command = GetParam().command(folder_.file(scan + ".las"), output_in(folder));
        more.insert(more.begin(), command.begin(), command.end());
        more.push_back("--no-sync");
        return run_strata(more);
    }
    std::pair<ProgramResult, ProgramResult> together(const std::vector<std::string>& more) {
        std::pair<ProgramResult, ProgramResult> results;
        std::thread other([&] { results.second = convert("b", "target", more); });
        results.first = convert("a", "target", more);
        other.join();
        return results;
    }
    bool holds(const std::string& scan) const { return same_output(output_in("target"), output_in(scan)); }

    const int pairs_ = full_run() ? 50 : GetParam().label == std::string("potree") ? 5 : 2;
    const TemporaryFolder folder_;
};

TEST_P(TwoWriters, OneWinsWholeAndTheOtherSaysSo) {
    for (int i = 0; i < pairs_ && !HasFailure(); ++i) {
        fs::remove_all(output_in("target"));
        const auto [a, b] = together({});
        const bool a_won = a.exit_code == 0;
        ASSERT_NE(a_won, b.exit_code == 0) << a.err << b.err;
        EXPECT_EQ(refusal_verdict(a_won ? b : a), "");
        EXPECT_TRUE(holds(a_won ? "a" : "b"));
        EXPECT_EQ(entries(folder_.file("target")), 1u);
    }
}

TEST_P(TwoWriters, WithOverwriteTheLastOneWinsWhole) {
    for (int i = 0; i < pairs_ && !HasFailure(); ++i) {
        const auto [a, b] = together({"--overwrite"});
        EXPECT_EQ(a.exit_code, 0) << a.err;
        EXPECT_EQ(b.exit_code, 0) << b.err;
        EXPECT_TRUE(holds("a") || holds("b"));
        EXPECT_EQ(entries(folder_.file("target")), 1u);
    }
}

INSTANTIATE_TEST_SUITE_P(Robust, TwoWriters, testing::ValuesIn(converted_outputs()), [](const auto& output) { return output.param.label; });

}  // namespace
}  // namespace strata::robust
