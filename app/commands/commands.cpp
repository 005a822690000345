#include "app/commands/commands.h"

#include <array>

namespace strata {

std::span<const Command> all_commands() {
    static const std::array commands = {convert_command(), info_command(), render_command(), voxelize_command(), surface_command(), sample_command(), bench_command()};
    return commands;
}

}  // namespace strata
