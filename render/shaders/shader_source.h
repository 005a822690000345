#pragma once

#include <string_view>

namespace strata {

/// The text of a file of render/shaders, which the build embeds. The file must be there: names come from our code.
std::string_view shader_source(std::string_view file);

}  // namespace strata
