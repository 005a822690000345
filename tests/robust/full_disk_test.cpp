// Disks that fill up: small file systems in memory as the target, a limit on the size of files, in a row of steps.
#include <gtest/gtest.h>
#include <sys/mount.h>

#include <algorithm>
#include <filesystem>

#include "tests/support/scan_files.h"

namespace strata::robust {
namespace {

namespace fs = std::filesystem;
using namespace test;

/// A file system of a few MiB in memory. Only root can make one.
class SmallDisk {
public:
    SmallDisk(const std::string& path, uint64_t bytes) : path_(path) {
        fs::create_directory(path);
        mounted_ = ::mount("tmpfs", path.c_str(), "tmpfs", 0, ("size=" + std::to_string(bytes)).c_str()) == 0;
    }
    SmallDisk(const SmallDisk&) = delete;
    SmallDisk& operator=(const SmallDisk&) = delete;
    ~SmallDisk() {
        if (mounted_) ::umount2(path_.c_str(), MNT_DETACH);
    }
    bool mounted() const { return mounted_; }
    const std::string& path() const { return path_; }
    std::string file(const std::string& name) const { return path_ + "/" + name; }

private:
    std::string path_;
    bool mounted_ = false;
};

class FullDisk : public testing::TestWithParam<ConvertedOutput> {
protected:
    static constexpr int kPoints = 60'000;  // 12 bytes of position and 22 to 26 of attributes: about 2 MB

    void SetUp() override {
        write_sheet(scan_, kPoints);
        write_sheet(folder_.file("other.las"), 500);
        fs::create_directory(folder_.file("whole"));  // the last part of an output's name is in its metadata
        fs::create_directory(folder_.file("earlier"));
        ASSERT_EQ(convert(scan_, whole_).exit_code, 0);
        ASSERT_EQ(convert(folder_.file("other.las"), earlier_).exit_code, 0);
    }
    static ProgramResult convert(const std::string& in, const std::string& out, const ProgramLimits& limits = {}) {
        std::vector<std::string> words = GetParam().command(in, out);
        words.push_back("--overwrite");
        return run_strata(words, limits);
    }

    /// Of the largest file of an output.
    static uint64_t file_bytes(const std::string& output) {
        uint64_t most = 0;
        for (const std::string& file : {output, output + "/octree.bin", output + "/000000.drc"})
            if (fs::is_regular_file(file)) most = std::max<uint64_t>(most, fs::file_size(file));
        return most;
    }

