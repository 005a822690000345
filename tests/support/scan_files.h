#pragma once

#include <string>

#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace strata::test {

/// Whether all cases of a table are asked for (STRATA_ROBUST_FULL=1), not the tenth that every build runs.
bool full_run();

std::string file_contents(const std::string& path);

/// Writes `points` points on a folded sheet, LAS 1.2 point format 3.
void write_sheet(const std::string& path, int points);

/// What `strata convert` writes: its name tells the format, the words tell what the name does not.
struct ConvertedOutput {
    const char* label;
    const char* name;
    std::vector<std::string> words = {};
    const char* verb = "convert";  // or "voxelize", "surface"

    /// The words after "strata" that make it.
    std::vector<std::string> command(const std::string& in, const std::string& out) const {
        std::vector<std::string> all = {verb, in};
        if (std::string(verb) != "convert") all.push_back("-o");
        all.push_back(out);
        all.insert(all.end(), words.begin(), words.end());
        all.push_back("--quiet");
        return all;
    }
    bool is_folder() const { return std::string(name).find('.') == std::string::npos; }
};
const std::vector<ConvertedOutput>& converted_outputs();

/// Whether two outputs, files or folders, are there and hold the same bytes.
bool same_output(const std::string& a, const std::string& b);

/// Entries of a folder, of whatever kind.
size_t entries(const std::string& folder);

/// Empty when the program ended by itself with exit code 1 and one line; else what is wrong.
std::string refusal_verdict(const ProgramResult& result);

}  // namespace strata::test
