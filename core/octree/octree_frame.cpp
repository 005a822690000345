#include "core/octree/octree_frame.h"

namespace strata {

OctreeFrame make_octree_frame(const Quantization& quantization, const Vec3i& min_quanta, const Vec3i& max_quanta) {
    OctreeFrame frame;
    frame.min_quanta = min_quanta;
    frame.max_quanta = max_quanta;
    const Eigen::Matrix<int64_t, 3, 1> extent = max_quanta.cast<int64_t>() - min_quanta.cast<int64_t>();
    while (frame.coarsening_bits < 2 && (extent.maxCoeff() >> frame.coarsening_bits) + 1 >= int64_t{1} << 31)
        ++frame.coarsening_bits;
    frame.scale = quantization.scale * std::ldexp(1.0, frame.coarsening_bits);
    frame.side = 0.0;
    for (int axis = 0; axis < 3; ++axis)
        frame.side = std::max(frame.side, double(frame.stored(axis, max_quanta[axis]) + int64_t{1}) * frame.scale[axis]);
    for (int axis = 0; axis < 3; ++axis) frame.cells_per_quantum[axis] = 0x1p31 * (frame.scale[axis] / frame.side);
    return frame;
}

}  // namespace strata
