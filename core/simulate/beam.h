#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/math/random.h"
#include "core/simulate/scene.h"

namespace strata {

/// A measured point, as a scanner delivers it.
struct ScanPoint {
    Vec3d position = Vec3d::Zero();  // metres from the scene's origin
    double gps_time = 0.0;           // adjusted standard GPS time, seconds
    uint16_t intensity = 0;
    uint16_t red = 0, green = 0, blue = 0;
    uint16_t source_id = 0;  // strip or station
    int16_t scan_angle = 0;  // 0.006 degrees
    uint8_t return_number = 1, return_count = 1;
    uint8_t classification = 0;
    bool scan_forward = false;  // scan direction flag
    bool line_edge = false;     // edge of flight line flag
    Part part = Part::ground;   // what was hit; leaves are no surface
};

/// What a scanner's beam is like.
struct BeamModel {
    double noise = 0.0;               // standard deviation along the beam, metres
    double beam_radius = 0.05;        // metres; a wire nearer than this to the axis is met
    double farthest = 1e9;            // metres
    double reference_range = 300.0;   // where a white board answers at full scale
    double range_resolution = 0.5;    // echoes nearer to each other than this merge, metres
    int most_returns = 5;
};

/// Fires pulses into a scene. One for each thread.
class BeamScanner {
public:
    explicit BeamScanner(const VillageScene& scene) : probe_(scene) {}

    SceneProbe& probe() { return probe_; }
    /// Fires one pulse and appends its echoes. `pulse`: seed of this pulse, well mixed; the noise has a stream of its own, so that the
    /// same pulses with another sigma meet the same surfaces. `fields`: time, angle, source and flags, copied into each echo.
    void fire(const Ray& ray, const BeamModel& model, uint64_t pulse, const ScanPoint& fields, std::vector<ScanPoint>& out);

private:
    /// Something that takes a share of the beam.
    struct Echo {
        double distance;  // metres
        double share;     // of what arrives here; once recorded, of the whole pulse
        Vec3d point, normal;
        Part part;
        const LeafSpan* leaves;  // of leaves
    };
    static constexpr size_t kMostEchoes = 48;

    size_t gather_echoes(const Ray& ray, Random& random);
    size_t record_echoes(size_t count, const BeamModel& model);
    void meet_leaves(const LeafSpan& span, const Ray& ray, Random& random, size_t most, size_t& count);
    Shade shade(const Echo& echo) const;

    SceneProbe probe_;
    // Kept between pulses, because clearing them would cost as much as casting the beam.
    BeamPath path_;
    std::array<Echo, kMostEchoes> echoes_;
};

}  // namespace strata
