#include "app/commands/commands.h"
#include "core/error.h"

namespace strata {
namespace {

constexpr OptionRow kRows[] = {shared_option::kThreads, shared_option::kQuiet};

int run(const Options&) { throw Error(ErrorKind::unsupported, "info: not built yet"); }

}  // namespace

Command info_command() {
    return {.name = "info", .summary = "what a file or data set is, and whether it is whole", .positional = "PATH", .least_positional = 1, .rows = kRows, .run = run};
}

}  // namespace strata
