#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "core/cloud/point_source.h"
#include "core/octree/scratch_store.h"
#include "core/surface/scalar_field.h"
#include "core/voxel/record_buckets.h"

namespace strata {

struct PointBallsSettings {
    double spacing = 0.0;  // of samples; world units
    double radius = 0.0;   // of balls; world units, from 1 to 6 spacings
    int threads = 1;
    uint64_t memory_bytes = uint64_t{1} << 30;  // half of it for points, beyond which they go to the scratch store; at most all of it for
                                                // the bricks of a layer, and as much for the balls that reach into them
    ScratchStore* scratch = nullptr;            // nullptr: all stay in memory
    std::function<void(uint64_t points)> on_points;  // points read since the last call; from any thread
};

/// The distance to the union of balls around points, as a scalar field: negative inside, exact to 1/1024 spacing in a band of 2 spacings
/// around its surface, +- 2 spacings beyond. Its surface at 0 is closed, whatever the points are; it encloses a sheet of points from both
/// sides, without holes where balls overlap. Samples lie at multiples of the spacing, so that fields of neighboring scans fit together.
/// Points are read once, and layers made from those near them; neither threads nor memory show.
class PointBalls : public FieldBrickSource {
public:
    /// bounds  of the points; those outside are left out and counted
    /// throws  Error{usage}: the radius is out of its range; Error{limit}: more than 2^18 samples an axis; what the source throws
    /// cost    20 bytes a point of memory or scratch room
    PointBalls(const PointSource& points, const Box3d& bounds, const PointBallsSettings& settings);
    ~PointBalls() override;

    uint64_t outside() const { return outside_; }
    uint64_t scratch_bytes() const { return scratch_.written_bytes(); }

    const GridPlacement& placement() const override { return placement_; }
    float background() const override;
    /// throws  Error{limit}: the bricks of one layer do not fit
    bool next_layer(FieldBrickLayer& out) override;

private:
    // Of a ball, in 1/1024 spacing.
    using Center = std::array<int32_t, 3>;

    void distribute(const PointSource& points);
    void load(size_t layer);
    void fill(FieldBrickLayer& out);

    PointBallsSettings settings_;
    GridPlacement placement_;
    float reach_;  // spacings
    BlockPool pool_;
    ScratchBlocks scratch_;
    std::unique_ptr<RecordBuckets> buckets_;  // a layer of bricks each
    uint64_t outside_ = 0;
    size_t next_ = 0;                          // layer
    std::array<std::vector<Center>, 3> near_;  // of the layer below, this one and the one above; by layer % 3
};

}  // namespace strata
