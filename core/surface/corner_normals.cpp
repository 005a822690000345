#include "core/surface/corner_normals.h"

#include <Eigen/Geometry>
#include <span>

#include "core/parallel.h"

namespace strata {
namespace {

constexpr size_t kBlock = 1 << 14;
constexpr float kHalfCreaseCosine = 0.92387953f;  // directions so near to one are all within a crease of each other
constexpr float kNearCosine = 0.71933980f;       // 44 degrees: the mean of two sides of a box is 45 from each
constexpr float kSameSine = 0.0087265355f;       // half a degree
constexpr size_t kMostCompared = 64;  // triangles at a vertex; of more, each is compared with their mean alone

// As long as twice the area.
Vec3d area_normal(const TriangleMesh& mesh, size_t triangle) {
    const auto& [a, b, c] = mesh.triangles[triangle];
    const Vec3d& p = mesh.positions[a];
    return (mesh.positions[b] - p).cross(mesh.positions[c] - p);
}

// Of length 1, or zero.
Vec3f face_normal(const TriangleMesh& mesh, size_t triangle) {
    const Vec3d normal = area_normal(mesh, triangle);
    const double length = normal.norm();
    if (!(length > 0.0 && std::isfinite(length))) return Vec3f::Zero();
    return (normal / length).cast<float>();
}

float corner_angle(const TriangleMesh& mesh, size_t triangle, size_t corner) {
    const std::array<uint32_t, 3>& t = mesh.triangles[triangle];
    const Vec3d& p = mesh.positions[t[corner]];
    const Vec3d u = mesh.positions[t[(corner + 1) % 3]] - p, v = mesh.positions[t[(corner + 2) % 3]] - p;
    const double inverse = 1.0 / std::sqrt(u.squaredNorm() * v.squaredNorm());
    const float cosine = float(u.dot(v) * inverse);
    if (std::abs(cosine) < 0.9f) return std::acos(cosine);
    const float angle = std::asin(float(std::min(u.cross(v).norm() * inverse, 1.0)));  // of a small angle the cosine says nothing
    return cosine > 0.0f ? angle : float(M_PI) - angle;
}

// Corners by their vertex, and then by their triangle.
struct CornerLists {
    std::vector<uint64_t> ends;      // [vertices] of the vertex's corners
    std::vector<uint64_t> corners;   // 3 * triangle + corner

    explicit CornerLists(const TriangleMesh& mesh) : ends(mesh.positions.size(), 0), corners(3 * mesh.triangles.size()) {
        for (const auto& triangle : mesh.triangles)
            for (const uint32_t vertex : triangle) ++ends[vertex];
        uint64_t sum = 0;
        for (uint64_t& end : ends) {
            const uint64_t count = end;
            end = sum;
            sum += count;
        }
        for (size_t i = 0; i < corners.size(); ++i) corners[ends[mesh.triangles[i / 3][i % 3]]++] = i;
    }
    std::span<const uint64_t> of(size_t vertex) const {
        const uint64_t begin = vertex == 0 ? 0 : ends[vertex - 1];
        return std::span(corners).subspan(begin, ends[vertex] - begin);
    }
};

// The corners of one vertex after the other.
class VertexNormals {
public:
    VertexNormals(const TriangleMesh& mesh, std::span<const Vec3f> faces, std::vector<uint32_t>& out) : mesh_(mesh), faces_(faces), out_(out) {}

    void find(size_t vertex, std::span<const uint64_t> corners) {
        Vec3f stored = mesh_.normals.empty() ? Vec3f(Vec3f::Zero()) : mesh_.normals[vertex];
        const float length = stored.stableNorm();
        stored = length > 0.0f && std::isfinite(length) ? Vec3f(stored / length) : Vec3f(Vec3f::Zero());
        if (!is_near_all(corners, stored) && is_mean_of(corners, stored)) stored.setZero();
        bool missing = false;
        for (const uint64_t corner : corners) {
            const Vec3f& face = faces_[corner / 3];
            const float cosine = stored.dot(face);
            const bool known = std::abs(cosine) >= kStoredCosine;
            out_[corner] = known ? pack_normal(cosine > 0.0f ? stored : Vec3f(-stored)) : kNoNormal;
            missing |= !known && !face.isZero();
        }
        if (missing) estimate(corners);
    }

private:
    bool is_near_all(std::span<const uint64_t> corners, const Vec3f& stored) const {
        return std::all_of(corners.begin(), corners.end(), [&](uint64_t corner) { return faces_[corner / 3].isZero() || std::abs(stored.dot(faces_[corner / 3])) >= kNearCosine; });
    }

