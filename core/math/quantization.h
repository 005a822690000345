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

}  // namespace strata
