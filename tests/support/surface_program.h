#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace strata::test {

/// Runs `strata surface`, with files in a folder of the test's own.
class SurfaceProgram : public testing::Test {
protected:
    ProgramResult run(std::vector<std::string> words) {
        words.insert(words.begin(), "surface");
        return run_strata(words);
    }
    /// The report of --json.
    nlohmann::json surface(std::vector<std::string> words) {
        words.insert(words.end(), {"--json", "--overwrite"});
        const ProgramResult result = run(words);
        EXPECT_EQ(result.exit_code, 0) << result.err;
        return result.exit_code == 0 ? nlohmann::json::parse(result.out) : nlohmann::json();
    }
    /// It leaves no file and says this, where the words are right in one line.
    void refuse(std::vector<std::string> words, int code, const std::string& said) {
        words.insert(words.end(), {"-o", file("refused.ply")});
        const ProgramResult result = run(words);
        EXPECT_EQ(result.exit_code, code) << said << '\n' << result.err;
        EXPECT_NE(result.err.find(said), std::string::npos) << said << '\n' << result.err;
        if (code == 1) EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
        EXPECT_FALSE(std::filesystem::exists(file("refused.ply")));
    }
    std::string file(const std::string& name) const { return folder_.file(name); }
    const TemporaryFolder folder_;
};

}  // namespace strata::test
