#pragma once

#include <memory>
#include <string>

#include "core/cloud/point_source.h"

namespace strata {

/// The points of a source, said to be in another coordinate reference system than it says itself.
std::unique_ptr<PointSource> with_crs(std::unique_ptr<PointSource> source, const std::string& crs);

/// The points of a source in another coordinate reference system, by PROJ. They get a quantization of their own: steps as fine as
/// the source's on the ground, a power of ten where the unit changes, wider (and a note) only where int32 asks for it; an offset that is
/// whole. Where neither system says anything of heights, z stays the integers it is; where both are one, the source itself is returned.
/// Reads the source once, to know where its points come to lie; info().bounds is exact.
/// name    of the source, for messages
/// throws  Error{usage}: PROJ cannot read a system; Error{unsupported}: the source says none, there is no way, or heights lack a
///         grid; Error{limit}: a point that cannot be transformed, by its number and place
std::unique_ptr<PointSource> reproject_points(std::unique_ptr<PointSource> source, const std::string& to, const std::string& name,
                                              int threads);

}  // namespace strata
