#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/math/box.h"
#include "core/math/vec.h"
#include "core/surface/large_array.h"
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

/// How often each edge was met, and in which direction. Edges of the vertices of late are kept at the lesser one, where neighbors are near
/// each other in memory; those of earlier ones in a hash table, but for edges with two faces that agree, which are forgotten.
class EdgeTable {
public:
    /// keep_all  forget none: 32 bytes a vertex
    explicit EdgeTable(bool keep_all) : keep_all_(keep_all) {}

    /// Before the faces that use them.
    void add_vertices(uint64_t count);
    void add(uint32_t from, uint32_t to);
    /// After each face.
    void face_done() { ++faces_in_run_; }

    uint64_t edges() const { return edges_; }
    uint64_t memory_bytes() const { return late_.size() * sizeof(Star) + early_.keys.size() * sizeof early_.keys[0] + early_.states.size(); }
    /// Adds what edges that are not forgotten are to a report.
    void count(SurfaceReport& report) const;

private:
    static constexpr size_t kAtVertex = 6;
    /// The edges from a vertex to greater ones; half of all, which are 6 on average, and others in the hash table.
    struct Star {
        std::array<uint32_t, kAtVertex> ends;
        std::array<uint8_t, kAtVertex> states;
        uint16_t count;
    };
    struct Slots {
        std::vector<uint64_t> keys;  // lesser vertex above greater; kFree
        std::vector<uint8_t> states;
        size_t used = 0;
    };
    static size_t slot_of(const Slots& slots, uint64_t key);
    uint8_t& state_of(uint32_t least, uint32_t greatest);
    uint8_t& early_state_of(uint64_t key);
    void end_run();
    void move_to(size_t capacity, bool forget);

    // Of a state: bits 0-2: times met from the lesser vertex, 3-5: from the greater; 6-7: the last run, in the hash table.
    bool keep_all_;
    uint32_t first_late_ = 0;     // vertex
    uint32_t first_of_run_ = 0;   // likewise: those that came in this run
    LargeArray<Star> late_;       // from first_late_ on
    Slots early_;
    uint64_t edges_ = 0;
    uint64_t faces_in_run_ = 0;
    uint8_t run_ = 0;  // modulo 4
};

/// Measures a surface as it grows. Takes 4.1 bytes a vertex, 32 bytes for each vertex of the last two runs, and 18 to 36 for each edge of
/// earlier ones that is open, be it for good; 54 while their table grows. A run is some pieces of 65,536 faces or of half as many as
/// such edges, if that is more: of a closed surface a small part, of quads that share no vertices most. Measured at 10 million
/// vertices: 5 bytes each, and of such quads 41, with 58 at the worst moment. A third face that comes to an edge after more
/// than a run is taken for a boundary; with keep_edges all edges are kept and none is.
class SurfaceMeter {
public:
    explicit SurfaceMeter(bool keep_edges = false) : edges_(keep_edges) {}

    void add_vertices(uint64_t count);
    /// corners    3 or 4 vertices that were added, counterclockwise seen from outside
    /// positions  [corners] world
    void add_face(std::span<const uint32_t> corners, std::span<const Vec3d> positions);

    SurfaceReport report() const;

private:
    uint32_t root_of(uint32_t vertex);

    SurfaceReport report_;  // what is counted as it comes
    EdgeTable edges_;
    LargeArray<uint32_t> parents_;   // [vertices] towards the root of its component; of what no face has, itself
    std::vector<bool> used_;         // [vertices]
    uint64_t used_vertices_ = 0;
    Vec3d reference_ = Vec3d::Zero();  // world: volumes are summed about it, so that far from 0 nothing cancels
    double six_volumes_ = 0.0;
};

/// Measures a surface on its way to another sink, and keeps the places of its vertices, as positions() has them up to the piece that is handed on.
class MeasuredSurface : public SurfaceSink {
public:
    /// next     what gets the pieces; null: nothing does
    /// scratch  for places of vertices; null: all in memory
    MeasuredSurface(SurfaceSink* next, ScratchStore* scratch, uint64_t memory_bytes) : next_(next), positions_(scratch, memory_bytes) {}

    void set_next(SurfaceSink* next) { next_ = next; }
    VertexPositions& positions() { return positions_; }
    SurfaceReport report() const { return meter_.report(); }

    void add(const SurfacePiece& piece) override;

private:
    SurfaceSink* next_;
    VertexPositions positions_;
    SurfaceMeter meter_;
};

/// Measures a mesh, keeping all of its edges.
SurfaceReport measure_surface(const TriangleMesh& mesh);

}  // namespace strata
