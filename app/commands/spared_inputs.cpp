#include "app/commands/spared_inputs.h"

#include <algorithm>
#include <filesystem>

#include "core/error.h"

namespace strata {

namespace fs = std::filesystem;

void check_inputs_spared(const std::string& output, std::span<const std::string> inputs) {
    std::error_code problem;
    fs::path written = fs::weakly_canonical(output, problem);
    if (written.filename().empty()) written = written.parent_path();  // "out/"
    for (const std::string& input : inputs) {
        const fs::path read = fs::weakly_canonical(input, problem);
        if (read == written) throw Error(ErrorKind::io, output + ": is an input; another name is expected for the output");
        if (std::mismatch(written.begin(), written.end(), read.begin(), read.end()).first == written.end())
            throw Error(ErrorKind::io, output + ": the input " + input + " lies inside the output");
    }
}

}  // namespace strata
