#include "core/simulate/survey.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/simulate/waves.h"

namespace strata {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;
constexpr double kDensity = 25.0;             // points per square metre from the air
constexpr double kLeastExtent = 110.0;        // metres
constexpr double kSwathHalfAngle = 25.0 * std::numbers::pi / 180.0;
constexpr double kLook = 14.0 * std::numbers::pi / 180.0;  // of the two channels, ahead and back: walls that face along the flight are seen
constexpr double kSidelap = 1.7;              // swath over spacing: walls are seen from both sides
constexpr double kWidestSpacing = 250.0;      // of strips, metres
constexpr double kFlightSpeed = 50.0;         // m/s
constexpr double kTurnTime = 90.0;            // s, between strips
constexpr double kFirstTime = 400'000'000.0;  // adjusted standard GPS time
constexpr uint64_t kBlockPulses = 32768;
constexpr double kMargin = 1.006;              // pulses planned over those that the pilot beams ask for
constexpr double kLowestBeam = -45.0 * std::numbers::pi / 180.0;  // elevation; the tripod hides what is below
constexpr double kStationTime = 240.0;        // s for a whole turn
constexpr double kEyeHeight = 1.85;           // metres
constexpr uint64_t kStationPoints = 20'000'000;  // at most
constexpr uint64_t kLeastStationPoints = 3000;
constexpr uint64_t kVillageStations = 16;
constexpr uint16_t kFirstStationId = 5001;
constexpr uint64_t kPilotStream = 0x70696c6f74u;  // apart from the strips' numbers

uint64_t line_seed(uint64_t seed, uint64_t part, uint64_t line) { return mix_bits(seed ^ mix_bits(part ^ mix_bits(line))); }
uint64_t pulse_seed(uint64_t line, uint64_t pulse) { return mix_bits(line + pulse); }

int16_t scan_angle_units(double radians) { return int16_t(floor_to_int(radians * (180.0 / std::numbers::pi / 0.006) + 0.5)); }

// `angle` to the left of straight down as seen in the direction of flight, `pitch` ahead; from where straight down the middle of
// the channel that looks `look` ahead would meet level ground at `along`, so that both channels cover the same land.
Ray strip_ray(const AirborneStrips& strips, uint64_t strip, double along, double angle, double look, double pitch) {
    along -= 0.5 * strips.swath * (std::tan(kLook) / std::tan(kSwathHalfAngle)) * (look < 0.0 ? -1.0 : 1.0);
    const double heading = strip % 2 == 0 ? 1.0 : -1.0;
    const double y = (double(strip) - 0.5 * double(strips.strips - 1)) * strips.spacing;
    Ray ray;
    ray.origin = Vec3d(heading * (along - 0.5 * strips.extent), y, strips.altitude);
    const SinCos side = sin_cos_turns(angle / kTurn), ahead = sin_cos_turns(pitch / kTurn);
    ray.direction = Vec3d(heading * ahead.sin, heading * side.sin * ahead.cos, -side.cos * ahead.cos);
    return ray;
}

Ray station_ray(const Station& station, double azimuth, double elevation) {
    const SinCos around = sin_cos_turns(azimuth / kTurn), up = sin_cos_turns(elevation / kTurn);
    return {station.eye, Vec3d(up.cos * around.sin, up.cos * around.cos, up.sin)};
}

// The same beam, which ends at the border of the scene: stray echoes beyond would only lie about in the void.
BeamModel within_scene(BeamModel beam, const Ray& ray, double extent) {
    for (const int axis : {0, 1}) {
        const double border = ray.direction[axis] > 0.0 ? 0.5 * extent : -0.5 * extent;
        if (ray.direction[axis] != 0.0) beam.farthest = std::min(beam.farthest, (border - ray.origin[axis]) / ray.direction[axis]);
    }
    return beam;
}

}  // namespace

