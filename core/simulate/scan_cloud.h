#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "core/cloud/attribute.h"
#include "core/cloud/point_batch.h"
#include "core/math/quantization.h"
#include "core/simulate/beam.h"

namespace strata {

// How a simulated scan becomes a cloud: millimetres in UTM zone 32N, at whole kilometres.

/// World position of the scene's origin.
Vec3d scan_origin();
Quantization scan_quantization();
/// WKT of the coordinate system.
std::string_view scan_crs();
/// The columns that fill_scan_batch writes, in order.
std::vector<Attribute> scan_attributes();

/// Replaces `batch` by the points, positions rounded to the nearest quantum.
void fill_scan_batch(std::span<const ScanPoint> points, PointBatch& batch);

}  // namespace strata
