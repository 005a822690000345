#pragma once

#include <string>
#include <variant>
#include <vector>

#include "app/bench/svg_plot.h"

namespace strata {

/// A column of a table. Numbers are rounded to `digits` decimals in Markdown; CSV has six significant ones.
struct BenchColumn {
    std::string key;      // in CSV, with its unit: "frame_ms"
    std::string heading;  // in Markdown: "frame, ms"
    int digits = 2;
};

/// Infinity is written as inf; NaN means "does not apply" and leaves the cell empty.
using BenchCell = std::variant<std::string, double>;

struct BenchTable {
    std::vector<BenchColumn> columns;
    std::vector<std::vector<BenchCell>> rows;
};

struct BenchPlot {
    std::string name;  // of its file, after the section's
    Plot plot;
};

/// One comparison: what was asked, its table and its plots.
struct BenchSection {
    std::string name;   // of its files
    std::string title;
    std::string words;  // Markdown before the table: what was measured, what the columns mean
    BenchTable table;
    std::vector<BenchPlot> plots;
};

struct BenchReport {
    std::string name;  // of its files: "accuracy"
    std::string title;
    std::string words;  // Markdown: machine and scene
    std::vector<BenchSection> sections;
};

std::string csv_of(const BenchTable& table);
std::string markdown_of(const BenchTable& table);

/// Nothing of an earlier report of that name is in the folder, or it may be replaced.
/// throws  Error{io}, naming the file
void check_report_folder(const std::string& folder, const std::string& name, bool overwrite);

/// Writes NAME.md with all sections, NAME_SECTION.csv for each table and NAME_SECTION_PLOT.svg for each plot.
/// throws  Error{io}
void write_report(const BenchReport& report, const std::string& folder, bool overwrite);

}  // namespace strata
