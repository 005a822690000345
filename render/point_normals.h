#pragma once

#include <array>
#include <span>
#include <vector>

#include "core/cloud/point_source.h"
#include "render/stream/resident_node.h"

namespace strata {

/// Where NormalX, NormalY and NormalZ are among a cloud's attributes; -1 each: it has none.
std::array<int, 3> normal_attributes(const CloudInfo& info);

/// Takes the normals of points from their attributes. Safe from several threads.
class PointNormals {
public:
    /// throws  Error{usage}: the cloud has none
    explicit PointNormals(const CloudInfo& info);

    /// Attributes that `read` wants: pass to read_node.
    std::span<const int> wanted() const { return wanted_; }

    /// The normals of a batch, of any length; zero where one is zero, not finite or has no value.
    std::vector<PackedNormal> read(const PointBatch& batch) const;

private:
    std::array<int, 3> wanted_;
    std::array<Attribute, 3> attributes_;
};

}  // namespace strata
