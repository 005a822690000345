#pragma once

#include "app/progress.h"
#include "core/math/box.h"
#include "core/surface/scalar_field.h"

namespace strata {

/// Slices of a volume on their way to the surface, with a line of progress.
class SlicesWithProgress : public SliceSource {
public:
    SlicesWithProgress(SliceSource& source, ProgressLine& progress) : source_(source), progress_(progress) {}
    const GridPlacement& placement() const override { return source_.placement(); }
    std::array<uint32_t, 3> size() const override { return source_.size(); }
    void read(uint32_t count, double reference, std::span<float> out) override {
        source_.read(count, reference, out);
        progress_.update("surface", done_ += out.size(), uint64_t{size()[0]} * size()[1] * size()[2]);
    }

private:
    SliceSource& source_;
    ProgressLine& progress_;
    uint64_t done_ = 0;
};

/// The box of the cells around a volume's samples, of which some may be left out; world.
/// beyond  samples that it reaches beyond the outermost ones
inline Box3d box_around(const SliceSource& volume, double beyond) {
    Box3d box;
    for (int corner = 0; corner < 8; ++corner) {
        Vec3d index;
        for (int axis = 0; axis < 3; ++axis) index[axis] = corner >> axis & 1 ? volume.size()[size_t(axis)] - 1.0 + beyond : -beyond;
        box.extend(volume.placement().world_from_index(index));
    }
    return box;
}

}  // namespace strata
