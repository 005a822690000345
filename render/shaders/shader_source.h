#pragma once

#include <string>
#include <string_view>

namespace strata {

/// The text of a file of render/shaders or its include/, which the build embeds. The file must be there: names come from our code.
std::string_view shader_source(std::string_view file);

/// The same with each line `#include "FILE"` replaced by that file's text.
std::string whole_shader_source(std::string_view file);

}  // namespace strata
