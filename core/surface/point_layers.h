#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/cloud/point_source.h"
#include "core/octree/scratch_store.h"
#include "core/surface/scalar_field.h"
#include "core/voxel/record_buckets.h"

namespace strata {

/// Samples of a field around points, at multiples of a spacing, so that fields of neighboring scans fit together.
struct PointGrid {
    GridPlacement placement;
    double spacing = 0.0;                 // world units
    std::array<uint64_t, 3> bricks = {};  // of samples, an axis
    double units = 0.0;                   // of a spacing: what places of points are rounded to; a power of two

    /// reach   how far from points the field has values, in spacings; up to a layer
    /// throws  Error{usage}: spacing not positive; Error{limit}: bounds that are empty, or more than 2^18 samples an axis
    static PointGrid around(const Box3d& bounds, double spacing, double reach);
};

/// What is kept of points beside their places.
struct PointForm {
    /// An attribute, or one of its components, as a number.
    struct Scalar {
        std::string name;
        int attribute = -1, component = 0;  // of the source
        bool is_class = false;              // means of it say nothing
    };
    bool colors = false;  // of the source's attribute rgb, which it has then
    bool normals = false;
    std::vector<Scalar> scalars;

    size_t color_at() const { return 20; }
    size_t normal_at() const { return color_at() + (colors ? 8 : 0); }
    size_t scalars_at() const { return normal_at() + (normals ? 12 : 0); }
    size_t record_bytes() const { return scalars_at() + 4 * scalars.size(); }
};

/// Where a brick's corner is among ascending ones; corners.size(): nowhere.
size_t find_brick(const std::vector<std::array<int32_t, 2>>& corners, const std::array<int32_t, 2>& corner);

/// Points of one layer of bricks, those of a brick together.
struct PointLayer {
    std::vector<std::array<int32_t, 2>> corners;    // of bricks with points, ascending by j, then i
    std::vector<uint32_t> begins;                   // [corners + 1] of their points
    std::vector<Vec3f> places;                      // from the least sample of the brick, spacings; exact
    std::vector<Vec3f> normals;                     // [places] unit, zero: none; or empty
    std::vector<std::array<uint16_t, 3>> colors;    // [places] as stored; or empty
    std::vector<float> scalars;                     // [places * form.scalars]; NaN: unknown

    size_t points() const { return places.size(); }
    /// The brick at that corner; corners.size(): none.
    size_t find(const std::array<int32_t, 2>& corner) const { return find_brick(corners, corner); }
    uint64_t memory_bytes() const;
};

/// Of normals that were read: those that are not zero, and such of these that do not look down.
struct NormalCount {
    uint64_t points = 0, up = 0;

    void add(const NormalCount& other) {
        points += other.points;
        up += other.up;
    }
};

/// Points as records, sorted into layers of bricks of samples; in memory, or beyond it in the scratch store.
class PointLayers {
public:
    /// memory_bytes  beyond that, where there is a scratch store, records go there
    /// scratch       what several of these may share
    PointLayers(const PointGrid& grid, const PointForm& form, uint64_t memory_bytes, ScratchBlocks& scratch);
    ~PointLayers();

    const PointGrid& grid() const { return grid_; }
    const PointForm& form() const { return form_; }
    size_t size() const { return buckets_->size(); }
    uint64_t points(size_t layer) const { return layer < size() ? buckets_->records(layer) : 0; }
    uint64_t outside() const { return outside_; }
    const NormalCount& normals() const { return normals_; }

    /// Adds all points of a source, with normals where it has attributes of them, else of zero. Those outside the grid, with one brick at each end kept free, are left out and counted.
    /// returns  how many of these were outside
    uint64_t distribute(const PointSource& points, int threads, const std::function<void(uint64_t points)>& on_points);
    /// Adds the points of a layer as they are.
    void add(size_t layer, const PointLayer& points);

    /// The places of a layer's points, in units, in no order; their records are gone then.
    /// throws  Error{limit}: they take more than memory_bytes
    void take_places(size_t layer, uint64_t memory_bytes, std::vector<std::array<int32_t, 3>>& out);
    /// The points of a layer, in an order that depends on them alone; their records are gone then.
    /// merge   points in the same cell of half a spacing become one, of mean place, color and number, the most frequent class, and the
    ///         direction of the sum of normals
    /// places  if not null: gets those of all points, in units, in no order
    /// throws  Error{limit}: that and places take more than memory_bytes
    PointLayer take(size_t layer, bool merge, uint64_t memory_bytes, std::vector<std::array<int32_t, 3>>* places = nullptr);

private:
    struct Sorted;
    Sorted read_sorted(size_t layer);

    PointGrid grid_;
    PointForm form_;
    BlockPool pool_;
    std::unique_ptr<RecordBuckets> buckets_;
    uint64_t outside_ = 0;
    NormalCount normals_;
};

}  // namespace strata
