// strata bench: what each technique costs and how wrong it is, on this machine.
#include <cstdio>
#include <tuple>

#include "app/bench/accuracy.h"
#include "app/bench/speed.h"
#include "app/commands/commands.h"
#include "app/commands/render_options.h"
#include "core/error.h"

namespace strata {
namespace {

constexpr OptionRow kRows[] = {
    {"--output", "-o", "DIR", "", "folder for the report: Markdown, CSV tables and SVG plots"},
    {"--only", "", "NAME", "", "only cases whose name contains NAME, such as splats/near or disc"},
    {"--points", "-n", "N", "2000000", "points of the simulated village, 10000 to 100000000"},
    {"--size", "-s", "WIDTHxHEIGHT", "640x360", "pixels of the pictures"},
    {"--runs", "", "N", "5", "runs of each timed step, after one that warms up; medians count"},
    shared_option::kThreads,
    shared_option::kMemory,
    shared_option::kOverwrite,
    shared_option::kQuiet,
};

int run(const Options& options) {
    const std::string& what = options.positional[0];
    if (what != "speed" && what != "accuracy") throw Error(ErrorKind::usage, "bench: expected speed or accuracy, got '" + what + "'");
    if (!options.given("--output")) throw Error(ErrorKind::usage, "bench: -o DIR is missing");
    BenchSettings settings;
    settings.points = uint64_t(options.integer("--points", 10'000, 100'000'000));
    std::tie(settings.width, settings.height) = parse_size(options.text("--size"));
    settings.runs = int(options.integer("--runs", 1, 1000));
    settings.threads = thread_count(options);
    settings.memory_bytes = memory_cap(options);
    settings.only = options.text("--only");
    settings.log = [quiet = options.given("--quiet")](const std::string& line) {
        if (!quiet) std::fprintf(stderr, "%s\n", line.c_str());
    };
    const std::string folder = options.text("--output");
    check_report_folder(folder, what, options.given("--overwrite"));
    BenchScene scene(folder, settings);
    write_report(what == "speed" ? run_speed(scene, settings) : run_accuracy(scene, settings), folder, options.given("--overwrite"));
    return 0;
}

}  // namespace

Command bench_command() {
    return {.name = "bench",
            .summary = "what each technique costs and how wrong it is, on this machine",
            .positional = "speed|accuracy",
            .least_positional = 1,
            .most_positional = 1,
            .rows = kRows,
            .run = run};
}

}  // namespace strata
