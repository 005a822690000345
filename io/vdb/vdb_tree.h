#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>

#include "core/math/vec.h"
#include "io/byte_stream.h"
#include "io/vdb/vdb_file.h"

namespace strata {

/// What is told of a tree, in the order of its file. Bool values are 0 and 1; those of a mask are its bits.
struct VdbVisitor {
    std::function<void(double background)> begin;
    /// A cube of 2^log2_side points a side, 3, 7 or 12, whose least is `origin`: all have the value.
    std::function<void(const Vec3i& origin, int log2_side, double value, bool active)> tile;
    /// 8^3 points. Place 64 x + 8 y + z; bit i of word i / 64 of `active`.
    std::function<void(const Vec3i& origin, std::span<const uint64_t, 8> active, std::span<const double, 512> values)> leaf;
};

/// Whether trees of its type are read, and it is known where its tree is.
bool is_readable(const VdbGrid& grid);
/// Likewise of trees of three numbers a point, of which one at a time is read.
bool is_vector(const VdbGrid& grid);

/// The value of what no node of a grid that is_readable says.
double read_vdb_background(ByteStream& stream, const VdbGrid& grid);

/// Reads a grid's tree: its branches first, then its leaves. Keeps 12 bytes a leaf.
/// component  of a grid that is_vector, 0 to 2, which is not read without; of others it does not count
/// throws  Error{malformed}, naming the byte; Error{unsupported}: a type or a transform that is not read; values that cannot be decompressed
void read_vdb_tree(ByteStream& stream, const VdbGrid& grid, const VdbVisitor& visitor, std::optional<int> component = std::nullopt);

}  // namespace strata
