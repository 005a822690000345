// Outputs that cannot or must not be written: nothing is lost, one line says why.
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "tests/support/scan_files.h"

namespace strata::robust {
namespace {

namespace fs = std::filesystem;
using namespace test;

class OutputInTheWay : public testing::Test {
protected:
    void SetUp() override { write_sheet(scan_, 1000); }

    ProgramResult convert(const std::string& out, bool overwrite = true, const ProgramLimits& limits = {}) const {
        std::vector<std::string> words = {"convert", scan_, out, "--quiet"};
        if (overwrite) words.push_back("--overwrite");
        return run_strata(words, limits);
    }
    ProgramResult render(const std::string& out, bool overwrite = true) const {
        std::vector<std::string> words = {"render", scan_, "-o", out, "--quiet", "--size", "64x64", "--edl", "0"};
        if (overwrite) words.push_back("--overwrite");
        return run_strata(words);
    }
    static void expect_refused(const ProgramResult& result, const std::string& path, const std::string& reason) {
        EXPECT_EQ(refusal_verdict(result), "");
        EXPECT_NE(result.err.find(path), std::string::npos) << result.err;
        EXPECT_NE(result.err.find(reason), std::string::npos) << result.err;
    }
    static void write(const std::string& path, const std::string& text) { std::ofstream(path, std::ios::binary) << text; }

