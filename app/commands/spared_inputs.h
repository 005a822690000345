#pragma once

#include <span>
#include <string>

namespace strata {

/// Nothing that is read may be replaced by what is written, with --overwrite neither.
/// throws  Error{io} when `output` is one of `inputs`, or a folder that holds one, whatever links lead there
void check_inputs_spared(const std::string& output, std::span<const std::string> inputs);

}  // namespace strata
