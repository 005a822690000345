// strata: maps the command line to a command, and what it throws to one line and an exit code.
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <iostream>
#include <new>
#include <span>
#include <string>

#include "app/commands/commands.h"
#include "app/help.h"
#include "app/options.h"
#include "core/error.h"

namespace {

constexpr int kExitFailed = 1;
constexpr int kExitUsage = 2;

int report(const char* message, int exit_code) {
    std::fprintf(stderr, "strata: %s\n", message);
    return exit_code;
}

/// What was printed is only done when it arrived: a full disk behind standard output is a failure.
int flushed(int exit_code) {
    std::cout.flush();
    if (std::fflush(stdout) == 0 && std::cout.good() && !std::ferror(stdout)) return exit_code;
    return report((std::string("standard output: ") + std::strerror(errno)).c_str(), kExitFailed);
}

}  // namespace

int main(int argc, char** argv) {
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
        return report("out of memory; a lower --memory or fewer --threads needs less", kExitFailed);
    } catch (const std::exception& error) {
        return report(error.what(), kExitFailed);
    }
}
