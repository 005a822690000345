// Runs the real program: what it prints where, and the exit codes that scripts rely on.
#include <gtest/gtest.h>

#include "app/commands/commands.h"
#include "app/help.h"
#include "app/version.h"
#include "tests/support/run_program.h"

namespace strata {
namespace {

using test::ProgramResult;
using test::run_program;
using test::run_strata;

TEST(CommandLine, WithoutWordsItSaysWhatThereIs) {
    const ProgramResult result = run_strata({});
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_EQ(result.out, "");
    EXPECT_EQ(result.err, program_help(all_commands()));
}

TEST(CommandLine, HelpAndVersionGoToStandardOutput) {
    const ProgramResult help = run_strata({"--help"});
    EXPECT_EQ(help.exit_code, 0);
    EXPECT_EQ(help.err, "");
    for (const Command& command : all_commands()) EXPECT_NE(help.out.find(command.name), std::string::npos);
    EXPECT_EQ(run_strata({"--version"}).out, "strata " STRATA_VERSION "\n");
}

// Every row of every table shows with its placeholder and its default, and no line is wider than a terminal may be.
TEST(CommandLine, TheHelpOfACommandIsItsWholeTable) {
    for (const Command& command : all_commands()) {
        const ProgramResult help = run_strata({std::string(command.name), "--help"});
        EXPECT_EQ(help.exit_code, 0);
        EXPECT_EQ(help.err, "");
        EXPECT_NE(help.out.find("usage: strata " + std::string(command.name) + " " + std::string(command.positional)),
                  std::string::npos);
        for (const OptionRow& row : command.rows) {
            const std::string term = std::string(row.flag) + (row.value.empty() ? "" : " " + std::string(row.value));
            EXPECT_NE(help.out.find(term), std::string::npos) << command.name << " " << row.flag;
            EXPECT_FALSE(row.help.empty()) << command.name << " " << row.flag;
        }
        for (size_t begin = 0, end; begin < help.out.size(); begin = end + 1) {
            end = help.out.find('\n', begin);
            ASSERT_NE(end, std::string::npos);
            EXPECT_LE(end - begin, 100u) << help.out.substr(begin, end - begin);
        }
    }
}

TEST(CommandLine, DefaultsShowInTheHelp) {
    constexpr OptionRow rows[] = {{"--error", "-e", "PX", "1", "largest error, in pixels"}};
    const std::string help = command_help({.name = "try", .summary = "tries", .positional = "IN", .rows = rows});
    EXPECT_NE(help.find("  -e, --error PX          largest error, in pixels (default: 1)\n"), std::string::npos)
        << help;
}

TEST(CommandLine, AWrongOneGetsTwoLinesOfUsageAndExitCode2) {
    const struct {
        std::vector<std::string> words;
        std::string errors;
    } cases[] = {
        {{"inof"},
         "strata: unknown command 'inof'; did you mean info?\nusage: strata COMMAND ... [OPTIONS]\n'strata --help' "
         "lists the commands\n"},
        {{"--frob"},
         "strata: unknown option --frob before the command\nusage: strata COMMAND ... [OPTIONS]\n'strata --help' lists "
         "the commands\n"},
        {{"info"},
         "strata: info: expected PATH, got nothing\nusage: strata info PATH [OPTIONS]\n'strata info --help' says "
         "more\n"},
    };
    for (const auto& [words, errors] : cases) {
        const ProgramResult result = run_strata(words);
        EXPECT_EQ(result.exit_code, 2);
        EXPECT_EQ(result.out, "");
        EXPECT_EQ(result.err, errors);
    }
}

TEST(CommandLine, AFileThatIsNotThereIsOneLineAndExitCode1) {
    const ProgramResult result = run_strata({"info", "/nowhere/at all.las"});
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_EQ(result.out, "");
    EXPECT_TRUE(result.err.starts_with("strata: /nowhere/at all.las: ")) << result.err;
    EXPECT_EQ(result.err.find('\n'), result.err.size() - 1);
}

// What did not reach its reader was not done.
TEST(CommandLine, AFullStandardOutputIsAFailure) {
    const ProgramResult result = run_program({"/bin/sh", "-c", "exec \"$0\" --help >/dev/full", STRATA_PROGRAM});
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_EQ(result.err, "strata: standard output: No space left on device\n");
}

}  // namespace
}  // namespace strata
