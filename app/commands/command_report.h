#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>

namespace strata {

// How commands say what they did.

/// A line each on standard error; control characters, which names in files may have, as they can be seen.
void print_notes(std::span<const std::string> notes);

/// On standard output. Names from a file may be of any encoding; what is not UTF-8 in them is replaced.
void print_json(const nlohmann::ordered_json& report);

}  // namespace strata
