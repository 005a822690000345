#include "tests/support/run_program.h"

#include <fcntl.h>
#include <grp.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <stdexcept>

namespace strata::test {
namespace {

constexpr size_t kMostOutput = 1 << 20;

struct Pipe {
    int ends[2] = {-1, -1};
    Pipe() {
        if (::pipe2(ends, O_CLOEXEC) != 0) throw std::runtime_error("pipe2 failed");
    }
    ~Pipe() {
        close_end(0);
        close_end(1);
    }
    void close_end(int end) {
        if (ends[end] >= 0) ::close(ends[end]);
        ends[end] = -1;
    }
};

// Reads what is there. Returns false at the end.
bool drain(int descriptor, std::string& into) {
    char buffer[4096];
    const ssize_t count = ::read(descriptor, buffer, sizeof buffer);
    if (count < 0) return errno == EINTR || errno == EAGAIN;
    if (into.size() < kMostOutput) into.append(buffer, size_t(count));
    return count > 0;
}

}  // namespace

ProgramResult run_program(const std::vector<std::string>& words, const ProgramLimits& limits) {
    std::vector<char*> arguments;
    for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
    arguments.push_back(nullptr);
    Pipe out, err;
    const pid_t child = ::fork();
    if (child < 0) throw std::runtime_error("fork failed");
    if (child == 0) {
        ::dup2(out.ends[1], STDOUT_FILENO);
        ::dup2(err.ends[1], STDERR_FILENO);
        const rlimit no_core{0, 0};
        ::setrlimit(RLIMIT_CORE, &no_core);
        if (limits.address_space_bytes > 0) {
            const rlimit space{limits.address_space_bytes, limits.address_space_bytes};
            ::setrlimit(RLIMIT_AS, &space);
        }
        if (limits.file_size_bytes > 0) {
            const rlimit size{limits.file_size_bytes, limits.file_size_bytes};
            ::setrlimit(RLIMIT_FSIZE, &size);
        }
        if (limits.out_path == "-")
            ::close(STDOUT_FILENO);
        else if (!limits.out_path.empty())
            ::dup2(::open(limits.out_path.c_str(), O_WRONLY | O_CLOEXEC), STDOUT_FILENO);
        if (limits.user != 0 && (::setgroups(0, nullptr) != 0 || ::setgid(limits.user) != 0 || ::setuid(limits.user) != 0)) ::_exit(126);
        if (limits.signal != 0) ::signal(limits.signal, SIG_DFL);  // our caller may ignore it, as shells do for what runs in the background
        ::execv(arguments[0], arguments.data());
        ::_exit(127);
    }
    out.close_end(1);
    err.close_end(1);

    ProgramResult result;
    using Clock = std::chrono::steady_clock;
    const Clock::time_point start = Clock::now();
    const auto after = [&](double seconds) {
        return start + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
    };
    const Clock::time_point deadline = after(limits.seconds);
    Clock::time_point moment = limits.signal != 0 ? after(limits.signal_after) : Clock::time_point::max();
    pollfd waiting[2] = {{out.ends[0], POLLIN, 0}, {err.ends[0], POLLIN, 0}};
    while (waiting[0].fd >= 0 || waiting[1].fd >= 0) {
        const Clock::time_point now = Clock::now();
        if (now >= moment) {
            ::kill(child, limits.signal);
            moment = Clock::time_point::max();
        }
        if (now >= deadline) {
            ::kill(child, SIGKILL);
            result.timed_out = true;
            break;
        }
        const std::chrono::nanoseconds left = std::min(deadline, moment) - now;
        const timespec pause{.tv_sec = left.count() / 1'000'000'000, .tv_nsec = left.count() % 1'000'000'000};
        if (::ppoll(waiting, 2, &pause, nullptr) < 0 && errno != EINTR) break;
        if (waiting[0].revents && !drain(waiting[0].fd, result.out)) waiting[0].fd = -1;
        if (waiting[1].revents && !drain(waiting[1].fd, result.err)) waiting[1].fd = -1;
    }
    int status = 0;
    rusage usage{};
    while (::wait4(child, &status, 0, &usage) < 0 && errno == EINTR) {
    }
    result.seconds = std::chrono::duration<double>(Clock::now() - start).count();
    result.peak_memory_bytes = uint64_t(usage.ru_maxrss) * 1024;
    if (WIFEXITED(status)) result.exit_code = WEXITSTATUS(status);
    if (WIFSIGNALED(status)) result.signal = WTERMSIG(status);
    return result;
}

ProgramResult run_strata(std::vector<std::string> words, const ProgramLimits& limits) {
    words.insert(words.begin(), STRATA_PROGRAM);
    return run_program(words, limits);
}

bool built_with_sanitizer() {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    return true;
#else
    return false;
#endif
}

}  // namespace strata::test
