#pragma once

#include <span>
#include <string>
#include <string_view>

#include "app/options.h"

namespace strata {

/// What `strata --help` prints: every command with its summary.
std::string program_help(std::span<const Command> commands);

/// What `strata COMMAND --help` prints: the words it takes and its option table with units and defaults.
std::string command_help(const Command& command);

/// The two lines after a wrong command line; `name` is the word in the command's place, which may be none.
std::string usage_hint(std::span<const Command> commands, std::string_view name);

/// "; did you mean X?" for the candidate nearest to `word`; empty when none is near.
std::string suggestion(std::string_view word, std::span<const std::string_view> candidates);

}  // namespace strata