Survey::Survey(const VillageScene& scene, const SurveySettings& settings) : scene_(&scene), settings_(settings) {
    BeamScanner scanner(scene);
    const uint64_t from_air = settings.mode == SurveyMode::airborne ? settings.points
                              : settings.mode == SurveyMode::both   ? settings.points - settings.points * 2 / 5
                                                                    : 0;
    extent_ = std::max(kLeastExtent, std::sqrt(double(settings.points) / kDensity));
    if (from_air > 0) plan_strips(scanner, from_air);
    if (settings.points > from_air) plan_stations(scanner, settings.points - from_air);
}

void Survey::plan_strips(BeamScanner& scanner, uint64_t points) {
    SurveyPart part;
    part.quota = points;
    part.start_time = kFirstTime;
    AirborneStrips& strips = part.strips;
    strips.extent = extent_;
    strips.strips = std::max<uint64_t>(2, uint64_t(std::ceil(extent_ / kWidestSpacing)));
    strips.spacing = extent_ / double(strips.strips);
    strips.swath = strips.spacing * kSidelap;
    const double height = 0.5 * strips.swath / std::tan(kSwathHalfAngle);
    double ground = 0.0;
    constexpr int kSamples = 5;
    for (int i = 0; i < kSamples; ++i)
        for (int j = 0; j < kSamples; ++j)
            ground += scene_->terrain().height((i / 4.0 - 0.5) * extent_, (j / 4.0 - 0.5) * extent_) / (kSamples * kSamples);
    strips.altitude = ground + height;
    part.beam = {.noise = settings_.noise, .beam_radius = 0.05, .reference_range = height};

    // Pilot beams, evenly spread along every strip and over its width, tell how many echoes a pulse gives here.
    constexpr uint64_t kPilotPulses = 40'000;
    constexpr double kGoldenTurn = 0.6180339887498949;
    const uint64_t pulses_per_strip = std::max<uint64_t>(64, kPilotPulses / strips.strips);
    std::vector<ScanPoint> echoes;
    uint64_t echo_count = 0;
    for (uint64_t strip = 0; strip < strips.strips; ++strip)
        for (uint64_t i = 0; i < pulses_per_strip; ++i) {
            const double along = (double(i) + 0.5) / double(pulses_per_strip) * extent_;
            const double across = double(i) * kGoldenTurn - double(floor_to_int(double(i) * kGoldenTurn));
            echoes.clear();
            const double look = i % 2 == 0 ? kLook : -kLook;
            const Ray ray = strip_ray(strips, strip, along, kSwathHalfAngle * (2.0 * across - 1.0), look, look);
            scanner.fire(ray, part.beam, pulse_seed(line_seed(settings_.seed, kPilotStream, strip), i), {}, echoes);
            echo_count += echoes.size();
        }
    const double echoes_per_pulse = std::max(0.2, double(echo_count) / double(strips.strips * pulses_per_strip));
    const double pulses = kMargin * double(points) / echoes_per_pulse;
    const double spacing = std::sqrt(extent_ * strips.swath * double(strips.strips) / pulses);
    strips.pulses = std::max<uint64_t>(4, uint64_t(std::ceil(strips.swath / spacing)));
    strips.lines = std::max<uint64_t>(1, uint64_t(std::ceil(pulses / double(strips.strips * strips.pulses))));
    strips.lines_per_block = std::max<uint64_t>(1, std::min(strips.lines, kBlockPulses / strips.pulses));
    const uint64_t blocks_per_strip = (strips.lines + strips.lines_per_block - 1) / strips.lines_per_block;
    part.planned_blocks = strips.strips * blocks_per_strip;
    parts_.push_back(part);
}