    const TemporaryFolder folder_;
    const std::string scan_ = folder_.file("scan.las");
};

TEST_F(OutputInTheWay, AnExistingOutputNeedsOverwrite) {
    const std::string set = folder_.file("set"), picture = folder_.file("a.png"), sample = folder_.file("s.las");
    ASSERT_EQ(convert(set, false).exit_code, 0);
    ASSERT_EQ(render(picture, false).exit_code, 0);
    ASSERT_EQ(run_strata({"sample", sample, "--points", "500", "--quiet"}).exit_code, 0);
    const std::string earlier = file_contents(set + "/octree.bin") + file_contents(picture) + file_contents(sample);
    expect_refused(convert(set, false), set, "exists; --overwrite replaces it");
    expect_refused(render(picture, false), picture, "exists; --overwrite replaces it");
    expect_refused(run_strata({"sample", sample, "--points", "600", "--quiet"}), sample, "exists; --overwrite replaces it");
    EXPECT_TRUE(earlier == file_contents(set + "/octree.bin") + file_contents(picture) + file_contents(sample));
    EXPECT_EQ(convert(set).exit_code, 0);
    EXPECT_EQ(render(picture).exit_code, 0);
    EXPECT_EQ(run_strata({"sample", sample, "--points", "600", "--quiet", "--overwrite"}).exit_code, 0);
    EXPECT_EQ(entries(folder_.path()), 4u);
}

class EachOutputInTheWay : public OutputInTheWay, public testing::WithParamInterface<ConvertedOutput> {
protected:
    ProgramResult convert_to(const std::string& out, bool overwrite = true) const {
        std::vector<std::string> words = GetParam().command(scan_, out);
        if (overwrite) words.push_back("--overwrite");
        return run_strata(words);
    }
};

TEST_P(EachOutputInTheWay, ReplacesWhatItMayAndNothingElse) {
    const std::string name = GetParam().name, out = folder_.file(name), earlier = folder_.file("earlier" + name), link = folder_.file("link" + name);
    ASSERT_EQ(convert_to(out, false).exit_code, 0);
    ASSERT_EQ(convert_to(earlier, false).exit_code, 0);
    fs::create_symlink(out, link);
    expect_refused(convert_to(out, false), out, "exists; --overwrite replaces it");
    expect_refused(convert_to(link, false), GetParam().is_folder() ? out : link, "exists; --overwrite replaces it");
    EXPECT_TRUE(same_output(out, earlier) || GetParam().label == std::string("potree"));  // whose metadata has the name
    write_sheet(scan_, 700);
    const std::string before = file_contents(scan_);
    EXPECT_EQ(convert_to(link).exit_code, 0);
    EXPECT_TRUE(fs::is_symlink(link));
    EXPECT_FALSE(same_output(out, earlier));
    EXPECT_EQ(convert_to(earlier).exit_code, 0);
    if (GetParam().label != std::string("potree")) EXPECT_TRUE(same_output(out, earlier));
    // What is of another kind.
    fs::create_directory(folder_.file("photos" + name));
    write(folder_.file("photos" + name + "/one.jpg"), "x");
    expect_refused(convert_to(folder_.file("photos" + name)), folder_.file("photos" + name), GetParam().is_folder() ? "is no earlier output" : "is a folder");
    ASSERT_EQ(::mkfifo(folder_.file("fifo" + name).c_str(), 0666), 0);
    expect_refused(convert_to(folder_.file("fifo" + name)), folder_.file("fifo" + name), GetParam().is_folder() ? "is no earlier output" : "is no regular file");
    fs::create_symlink(scan_, folder_.file("scan" + name));
    expect_refused(convert_to(folder_.file("scan" + name)), folder_.file("scan" + name), "is an input");
    expect_refused(convert_to(folder_.file("missing/" + name)), folder_.file("missing"), "No such file");
    expect_refused(convert_to(scan_ + "/" + name), scan_, "Not a directory");
    EXPECT_EQ(file_contents(folder_.file("photos" + name + "/one.jpg")), "x");
    EXPECT_TRUE(before == file_contents(scan_));
    // 255 bytes are the longest name; names are bytes, not text.
    for (const std::string& odd : {std::string(255 - name.size(), 'n') + name, "\xff\xfe \"quoted\" \n line" + name}) {
        EXPECT_EQ(convert_to(folder_.file(odd)).exit_code, 0);
        EXPECT_EQ(convert_to(folder_.file(odd)).exit_code, 0);
        const std::string what = fs::exists(folder_.file(odd + "/000000.drc")) ? odd + "/000000.drc" : odd;  // blocks are files of their own
        const bool readable = name != "out.glb";
        EXPECT_EQ(run_strata({"info", "--exact", "--json", folder_.file(what)}).exit_code, readable ? 0 : 1);
        fs::remove_all(folder_.file(odd));
    }
    EXPECT_EQ(refusal_verdict(convert_to(folder_.file(std::string(256 - name.size(), 'n') + name))), "");
    EXPECT_EQ(entries(folder_.path()), 7u);
}

INSTANTIATE_TEST_SUITE_P(Robust, EachOutputInTheWay, testing::ValuesIn(converted_outputs()), [](const auto& output) { return output.param.label; });

// --overwrite replaces outputs, not what else a user keeps by that name.
TEST_F(OutputInTheWay, WhatIsNoOutputOfThatKindIsLeftAlone) {
    fs::create_directory(folder_.file("photos.png"));
    write(folder_.file("photos.png/one.jpg"), "x");
    write(folder_.file("notes"), "x");
    ASSERT_EQ(::mkfifo(folder_.file("fifo.png").c_str(), 0666), 0);
    expect_refused(convert(folder_.file("photos.png")), folder_.file("photos.png"), "is no earlier output");
    expect_refused(convert(folder_.file("notes")), folder_.file("notes"), "is no earlier output");
    expect_refused(convert(folder_.file("fifo.png")), folder_.file("fifo.png"), "is no earlier output");
    expect_refused(render(folder_.file("photos.png")), folder_.file("photos.png"), "is a folder");
    expect_refused(render(folder_.file("fifo.png")), folder_.file("fifo.png"), "is no regular file");
    EXPECT_EQ(file_contents(folder_.file("photos.png/one.jpg")) + file_contents(folder_.file("notes")), "xx");
    EXPECT_EQ(entries(folder_.path()), 4u);
}

// A name that a data set has, too, does not make one of a folder: nothing in it may go.
TEST_F(OutputInTheWay, AFolderWithMoreThanAnOutputIsLeftAlone) {
    const std::string project = folder_.file("proj");
    fs::create_directories(project + "/raw");
    write(project + "/metadata.json", "{\"project\":\"bridge\"}");
    write(project + "/field_notes.txt", "x");
    expect_refused(convert(project), project, "holds 'field_notes.txt', which is no part of a data set; --overwrite would delete it");
    fs::remove(project + "/field_notes.txt");
    expect_refused(convert(project), project, "holds 'raw'");
    fs::remove(project + "/raw");
    expect_refused(convert(project), project, "is no earlier output (an empty folder or one with metadata.json, hierarchy.bin, octree.bin)");
    EXPECT_EQ(file_contents(project + "/metadata.json"), "{\"project\":\"bridge\"}");

    // What a user adds to a data set stays; so does a folder under the name of one of its files.
    const std::string set = folder_.file("set");
    ASSERT_EQ(convert(set).exit_code, 0);
    const std::string points = file_contents(set + "/octree.bin");
    write(set + "/view.html", "x");
    expect_refused(convert(set), set, "holds 'view.html'");
    fs::remove(set + "/view.html");
    fs::rename(set + "/octree.bin", folder_.file("octree.bin"));
    fs::create_directory(set + "/octree.bin");
    write(set + "/octree.bin/mine", "x");
    expect_refused(convert(set), set, "holds 'octree.bin'");
    EXPECT_EQ(file_contents(set + "/octree.bin/mine"), "x");
    fs::remove_all(set + "/octree.bin");
    fs::create_symlink(folder_.file("octree.bin"), set + "/octree.bin");  // the link goes, not what it points to
    EXPECT_EQ(convert(set).exit_code, 0);
    EXPECT_TRUE(file_contents(folder_.file("octree.bin")) == points);

    const std::string blocks = folder_.file("blocks");
    const auto convert_to_blocks = [&] { return run_strata({"convert", scan_, blocks, "--format", "drc", "--overwrite", "--quiet"}); };
    ASSERT_EQ(convert_to_blocks().exit_code, 0);
    write(blocks + "/000001.drc", "an earlier output of more points");
    EXPECT_EQ(convert_to_blocks().exit_code, 0);
    EXPECT_EQ(entries(blocks), 1u);
    for (const char* name : {"mysurvey.drc", "1.drc", "0000001.drc", "000001.drc.bak", "-00001.drc"}) {
        SCOPED_TRACE(name);
        write(blocks + "/" + name, "x");
        expect_refused(convert_to_blocks(), blocks, "holds '" + std::string(name) + "'");
        EXPECT_EQ(file_contents(blocks + "/" + name), "x");
        fs::remove(blocks + "/" + name);
    }
    EXPECT_EQ(entries(folder_.path()), 5u);  // no temporaries
}

TEST_F(OutputInTheWay, AnInputIsNeverTheOutput) {
    const std::string before = file_contents(scan_);
    expect_refused(convert(scan_), scan_, "is an input");
    fs::create_symlink(scan_, folder_.file("link.png"));
    expect_refused(render(folder_.file("link.png")), folder_.file("link.png"), "is an input");
    EXPECT_TRUE(before == file_contents(scan_));

    ASSERT_EQ(render(folder_.file("a.png")).exit_code, 0);
    const std::string picture = file_contents(folder_.file("a.png"));
    expect_refused(run_strata({"render", scan_, "-o", folder_.file("a.png"), "--reference", folder_.file("a.png"), "--overwrite", "--edl", "0",
                               "--background", "#ffffff", "--size", "64x64"}),
                   folder_.file("a.png"), "is an input");
    EXPECT_TRUE(picture == file_contents(folder_.file("a.png")));

    ASSERT_EQ(convert(folder_.file("set")).exit_code, 0);
    fs::create_symlink(folder_.file("set/octree.bin"), folder_.file("points.png"));
    expect_refused(run_strata({"render", folder_.file("set"), "-o", folder_.file("points.png"), "--overwrite", "--edl", "0"}),
                   folder_.file("points.png"), "is an input");
    // The scan inside the folder that would be replaced.
    fs::rename(scan_, folder_.file("set/scan.las"));
    expect_refused(run_strata({"convert", folder_.file("set/scan.las"), folder_.file("set"), "--overwrite"}), folder_.file("set"),
                   "lies inside the output");
    EXPECT_TRUE(before == file_contents(folder_.file("set/scan.las")));
}

TEST_F(OutputInTheWay, AnOutputInsideTheInputFolderIsFine) {
    fs::create_directory(folder_.file("scans"));
    fs::rename(scan_, folder_.file("scans/a.las"));
    const ProgramResult result = run_strata({"convert", folder_.file("scans"), folder_.file("scans/out"), "--quiet"});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(entries(folder_.file("scans")), 2u);
}

TEST_F(OutputInTheWay, ALinkStandsForWhatItPointsTo) {
    ASSERT_EQ(convert(folder_.file("real")).exit_code, 0);
    fs::create_directory_symlink(folder_.file("real"), folder_.file("link"));
    expect_refused(convert(folder_.file("link"), false), folder_.file("real"), "exists");
    write_sheet(scan_, 700);
    EXPECT_EQ(convert(folder_.file("link")).exit_code, 0);
    EXPECT_TRUE(fs::is_symlink(folder_.file("link")));
    ASSERT_EQ(convert(folder_.file("fresh")).exit_code, 0);
    EXPECT_TRUE(file_contents(folder_.file("real/octree.bin")) == file_contents(folder_.file("fresh/octree.bin")));
    fs::create_symlink(folder_.file("nowhere/set"), folder_.file("dangling"));
    EXPECT_EQ(refusal_verdict(convert(folder_.file("dangling"))), "");
}

TEST_F(OutputInTheWay, AFolderThatCannotBeWritten) {
    fs::create_directory(folder_.file("locked"));
    expect_refused(convert(folder_.file("missing/out")), folder_.file("missing"), "No such file");
    expect_refused(render(folder_.file("missing/a.png")), folder_.file("missing"), "No such file");
    expect_refused(convert(scan_ + "/out"), scan_, "Not a directory");
    constexpr unsigned kNobody = 65534;
    if (::getuid() != 0) {
        ASSERT_EQ(::chmod(folder_.file("locked").c_str(), 0555), 0);
        expect_refused(convert(folder_.file("locked/out")), folder_.file("locked"), "Permission denied");
        return;
    }
    // Nothing is locked for root: another user meets the lock, where that user may run the program at all.
    ASSERT_EQ(::chmod(folder_.path().c_str(), 0755), 0);
    if (run_strata({"--version"}, {.user = kNobody}).exit_code != 0) GTEST_SKIP() << "another user cannot run " STRATA_PROGRAM;
    expect_refused(convert(folder_.file("locked/out"), true, {.user = kNobody}), folder_.file("locked"), "Permission denied");
}

// 255 bytes are the longest name; names are bytes, not text.
TEST_F(OutputInTheWay, NamesOfEveryKind) {
    const std::string longest(255, 'n'), odd = "\xff\xfe\x80 \"quoted\" \n line";
    for (const std::string& name : {longest, odd, std::string("-"), std::string("ünïcødé")}) {
        SCOPED_TRACE(name);
        const std::string set = folder_.file(name);
        EXPECT_EQ(convert(set).exit_code, 0);
        EXPECT_EQ(convert(set).exit_code, 0);
        const ProgramResult info = run_strata({"info", set, "--exact", "--json"});
        EXPECT_EQ(info.exit_code, 0) << info.err;
        fs::remove_all(set);
        const std::string picture = folder_.file(name.substr(0, 251) + ".png");
        EXPECT_EQ(render(picture).exit_code, 0);
        EXPECT_TRUE(file_contents(picture).starts_with("\x89PNG"));
        fs::remove(picture);
    }
    EXPECT_EQ(refusal_verdict(convert(folder_.file(longest + "n"))), "");
    EXPECT_EQ(refusal_verdict(render(folder_.file(longest + ".png"))), "");
    EXPECT_EQ(entries(folder_.path()), 1u);
    // A message is one line, whatever the name.
    EXPECT_EQ(refusal_verdict(run_strata({"info", folder_.file(odd)})), "");
}

}  // namespace
}  // namespace strata::robust
