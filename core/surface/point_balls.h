#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "core/cloud/point_source.h"
#include "core/octree/scratch_store.h"
#include "core/surface/point_field.h"
#include "core/surface/point_layers.h"

namespace strata {

struct PointBallsSettings {
    double spacing = 0.0;  // of samples; world units
    double radius = 0.0;   // of balls; world units, from 1 to 6 spacings
    int threads = 1;
    uint64_t memory_bytes = uint64_t{1} << 30;  // an eighth of it for points, beyond which they go to the scratch store; the rest for those
                                                // of some layers, the bricks of a layer and the balls that reach into them
    ScratchStore* scratch = nullptr;            // nullptr: all stay in memory
    PointForm form;                             // what is kept of points for those who ask for it
    bool keep_points = false;                   // in window(), those of a cell of half a spacing as one
    std::function<void(uint64_t points)> on_points;  // points read since the last call; from any thread
    std::function<Box3d(uint64_t outside)> bounds_of_all;  // if set, asked where the bounds leave points out; then all begins again
};

/// The distance to the union of balls around points, as a scalar field: negative inside, exact to 1/8192 spacing or less in a band of 2 spacings
/// around its surface, +- 2 spacings beyond. Its surface at 0 is closed, whatever the points are; it encloses a sheet of points from both
/// sides, without holes where balls overlap. Samples lie at multiples of the spacing, so that fields of neighboring scans fit together.
/// Points are read once, and layers made from those near them; neither threads nor memory show.
class PointBalls : public PointField {
public:
    /// bounds  of the points; those outside are left out and counted
    /// throws  Error{usage}: the radius is out of its range; Error{limit}: more than 2^18 samples an axis; what the source throws
    /// cost    20 bytes a point of memory or scratch room
    PointBalls(const PointSource& points, const Box3d& bounds, const PointBallsSettings& settings);

    uint64_t outside() const { return layers_->outside(); }
    uint64_t scratch_bytes() const { return scratch_.written_bytes(); }

    const PointGrid& grid() const { return layers_->grid(); }

    const GridPlacement& placement() const override { return layers_->grid().placement; }
    float background() const override;

private:
    uint64_t room() const;
    size_t layers() const override { return layers_->size(); }
    void load(size_t layer) override;
    bool has_points_near() const override { return !near_[0].empty() || !near_[1].empty() || !near_[2].empty(); }
    void fill(FieldBrickLayer& out) override;

    PointBallsSettings settings_;
    float reach_;  // spacings
    ScratchBlocks scratch_;
    std::unique_ptr<PointLayers> layers_;
    std::array<std::vector<std::array<int32_t, 3>>, 3> near_;  // places of the layer below, this one and the one above; by layer % 3
};

}  // namespace strata
