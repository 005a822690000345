#include "app/options.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <deque>
#include <fstream>
#include <iostream>

#include "app/help.h"
#include "app/version.h"
#include "core/error.h"
#include "core/parallel.h"

namespace strata {
namespace {

Error bad_value(std::string_view flag, const std::string& expected, const std::string& text) {
    return {ErrorKind::usage, std::string(flag) + ": expected " + expected + ", got '" + text + "'"};
}

uint64_t available_memory_bytes() {
    std::ifstream meminfo("/proc/meminfo");
    for (std::string line; std::getline(meminfo, line);)
        if (line.starts_with("MemAvailable:")) return std::stoull(line.substr(13)) * 1024;
    return uint64_t{2} << 30;
}

Error unknown_command(std::span<const Command> commands, const std::string& name) {
    std::vector<std::string_view> names;
    for (const Command& command : commands) names.push_back(command.name);
    return {ErrorKind::usage, "unknown command '" + name + "'" + suggestion(name, names)};
}

// A value in brackets may be left out: then the row's default becomes the word. Only a number that follows is the value,
// so that a file may follow too.
std::vector<std::string> with_values_left_out(std::span<const Command> commands, std::vector<std::string> words) {
    const auto is_number = [](const std::string& word) {
        double value = 0.0;
        const char* const end = word.data() + word.size();
        return !word.empty() && std::from_chars(word.data(), end, value).ptr == end;
    };
    for (const Command& command : commands) {
        if (words.empty() || words[0] != command.name) continue;
        for (const OptionRow& row : command.rows)
            for (size_t i = 1; i < words.size() && row.value.starts_with('['); ++i)
                if (words[i] == row.flag && (i + 1 == words.size() || !is_number(words[i + 1])))
                    words[i] += "=" + std::string(row.initial);
    }
    return words;
}

/// One subcommand's table, handed to CLI11, and what CLI11 read for it.
class CommandParser {
public:
    CommandParser(CLI::App& program, const Command& command)
        : command_(command), app_(program.add_subcommand(std::string(command.name))) {
        app_->formatter_fn(
            [&](const CLI::App*, const std::string&, CLI::AppFormatMode) { return command_help(command_); });
        // Counted in run(), where the message can say what the words are.
        app_->add_option("words", options_.positional)->expected(0, 1 << 29);
        for (const OptionRow& row : command.rows) {
            const std::string names =
                row.letter.empty() ? std::string(row.flag) : std::string(row.letter) + "," + std::string(row.flag);
            if (!row.initial.empty()) options_.initials[std::string(row.flag)] = row.initial;
            if (row.value.empty())
                options_of_rows_.push_back(app_->add_flag(names)->disable_flag_override());
            else
                options_of_rows_.push_back(
                    app_->add_option(names, texts_.emplace_back())->type_name(std::string(row.value)));
        }
    }

    bool chosen() const { return app_->parsed(); }

    /// Throws the Error that says in our words what CLI11 did not accept, when it was in this command's words.
    void explain(const CLI::ParseError& problem) const {
        if (!chosen()) return;
        const std::string place = std::string(command_.name) + ": ";
        for (const std::string& word : app_->remaining()) {
            std::vector<std::string_view> flags = {"--help"};
            for (const OptionRow& row : command_.rows) flags.push_back(row.flag);
            throw Error(ErrorKind::usage,
                        place + "unknown option " + word + suggestion(word.substr(0, word.find('=')), flags));
        }
        for (const OptionRow& row : command_.rows) {
            if (dynamic_cast<const CLI::ArgumentMismatch*>(&problem) == nullptr) break;
            const size_t times = app_->count(std::string(row.flag));
            if (!std::string_view(problem.what()).starts_with(std::string(row.flag) + ":")) continue;
            if (times > 1) throw Error(ErrorKind::usage, place + std::string(row.flag) + ": given more than once");
            throw Error(ErrorKind::usage,
                        place + std::string(row.flag) + ": expected " + std::string(row.value) + ", got nothing");
        }
        throw Error(ErrorKind::usage, place + problem.what());
    }

