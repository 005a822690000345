// strata: maps the command line to a command, and what it throws to one line and an exit code.
#include <cstdio>
#include <new>
#include <vector>

#include "app/commands/commands.h"
#include "app/options.h"
#include "core/error.h"

namespace {

constexpr int kExitFailed = 1;
constexpr int kExitUsage = 2;

int report(const char* message, int exit_code) {
    std::fprintf(stderr, "strata: %s\n", message);
    return exit_code;
}

}  // namespace

int main(int argc, char** argv) {
    try {
        return strata::run_command_line(strata::all_commands(), argc, argv);
    } catch (const strata::Error& error) {
        if (error.kind != strata::ErrorKind::usage) return report(error.what(), kExitFailed);
        report(error.what(), kExitUsage);
        std::fputs("usage: strata COMMAND ...; 'strata --help' and 'strata COMMAND --help' say more\n", stderr);
        return kExitUsage;
    } catch (const std::bad_alloc&) {
        return report("out of memory; a lower --memory or fewer --threads needs less", kExitFailed);
    } catch (const std::exception& error) {
        return report(error.what(), kExitFailed);
    }
}