void Survey::plan_stations(BeamScanner& scanner, uint64_t points) {
    const uint64_t count = std::max(std::clamp<uint64_t>(points / kLeastStationPoints, 2, kVillageStations), (points + kStationPoints - 1) / kStationPoints);
    const double farthest = std::clamp(0.5 * extent_, 50.0, 300.0);
    // Evenly spread around the crossings of the villages in the scene, so that every side of a house is seen; closer together
    // when too many of the places are taken.
    std::vector<Vec3d> eyes;
    const int64_t rings = floor_to_int(0.5 * extent_ / kTileSize);
    constexpr double kGoldenTurn = 0.38196601125010515;
    for (int64_t spots = int64_t(std::clamp<uint64_t>(count + count / 4, 3, kVillageStations + 4)); eyes.size() < count; spots += 1 + spots / 4) {
        eyes.clear();
        for (int64_t row = -rings; row <= rings && eyes.size() < count; ++row)
            for (int64_t column = -rings; column <= rings && eyes.size() < count; ++column) {
                if (!scene_->land().settled(column, row)) continue;
                const Vec2d crossing = scene_->land().crossing(column, row);
                const double reach = std::min(0.9 * scene_->land().village_radius(column, row), 0.5 * extent_);
                for (int64_t spot = 0; spot < spots && eyes.size() < count; ++spot) {
                    const SinCos way = sin_cos_turns(kGoldenTurn * double(spot));
                    const Vec2d place = crossing + reach * std::sqrt((double(spot) + 0.3) / double(spots)) * Vec2d(way.cos, way.sin);
                    if (place.cwiseAbs().maxCoeff() > 0.5 * extent_) continue;
                    const Vec3d eye(place.x(), place.y(), scanner.probe().ground(place.x(), place.y()).height + kEyeHeight);
                    if (scanner.probe().nearest_surface(eye).distance > 1.2 && !scanner.probe().buried(eye, 0.0)) eyes.push_back(eye);
                }
            }
    }
    for (uint64_t i = 0; i < count; ++i) {
        SurveyPart part;
        part.quota = points / count + (i < points % count ? 1 : 0);
        part.airborne = false;
        part.source_id = uint16_t(kFirstStationId + i % 60000);
        part.start_time = kFirstTime + 500'000.0 + double(i) * 900.0;
        part.beam = {.noise = settings_.noise, .beam_radius = 0.015, .farthest = farthest, .reference_range = 14.0, .range_resolution = 0.3, .most_returns = 3};
        Station& station = part.station;
        station.eye = eyes[i];
        constexpr uint64_t kPilotPulses = 6000;
        constexpr double kHighest = 0.5 * std::numbers::pi;
        Random random(line_seed(settings_.seed, kPilotStream, ~i));
        std::vector<ScanPoint> echoes;
        for (uint64_t pulse = 0; pulse < kPilotPulses; ++pulse) {
            const Ray ray = station_ray(station, kTurn * double(pulse) / kPilotPulses, random.uniform(kLowestBeam, kHighest));
            scanner.fire(ray, within_scene(part.beam, ray, extent_), random.bits(), {}, echoes);
        }
        const double pulses = kMargin * double(part.quota) * double(kPilotPulses) / double(std::max<size_t>(echoes.size(), kPilotPulses / 8));
        const double step = std::sqrt(2.0 * std::numbers::pi * (kHighest - kLowestBeam) / pulses);
        station.rows = std::max<uint64_t>(4, uint64_t(std::ceil((kHighest - kLowestBeam) / step)));
        station.columns = std::max<uint64_t>(4, uint64_t(std::ceil(pulses / double(station.rows))));
        station.columns_per_block = std::max<uint64_t>(1, kBlockPulses / station.rows);
        part.planned_blocks = (station.columns + station.columns_per_block - 1) / station.columns_per_block;
        parts_.push_back(part);
    }
}

void Survey::scan_block(BeamScanner& scanner, size_t part, uint64_t block, std::vector<ScanPoint>& out) const {
    out.clear();
    if (parts_[part].airborne) scan_strip_block(scanner, parts_[part], block, out);
    else scan_station_block(scanner, parts_[part], block, out);
}

