#include "core/surface/surface_report.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>

namespace strata {
void SurfaceMeter::add_vertices(uint64_t count) {
    for (uint64_t left = count; left > 0;) {
        const std::span<uint32_t> added = parents_.grow(left);
        std::fill(added.begin(), added.end(), kUnused);
        left -= added.size();
    }
    edges_.add_vertices(count);
    report_.vertices += count;
}

// Where the way is long, it is half as long the next time.
uint32_t SurfaceMeter::root_of(uint32_t vertex) {
    for (;;) {
        const uint32_t parent = parents_[vertex];
        if (parent == vertex) return vertex;
        const uint32_t next = parents_[parent];
        if (next == parent) return parent;
        parents_.set(vertex, next);
        vertex = next;
    }
}

void SurfaceMeter::add_face(std::span<const uint32_t> corners, std::span<const Vec3d> positions) {
    const size_t count = corners.size();
    ++(count == 4 ? report_.quads : report_.triangles);
    bool degenerate = false;
    for (size_t i = 0; i < count; ++i)
        for (size_t j = 0; j < i; ++j) degenerate |= corners[i] == corners[j];
    if (degenerate) {
        ++report_.degenerate_faces;
        return;
    }
    if (used_vertices_ == 0) reference_ = positions[0];
    for (size_t i = 0; i < count; ++i) {
        if (parents_[corners[i]] == kUnused) {
            parents_.set(corners[i], corners[i]);
            ++used_vertices_;
            ++report_.components;
            report_.bounds.extend(positions[i]);
        }
        edges_.add(corners[i], corners[i + 1 == count ? 0 : i + 1]);
    }
    edges_.face_done();
    uint32_t root = root_of(corners[0]);
    for (size_t i = 1; i < count; ++i) {
        const uint32_t other = root_of(corners[i]);
        if (other == root) continue;
        parents_.set(std::max(root, other), std::min(root, other));
        root = std::min(root, other);
        --report_.components;
    }
    const Vec3d a = positions[0] - reference_;
    for (size_t i = 2; i < count; ++i) {
        const Vec3d b = positions[i - 1] - reference_, c = positions[i] - reference_;
        report_.area += 0.5 * (b - a).cross(c - a).norm();
        six_volumes_ += a.dot(b.cross(c));
    }
}

SurfaceReport SurfaceMeter::report() {
    SurfaceReport report = report_;
    report.unused_vertices = report.vertices - used_vertices_;
    const EdgeCounts edges = edges_.count();
    report.edges = edges.edges;
    report.boundary_edges = edges.boundary;
    report.nonmanifold_edges = edges.nonmanifold;
    report.flipped_edges = edges.flipped;
    report.open_edges = edges.open;
    const uint64_t faces = report.triangles + report.quads - report.degenerate_faces;
    report.euler_characteristic = int64_t(used_vertices_) - int64_t(report.edges) + int64_t(faces);
    report.volume = six_volumes_ / 6.0;
    return report;
}

MeasuredSurface::MeasuredSurface(SurfaceSink* next, ScratchStore* scratch, uint64_t memory_bytes, bool keep_edges)
    : next_(next),
      scratch_(scratch ? std::optional<ScratchRoom>(*scratch) : std::nullopt),
      positions_(scratch_ ? &*scratch_ : nullptr, memory_bytes / 3),
      meter_(keep_edges, scratch_ ? &*scratch_ : nullptr, memory_bytes - memory_bytes / 3) {}

void MeasuredSurface::add(const SurfacePiece& piece) {
    positions_.append(piece);
    meter_.add_vertices(piece.positions.size());
    std::array<Vec3d, 4> positions;
    const auto add_face = [&](std::span<const uint32_t> corners) {
        for (size_t i = 0; i < corners.size(); ++i) positions[i] = positions_[corners[i]];
        meter_.add_face(corners, std::span(positions).first(corners.size()));
    };
    for (const std::array<uint32_t, 3>& triangle : piece.triangles) add_face(triangle);
    for (const std::array<uint32_t, 4>& quad : piece.quads) add_face(quad);
    if (next_) next_->add(piece);
}

SurfaceReport measure_surface(const TriangleMesh& mesh) {
    SurfaceMeter meter(true);
    meter.add_vertices(mesh.positions.size());
    for (const std::array<uint32_t, 3>& triangle : mesh.triangles)
        meter.add_face(triangle, std::array{mesh.positions[triangle[0]], mesh.positions[triangle[1]], mesh.positions[triangle[2]]});
    return meter.report();
}

}  // namespace strata
