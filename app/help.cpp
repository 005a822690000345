#include "app/help.h"

#include <algorithm>
#include <numeric>
#include <utility>
#include <vector>

namespace strata {
namespace {

constexpr size_t kTermWidth = 26;   // columns before the explanation
constexpr size_t kLineWidth = 100;  // columns

/// "  term    explanation", the explanation wrapped at words and indented.
std::string entry(const std::string& term, std::string_view explanation) {
    std::string text = "  " + term;
    text += text.size() < kTermWidth ? std::string(kTermWidth - text.size(), ' ') : "\n" + std::string(kTermWidth, ' ');
    size_t column = kTermWidth;
    while (!explanation.empty()) {
        const std::string_view word = explanation.substr(0, explanation.find(' '));
        if (column > kTermWidth && column + 1 + word.size() > kLineWidth) {
            text += "\n" + std::string(kTermWidth, ' ');
            column = kTermWidth;
        }
        if (column > kTermWidth) text += ' ';
        column += word.size() + (column > kTermWidth);
        text += word;
        explanation.remove_prefix(std::min(word.size() + 1, explanation.size()));
    }
    return text + "\n";
}

std::string option_term(const OptionRow& row) {
    std::string term = row.letter.empty() ? "    " : std::string(row.letter) + ", ";
    term += row.flag;
    if (!row.value.empty()) term += " " + std::string(row.value);
    return term;
}

std::string option_explanation(const OptionRow& row) {
    std::string text(row.help);
    if (!row.initial.empty()) text += " (default: " + std::string(row.initial) + ")";
    return text;
}

std::string usage(const Command& command) {
    std::string text = "usage: strata " + std::string(command.name);
    if (!command.positional.empty()) text += " " + std::string(command.positional);
    return text + (command.rows.empty() ? "\n" : " [OPTIONS]\n");
}

/// Letters to insert, remove or replace to turn one word into the other.
size_t edit_distance(std::string_view a, std::string_view b) {
    std::vector<size_t> row(b.size() + 1);
    std::iota(row.begin(), row.end(), size_t{0});
    for (size_t i = 0; i < a.size(); ++i) {
        size_t diagonal = std::exchange(row[0], i + 1);
        for (size_t j = 0; j < b.size(); ++j) {
            const size_t replaced = diagonal + (a[i] != b[j]);
            diagonal = row[j + 1];
            row[j + 1] = std::min({replaced, row[j] + 1, row[j + 1] + 1});
        }
    }
    return row.back();
}

}  // namespace

std::string program_help(std::span<const Command> commands) {
    std::string text =
        "strata: layered point clouds and headless pictures from scans of any size\n\n"
        "usage: strata COMMAND ... [OPTIONS]\n\ncommands:\n";
    for (const Command& command : commands) text += entry(std::string(command.name), command.summary);
    text += "\noptions:\n" + entry("-h, --help", "this text, or that of a command: strata COMMAND --help");
    text += entry("    --version", "the version");
    return text + "\nExit codes: 0 done, 1 failed, 2 wrong command line.\n";
}

std::string command_help(const Command& command) {
    std::string text = "strata " + std::string(command.name) + ": " + std::string(command.summary) + "\n\n";
    text += usage(command) + "\noptions:\n";
    for (const OptionRow& row : command.rows) text += entry(option_term(row), option_explanation(row));
    return text + entry("-h, --help", "this text");
}

std::string usage_hint(std::span<const Command> commands, std::string_view name) {
    const auto found = std::find_if(commands.begin(), commands.end(), [&](const Command& c) { return c.name == name; });
    if (found != commands.end()) return usage(*found) + "'strata " + std::string(name) + " --help' says more\n";
    return "usage: strata COMMAND ... [OPTIONS]\n'strata --help' lists the commands\n";
}

std::string suggestion(std::string_view word, std::span<const std::string_view> candidates) {
    std::string_view nearest;
    size_t least = 3;  // more letters than that are another word
    for (const std::string_view candidate : candidates) {
        const size_t distance = edit_distance(word, candidate);
        if (distance < least && distance < candidate.size()) least = distance, nearest = candidate;
    }
    return nearest.empty() ? "" : "; did you mean " + std::string(nearest) + "?";
}

}  // namespace strata
