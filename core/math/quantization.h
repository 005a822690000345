#pragma once

#include "core/math/vec.h"

namespace strata {

/// How a cloud's int32 coordinates (quanta) stand for world positions: world = quanta * scale + offset, per axis.
struct Quantization {
    Vec3d scale = Vec3d::Constant(0.001);  // world units per quantum
    Vec3d offset = Vec3d::Zero();          // world units

    Vec3d world_from_quanta(const Vec3i& p_quanta) const { return p_quanta.cast<double>().cwiseProduct(scale) + offset; }
    bool operator==(const Quantization& other) const { return scale == other.scale && offset == other.offset; }
};

/// The least whole q with q * scale + offset >= value, and the greatest with <= value, for a positive scale. A value that
/// only the rounding of these doubles keeps from a whole q is on it, so that a limit typed as a point's coordinate holds
/// that point whatever the offset. Infinite values give themselves.
double first_quantum_from(double value, double scale, double offset);
double last_quantum_to(double value, double scale, double offset);

}  // namespace strata
