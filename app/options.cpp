#include "app/options.h"

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>
#include <deque>
#include <fstream>
#include <iostream>

#include "app/version.h"
#include "core/error.h"
#include "core/parallel.h"

namespace strata {
namespace {

Error bad_value(std::string_view flag, const std::string& expected, const std::string& text) {
    return {ErrorKind::usage, std::string(flag) + ": expected " + expected + ", got '" + text + "'"};
}

double parse_number(std::string_view flag, const std::string& text) {
    double value = 0.0;
    const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (status != std::errc() || end != text.data() + text.size() || !std::isfinite(value))
        throw bad_value(flag, "a number", text);
    return value;
}

uint64_t available_memory_bytes() {
    std::ifstream meminfo("/proc/meminfo");
    for (std::string line; std::getline(meminfo, line);)
        if (line.starts_with("MemAvailable:")) return std::stoull(line.substr(13)) * 1024;
    return uint64_t{2} << 30;
}

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
    for (size_t begin = 0; begin <= word.size();) {
        const size_t end = std::min(word.find(',', begin), word.size());
        values_read.push_back(parse_number(flag, word.substr(begin, end - begin)));
        begin = end + 1;
    }
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

int thread_count(const Options& options) {
    return options.given("--threads") ? int(options.integer("--threads", 1, 1024)) : default_thread_count();
}

uint64_t memory_cap(const Options& options) {
    return options.given("--memory") ? options.bytes("--memory") : available_memory_bytes() / 2;
}

int run_command_line(std::span<const Command> commands, int argc, const char* const* argv) {
    CLI::App program("strata: layered point clouds, voxels and pictures from scans of any size", "strata");
    program.require_subcommand(1);
    program.set_version_flag("--version", "strata " STRATA_VERSION);

    struct Parsed {
        const Command* command;
        CLI::App* app;
        Options options;
        std::deque<std::pair<const OptionRow*, std::string>> texts;
        std::deque<std::pair<const OptionRow*, bool>> switches;
    };
    std::deque<Parsed> parsed;
    for (const Command& command : commands) {
        Parsed& entry = parsed.emplace_back();
        entry.command = &command;
        entry.app = program.add_subcommand(std::string(command.name), std::string(command.summary));
        if (command.most_positional > 0) {
            auto* words = entry.app->add_option(std::string(command.positional), entry.options.positional);
            words->type_name("")->expected(int(command.least_positional),
                                           command.most_positional > 4096 ? 1 << 29 : int(command.most_positional));
            if (command.least_positional > 0) words->required();
        }
        for (const OptionRow& row : command.rows) {
            const std::string names = row.letter.empty() ? std::string(row.flag) : std::string(row.letter) + "," + std::string(row.flag);
            if (row.value.empty()) {
                auto& [_, value] = entry.switches.emplace_back(&row, false);
                entry.app->add_flag(names, value, std::string(row.help));
                continue;
            }
            auto& [_, value] = entry.texts.emplace_back(&row, std::string());
            auto* option = entry.app->add_option(names, value, std::string(row.help))->type_name(std::string(row.value));
            if (!row.initial.empty()) {
                option->default_str(std::string(row.initial));
                entry.options.initials[std::string(row.flag)] = std::string(row.initial);
            }
        }
    }
    try {
        program.parse(argc, argv);
    } catch (const CLI::ParseError& problem) {
        if (problem.get_exit_code() == 0) return program.exit(problem);  // help and version
        throw Error(ErrorKind::usage, problem.what());
    }
    for (Parsed& entry : parsed) {
        if (!entry.app->parsed()) continue;
        for (const auto& [row, value] : entry.texts)
            if (entry.app->count(std::string(row->flag)) > 0) entry.options.values[std::string(row->flag)] = value;
        for (const auto& [row, value] : entry.switches)
            if (value) entry.options.values[std::string(row->flag)] = "1";
        return entry.command->run(entry.options);
    }
    throw Error(ErrorKind::usage, "no command given");
}

}  // namespace strata
