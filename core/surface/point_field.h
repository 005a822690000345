#pragma once

#include "core/surface/point_window.h"
#include "core/surface/scalar_field.h"

namespace strata {

/// What fields made of points have in common: layers of bricks, each of the points of its own layer and of those below and above it.
class PointField : public FieldBrickSource {
public:
    /// Layers of points that a surface's pieces may still ask for.
    PointWindow& window() { return window_; }
    /// throws  Error{limit}: the bricks of one layer do not fit
    bool next_layer(FieldBrickLayer& out) override;

protected:
    virtual size_t layers() const = 0;
    /// Reads the points of a layer in place of those three below; there may be none of that number.
    virtual void load(size_t layer) = 0;
    virtual bool has_points_near() const = 0;
    /// Makes the bricks of layer next(), for which points are near; `out` has its k.
    virtual void fill(FieldBrickLayer& out) = 0;

    size_t next() const { return next_; }

    PointWindow window_;

private:
    size_t next_ = 0;
};

}  // namespace strata
