#include "app/options.h"

#include <gtest/gtest.h>

#include <functional>

#include "core/error.h"

namespace strata {
namespace {

constexpr OptionRow kRows[] = {
    {"--size", "-s", "WxH", "1920x1080", "pixels"},
    {"--eye", "", "X,Y,Z", "", "where the camera stands, in CRS units"},
    {"--count", "-n", "N", "7", "how many"},
    {"--depth", "", "[N]", "5", "how deep, if at all"},
    shared_option::kMemory,
    shared_option::kQuiet,
};

Options g_seen;  // what the last run of the command saw; a command is a plain function

int remember(const Options& options) {
    g_seen = options;
    return 0;
}

/// Runs "strata try WORDS..." and returns what the command saw.
Options parsed(std::vector<const char*> words) {
    const Command command = {.name = "try",
                             .summary = "tries",
                             .positional = "IN... OUT",
                             .least_positional = 2,
                             .rows = kRows,
                             .run = remember};
    words.insert(words.begin(), {"strata", "try"});
    g_seen = {};
    EXPECT_EQ(run_command_line({&command, 1}, int(words.size()), words.data()), 0);
    return g_seen;
}

/// The message of the usage error that `body` throws.
std::string usage_error(const std::function<void()>& body) {
    try {
        body();
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, ErrorKind::usage);
        return error.what();
    }
    ADD_FAILURE() << "nothing was thrown";
    return {};
}

TEST(Options, WordsFlagsAndSwitchesMayMix) {
    const Options options = parsed({"a.las", "-q", "b.las", "--size=640x480", "out"});
    EXPECT_EQ(options.positional, (std::vector<std::string>{"a.las", "b.las", "out"}));
    EXPECT_EQ(options.text("--size"), "640x480");
    EXPECT_TRUE(options.given("--quiet"));
}

TEST(Options, AValueInBracketsMayBeLeftOut) {
    EXPECT_FALSE(parsed({"a", "b"}).given("--depth"));
    EXPECT_EQ(parsed({"a", "b"}).integer("--depth", 0, 9), 5);
    for (const std::vector<const char*>& words : {std::vector<const char*>{"a", "b", "--depth"}, {"--depth", "a", "b"}, {"a", "--depth", "-q", "b"}}) {
        const Options options = parsed(words);
        EXPECT_TRUE(options.given("--depth"));
        EXPECT_EQ(options.integer("--depth", 0, 9), 5);
        EXPECT_EQ(options.positional, (std::vector<std::string>{"a", "b"}));
    }
    EXPECT_EQ(parsed({"--depth", "8", "a", "b"}).integer("--depth", 0, 9), 8);
    EXPECT_EQ(parsed({"--depth=3", "a", "b"}).integer("--depth", 0, 9), 3);
    EXPECT_EQ(parsed({"--depth", "2.5", "a", "b"}).number("--depth"), 2.5);
}

TEST(Options, WhatIsNotGivenHasItsDefault) {
    const Options options = parsed({"a", "b"});
    EXPECT_EQ(options.text("--size"), "1920x1080");
    EXPECT_EQ(options.integer("--count", 1, 10), 7);
    EXPECT_FALSE(options.given("--size"));
    EXPECT_FALSE(options.given("--quiet"));
    EXPECT_EQ(options.text("--eye"), "");
}

// Coordinates are often negative, and must not be taken for flags.
TEST(Options, NumbersMayBeNegative) {
    EXPECT_EQ(parsed({"a", "b", "--eye", "-1.5,-.25,3e2"}).numbers("--eye", 3),
              (std::vector<double>{-1.5, -0.25, 300.0}));
    EXPECT_EQ(parsed({"--eye", "-1,2,3", "a", "b"}).numbers("--eye", 3), (std::vector<double>{-1, 2, 3}));
}

TEST(Options, NumbersThatAreNoneAreRefusedByName) {
    for (const char* text : {"", "1,2", "1,2,3,4", "1,2,x", "1,2,", "1,2,nan", "1,2,inf", "1 ,2,3", "1,2,3m"}) {
        const Options options = parsed({"a", "b", "--eye", text});
        EXPECT_NE(usage_error([&] { options.numbers("--eye", 3); }).find("--eye: expected "), std::string::npos)
            << text;
    }
    for (const char* text : {"", "0", "11", "3.5", "99999999999999999999", "-1", "7 "}) {
        const Options options = parsed({"a", "b", "--count", text});
        EXPECT_EQ(usage_error([&] { options.integer("--count", 1, 10); }),
                  "--count: expected a whole number from 1 to 10, got '" + std::string(text) + "'");
    }
}

TEST(Options, SizesCountInPowersOf1024) {
    EXPECT_EQ(parsed({"a", "b", "-m", "2G"}).bytes("--memory"), uint64_t{2} << 30);
    EXPECT_EQ(parsed({"a", "b", "-m", "1.5M"}).bytes("--memory"), uint64_t{3} << 19);
    EXPECT_EQ(parsed({"a", "b", "-m", "1000"}).bytes("--memory"), 1000u);
    for (const char* text : {"", "G", "-1G", "0", "2X", "1e30T", "nan"}) {
        const Options options = parsed({"a", "b", "-m", text});
        EXPECT_NE(usage_error([&] { options.bytes("--memory"); }).find("--memory: expected a size"), std::string::npos)
            << text;
    }
}

TEST(Options, HalfOfWhatIsFreeIsTheDefaultCap) {
    const uint64_t cap = memory_cap(parsed({"a", "b"}));
    EXPECT_GT(cap, uint64_t{1} << 20);
    EXPECT_LT(cap, uint64_t{1} << 50);
}

TEST(Options, AWrongCommandLineIsExplained) {
    EXPECT_EQ(usage_error([] { parsed({"a"}); }), "try: expected IN... OUT, got 1 word");
    EXPECT_EQ(usage_error([] { parsed({}); }), "try: expected IN... OUT, got nothing");
    EXPECT_EQ(usage_error([] {
                  parsed({"a", "b", "--sise", "1x1"});
              }),
              "try: unknown option --sise; did you mean --size?");
    EXPECT_EQ(usage_error([] { parsed({"a", "b", "--frobnicate"}); }), "try: unknown option --frobnicate");
    EXPECT_EQ(usage_error([] { parsed({"a", "b", "--size"}); }), "try: --size: expected WxH, got nothing");
    EXPECT_EQ(usage_error([] { parsed({"a", "b", "-n", "1", "-n", "2"}); }), "try: --count: given more than once");
}

TEST(Options, AListHasAWordMoreThanCommas) {
    using Words = std::vector<std::string>;
    EXPECT_EQ(split_list("a,b c,,d"), (Words{"a", "b c", "", "d"}));
    EXPECT_EQ(split_list(""), Words{""});
    EXPECT_EQ(split_list("a,"), (Words{"a", ""}));
}

}  // namespace
}  // namespace strata
