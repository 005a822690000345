#include "app/commands/commands.h"
#include "core/error.h"

namespace strata {
namespace {

constexpr OptionRow kRows[] = {shared_option::kThreads, shared_option::kQuiet};

int run(const Options&) { throw Error(ErrorKind::unsupported, "render: not built yet"); }

}  // namespace

Command render_command() {
    return {.name = "render", .summary = "a headless picture of anything strata opens", .positional = "PATH...", .least_positional = 1, .rows = kRows, .run = run};
}

}  // namespace strata
