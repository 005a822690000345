#include "render/shaders/shader_source.h"

#include <algorithm>

namespace strata {

std::string whole_shader_source(std::string_view file) {
    constexpr std::string_view kInclude = "#include \"";
    std::string whole;
    std::string_view rest = shader_source(file);
    while (!rest.empty()) {
        const size_t end = std::min(rest.find('\n'), rest.size() - 1) + 1;
        const std::string_view line = rest.substr(0, end);
        if (line.starts_with(kInclude))
            whole += whole_shader_source(line.substr(kInclude.size(), line.rfind('"') - kInclude.size()));
        else
            whole += line;
        rest.remove_prefix(end);
    }
    return whole;
}

}  // namespace strata
