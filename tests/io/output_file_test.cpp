#include "io/output_file.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <functional>
#include <iterator>
#include <thread>
#include <vector>

#include "core/error.h"
#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

namespace fs = std::filesystem;

std::span<const std::byte> bytes_of(std::string_view text) { return std::as_bytes(std::span(text.data(), text.size())); }

std::string content(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

size_t entries(const std::string& folder) { return size_t(std::distance(fs::directory_iterator(folder), {})); }

// The kind and the message of what `body` throws.
Error error_of(const std::function<void()>& body) {
    try {
        body();
    } catch (const Error& error) {
        return error;
    }
    ADD_FAILURE() << "nothing was thrown";
    return {ErrorKind::device, "nothing"};
}

// Runs `body` in a child process that then ends without destructors, as a killed one does. returns its number
pid_t die_in(const std::function<void()>& body) {
    const pid_t child = ::fork();
    if (child == 0) {
        body();
        ::kill(::getpid(), SIGKILL);
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    EXPECT_TRUE(WIFSIGNALED(status));
    return child;
}

TEST(OutputFile, IsWholeAfterCommitAndAbsentBefore) {
    const TemporaryFolder folder;
    const std::string path = folder.file("out.bin");
    {
        OutputFile file(path, false);
        file.write(bytes_of("head"));
        file.write_at(10, bytes_of("tail"));
        file.write_at(4, bytes_of("middle"));
        EXPECT_EQ(file.size(), 14u);
        std::string back(6, ' ');
        file.read_at(4, std::as_writable_bytes(std::span(back.data(), back.size())));
        EXPECT_EQ(back, "middle");
        EXPECT_FALSE(fs::exists(path));
        EXPECT_EQ(fs::directory_iterator(folder.path())->path().filename(),
                  ".out.bin.strata-" + std::to_string(::getpid()) + ".tmp");
        file.commit();
    }
    EXPECT_EQ(content(path), "headmiddletail");
    EXPECT_EQ(entries(folder.path()), 1u);
}

TEST(OutputFile, WithoutCommitNothingStays) {
    const TemporaryFolder folder;
    OutputFile(folder.file("out"), false).write(bytes_of("x"));
    EXPECT_EQ(entries(folder.path()), 0u);
}

TEST(OutputFile, ReplacesOnlyWhenTold) {
    const TemporaryFolder folder;
    const std::string path = folder.file("out");
    std::ofstream(path) << "earlier";
    ::chmod(path.c_str(), 0640);
    const Error refused = error_of([&] { OutputFile(path, false); });
    EXPECT_EQ(refused.kind, ErrorKind::io);
    EXPECT_NE(std::string(refused.what()).find("--overwrite"), std::string::npos);
    EXPECT_EQ(content(path), "earlier");

    OutputFile file(path, true);
    file.write(bytes_of("later"));
    EXPECT_EQ(content(path), "earlier");
    file.commit();
    EXPECT_EQ(content(path), "later");
    struct stat status {};
    ::stat(path.c_str(), &status);
    EXPECT_EQ(status.st_mode & 0777, 0640u);
}

TEST(OutputFile, OfTwoWritersOneSaysSo) {
    const TemporaryFolder folder;
    const std::string path = folder.file("out");
    OutputFile first(path, false);
    EXPECT_EQ(error_of([&] { OutputFile(path, false); }).kind, ErrorKind::io);  // this process is at it already
    first.write(bytes_of("first"));
    std::ofstream(path) << "second";  // another program was faster
    EXPECT_EQ(error_of([&] { first.commit(); }).kind, ErrorKind::io);
    EXPECT_EQ(content(path), "second");
}

TEST(OutputFile, SymbolicLinksStandForTheirFile) {
    const TemporaryFolder folder;
    fs::create_directory(folder.file("elsewhere"));
    std::ofstream(folder.file("elsewhere/real")) << "earlier";
    fs::create_symlink("elsewhere/real", folder.file("link"));
    EXPECT_EQ(error_of([&] { OutputFile(folder.file("link"), false); }).kind, ErrorKind::io);
    OutputFile file(folder.file("link"), true);
    file.write(bytes_of("later"));
    file.commit();
    EXPECT_TRUE(fs::is_symlink(folder.file("link")));
    EXPECT_EQ(content(folder.file("elsewhere/real")), "later");
}

TEST(OutputFile, RefusesWhatIsNoFile) {
    const TemporaryFolder folder;
    ::mkfifo(folder.file("pipe").c_str(), 0600);
    fs::create_directory(folder.file("folder"));
    for (const char* name : {"pipe", "folder"}) {
        const Error error = error_of([&] { OutputFile(folder.file(name), true); });
        EXPECT_EQ(error.kind, ErrorKind::io) << error.what();
    }
    EXPECT_EQ(error_of([] { OutputFile("/dev/full", true); }).kind, ErrorKind::io);
    EXPECT_EQ(error_of([] { OutputFile("", true); }).kind, ErrorKind::io);
    EXPECT_EQ(error_of([&] { OutputFile(folder.file("no/such/folder"), true); }).kind, ErrorKind::not_found);
    EXPECT_EQ(error_of([&] { OutputFile(folder.file("pipe") + "/x", true); }).kind, ErrorKind::io);
}

TEST(OutputFile, NamesOf255BytesAndNamesThatAreNoUtf8) {
    const TemporaryFolder folder;
    for (const std::string& name : {std::string(255, 'n'), std::string("caf\xe9 \xff")}) {
        OutputFile file(folder.file(name), false);
        file.write(bytes_of("x"));
        file.commit();
        EXPECT_EQ(content(folder.file(name)), "x");
    }
}

TEST(OutputFile, RelativeNamesGoToTheWorkingFolder) {
    const TemporaryFolder folder;
    const fs::path before = fs::current_path();
    fs::current_path(folder.path());
    OutputFile file("bare", false);
    file.write(bytes_of("x"));
    file.commit();
    fs::current_path(before);
    EXPECT_EQ(content(folder.file("bare")), "x");
}

TEST(OutputFile, TheNextRunRemovesWhatADeadProcessLeft) {
    const TemporaryFolder folder;
    const auto leave = [&](const std::string& path) {
        return die_in([&] {
            OutputFile file(path, false);
            file.write(bytes_of("half"));
            ::kill(::getpid(), SIGKILL);
        });
    };
    const std::string path = folder.file("out");
    const pid_t dead = leave(path);
    const std::string stale = folder.file(".out.strata-" + std::to_string(dead) + ".tmp");
    EXPECT_TRUE(fs::exists(stale));

    // What must stay: another output's temporary, that of a process that runs, names that only look alike.
    const pid_t other = leave(folder.file("other"));
    const std::vector<std::string> kept = {folder.file(".other.strata-" + std::to_string(other) + ".tmp"),
                                           folder.file(".out.strata-" + std::to_string(::getppid()) + ".tmp"),
                                           folder.file(".out.strata-12x.tmp"), folder.file(".out.strata-.tmp")};
    for (const std::string& name : kept) std::ofstream(name, std::ios::app) << "";
    { OutputFile file(path, false); }
    EXPECT_FALSE(fs::exists(stale));
    for (const std::string& name : kept) EXPECT_TRUE(fs::exists(name)) << name;
}

TEST(OutputFile, ALockedTemporaryIsAlive) {
    const TemporaryFolder folder;
    const pid_t dead = die_in([] {});
    const std::string path = folder.file(".out.strata-" + std::to_string(dead) + ".tmp");
    std::ofstream(path) << "of a process in another container";
    const int holder = ::open(path.c_str(), O_RDONLY);
    ASSERT_EQ(::flock(holder, LOCK_EX), 0);
    { OutputFile file(folder.file("out"), false); }
    EXPECT_TRUE(fs::exists(path));
    ::close(holder);
    { OutputFile file(folder.file("out"), false); }
    EXPECT_FALSE(fs::exists(path));
}

TEST(OutputFile, AReusedProcessNumberDoesNotBlock) {
    const TemporaryFolder folder;
    std::ofstream(folder.file(".out.strata-" + std::to_string(::getpid()) + ".tmp")) << "left by our number's last owner";
    OutputFile file(folder.file("out"), false);
    file.write(bytes_of("x"));
    file.commit();
    EXPECT_EQ(content(folder.file("out")), "x");
    EXPECT_EQ(entries(folder.path()), 1u);
}

TEST(TemporaryPath, FoldersGoWithAllTheyHold) {
    const TemporaryFolder folder;
    const pid_t dead = die_in([&] {
        const TemporaryPath temporary(folder.file("set"), TemporaryPath::Kind::folder);
        std::ofstream(temporary.path() + "/part") << "x";
        ::kill(::getpid(), SIGKILL);
    });
    EXPECT_TRUE(fs::exists(folder.file(".set.strata-" + std::to_string(dead) + ".tmp/part")));
    {
        const TemporaryPath temporary(folder.file("set"), TemporaryPath::Kind::folder);
        EXPECT_EQ(entries(folder.path()), 1u);
        std::ofstream(temporary.path() + "/part") << "x";
    }
    EXPECT_EQ(entries(folder.path()), 0u);
    TemporaryPath kept(folder.file("set"), TemporaryPath::Kind::folder);
    rename_output(kept.path(), folder.file("set"), false);
    kept.keep();
    EXPECT_EQ(error_of([&] {
                  const TemporaryPath second(folder.file("set"), TemporaryPath::Kind::folder);
                  rename_output(second.path(), folder.file("set"), false);
              }).kind,
              ErrorKind::io);
    EXPECT_TRUE(fs::exists(folder.file("set")));
}

TEST(TemporaryPath, TheEndRemovesAllOfThem) {
    const TemporaryFolder folder;
    const TemporaryPath file(folder.file("a"), TemporaryPath::Kind::file);
    const TemporaryPath set(folder.file("b"), TemporaryPath::Kind::folder);
    OutputFile whole(folder.file("c"), false);
    whole.commit();
    fs::create_directory(set.path() + "/deeper");
    std::ofstream(set.path() + "/deeper/part") << "x";
    EXPECT_EXIT(remove_temporaries_and_exit(7), testing::ExitedWithCode(7), "");
    EXPECT_EQ(entries(folder.path()), 1u);
    EXPECT_TRUE(fs::exists(folder.file("c")));
}

// A file system that is full, whoever we are: the limit on a file's size stands for it.
TEST(OutputFile, AFileThatCannotGrowNamesPathAndBytes) {
    const TemporaryFolder folder;
    const std::string path = folder.file("out");
    std::ofstream(path) << "earlier";
    rlimit before{};
    ::getrlimit(RLIMIT_FSIZE, &before);
    const auto handler = ::signal(SIGXFSZ, SIG_IGN);
    const rlimit small{.rlim_cur = 1000, .rlim_max = before.rlim_max};
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
    const Error error = error_of([&] {
        OutputFile file(path, true);
        file.write(bytes_of(std::string(600, 'x')));
        file.write(bytes_of(std::string(600, 'x')));  // 400 bytes fit: a short write comes first
    });
    ::setrlimit(RLIMIT_FSIZE, &before);
    ::signal(SIGXFSZ, handler);
    EXPECT_EQ(error.kind, ErrorKind::io);
    EXPECT_NE(std::string(error.what()).find(path + ": byte 1000: writing 200 bytes"), std::string::npos) << error.what();
    EXPECT_EQ(content(path), "earlier");
    EXPECT_EQ(entries(folder.path()), 1u);
}

TEST(OutputFile, AFullDiskLeavesTheEarlierFile) {
    const TemporaryFolder folder;
    if (::mount("tmpfs", folder.path().c_str(), "tmpfs", 0, "size=1m") != 0) GTEST_SKIP() << "needs the right to mount a small tmpfs";
    const std::string path = folder.file("out");
    std::ofstream(path) << "earlier";
    const Error early = error_of([&] { OutputFile(path, true).reserve(2 << 20); });
    const Error late = error_of([&] {
        OutputFile file(path, true);
        for (int i = 0; i < 4; ++i) file.write(bytes_of(std::string(512 << 10, 'x')));
    });
    EXPECT_NE(std::string(early.what()).find("2097152 bytes needed"), std::string::npos) << early.what();
    EXPECT_NE(std::string(late.what()).find(path + ": byte "), std::string::npos) << late.what();
    EXPECT_EQ(content(path), "earlier");
    EXPECT_EQ(entries(folder.path()), 1u);
    ::umount(folder.path().c_str());
}

TEST(OutputFile, ManyThreadsWriteAtTheirPlaces) {
    const TemporaryFolder folder;
    OutputFile file(folder.file("out"), false);
    constexpr size_t kPiece = 1000;
    {
        std::vector<std::jthread> threads;
        for (int t = 0; t < 8; ++t)
            threads.emplace_back([&, t] {
                const std::string piece(kPiece, char('a' + t));
                for (size_t i = 0; i < 20; ++i) file.write_at((i * 8 + size_t(t)) * kPiece, bytes_of(piece));
            });
    }
    EXPECT_EQ(file.size(), 160 * kPiece);
    file.commit(Durability::unsynced);
    const std::string all = content(folder.file("out"));
    ASSERT_EQ(all.size(), 160 * kPiece);
    for (size_t i = 0; i < all.size(); ++i) ASSERT_EQ(all[i], char('a' + i / kPiece % 8)) << i;
}

}  // namespace
}  // namespace strata
