#pragma once

#include "app/progress.h"
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

}  // namespace strata
