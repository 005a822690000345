// strata: maps the command line to a command, and what it throws to one line and an exit code.
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <iostream>
#include <new>
#include <span>
#include <string>

#include "app/commands/commands.h"
#include "app/help.h"
#include "app/options.h"
#include "app/signals.h"
#include "core/error.h"
#include "io/temporary_path.h"

namespace {

constexpr int kExitFailed = 1;
constexpr int kExitUsage = 2;
constexpr const char* kOutOfMemory = "out of memory; a lower --memory or fewer --threads needs less";

/// One line, whatever names and texts from files are in it. Takes no memory: there may be none left.
int report(const char* message, int exit_code) {
    std::fputs("strata: ", stderr);
    for (const char* c = message; *c; ++c) {
        if (static_cast<unsigned char>(*c) < 0x20 || *c == 0x7f)
            std::fprintf(stderr, "\\x%02x", static_cast<unsigned>(*c));
        else
            std::fputc(*c, stderr);
    }
    std::fputc('\n', stderr);
    return exit_code;
}

/// Packages that want memory where nothing may be thrown (destructors of nlohmann's JSON, iterators of std::filesystem)
/// end here when there is none.
/// Anything else that ends here is a defect of ours, and abort() shows where.
[[noreturn]] void end_without_memory() noexcept {
    bool without_memory = errno == ENOMEM;
    try {
        if (const std::exception_ptr failure = std::current_exception()) {
            without_memory = false;
            std::rethrow_exception(failure);
        }
    } catch (const std::bad_alloc&) {
        without_memory = true;
    } catch (...) {
    }
    if (!without_memory) std::abort();
    report(kOutOfMemory, kExitFailed);
    strata::remove_temporaries_and_exit(kExitFailed);
}

/// What was printed is only done when it arrived: a full disk behind standard output is a failure.
int flushed(int exit_code) {
    std::cout.flush();
    if (std::fflush(stdout) == 0 && std::cout.good() && !std::ferror(stdout)) return exit_code;
    return report((std::string("standard output: ") + std::strerror(errno)).c_str(), kExitFailed);
}

}  // namespace

int main(int argc, char** argv) {
    strata::occupy_standard_descriptors();
    strata::end_on_signals();
    std::set_terminate(end_without_memory);
    std::span<const strata::Command> commands;
    try {
        commands = strata::all_commands();
        if (argc > 1) return flushed(strata::run_command_line(commands, argc, argv));
        std::fputs(strata::program_help(commands).c_str(), stderr);
        return kExitUsage;
    } catch (const strata::Error& error) {
        if (error.kind != strata::ErrorKind::usage) return report(error.what(), kExitFailed);
        report(error.what(), kExitUsage);
        std::fputs(strata::usage_hint(commands, argc > 1 ? argv[1] : "").c_str(), stderr);
        return kExitUsage;
    } catch (const std::bad_alloc&) {
        return report(kOutOfMemory, kExitFailed);
    } catch (const std::exception& error) {
        return report(error.what(), kExitFailed);
    }
}
