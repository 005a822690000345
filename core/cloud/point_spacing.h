#pragma once

#include <cstdint>
#include <vector>

#include "core/cloud/point_source.h"

namespace strata {

/// How far apart the points of a cloud lie on their surface: at some 4,000 of them, chosen by chance, the side of a square that holds one, by the
/// distance of the 12th nearest. Ascending, world units; 0 where points coincide. Empty: fewer than 4 points.
/// Of more than 2^20 points as many are looked at, chosen likewise, and what is between them follows from the share; all are read once.
/// The threads do not show.
/// bounds  of points that count
std::vector<double> measure_point_spacings(const PointSource& source, const Box3d& bounds, int threads);

}  // namespace strata