    const TemporaryFolder folder_;
    const std::string label_ = GetParam().label;
    const bool faces_wait_ = label_ == "ply" || label_ == "glb";  // in a temporary file of the same folder, until all vertices are written
    const bool is_potree_ = label_ == "potree" || label_ == "brotli", levels_ = is_potree_ || label_ == "copc";
    const std::string scan_ = folder_.file("scan.las"), name_ = GetParam().name, whole_ = folder_.file("whole/" + name_), earlier_ = folder_.file("earlier/" + name_);
};

// The steps cross every file of the output: before, within and after each.
TEST_P(FullDisk, IsRefusedWithPathAndBytes) {
    int refused = 0, whole = 0;
    const int steps = full_run() ? 64 : is_potree_ ? 12 : 4;
    const uint64_t most = levels_ ? uint64_t{4} << 20 : (faces_wait_ ? 5 : 3) * file_bytes(whole_) / 2 + 65'536;  // the folder itself takes a page
    for (int step = 1; step <= steps; ++step) {
        const uint64_t bytes = uint64_t(step) * most / uint64_t(steps);
        const SmallDisk disk(folder_.file("disk" + std::to_string(step)), bytes);
        if (!disk.mounted()) GTEST_SKIP() << "only root can make a small disk";
        SCOPED_TRACE("a disk of " + std::to_string(bytes) + " bytes");
        std::error_code problem;
        fs::copy(earlier_, disk.file(name_), fs::copy_options::recursive, problem);
        const bool earlier = !problem && same_output(disk.file(name_), earlier_);
        if (!earlier) fs::remove_all(disk.file(name_));
        const ProgramResult result = convert(scan_, disk.file(name_));
        if (result.exit_code == 0) {
            EXPECT_TRUE(same_output(disk.file(name_), whole_));
            ++whole;
        } else {
            EXPECT_EQ(refusal_verdict(result), "");
            // Level-of-detail sets are estimated and plain LAS is reserved; the size of the others is known when they are written. A
            // block of a folder is named in the temporary one.
            const std::string path = label_ == "drc_blocks" ? disk.path() + "/." + name_ : faces_wait_ ? disk.path() : disk.file(name_);
            const std::string reason = faces_wait_ ? "No space left" : levels_ ? "MiB of disk are needed" : label_ == "las" ? "bytes needed: No space left" : "bytes: No space left";
            EXPECT_TRUE(result.err.starts_with("strata: " + path + (levels_ ? ": about " : ""))) << result.err;
            EXPECT_NE(result.err.find(reason), std::string::npos) << result.err;
            if (earlier) EXPECT_TRUE(same_output(disk.file(name_), earlier_));
            ++refused;
        }
        EXPECT_EQ(entries(disk.file("")), earlier || result.exit_code == 0 ? 1u : 0u);
    }
    EXPECT_GT(refused, 0);
    EXPECT_GT(whole, 0);
}

// Nothing foretells a limit on the size of files, or a quota: the write fails in the middle.
TEST_P(FullDisk, FoundWhileWritingNamesPathAndBytes) {
    fs::copy(earlier_, folder_.file(name_), fs::copy_options::recursive);
    const uint64_t most = file_bytes(whole_);
    const int steps = full_run() ? 64 : is_potree_ ? 8 : 3;
    for (int step = 0; step < steps; ++step) {
        const uint64_t bytes = 1 + most * uint64_t(step) / uint64_t(steps);
        SCOPED_TRACE("files of at most " + std::to_string(bytes) + " bytes");
        const ProgramResult result = convert(scan_, folder_.file(name_), {.file_size_bytes = bytes});
        EXPECT_EQ(refusal_verdict(result), "");
        EXPECT_NE(result.err.find(folder_.path()), std::string::npos) << result.err;
        if (!faces_wait_ || result.err.find(": temporary file: writing ") == std::string::npos) EXPECT_NE(result.err.find((is_potree_ ? "octree.bin" : label_ == "drc_blocks" ? "0-0" : name_) + ": byte "), std::string::npos) << result.err;
        EXPECT_NE(result.err.find("File too large"), std::string::npos) << result.err;
        EXPECT_TRUE(same_output(folder_.file(name_), earlier_));
        EXPECT_EQ(entries(folder_.path()), 5u);
    }
}

std::vector<ConvertedOutput> all_outputs() {
    std::vector<ConvertedOutput> all = converted_outputs();
    all.push_back({"brotli", "out", {"--encoding", "brotli"}});
    return all;
}
INSTANTIATE_TEST_SUITE_P(Robust, FullDisk, testing::ValuesIn(all_outputs()), [](const auto& output) { return output.param.label; });

// A disk that holds the estimate and then fills up by someone else's doing is met by the failing calls (ENOSPC); a sample
// knows its size and reserves it.
TEST(FullDiskOfASample, IsRefusedBeforeTheStart) {
    const TemporaryFolder folder;
    const SmallDisk disk(folder.file("disk"), 1 << 20);
    if (!disk.mounted()) GTEST_SKIP() << "only root can make a small disk";
    const ProgramResult result = run_strata({"sample", disk.file("out.las"), "--points", "100000", "--quiet"});
    EXPECT_EQ(refusal_verdict(result), "");
    EXPECT_TRUE(result.err.starts_with("strata: " + disk.file("out.las"))) << result.err;
    EXPECT_NE(result.err.find("bytes needed: No space left"), std::string::npos) << result.err;
    EXPECT_EQ(entries(disk.file("")), 0u);
}

}  // namespace
}  // namespace strata::robust
