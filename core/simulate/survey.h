#pragma once

#include <cstdint>
#include <vector>

#include "core/simulate/beam.h"
#include "core/simulate/scene.h"

namespace strata {

enum class SurveyMode { airborne, terrestrial, both };

struct SurveySettings {
    uint64_t points = 1'000'000;
    double noise = 0.01;  // of a beam's range, standard deviation, metres
    uint64_t seed = 1;    // of the pulses; the scene has its own
    SurveyMode mode = SurveyMode::both;
};

/// Parallel overlapping strips over a square around the origin, flown to and fro, scanned across by the oscillating mirrors of
/// two channels, one that looks ahead and one that looks back.
struct AirborneStrips {
    double extent = 0.0;    // side of the square, metres
    uint64_t strips = 0;    // planned; more follow on the far side should the points not suffice
    double spacing = 0.0;   // between strips
    double swath = 0.0;     // width of a strip on level ground
    double altitude = 0.0;  // world height of the flight
    uint64_t lines = 0;     // scan lines of a strip
    uint64_t pulses = 0;    // of a line
    uint64_t lines_per_block = 1;
};

/// A tripod: columns of beams from below the horizon to the zenith, turning around.
struct Station {
    Vec3d eye = Vec3d::Zero();
    uint64_t columns = 0;  // of a whole turn
    uint64_t rows = 0;
    uint64_t columns_per_block = 1;
};

/// A flight or a station: its pulses in order of time, cut into blocks that can be scanned independently. The sequence has
/// no end; the file takes the first `quota` points of it.
struct SurveyPart {
    uint64_t quota = 0;           // points
    uint64_t planned_blocks = 0;  // enough in nearly every case
    bool airborne = true;
    AirborneStrips strips;
    Station station;
    uint16_t source_id = 1;  // of the first strip, or of the station
    double start_time = 0.0;
    BeamModel beam;
};

/// Plans a survey with exactly `points` points: about 25 to the square metre from the air (less on the smallest scenes, which
/// are never below 110 m wide), so the scene grows with the count.
class Survey {
public:
    /// Casts some thousand pilot beams to learn how many echoes a pulse gives.
    Survey(const VillageScene& scene, const SurveySettings& settings);

    const std::vector<SurveyPart>& parts() const { return parts_; }
    /// Scans a block of a part: a pure function of the survey and the two numbers. `out` is replaced.
    void scan_block(BeamScanner& scanner, size_t part, uint64_t block, std::vector<ScanPoint>& out) const;

private:
    void plan_strips(BeamScanner& scanner, uint64_t points);
    void plan_stations(BeamScanner& scanner, uint64_t points);
    void scan_strip_block(BeamScanner& scanner, const SurveyPart& part, uint64_t block, std::vector<ScanPoint>& out) const;
    void scan_station_block(BeamScanner& scanner, const SurveyPart& part, uint64_t block, std::vector<ScanPoint>& out) const;

    const VillageScene* scene_;
    SurveySettings settings_;
    double extent_ = 0.0;
    std::vector<SurveyPart> parts_;
};

}  // namespace strata
