// One input and one set of options give the same bytes, whatever surrounds the run; and no more memory than allowed.
#include <gtest/gtest.h>

#include <filesystem>
#include <regex>

#include "tests/support/scan_files.h"

namespace strata::robust {
namespace {

namespace fs = std::filesystem;
using namespace test;

/// What surrounds a run: variables by env(1), a umask and a folder by the shell.
struct Surroundings {
    std::string name;
    std::vector<std::string> variables;
    int threads = 2;
    std::string umask_text = "022", folder = "/";
};

std::vector<Surroundings> surroundings() {
    std::vector<Surroundings> all;
    const int runs = full_run() ? 20 : 2;
    for (const int threads : {1, 2, 3, 4, 7})
        for (int i = 0; i < runs; ++i) all.push_back({std::to_string(threads) + " threads", {}, threads});
    all.push_back({"decimal commas", {"LC_ALL=de_DE.UTF-8", "LANG=de_DE.UTF-8"}});
    all.push_back({"a dotless i", {"LC_ALL=tr_TR.UTF-8"}});
    all.push_back({"a time zone", {"TZ=Pacific/Auckland"}});
    all.push_back({"a umask", {}, 2, "077"});
    all.push_back({"a folder", {}, 2, "022", "/tmp"});
    return all;
}

// Every build takes fewer for outputs that share most code with others.
std::vector<Surroundings> surroundings_of(const ConvertedOutput& output) {
    const std::string_view label = output.label;
    if (full_run() || label == "potree" || label == "brotli") return surroundings();
    return {{"1 thread", {}, 1}, {"3 threads", {}, 3}, {"7 threads and decimal commas", {"LC_ALL=de_DE.UTF-8", "LANG=de_DE.UTF-8"}, 7}};
}

ProgramResult run_in(const Surroundings& at, const std::vector<std::string>& command) {
    std::vector<std::string> words = {"/usr/bin/env"};
    words.insert(words.end(), at.variables.begin(), at.variables.end());
    words.insert(words.end(), {"/bin/sh", "-c", "umask $1; cd \"$2\"; shift 2; exec \"$@\"", "sh", at.umask_text, at.folder, STRATA_PROGRAM});
    words.insert(words.end(), command.begin(), command.end());
    words.insert(words.end(), {"--threads", std::to_string(at.threads), "--overwrite"});
    if (command.back() != "--quiet") words.push_back("--quiet");
    return run_program(words);
}

class Determinism : public testing::Test {
protected:
    void SetUp() override {
        ASSERT_EQ(run_strata({"sample", scan_, "--points", full_run() ? "600000" : "100000", "--quiet"}).exit_code, 0);
    }
    const TemporaryFolder folder_;
    const std::string scan_ = folder_.file("scan.las");
};

TEST_F(Determinism, OfConvert) {
    std::vector<ConvertedOutput> outputs = converted_outputs();
    outputs.insert(outputs.begin(), {"brotli", "out", {"--encoding", "brotli"}});
    for (const ConvertedOutput& output : outputs) {
        // The name of the output is in its metadata.
        fs::create_directories(folder_.file(std::string(output.label) + "/first"));
        fs::create_directories(folder_.file(std::string(output.label) + "/again"));
        const std::string first = folder_.file(std::string(output.label) + "/first/") + output.name, again = folder_.file(std::string(output.label) + "/again/") + output.name;
        ASSERT_EQ(run_in({}, output.command(scan_, first)).exit_code, 0);
        const std::vector<std::string> words = output.command(scan_, again);
        for (const Surroundings& at : surroundings_of(output)) {
            SCOPED_TRACE(output.label + (", " + at.name));
            const ProgramResult result = run_in(at, words);
            ASSERT_EQ(result.exit_code, 0) << result.err;
            ASSERT_TRUE(same_output(first, again));
        }
    }
}

TEST_F(Determinism, OfRender) {
    std::vector<std::string> words = {"render", scan_, "-o", folder_.file("first.png"), "--size", "320x200"};
    ASSERT_EQ(run_in({}, words).exit_code, 0);
    words[3] = folder_.file("again.png");
    for (const Surroundings& at : surroundings()) {
        SCOPED_TRACE(at.name);
        const ProgramResult result = run_in(at, words);
        ASSERT_EQ(result.exit_code, 0) << result.err;
        ASSERT_TRUE(file_contents(folder_.file("first.png")) == file_contents(folder_.file("again.png")));
    }
}

// A sample is the same scan on every number of threads.
TEST_F(Determinism, OfSample) {
    for (const int threads : {1, 3, 7}) {
        ASSERT_EQ(run_in({.threads = threads}, {"sample", folder_.file("again.las"), "--points", "100000"}).exit_code, 0);
        ASSERT_TRUE(file_contents(scan_) == file_contents(folder_.file("again.las")));
    }
}

TEST(MemoryCap, BelowTheLeastIsRefusedWithTheNumberAndTheLeastIsHeld) {
    if (built_with_sanitizer()) GTEST_SKIP() << "sanitizers take memory of their own";
    const TemporaryFolder folder;
    const std::string scan = folder.file("scan.las"), out = folder.file("out");
    ASSERT_EQ(run_strata({"sample", scan, "--points", full_run() ? "20000000" : "1500000", "--quiet"}).exit_code, 0);
    const ProgramResult refused = run_strata({"convert", scan, out, "--quiet", "--memory", "1M"});
    EXPECT_EQ(refusal_verdict(refused), "");
    std::smatch least;
    ASSERT_TRUE(std::regex_search(refused.err, least, std::regex("a memory cap of at least ([0-9]+) MiB is needed, 1 MiB are allowed"))) << refused.err;
    const uint64_t mebibytes = std::stoull(least[1]);

    const ProgramResult below = run_strata({"convert", scan, out, "--quiet", "--memory", std::to_string(mebibytes - 1) + "M"});
    EXPECT_EQ(refusal_verdict(below), "");
    EXPECT_EQ(entries(folder.path()), 1u);

    for (const std::string encoding : {"default", "brotli"}) {
        const ProgramResult held = run_strata({"convert", scan, out, "--quiet", "--overwrite", "--encoding", encoding, "--memory", std::to_string(mebibytes) + "M"});
        EXPECT_EQ(held.exit_code, 0) << held.err;
        EXPECT_LE(held.peak_memory_bytes, (mebibytes << 20) + 100'000'000) << "under a cap of " << mebibytes << " MiB, " << encoding;
        std::printf("cap %llu MiB, %s: %.0f MiB resident\n", static_cast<unsigned long long>(mebibytes), encoding.c_str(),
                    double(held.peak_memory_bytes) / double(1 << 20));
    }
}

}  // namespace
}  // namespace strata::robust
