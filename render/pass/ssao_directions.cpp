#include "render/pass/ssao_directions.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace strata {
namespace {

constexpr double kStepRatio = 1.5;

SsaoDirections directions_of(int phase) {
    SsaoDirections directions;
    const double angle = 0.5 * std::numbers::pi * (phase + 0.5) / kSsaoPhases;
    for (int i = 0; i < 4; ++i) {
        const double turned = angle + (i / 2 == 1 ? 0.5 * std::numbers::pi : 0.0) + (i % 2 == 1 ? std::numbers::pi : 0.0);
        SsaoDirection& direction = directions[size_t(i)];
        direction.x = float(std::cos(turned));
        direction.y = float(std::sin(turned));
        double length = std::pow(kStepRatio, (2 * phase + 3 * (i / 2)) % 4 / 4.0);
        for (SsaoOffset& offset : direction.offsets) {
            const int x = int(std::lround(length * direction.x)), y = int(std::lround(length * direction.y));
            offset = {x, y, 2.0f * float(std::hypot(x, y))};
            length = std::max(length * kStepRatio, length + 1.0);
        }
    }
    return directions;
}

}  // namespace

std::array<SsaoDirections, kSsaoPhases> ssao_directions() {
    std::array<SsaoDirections, kSsaoPhases> directions;
    for (int phase = 0; phase < kSsaoPhases; ++phase) directions[size_t(phase)] = directions_of(phase);
    return directions;
}

}  // namespace strata
