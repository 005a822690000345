#pragma once

#include <array>
#include <cstdint>

#include "core/surface/contour_cell.h"

namespace strata {

/// Which corners of a cell are joined through it where its trilinear function has the corners' sign. Where the function has no saddle in
/// the cell, what its faces join is all that is joined, and need not be told. values     of the corners, less the isovalue; inside is
/// positive or 0 cell_case  which corners are inside returns    [8] the least corner that is joined to this one, itself or another; nothing
/// is joined where a value is not finite source     Every part of a bilinear function's positive (or negative) set on a square has a
/// corner, since the function is linear along
///            both axes. So the parts in a slice of the cell are groups of its four corners, told by their signs and the asymptotic
///            decider; between the heights at which a corner or the decider changes sign they do not change, and two slices on both sides
///            of such a height share the corners that keep their sign.
std::array<uint8_t, 8> join_corners_within(const CellValues& values, unsigned cell_case);

}  // namespace strata
