#include "app/commands/commands.h"
#include "core/error.h"

namespace strata {
namespace {

constexpr OptionRow kRows[] = {shared_option::kThreads, shared_option::kQuiet};

int run(const Options&) { throw Error(ErrorKind::unsupported, "convert: not built yet"); }

}  // namespace

Command convert_command() {
    return {.name = "convert", .summary = "scans to level-of-detail data sets", .positional = "IN... OUT", .least_positional = 2, .rows = kRows, .run = run};
}

}  // namespace strata
