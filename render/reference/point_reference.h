#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/math/camera.h"
#include "core/octree/layered_cloud.h"
#include "render/image.h"
#include "render/point_color.h"
#include "render/reference/neighbor_tree.h"

namespace strata {

/// A picture of the reference. Colors are those of 16 samples a pixel, averaged in linear light.
struct ReferencePicture {
    Image image;
    std::vector<float> depths;  // [pixels] eye depth, median of the samples; kNoDepth where most show background
};

/// The best picture that we know to make of a cloud, slowly: what the pictures of the rasterizer are measured against.
///
/// Every point is drawn, without levels of detail, as a disc that its kNeighbors nearest neighbors decide. Where they lie in a
/// plane, the disc lies in that plane, and reaches 0.8 of the way to the nearest neighbor in the emptiest of the four quarters
/// around it: between scan lines, or strips of different density, as far as is needed and no farther. Where they leave a quarter
/// empty, 96 neighbors are asked if they lie in a plane; a quarter that stays empty is an edge, and then the second emptiest counts.
/// Elsewhere (leaves, wires, poles) a disc faces the eye and reaches the second neighbor. A disc in the plane of the surface
/// has the surface's own depth at every sample, however it is tilted, and needs no bulge to meet its neighbors.
///
/// Of the discs that a sample's ray meets, the front ones are those no farther than the nearest by more than that one's
/// radius; of these the sample shows the one whose center is nearest to where the ray meets it, and has its depth there.
/// So on a surface each point colors the places that are nearer to it than to other points, and noise in depth decides
/// nothing. Discs reach up to a radius beyond the edges of what was scanned; that error is the reference's own, and so are
/// gaps where scan lines lie more than a few of their points' distances apart.
///
/// All in double precision, with a projection of its own, so that faults of the rasterizer's are seen. The picture does
/// not depend on the number of threads.
class PointReference {
public:
    static constexpr size_t kNeighbors = 16;  // discs of random points then leave about e^-8 of a surface open
    static constexpr uint32_t kSamplesSide = 4;   // samples along a pixel's side

    /// Reads the whole cloud. colors  as the pictures to compare have them
    /// throws  what the cloud throws
    /// cost    about 150 bytes and 7 µs of processor time a point
    PointReference(LayeredCloud& cloud, const PointColorizer& colors, int threads);

    /// cost  O(points + samples covered), under 1 µs a point at 640 x 360
    ReferencePicture draw(const Camera& camera, uint32_t width, uint32_t height, Rgba8 background, int threads) const;

    /// Whether the cloud has a point there: the nearest one's splat reaches p.
    bool reaches(const Vec3d& p) const;

    size_t size() const { return splats_.size(); }

private:
    struct Splat {
        Vec3d center;  // world
        Vec3d normal;  // of length 1; zero: faces the eye
        double radius;
        Rgba8 color;
    };

    std::vector<Splat> splats_;
    std::unique_ptr<NeighborTree> tree_;
};

}  // namespace strata
