#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>

#include "render/pass/mesh_kernel.h"

namespace strata {

class EglContext;

/// Rasterizes triangles with OpenGL: the twin of the kernels in mesh_kernel.h, which leaves the same words. The context must be current while this lives.
class MeshGlPass {
public:
    /// Draws a trial: OpenGL leaves it to the driver which triangle a pixel on an edge belongs to, and how corners are rounded.
    /// throws  Error{device} where the driver does not take the shaders, or draws otherwise than the kernels
    explicit MeshGlPass(const EglContext& context);
    ~MeshGlPass();

    /// Bytes of the GPU's memory for a mesh; pixels take 12 each, at most 48 MiB.
    static uint64_t gpu_bytes(uint64_t vertices, uint64_t triangles) { return sizeof(ProjectedVertex) * vertices + sizeof(std::array<uint32_t, 3>) * triangles; }
    /// Whether a mesh of that size fits into its buffers.
    bool takes(uint64_t vertices, uint64_t triangles) const;

    /// A mesh as this knows it again.
    struct Mesh {
        uint64_t serial;  // of what its triangles are; 0: nobody else has it
        std::span<const std::array<uint32_t, 3>> triangles;
        std::span<const ProjectedVertex> vertices;
    };
    /// Draws into words, whatever they hold, all triangles whose corners the reach holds.
    /// throws  Error{device} where the GPU has no room
    void draw(const Mesh& mesh, const MeshTarget& target);

    /// Coordinates that corners may have in a picture of some size, 1/256 pixel.
    struct Reach {
        int32_t middle_x, middle_y, size;
        bool holds(const ProjectedVertex& v) const {
            return v.x != kUnsnapped && v.x >= middle_x - size && v.x <= middle_x + size && v.y >= middle_y - size && v.y <= middle_y + size;
        }
    };
    Reach reach(const MeshTarget& target) const;

private:
    struct Resources;
    std::unique_ptr<Resources> resources_;
};

}  // namespace strata
