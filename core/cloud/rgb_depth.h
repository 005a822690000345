#pragma once

#include "core/cloud/point_source.h"

namespace strata {

/// How many bits of its 16-bit rgb a cloud uses, over all its points: 16, or 8 when no channel exceeds 255 (many writers
/// store bytes unscaled), or 0 when there is no color or all is black.
/// cost  reads points until a channel exceeds 255: usually one batch, the whole cloud where the answer is 8 or 0
int rgb_depth(const PointSource& source, int threads);

}  // namespace strata