    // Whether it is what programs make of the triangles at a vertex, be they weighted by their angles there, by their areas or alike.
    bool is_mean_of(std::span<const uint64_t> corners, const Vec3f& stored) const {
        Vec3d by_angle = Vec3d::Zero(), by_area = Vec3d::Zero(), alike = Vec3d::Zero();
        for (const uint64_t corner : corners) {
            if (faces_[corner / 3].isZero()) continue;
            const Vec3d face = faces_[corner / 3].cast<double>();
            by_angle += corner_angle(mesh_, corner / 3, corner % 3) * face;
            by_area += area_normal(mesh_, corner / 3);
            alike += face;
        }
        for (const Vec3d& mean : {by_angle, by_area, alike})
            if (stored.cast<double>().cross(mean).norm() < kSameSine * mean.norm()) return true;
        return false;
    }

    void estimate(std::span<const uint64_t> corners) {
        weighted_.clear();
        Vec3f sum = Vec3f::Zero();
        for (const uint64_t corner : corners) {
            const Vec3f& face = faces_[corner / 3];
            weighted_.push_back(face.isZero() ? face : Vec3f(corner_angle(mesh_, corner / 3, corner % 3) * face));
            sum += weighted_.back();
        }
        const Vec3f mean = sum.stableNormalized();
        bool together = true;
        for (const uint64_t corner : corners) together &= faces_[corner / 3].isZero() || mean.dot(faces_[corner / 3]) >= kHalfCreaseCosine;
        const uint32_t packed_mean = pack_normal(mean);
        for (const uint64_t corner : corners) {
            const Vec3f& face = faces_[corner / 3];
            if (out_[corner] != kNoNormal || face.isZero()) continue;
            if (together)
                out_[corner] = packed_mean;
            else if (corners.size() <= kMostCompared)
                out_[corner] = pack_normal(sum_near(face, corners));
            else
                out_[corner] = pack_normal(mean.dot(face) >= kCreaseCosine ? mean : face);
        }
    }

    Vec3f sum_near(const Vec3f& face, std::span<const uint64_t> corners) const {
        Vec3f sum = Vec3f::Zero();
        for (size_t i = 0; i < corners.size(); ++i) {
            const float cosine = face.dot(faces_[corners[i] / 3]);
            if (std::abs(cosine) >= kCreaseCosine) sum += cosine > 0.0f ? weighted_[i] : Vec3f(-weighted_[i]);
        }
        return sum;
    }

    const TriangleMesh& mesh_;
    std::span<const Vec3f> faces_;
    std::vector<uint32_t>& out_;
    std::vector<Vec3f> weighted_;  // of the vertex's corners
};

}  // namespace

uint32_t pack_normal(const Vec3f& normal) {
    const float sum = std::abs(normal.x()) + std::abs(normal.y()) + std::abs(normal.z());
    if (!(sum > 0.0f)) return pack_normal(Vec3f::UnitZ());
    float u = normal.x() / sum, v = normal.y() / sum;
    if (normal.z() < 0.0f) {
        const float folded = (1.0f - std::abs(v)) * (u >= 0.0f ? 1.0f : -1.0f);
        v = (1.0f - std::abs(u)) * (v >= 0.0f ? 1.0f : -1.0f);
        u = folded;
    }
    const auto code = [](float part) { return uint32_t(uint16_t(int16_t(std::lround(part * 32767.0f)))); };
    return code(u) | code(v) << 16;
}

std::vector<uint32_t> corner_normals(const TriangleMesh& mesh, int threads) {
    std::vector<Vec3f> faces(mesh.triangles.size());
    parallel_blocks(threads, faces.size(), kBlock, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) faces[i] = face_normal(mesh, i);
    });
    const CornerLists lists(mesh);
    std::vector<uint32_t> corners(3 * mesh.triangles.size());
    parallel_blocks(threads, mesh.positions.size(), kBlock, [&](size_t begin, size_t end) {
        VertexNormals vertices(mesh, faces, corners);
        for (size_t i = begin; i < end; ++i) vertices.find(i, lists.of(i));
    });
    return corners;
}

}  // namespace strata
