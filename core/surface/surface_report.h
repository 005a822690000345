#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "core/math/box.h"
#include "core/math/vec.h"
#include "core/surface/edge_table.h"
#include "core/surface/paged_array.h"
#include "core/surface/surface_sink.h"
#include "core/surface/triangle_mesh.h"
#include "core/surface/vertex_positions.h"

namespace strata {

/// What a surface is like, by its faces: vertices are the same where their numbers are, not where they coincide.
struct SurfaceReport {
    uint64_t vertices = 0, unused_vertices = 0;  // those that no face has
    uint64_t triangles = 0, quads = 0;
    uint64_t degenerate_faces = 0;  // of these, such that have a vertex twice; they count in nothing that follows
    uint64_t components = 0;        // parts of which no two have a vertex in common
    uint64_t edges = 0;
    uint64_t boundary_edges = 0;    // with one face
    uint64_t nonmanifold_edges = 0; // with more than two
    uint64_t flipped_edges = 0;     // with two that turn opposite ways
    uint64_t open_edges = 0;        // that are not used as often one way as the other
    int64_t euler_characteristic = 0;
    double area = 0.0;
    double volume = 0.0;            // enclosed, where is_closed(); negative: inside out
    Box3d bounds;                   // of vertices that faces have

    /// Encloses a volume; cubes that touch along an edge do, although four faces have it.
    bool is_closed() const { return open_edges == 0; }
    bool is_manifold() const { return open_edges == 0 && nonmanifold_edges == 0; }
};

/// Measures a surface as it grows, through memory of a given size and a scratch store, whatever the order of its faces: 32 bytes for each
/// vertex of the last two runs, 18 to 54 for each edge of earlier ones that is open, and 4 for each vertex, to know its component by. A run is
/// some pieces of 65,536 faces or of half as many as such edges, if that is more, or fewer where memory asks for it. A third face that comes to an
/// edge after that, which a surface by isovalues never has, is taken for a boundary; with keep_edges all edges are kept, 9 bytes each in the store, and none is.
class SurfaceMeter {
public:
    /// scratch       for what does not fit; null: all stays in memory
    /// memory_bytes  beside what two pieces add to EdgeTable
    explicit SurfaceMeter(bool keep_edges = false, ScratchRoom* scratch = nullptr, uint64_t memory_bytes = 0)
        : edges_(keep_edges, scratch, memory_bytes - memory_bytes / 4), parents_(scratch, memory_bytes / 4) {}

    void add_vertices(uint64_t count);
    /// corners    3 or 4 vertices that were added, counterclockwise seen from outside
    /// positions  [corners] world
    void add_face(std::span<const uint32_t> corners, std::span<const Vec3d> positions);

    /// Of the faces up to here.
    SurfaceReport report();

private:
    static constexpr uint32_t kUnused = 0xFFFFFFFF;

    uint32_t root_of(uint32_t vertex);

    SurfaceReport report_;  // what is counted as it comes
    EdgeTable edges_;
    PagedArray<uint32_t, 16'384> parents_;  // [vertices] towards the root of its component, the least vertex; kUnused: no face has it
    uint64_t used_vertices_ = 0;
    Vec3d reference_ = Vec3d::Zero();  // world: volumes are summed about it, so that far from 0 nothing cancels
    double six_volumes_ = 0.0;
};

/// Measures a surface on its way to another sink, and keeps the places of its vertices, as positions() has them up to the piece that is handed on.
class MeasuredSurface : public SurfaceSink {
public:
    /// next     what gets the pieces; null: nothing does
    /// scratch       for places of vertices, and what SurfaceMeter keeps; null: all in memory
    /// memory_bytes  for both
    /// keep_edges    as of SurfaceMeter
    MeasuredSurface(SurfaceSink* next, ScratchStore* scratch, uint64_t memory_bytes, bool keep_edges = false);
    MeasuredSurface(const MeasuredSurface&) = delete;
    MeasuredSurface& operator=(const MeasuredSurface&) = delete;

    void set_next(SurfaceSink* next) { next_ = next; }
    VertexPositions& positions() { return positions_; }
    SurfaceReport report() { return meter_.report(); }

    void add(const SurfacePiece& piece) override;

private:
    SurfaceSink* next_;
    std::optional<ScratchRoom> scratch_;
    VertexPositions positions_;
    SurfaceMeter meter_;
};

/// Measures a mesh, keeping all of its edges.
SurfaceReport measure_surface(const TriangleMesh& mesh);

}  // namespace strata
