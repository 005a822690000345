#pragma once

#include <cstdint>

#include "core/simulate/land.h"
#include "core/simulate/terrain.h"
#include "core/simulate/tile.h"

namespace strata {

/// Lays out and indexes one tile of the village scene: houses along the roads, a church and a pond in every village,
/// gardens, woods, hedges, avenues, poles and wires. A pure function of its arguments.
SceneTile plan_village_tile(const Land& land, const Terrain& terrain, int64_t column, int64_t row);

}  // namespace strata
