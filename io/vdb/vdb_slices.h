#pragma once

#include "core/surface/scalar_field.h"
#include "io/vdb/vdb_field.h"

namespace strata {

/// The field of a grid as dense slices: those of its bricks and one sample more on each side.
class VdbSlices : public SliceSource {
public:
    /// field  no layer of which was taken; must live as long
    explicit VdbSlices(VdbField& field);

    const GridPlacement& placement() const override { return placement_; }
    std::array<uint32_t, 3> size() const override { return size_; }
    void read(uint32_t count, double reference, std::span<float> out) override;

private:
    void read_slice(int32_t k, double reference, std::span<float> out);

    VdbField& field_;
    GridPlacement placement_;
    Vec3i least_ = Vec3i::Zero();  // index in the grid of the first sample
    std::array<uint32_t, 3> size_ = {2, 2, 2};
    FieldBrickLayer layer_;
    bool has_layer_ = false;       // layer_ is the next of the field's that has not gone by
    uint32_t next_ = 0;            // slice
};

}  // namespace strata
