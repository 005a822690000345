#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace strata {

/// One row of a command's option table: what its help prints and what the parser accepts.
struct OptionRow {
    std::string_view flag;     // "--size"
    std::string_view letter;   // "-s", or empty
    std::string_view value;    // placeholder and unit, "WIDTHxHEIGHT"; empty: a switch; "[N]": a number, or the default
    std::string_view initial;  // the default, as text; empty: none
    std::string_view help;
};

/// The options of one call, checked against the table. Getters throw Error{usage} naming the flag when the text does
/// not fit, and fall back to the row's default.
class Options {
public:
    std::vector<std::string> positional;

    bool given(std::string_view flag) const;                    // switches, and "did the user say so"
    std::string text(std::string_view flag) const;              // empty when neither given nor defaulted
    int64_t integer(std::string_view flag, int64_t least, int64_t most) const;
    double number(std::string_view flag) const;                 // finite
    std::vector<double> numbers(std::string_view flag, size_t count) const;  // comma-separated
    uint64_t bytes(std::string_view flag) const;                // "512M", "2G"; powers of 1024

    std::map<std::string, std::string, std::less<>> values;     // flag to text; switches map to "1"
    std::map<std::string, std::string, std::less<>> initials;   // defaults of the table
};

/// A subcommand: its words, its table and the function that runs it.
struct Command {
    std::string_view name;
    std::string_view summary;       // one line
    std::string_view positional;    // "IN... OUT"
    size_t least_positional = 0;
    size_t most_positional = SIZE_MAX;
    std::span<const OptionRow> rows;
    int (*run)(const Options&) = nullptr;  // returns the exit code; throws Error
};

/// Rows that several commands share.
namespace shared_option {
inline constexpr OptionRow kThreads = {"--threads", "-t", "N", "", "threads to use; default: all that the machine gives"};
inline constexpr OptionRow kMemory = {"--memory", "-m", "BYTES", "", "memory cap, such as 512M or 2G; default: half of what is free"};
inline constexpr OptionRow kOverwrite = {"--overwrite", "", "", "", "replace an output that exists"};
inline constexpr OptionRow kQuiet = {"--quiet", "-q", "", "", "no progress, no summary"};
inline constexpr OptionRow kJson = {"--json", "", "", "", "one JSON object on standard output and nothing else"};
}  // namespace shared_option

/// What is between the commas of a text: one word more than there are commas, which may be empty.
std::vector<std::string> split_list(std::string_view text);

/// The whole text as a finite number.  throws  Error{usage}, naming the flag
double parse_number(std::string_view flag, const std::string& text);

int thread_count(const Options& options);     // --threads or the machine's
uint64_t memory_cap(const Options& options);  // --memory or half of what is free, bytes

/// Parses the words after the program's name and runs the command they name. Prints help and version itself.
/// returns the exit code; throws Error{usage} for a wrong command line
int run_command_line(std::span<const Command> commands, int argc, const char* const* argv);

}  // namespace strata
