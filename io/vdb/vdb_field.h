#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/octree/scratch_store.h"
#include "core/surface/scalar_field.h"
#include "io/byte_source.h"
#include "io/vdb/vdb_file.h"

namespace strata {

struct VdbFieldSettings {
    std::string grid;                                                  // its name; empty: the first that can be read
    std::optional<int> component;                                      // 0 to 2, of a grid of vectors; none: it is one of scalars
    bool only_active = false;                                          // values that are not active, and the background, are NaN
    uint64_t memory_bytes = std::numeric_limits<uint64_t>::max();      // for what is kept of the tree
    uint64_t memory_parts = 1;                                         // memory_bytes is one of so many of what was given: errors speak of that
    ScratchStore* scratch = nullptr;                                   // for values that do not fit; null: they must
};

/// The values of a grid of a `.vdb` file as a scalar field: its leaves are the bricks, tiles are constant regions. All of the tree is read
/// when it is made, as a file has its leaves in no order that a field could be given in: 24 bytes a leaf and its values, which go to the
/// scratch store where they do not fit.
class VdbField : public FieldBrickSource {
public:
    /// throws  Error{malformed}
    ///         Error{unsupported}: no grid that can be read, or one whose transform is not a scale and a shift
    ///         Error{usage}: no grid of that name; Error{limit}: more memory than allowed
    VdbField(const ByteSource& source, const VdbFieldSettings& settings);

    const VdbGrid& grid() const { return grid_; }
    uint64_t bricks() const { return bricks_.size(); }
    /// Of the values of leaves and tiles and the background, but for NaN; the least above the greatest: there is none.
    float least() const { return least_; }
    float greatest() const { return greatest_; }
    /// Of points in bricks, where there are some.
    const Vec3i& least_index() const { return least_index_; }
    const Vec3i& greatest_index() const { return greatest_index_; }
    /// World: of the centers of these.
    const Box3d& bounds() const { return bounds_; }

    const GridPlacement& placement() const override { return placement_; }
    float background() const override { return background_; }
    float absent_value(const std::array<int32_t, 3>& corner) const override;
    bool next_layer(FieldBrickLayer& out) override;
    /// The value of any point. The last brick that was found is kept, and looked at first.
    float value_at(const Vec3i& index);

private:
    /// A cube of points of one value, or a leaf, by its least.
    struct Region {
        Vec3i origin;
        float value;
    };
    struct Brick {
        Vec3i origin;
        float value;     // of all its points, where it has no slot
        uint64_t slot;   // of its values; kNoSlot
    };
    static constexpr uint64_t kNoSlot = ~uint64_t{0};

    void add_tile(const Vec3i& origin, int log2_side, float value);
    void add_leaf(const Vec3i& origin, std::span<const double, 512> values);
    void add_rims();
    void add_rim(const Region& tile, int log2_side);
    bool touches_other(const Vec3i& brick, float value) const;
    void see(float value);
    void check_memory() const;
    void read_values(const Brick& brick, std::span<float> out) const;

    std::string place_;  // for messages
    VdbGrid grid_;
    GridPlacement placement_;
    float background_ = 0.0f, least_ = std::numeric_limits<float>::infinity(), greatest_ = -std::numeric_limits<float>::infinity();
    Vec3i least_index_ = Vec3i::Constant(std::numeric_limits<int>::max()), greatest_index_ = Vec3i::Constant(std::numeric_limits<int>::min());
    Box3d bounds_;
    uint64_t memory_bytes_, memory_parts_;
    ScratchStore* scratch_;

    std::vector<Brick> bricks_;                          // ascending by k, j, i
    std::array<std::vector<Region>, 3> tiles_;           // of 8, 128 and 4096 points a side, likewise; none of the background's value
    std::vector<std::unique_ptr<float[]>> pages_;        // of values of bricks, those of the first slots
    uint64_t slots_ = 0;
    size_t next_ = 0;  // brick
    // Of value_at: the last brick, and its values where the scratch store has them.
    size_t last_ = 0, cached_ = ~size_t{0};
    std::vector<float> cache_;
};

/// throws  as VdbField; Error{not_found, io}
std::unique_ptr<VdbField> open_vdb_field(const std::string& path, const VdbFieldSettings& settings);

}  // namespace strata