    int run() {
        const size_t words = options_.positional.size();
        if (words < command_.least_positional || words > command_.most_positional)
            throw Error(ErrorKind::usage,
                        std::string(command_.name) + ": expected " + std::string(command_.positional) + ", got " +
                            (words == 0 ? "nothing" : std::to_string(words) + (words == 1 ? " word" : " words")));
        for (size_t i = 0; i < command_.rows.size(); ++i) {
            const OptionRow& row = command_.rows[i];
            const CLI::Option& option =
                *options_of_rows_[i];  // to ask CLI11 by name ends the program when memory is out
            if (option.count() > 0)
                options_.values[std::string(row.flag)] = row.value.empty() ? "1" : option.results().back();
        }
        return command_.run(options_);
    }

private:
    const Command& command_;
    CLI::App* app_;
    Options options_;
    std::vector<CLI::Option*> options_of_rows_;  // in the order of the rows; owned by app_
    std::deque<std::string> texts_;
};

}  // namespace

bool Options::given(std::string_view flag) const { return values.find(flag) != values.end(); }

std::string Options::text(std::string_view flag) const {
    if (const auto found = values.find(flag); found != values.end()) return found->second;
    if (const auto found = initials.find(flag); found != initials.end()) return found->second;
    return {};
}

int64_t Options::integer(std::string_view flag, int64_t least, int64_t most) const {
    const std::string word = text(flag);
    int64_t value = 0;
    const auto [end, status] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (status != std::errc() || end != word.data() + word.size() || value < least || value > most)
        throw bad_value(flag, "a whole number from " + std::to_string(least) + " to " + std::to_string(most), word);
    return value;
}

double Options::number(std::string_view flag) const { return parse_number(flag, text(flag)); }

std::vector<double> Options::numbers(std::string_view flag, size_t count) const {
    const std::string word = text(flag);
    std::vector<double> values_read;
    for (const std::string& item : split_list(word)) values_read.push_back(parse_number(flag, item));
    if (values_read.size() != count) throw bad_value(flag, std::to_string(count) + " numbers with commas", word);
    return values_read;
}

uint64_t Options::bytes(std::string_view flag) const {
    const std::string word = text(flag);
    double value = 0.0;
    const auto [end, status] = std::from_chars(word.data(), word.data() + word.size(), value);
    const std::string_view unit(end, size_t(word.data() + word.size() - end));
    int shift = -1;
    if (unit.empty() || unit == "B") shift = 0;
    if (unit == "K" || unit == "k" || unit == "KiB") shift = 10;
    if (unit == "M" || unit == "m" || unit == "MiB") shift = 20;
    if (unit == "G" || unit == "g" || unit == "GiB") shift = 30;
    if (unit == "T" || unit == "TiB") shift = 40;
    if (status != std::errc() || shift < 0 || !(value > 0.0) || value * std::ldexp(1.0, shift) > 0x1p60)
        throw bad_value(flag, "a size such as 512M or 2G", word);
    return uint64_t(value * std::ldexp(1.0, shift));
}

std::vector<std::string> split_list(std::string_view text) {
    std::vector<std::string> items;
    for (size_t begin = 0; begin <= text.size();) {
        const size_t end = std::min(text.find(',', begin), text.size());
        items.emplace_back(text.substr(begin, end - begin));
        begin = end + 1;
    }
    return items;
}

double parse_number(std::string_view flag, const std::string& text) {
    double value = 0.0;
    const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (status != std::errc() || end != text.data() + text.size() || !std::isfinite(value))
        throw bad_value(flag, "a number", text);
    return value;
}

int thread_count(const Options& options) {
    return options.given("--threads") ? int(options.integer("--threads", 1, 1024)) : default_thread_count();
}

uint64_t memory_cap(const Options& options) {
    return options.given("--memory") ? options.bytes("--memory") : available_memory_bytes() / 2;
}

int run_command_line(std::span<const Command> commands, int argc, const char* const* argv) {
    CLI::App program;
    program.require_subcommand(1);
    program.set_version_flag("--version", "strata " STRATA_VERSION);
    program.formatter_fn(
        [&](const CLI::App*, const std::string&, CLI::AppFormatMode) { return program_help(commands); });

    std::deque<CommandParser> parsers;  // a deque: CLI11 keeps pointers into them
    for (const Command& command : commands) parsers.emplace_back(program, command);
    try {
        std::vector<std::string> words = with_values_left_out(commands, {argv + std::min(argc, 1), argv + argc});
        std::reverse(words.begin(), words.end());  // as CLI11 wants them
        program.parse(std::move(words));
    } catch (const CLI::ParseError& problem) {
        if (problem.get_exit_code() == 0) return program.exit(problem);  // help and version
        if (argc > 1 && argv[1][0] == '-')
            throw Error(ErrorKind::usage, "unknown option " + std::string(argv[1]) + " before the command");
        for (const CommandParser& parser : parsers) parser.explain(problem);
        throw argc > 1 ? unknown_command(commands, argv[1]) : Error(ErrorKind::usage, "no command given");
    }
    const auto chosen =
        std::find_if(parsers.begin(), parsers.end(), [](const CommandParser& parser) { return parser.chosen(); });
    return chosen->run();  // one is: it was required
}

}  // namespace strata
