#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <functional>
#include <future>
#include <limits>
#include <optional>
#include <vector>

#include "core/simd_level.h"
#include "core/surface/contour.h"
#include "core/surface/sample_masks.h"
#include "core/surface/scalar_field.h"

namespace strata {

using BrickPlace = std::array<int32_t, 2>;                  // i and j of a brick's least sample
using BrickPlanes = std::array<uint64_t, kFieldBrickSide>;  // a word a plane of constant k, bit 8 j + i

inline bool comes_before(const BrickPlace& a, const BrickPlace& b) { return a[1] != b[1] ? a[1] < b[1] : a[0] < b[0]; }

/// What samples are compared with: for every isovalue a level that those inside reach, and where surfaces are open at NaN then one that every
/// number reaches.
struct BrickLevels {
    /// throws  Error{usage}: isovalues not finite
    explicit BrickLevels(const ContourSettings& settings);

    uint64_t mask_of(float constant, size_t level) const {
        const bool inside = below ? constant <= values[level] : constant >= values[level];
        return inside ? ~uint64_t{0} : 0;
    }

    bool below;
    size_t isovalues;
    std::vector<float> values;
};

/// Bricks of a layer and for every level which of their samples are inside.
struct MaskedLayer {
    FieldBrickLayer layer;
    std::vector<BrickPlanes> masks;  // [level * bricks + brick]

    uint64_t bytes() const { return bytes_of(layer) + masks.size() * sizeof masks[0]; }
    static uint64_t bytes_of(const FieldBrickLayer& layer) {
        return layer.corners.size() * sizeof layer.corners[0] + layer.values.size() * sizeof layer.values[0];
    }
};

/// The layers of a field that are in memory, read in order, the next one perhaps while a surface is made of these.
class BrickLayerWindow {
public:
    /// make_room  before memory is taken: so many bytes; whether it must throw where they are too many
    BrickLayerWindow(FieldBrickSource& source, const ContourSettings& settings, const BrickLevels& levels,
                     std::function<void(uint64_t bytes, bool must)> make_room)
        : source_(source), settings_(settings), levels_(levels), make_room_(std::move(make_room)) {}

    /// Reads layers until one at k or above is there, or there is no more.
    /// throws  Error{malformed}: layers or bricks out of order; and what the source and make_room throw
    void read_to(int32_t k);
    bool empty() const { return layers_.empty(); }
    const FieldBrickLayer& first() const { return layers_.front().layer; }
    /// Null: that layer has no bricks.
    const MaskedLayer* at(int32_t k) const;
    /// The least layer above k that is there.
    std::optional<int32_t> next_above(int32_t k) const;
    void drop_below(int32_t k);

    /// Begins to read the next layer, if one like the last is no more than so many bytes. Slopes ask the source for values meanwhile: then it
    /// does not.
    void read_ahead(uint64_t room);

    uint64_t bytes() const;
    void drop_spare() { spare_ = {}; }
    const SampleStatistics& statistics() const { return statistics_; }

private:
    std::optional<MaskedLayer> next_layer(MaskedLayer used);
    void check(const FieldBrickLayer& layer) const;
    void find_masks(MaskedLayer& samples);
    uint64_t bytes_to_read() const;

    FieldBrickSource& source_;
    const ContourSettings& settings_;
    const BrickLevels& levels_;
    std::function<void(uint64_t, bool)> make_room_;
    const SimdLevel simd_level_ = best_simd_level();
    std::deque<MaskedLayer> layers_;  // ascending
    MaskedLayer spare_;               // its memory is used again
    std::future<std::optional<MaskedLayer>> ahead_;
    bool ended_ = false;
    int32_t last_k_ = std::numeric_limits<int32_t>::min();
    SampleStatistics statistics_;
};

}  // namespace strata
