#include "app/commands/commands.h"
#include "core/error.h"

namespace strata {
namespace {

constexpr OptionRow kRows[] = {shared_option::kThreads, shared_option::kQuiet};

int run(const Options&) { throw Error(ErrorKind::unsupported, "sample: not built yet"); }

}  // namespace

Command sample_command() {
    return {.name = "sample", .summary = "a simulated scan whose truth is known", .positional = "OUT", .least_positional = 1, .rows = kRows, .run = run};
}

}  // namespace strata
