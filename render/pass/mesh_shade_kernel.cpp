#include "render/pass/mesh_shade_kernel.h"

#include <cmath>

#include "core/simd_target.h"
#include "core/surface/corner_normals.h"

namespace strata {
namespace {

struct Unit {
    float x, y, z;
};

// As unpack_normal.
inline Unit unpacked(uint32_t packed) {
    const float u = float(int32_t(packed << 16) >> 16) * (1.0f / 32767.0f), v = float(int32_t(packed) >> 16) * (1.0f / 32767.0f);
    const float z = 1.0f - std::abs(u) - std::abs(v), fold = z < 0.0f ? -z : 0.0f;
    const float x = u >= 0.0f ? u - fold : u + fold, y = v >= 0.0f ? v - fold : v + fold;
    const float inverse = 1.0f / std::sqrt(x * x + y * y + z * z);
    return {x * inverse, y * inverse, z * inverse};
}

template <bool perspective>
inline void meet(const MeshProjection& view, ShadeBlock& block) {
    const double fx = view.forward[0], fy = view.forward[1], fz = view.forward[2];
    const double below = block.y_px - view.center_y;
    const double below_x = below * view.down[0], below_y = below * view.down[1], below_z = below * view.down[2];
    for (size_t i = 0; i < kShadeBlock; ++i) {
        const double ax = block.corners[0][i] - view.eye[0], ay = block.corners[1][i] - view.eye[1], az = block.corners[2][i] - view.eye[2];
        // To the second corner and the third.
        const double bx = block.corners[3][i] - view.eye[0] - ax, by = block.corners[4][i] - view.eye[1] - ay, bz = block.corners[5][i] - view.eye[2] - az;
        const double cx = block.corners[6][i] - view.eye[0] - ax, cy = block.corners[7][i] - view.eye[1] - ay, cz = block.corners[8][i] - view.eye[2] - az;
        const double right = block.x_px[i] - view.center_x;
        const double aside_x = right * view.right[0] + below_x, aside_y = right * view.right[1] + below_y, aside_z = right * view.right[2] + below_z;
        const double dx = perspective ? fx + aside_x : fx, dy = perspective ? fy + aside_y : fy, dz = perspective ? fz + aside_z : fz;
        const double tx = perspective ? -ax : aside_x - ax, ty = perspective ? -ay : aside_y - ay, tz = perspective ? -az : aside_z - az;
        const double px = dy * cz - dz * cy, py = dz * cx - dx * cz, pz = dx * cy - dy * cx;
        const double qx = ty * bz - tz * by, qy = tz * bx - tx * bz, qz = tx * by - ty * bx;
        const double det = bx * px + by * py + bz * pz, over_b = tx * px + ty * py + tz * pz, over_c = dx * qx + dy * qy + dz * qz;
        const double inverse = 1.0 / det;

        // Where corners are rounded, a pixel's center may lie beside its triangle. No numbers, of a triangle that is seen from its side, become 0.
        double b = over_b * inverse, c = over_c * inverse;
        b = b > 0.0 ? b : 0.0;
        c = c > 0.0 ? c : 0.0;
        b = b < 1.0 ? b : 1.0;
        c = c < 1.0 ? c : 1.0;
        const double sum = b + c, scale = sum > 1.0 ? 1.0 / sum : 1.0;
        b *= scale;
        c *= scale;
        const double a = 1.0 - b - c, positive_a = a > 0.0 ? a : 0.0;
        block.weights[0][i] = float(positive_a);
        block.weights[1][i] = float(b);
        block.weights[2][i] = float(c);
        block.z[i] = block.corners[2][i] + b * bz + c * cz;

        const double at_first = fx * ax + fy * ay + fz * az, to_b = fx * bx + fy * by + fz * bz, to_c = fx * cx + fy * cy + fz * cz;
        const double least_way = to_b < to_c ? to_b : to_c, most_way = to_b > to_c ? to_b : to_c;
        const double least = at_first + (least_way < 0.0 ? least_way : 0.0), most = at_first + (most_way > 0.0 ? most_way : 0.0);
        const double on_plane = at_first + (over_b * to_b + over_c * to_c) * inverse, within = at_first + b * to_b + c * to_c;
        double depth = on_plane - on_plane == 0.0 ? on_plane : within;
        depth = depth > least ? depth : least;
        depth = depth < most ? depth : most;
        depth = depth > view.near_depth ? depth : view.near_depth;
        block.depth[i] = float(depth);

        // Scaled first, as squares of small triangles may vanish.
        const double nx = by * cz - bz * cy, ny = bz * cx - bx * cz, nz = bx * cy - by * cx;
        double largest = std::abs(nx) > std::abs(ny) ? std::abs(nx) : std::abs(ny);
        largest = largest > std::abs(nz) ? largest : std::abs(nz);
        const bool front = det >= 0.0, has_area = (largest > 0.0) & (largest < 1e300);
        const double size = has_area ? 1.0 / largest : 1.0, side = front ? 1.0 : -1.0;
        const double ux = nx * size, uy = ny * size, uz = nz * size, length = 1.0 / std::sqrt(ux * ux + uy * uy + uz * uz);
        const float face_x = float(side * (has_area ? ux * length : -side * fx)), face_y = float(side * (has_area ? uy * length : -side * fy)),
                    face_z = float(side * (has_area ? uz * length : -side * fz));
        block.front[i] = front ? 1 : 0;
        block.normal[0][i] = face_x;
        block.normal[1][i] = face_y;
        block.normal[2][i] = face_z;
    }
}

inline void smooth_and_light(const Sky& sky, ShadeBlock& block) {
    for (size_t i = 0; i < kShadeBlock; ++i) {
        const Unit a = unpacked(block.packed[0][i]), b = unpacked(block.packed[1][i]), c = unpacked(block.packed[2][i]);
        const float wa = block.weights[0][i], wb = block.weights[1][i], wc = block.weights[2][i];
        const float x = wa * a.x + wb * b.x + wc * c.x, y = wa * a.y + wb * b.y + wc * c.y, z = wa * a.z + wb * b.z + wc * c.z;
        const float square = x * x + y * y + z * z;
        const bool known = (block.packed[0][i] != kNoNormal) & (square > 0.0f);
        const float factor = (block.front[i] != 0 ? 1.0f : -1.0f) / std::sqrt(square);
        block.normal[0][i] = known ? x * factor : block.normal[0][i];
        block.normal[1][i] = known ? y * factor : block.normal[1][i];
        block.normal[2][i] = known ? z * factor : block.normal[2][i];
        block.light[i] = sky.light(block.normal[0][i], block.normal[1][i], block.normal[2][i]);
    }
}

inline void meet_triangles(const MeshProjection& view, const Sky& sky, ShadeBlock& block) {
    if (view.perspective)
        meet<true>(view, block);
    else
        meet<false>(view, block);
    smooth_and_light(sky, block);
}

STRATA_KERNEL_BASELINE void meet_baseline(const MeshProjection& view, const Sky& sky, ShadeBlock& block) { meet_triangles(view, sky, block); }
STRATA_KERNEL_AVX2 void meet_avx2(const MeshProjection& view, const Sky& sky, ShadeBlock& block) { meet_triangles(view, sky, block); }
STRATA_KERNEL_AVX512 void meet_avx512(const MeshProjection& view, const Sky& sky, ShadeBlock& block) { meet_triangles(view, sky, block); }

}  // namespace

MeetTriangles mesh_shade_kernel(SimdLevel level) {
    switch (level) {
        case SimdLevel::baseline: return meet_baseline;
        case SimdLevel::avx2: return meet_avx2;
        case SimdLevel::avx512: return meet_avx512;
    }
    return meet_baseline;
}

}  // namespace strata
