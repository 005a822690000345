#pragma once

#include <span>

#include "app/options.h"

namespace strata {

// One function a subcommand, each in a file of its name.
Command bench_command();
Command convert_command();
Command info_command();
Command render_command();
Command sample_command();
Command surface_command();
Command voxelize_command();

/// Every subcommand, in the order of the help text.
std::span<const Command> all_commands();

}  // namespace strata
