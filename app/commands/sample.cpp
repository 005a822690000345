// strata sample: a simulated scan whose truth is known.
#include <chrono>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "app/commands/commands.h"
#include "app/progress.h"
#include "app/quantity_text.h"
#include "app/simulated_scan.h"
#include "core/error.h"

namespace strata {
namespace {

constexpr OptionRow kRows[] = {
    {"--points", "-n", "N", "1000000", "points to write, 1 to 10000000000; the scene grows with them, to about 25 points a square metre"},
    {"--scene", "", "NAME", "village", "what is scanned: village"},
    {"--mode", "", "MODE", "both", "how it is scanned: airborne (strips), terrestrial (stations) or both (3/5 from the air)"},
    {"--noise", "", "METRES", "0.01", "standard deviation of a beam's range"},
    {"--seed", "", "K", "1", "whole number that decides the scene and every beam"},
    shared_option::kThreads,
    shared_option::kOverwrite,
    shared_option::kQuiet,
    shared_option::kJson,
};

constexpr int64_t kMostPoints = 10'000'000'000;
constexpr double kMostNoise = 100.0;  // metres

SurveyMode parse_mode(const std::string& text) {
    if (text == "airborne") return SurveyMode::airborne;
    if (text == "terrestrial") return SurveyMode::terrestrial;
    if (text == "both") return SurveyMode::both;
    throw Error(ErrorKind::usage, "--mode: expected airborne, terrestrial or both, got '" + text + "'");
}

int run(const Options& options) {
    const std::string& path = options.positional[0];
    if (path.ends_with(".laz")) throw Error(ErrorKind::usage, path + ": sample writes uncompressed LAS: a name that ends in .las is expected");
    SurveySettings settings;
    settings.points = uint64_t(options.integer("--points", 1, kMostPoints));
    settings.noise = options.number("--noise");
    settings.seed = uint64_t(options.integer("--seed", 0, INT64_MAX));
    settings.mode = parse_mode(options.text("--mode"));
    if (settings.noise < 0.0 || settings.noise > kMostNoise)
        throw Error(ErrorKind::usage, "--noise: expected 0 to 100 metres, got '" + options.text("--noise") + "'");
    if (options.text("--scene") != "village")
        throw Error(ErrorKind::usage, "--scene: expected village, got '" + options.text("--scene") + "'");
    const int threads = thread_count(options);
    const bool quiet = options.given("--quiet"), json = options.given("--json");

    ProgressLine progress(quiet || json);
    const auto begin = std::chrono::steady_clock::now();
    const uint64_t bytes = write_simulated_scan(path, VillageScene(settings.seed), settings, threads, options.given("--overwrite"), Durability::synced,
                                                [&](uint64_t points) { progress.update("scanning", points, settings.points); });
    progress.clear();
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    if (json) {
        const nlohmann::ordered_json report = {{"output", path}, {"points_written", settings.points}, {"output_bytes", bytes}, {"seconds", seconds},
                                               {"scene", "village"}, {"mode", options.text("--mode")}, {"noise", settings.noise}, {"seed", settings.seed}};
        std::printf("%s\n", report.dump().c_str());
    } else if (!quiet) {
        std::fprintf(stderr, "%s: %s points, %s, %.1f s\n", path.c_str(), with_commas(settings.points).c_str(), size_text(bytes).c_str(), seconds);
    }
    return 0;
}

}  // namespace

Command sample_command() {
    return {.name = "sample", .summary = "a simulated scan whose truth is known", .positional = "OUT.las", .least_positional = 1, .most_positional = 1, .rows = kRows, .run = run};
}

}  // namespace strata
