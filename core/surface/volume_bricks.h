#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/octree/scratch_store.h"
#include "core/surface/contour.h"
#include "core/surface/cube_brick_source.h"

namespace strata {

struct VolumeBricksSettings {
    std::string place = {};  // of the volume, for messages: "labels.nrrd"
    double isovalue = 0.0;  // samples on the inside of it are cells
    ContourInside inside = ContourInside::above;
    /// Samples are labels in place of that: each value that is not 0 is a material; called once for each, in the order in which they come.
    std::function<VoxelColor(int32_t label)> color_of;
    uint64_t label_bytes = 0;  // that the caller keeps of each label, which count, too
    uint64_t memory_bytes = std::numeric_limits<uint64_t>::max();
    uint64_t memory_parts = 1;        // memory_bytes is one of so many of what was given: errors speak of that
    ScratchStore* scratch = nullptr;  // for bricks that do not fit; null: they must
};

/// A material of a volume of labels.
struct VolumeLabel {
    int32_t value = 0;
    VoxelColor color = {};
    uint64_t cells = 0;
};

/// The samples of a volume as cells, each sample the center of its own: in bricks of 64^3, k slowest. What is not a number is no cell.
/// cost  4 nanoseconds a sample; memory: 1 bit a sample of the bricks that the surface crosses, with labels where a brick has several 1 byte more, or 4
///       beyond the 256th label; while it is made, as much for all bricks of a layer
class VolumeBricks : public CubeBrickSource {
public:
    static constexpr uint64_t kMostLabels = uint64_t{1} << 20;  // but 0; far fewer than there are colors

    /// Reads all slices.
    /// throws  what the source throws; Error{limit}: more memory than allowed, more labels than kMostLabels,
    ///         slices of more than 2^40 samples or more than 2^32 - 1 bricks
    ///         Error{malformed}: labels that are no whole numbers of less than 2^24, with the sample's place
    VolumeBricks(SliceSource& source, const VolumeBricksSettings& settings);
    ~VolumeBricks() override;

    const std::vector<VolumeLabel>& labels() const { return labels_; }
    uint64_t nan_samples() const { return nan_samples_; }

    const GridPlacement& placement() const override { return placement_; }
    bool has_colors() const override { return bool(settings_.color_of); }
    uint64_t cells() const override { return cells_; }
    size_t size() const override;
    uint64_t memory_bytes() const override { return held_bytes_; }
    std::string_view advice() const override { return "a coarser volume needs less"; }
    std::array<uint32_t, 3> place(size_t brick) const override;
    size_t find(const std::array<int64_t, 3>& place) const override;
    bool gather(size_t brick, const CubeMaterials& materials, CubeBrick& out) const override;

private:
    struct Brick;
    struct Layer;
    struct Data;

    void read_slice(std::span<const float> values, uint32_t k, Layer& layer);
    void read_labels(std::span<const float> values, uint32_t k, Layer& layer);
    uint32_t label_number(float value, uint32_t i, uint32_t j, uint32_t k);
    void finish_layer(Layer& layer, uint32_t place);
    void keep(Brick& brick, std::span<const uint64_t> bits, std::span<const uint32_t> numbers);
    void hold(uint64_t bytes);
    [[noreturn]] void fail(ErrorKind kind, const std::string& message) const;
    Data load(size_t brick) const;

    VolumeBricksSettings settings_;
    GridPlacement placement_;
    std::array<uint32_t, 3> size_, bricks_an_axis_;
    std::vector<Brick> bricks_;
    std::vector<uint32_t> index_;  // 1 + the brick at a place, i fastest; 0: none
    std::vector<VolumeLabel> labels_;
    std::map<int32_t, uint32_t> label_numbers_;
    float last_value_ = 0.0f;  // and its label's number: the next sample's is mostly the same
    uint32_t last_number_ = 0;
    uint64_t cells_ = 0, nan_samples_ = 0, held_bytes_ = 0, scratch_bytes_ = 0;
};

}  // namespace strata
