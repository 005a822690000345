#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>

#include "core/cloud/point_source.h"
#include "core/octree/scratch_store.h"
#include "core/surface/normal_orientation.h"
#include "core/surface/point_field.h"
#include "core/surface/point_layers.h"

namespace strata {

struct PointSurfaceSettings {
    double spacing = 0.0;  // of samples; world units
    double radius = 0.0;   // of what a point has a say in; world units, from kLeastReach to kMostReach spacings
    std::optional<Vec3d> viewpoint;  // world: normals look there
    PointForm form;                  // what is kept of points for those who ask for it; normals are found out
    bool keep_points = false;        // in window()
    int threads = 1;
    uint64_t memory_bytes = uint64_t{1} << 30;  // a quarter of it for points, beyond which they go to the scratch store; the rest for layers
                                                // of them that are read, cells by which normals are turned, and the bricks of a layer
    ScratchStore* scratch = nullptr;            // nullptr: all stay in memory
    std::function<void(uint64_t points)> on_points;  // points read since the last call; from any thread
    std::function<Box3d(uint64_t outside)> bounds_of_all;  // if set, asked where the bounds leave points out; then all begins again

    static constexpr double kLeastReach = 2.0, kMostReach = 7.0;  // within the layers next to a sample's
};

/// What was found out of points on the way.
struct PointSurfaceReport {
    uint64_t outside = 0;      // points beyond the bounds, left out
    uint64_t merged = 0;       // points of the surface, once those of a cell of half a spacing are one
    uint64_t without_normal = 0;  // of these: left out
    bool has_normals = false;  // the file's were taken
    bool oriented = false;     // sides were chosen here: normals were fitted, or all of the file's look up
    uint64_t components = 0;   // parts that the sides of normals were chosen for one by one
};

/// A smooth surface near points with normals, as a scalar field that is 0 on it, negative behind it: at each sample the mean of the distances
/// to the planes of the points within the radius, near ones with more weight. NaN where there is no surface to be sure of: away from
/// points, beyond the edge of what they cover by more than about a third of the radius, where they lie on planes that differ by much, or where fewer than
/// kLeastPoints have a say (near_points.h). So the surface is open where the points end; gaps narrower than about the radius are closed.
/// Points in a cell of half a spacing count once. Normals are those of the points (attributes NormalX, NormalY, NormalZ) where
/// there are any, else fitted (layer_normals.h); if these, or all of the points' look up, as those do that were fitted without a viewpoint,
/// their sides are chosen (normal_orientation.h). Points are read once; neither threads nor memory show.
/// source  C. Shen, J. F. O'Brien, J. R. Shewchuk, "Interpolating and approximating implicit surfaces from polygon soup", SIGGRAPH 2004, for
///         the mean of planes; A. Adamson, M. Alexa, "Approximating bounded, non-orientable surfaces from points", SMI 2004, for where it ends
class PointSurface : public PointField {
public:
    /// bounds  of the points; those outside are left out and counted
    /// throws  Error{usage}: the radius is out of its range; Error{limit}: more than 2^18 samples an axis, or memory; what the source throws
    /// cost    32 bytes a point of memory or scratch room, and what the form keeps
    PointSurface(const PointSource& points, const Box3d& bounds, const PointSurfaceSettings& settings);

    uint64_t outside() const { return report_.outside; }
    const PointSurfaceReport& report() const { return report_; }
    uint64_t scratch_bytes() const { return scratch_.written_bytes(); }
    const PointGrid& grid() const { return grid_; }

    const GridPlacement& placement() const override { return grid_.placement; }
    float background() const override;  // NaN

private:
    // The uppermost samples of the layer before.
    struct Top {
        int32_t k = 0;
        std::vector<std::array<int32_t, 2>> corners;
        std::vector<float> values;  // [corners * 64]

        uint64_t memory_bytes() const { return corners.size() * sizeof corners[0] + values.size() * sizeof values[0]; }
    };

    void distribute(const PointSource& points, const Box3d& bounds);
    uint64_t left_beside(uint64_t bytes) const { return settings_.memory_bytes - std::min(bytes, settings_.memory_bytes); }
    uint64_t room() const;
    void find_normals(bool fit, bool turn);
    size_t layers() const override { return layers_->size(); }
    void load(size_t layer) override;
    bool has_points_near() const override { return near_[0] || near_[1] || near_[2]; }
    void fill(FieldBrickLayer& out) override;
    void drop_jumps(FieldBrickLayer& out);

    PointSurfaceSettings settings_;
    PointGrid grid_;
    float radius_;                         // spacings
    ScratchBlocks scratch_;
    std::unique_ptr<PointLayers> layers_;  // with normals
    NormalOrientation orientation_;        // of their sides; no cells: they are as they are
    std::array<std::shared_ptr<const PointLayer>, 3> near_;  // the layer below, this one and the one above; by layer % 3
    Top top_;
    PointSurfaceReport report_;
};

}  // namespace strata