void Survey::scan_strip_block(BeamScanner& scanner, const SurveyPart& part, uint64_t block, std::vector<ScanPoint>& out) const {
    const AirborneStrips& strips = part.strips;
    const uint64_t blocks_per_strip = (strips.lines + strips.lines_per_block - 1) / strips.lines_per_block;
    const uint64_t strip = block / blocks_per_strip;
    const uint64_t first = block % blocks_per_strip * strips.lines_per_block;
    const uint64_t last = std::min(strips.lines, first + strips.lines_per_block);
    const double advance = strips.extent / double(strips.lines);  // metres flown during a line
    const double pulse_time = advance / kFlightSpeed / double(strips.pulses);
    const double start = part.start_time + double(strip) * (strips.extent / kFlightSpeed + kTurnTime);
    ScanPoint fields;
    fields.source_id = uint16_t(part.source_id + strip % 4000);
    for (uint64_t line = first; line < last; ++line) {
        // The mirror swings to the left on even lines and back on odd ones. Each swing has a channel of its own, so that a channel's
        // lines are parallel and evenly spaced: how the channels' lines fall between each other varies with the height of the ground.
        fields.scan_forward = line % 2 == 0;
        const double look = fields.scan_forward ? kLook : -kLook;
        const uint64_t line_of_seeds = line_seed(settings_.seed, strip, line);
        for (uint64_t i = 0; i < strips.pulses; ++i) {
            const uint64_t seed = pulse_seed(line_of_seeds, i);
            Random jitter(seed);  // the mirror's, well below the step between pulses
            const double phase = (double(i) + 0.5 + 0.5 * (jitter.uniform() - 0.5)) / double(strips.pulses);
            const double angle = kSwathHalfAngle * (fields.scan_forward ? 2.0 * phase - 1.0 : 1.0 - 2.0 * phase);
            const double pitch = look + 0.5 * (jitter.uniform() - 0.5) * advance / part.beam.reference_range;
            fields.gps_time = start + double(line * strips.pulses + i) * pulse_time;
            fields.line_edge = i + 1 == strips.pulses;
            fields.scan_angle = scan_angle_units(-angle);  // LAS counts angles to the left as negative
            scanner.fire(strip_ray(strips, strip, (double(line) + phase) * advance, angle, look, pitch), part.beam, seed, fields, out);
        }
    }
}

void Survey::scan_station_block(BeamScanner& scanner, const SurveyPart& part, uint64_t block, std::vector<ScanPoint>& out) const {
    const Station& station = part.station;
    const double row_step = (0.5 * std::numbers::pi - kLowestBeam) / double(station.rows);
    const double column_step = 2.0 * std::numbers::pi / double(station.columns);
    const double pulse_time = kStationTime / double(station.columns * station.rows);
    ScanPoint fields;
    fields.source_id = part.source_id;
    fields.scan_forward = true;
    for (uint64_t column = block * station.columns_per_block; column < (block + 1) * station.columns_per_block; ++column) {
        const uint64_t column_of_seeds = line_seed(settings_.seed, part.source_id, column);
        for (uint64_t row = 0; row < station.rows; ++row) {
            const uint64_t seed = pulse_seed(column_of_seeds, row);
            Random jitter(seed);
            const double elevation = kLowestBeam + (double(row) + 0.5 + 0.3 * (jitter.uniform() - 0.5)) * row_step;
            const double azimuth = (double(column) + double(row) / double(station.rows)) * column_step;
            fields.gps_time = part.start_time + double(column * station.rows + row) * pulse_time;
            fields.line_edge = row + 1 == station.rows;
            fields.scan_angle = scan_angle_units(elevation);
            const Ray ray = station_ray(station, azimuth, elevation);
            scanner.fire(ray, within_scene(part.beam, ray, extent_), seed, fields, out);
        }
    }
}

}  // namespace strata
