#include "app/bench/report.h"

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <span>

#include "core/error.h"
#include "io/output_file.h"

namespace strata {
namespace {

namespace fs = std::filesystem;

std::string number_text(const char* format, int digits, double value) {
    char text[64];
    std::snprintf(text, sizeof text, format, digits, value);
    return text;
}

std::string csv_cell(const BenchCell& cell) {
    if (const auto* text = std::get_if<std::string>(&cell)) {
        if (text->find_first_of(",\"\n") == std::string::npos) return *text;
        std::string quoted = "\"";
        for (const char c : *text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
        return quoted + "\"";
    }
    const double value = std::get<double>(cell);
    return std::isnan(value) ? "" : number_text("%.*g", 6, value);
}

std::string markdown_cell(const BenchCell& cell, int digits) {
    if (const auto* text = std::get_if<std::string>(&cell)) return *text;
    const double value = std::get<double>(cell);
    return std::isnan(value) ? "" : number_text("%.*f", digits, value);
}

void write_text(const std::string& path, const std::string& text, bool overwrite) {
    OutputFile file(path, overwrite);
    file.write(std::as_bytes(std::span(text)));
    file.commit(Durability::unsynced);
}

}  // namespace

std::string csv_of(const BenchTable& table) {
    std::string text;
    for (size_t c = 0; c < table.columns.size(); ++c) text += (c > 0 ? "," : "") + table.columns[c].key;
    text += '\n';
    for (const std::vector<BenchCell>& row : table.rows) {
        for (size_t c = 0; c < row.size(); ++c) text += (c > 0 ? "," : "") + csv_cell(row[c]);
        text += '\n';
    }
    return text;
}

std::string markdown_of(const BenchTable& table) {
    std::string text = "|", rule = "|";
    for (size_t c = 0; c < table.columns.size(); ++c) {
        const bool number = !table.rows.empty() && std::holds_alternative<double>(table.rows[0][c]);
        text += " " + table.columns[c].heading + " |";
        rule += number ? "---:|" : "---|";
    }
    text += "\n" + rule + "\n";
    for (const std::vector<BenchCell>& row : table.rows) {
        text += "|";
        for (size_t c = 0; c < row.size(); ++c) text += " " + markdown_cell(row[c], table.columns[c].digits) + " |";
        text += "\n";
    }
    return text;
}

void check_report_folder(const std::string& folder, const std::string& name, bool overwrite) {
    fs::create_directories(folder);
    for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
        const std::string file = entry.path().filename().string();
        if (file.starts_with(name + ".") || file.starts_with(name + "_")) check_output_path(entry.path().string(), overwrite);
    }
}

void write_report(const BenchReport& report, const std::string& folder, bool overwrite) {
    std::string text = "# " + report.title + "\n\n" + report.words + "\n";
    for (const BenchSection& section : report.sections) {
        const std::string stem = report.name + "_" + section.name;
        text += "\n## " + section.title + "\n\n" + section.words + "\n\n";
        for (const auto& [name, plot] : section.plots) {
            const std::string file = stem + "_" + name + ".svg";
            write_text(folder + "/" + file, svg_of(plot), overwrite);
            text += "![" + plot.title + "](" + file + ")\n";
        }
        if (!section.plots.empty()) text += "\n";
        text += markdown_of(section.table);
        write_text(folder + "/" + stem + ".csv", csv_of(section.table), overwrite);
    }
    write_text(folder + "/" + report.name + ".md", text, overwrite);
}

}  // namespace strata
