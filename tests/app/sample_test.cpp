// Runs the real `strata sample`.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <vector>

namespace strata {
namespace {

namespace fs = std::filesystem;

class SampleCommand : public testing::Test {
protected:
    SampleCommand() : folder_(fs::temp_directory_path() / ("strata_sample_" + std::to_string(::getpid()))) { fs::create_directories(folder_); }
    ~SampleCommand() override { fs::remove_all(folder_); }

    int run(const std::string& words) const {
        const std::string command = std::string(STRATA_PROGRAM) + " sample " + words + " >" + (folder_ / "stdout").string() + " 2>" + (folder_ / "stderr").string();
        const int status = std::system(command.c_str());
        return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    }
    std::string text(const std::string& name) const {
        std::ifstream in(folder_ / name, std::ios::binary);
        return {std::istreambuf_iterator<char>(in), {}};
    }
    std::string at(const std::string& name) const { return (folder_ / name).string(); }

    fs::path folder_;
};

TEST_F(SampleCommand, WritesTheCountAndTheSameBytesForAnyThreads) {
    ASSERT_EQ(run(at("a.las") + " --points 50000 --mode both --threads 1 --quiet"), 0) << text("stderr");
    ASSERT_EQ(run(at("b.las") + " --points 50000 --mode both --threads 5 --quiet"), 0) << text("stderr");
    const std::string a = text("a.las");
    ASSERT_GT(a.size(), 375u);
    uint64_t count = 0;
    std::memcpy(&count, a.data() + 247, sizeof count);
    EXPECT_EQ(count, 50'000u);
    EXPECT_EQ((a.size() - 50'000 * 36) / 1024, 1u);  // header and WKT
    EXPECT_TRUE(a == text("b.las"));
    EXPECT_EQ(text("stderr"), "");
    EXPECT_EQ(text("stdout"), "");
}

TEST_F(SampleCommand, AnotherSeedIsAnotherScan) {
    ASSERT_EQ(run(at("a.las") + " --points 5000 --quiet"), 0);
    ASSERT_EQ(run(at("b.las") + " --points 5000 --quiet --seed 2"), 0);
    EXPECT_FALSE(text("a.las") == text("b.las"));
}

TEST_F(SampleCommand, JsonIsAllOfStandardOutput) {
    ASSERT_EQ(run(at("a.las") + " --points 5000 --json"), 0);
    const std::string json = text("stdout");
    EXPECT_EQ(json.front(), '{');
    EXPECT_NE(json.find("\"points_written\":5000"), std::string::npos) << json;
    EXPECT_EQ(text("stderr"), "");
}

TEST_F(SampleCommand, KeepsAnExistingFile) {
    std::ofstream(at("a.las")) << "precious";
    EXPECT_NE(run(at("a.las") + " --points 1000"), 0);
    EXPECT_EQ(text("a.las"), "precious");
    EXPECT_NE(text("stderr").find("--overwrite"), std::string::npos);
    EXPECT_EQ(run(at("a.las") + " --points 1000 --overwrite"), 0);
    EXPECT_NE(text("a.las"), "precious");
}

TEST_F(SampleCommand, WrongWordsAreUsageErrors) {
    for (const std::string words : {" --points 0", " --points x", " --mode submarine", " --scene moon", " --noise -1", " --noise nan"})
        EXPECT_EQ(run(at("a.las") + words), 2) << words;
    EXPECT_FALSE(fs::exists(at("a.las")));
    EXPECT_EQ(run(at("a.laz") + " --points 10"), 2);  // it would be no LAZ
}

TEST_F(SampleCommand, MissingFolderIsOneLine) {
    EXPECT_EQ(run(at("none/a.las") + " --points 1000"), 1);
    const std::string message = text("stderr");
    EXPECT_NE(message.find("none"), std::string::npos) << message;
    EXPECT_EQ(std::count(message.begin(), message.end(), '\n'), 1) << message;
}

}  // namespace
}  // namespace strata
