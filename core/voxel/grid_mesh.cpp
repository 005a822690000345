#include "core/voxel/grid_mesh.h"

#include <atomic>
#include <cmath>
#include <string>

#include "core/error.h"
#include "core/parallel.h"
#include "core/voxel/mesh_voxels.h"

namespace strata {
namespace {

constexpr size_t kBlock = 1 << 14;
constexpr double kFarthest = 0x1p40;  // voxels: with 16 bits more, sums of two still fit 64 bits

}  // namespace

// Frame and margins then take 30 bits.
int snapped_bits(const VoxelFrame& frame) { return std::min(16, 29 - 2 * frame.levels); }

GridMesh::GridMesh(const TriangleMesh& mesh, const VoxelFrame& frame, int threads)
    : mesh_(mesh),
      frame_(frame),
      bits_(snapped_bits(frame)),
      side_(int64_t{frame.side()} << bits_),
      margin_(int64_t{1} << 28),
      triangles_(&mesh.triangles),
      vertices_(mesh.positions.size()) {
    // Only vertices that triangles use are refused, so which are is kept until triangles are looked at.
    std::atomic<bool> far = false, refused = false;
    const double scale = std::ldexp(1.0, bits_) / frame.voxel_size;
    parallel_blocks(threads, vertices_.size(), kBlock, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) {
            const Vec3d p = (mesh.positions[i] - frame.origin) * scale;
            const double least = double(-margin_), most = double(side_ + margin_);
            if ((p.array() > least && p.array() < most).all()) {
                for (int a = 0; a < 3; ++a) vertices_[i][size_t(a)] = int32_t(std::floor(p[a] + 0.5));
                continue;
            }
            if (!p.allFinite() || p.cwiseAbs().maxCoeff() > std::ldexp(kFarthest, bits_)) {
                vertices_[i] = {kFar, kRefused, 0};
                refused = true;
                continue;
            }
            const FarPoint place = this->place(uint32_t(i));
            if (near(place)) {
                for (size_t a = 0; a < 3; ++a) vertices_[i][a] = int32_t(place[a]);
            } else {
                vertices_[i] = {kFar, 0, 0};
                far = true;
            }
        }
    });
    any_far_ = far;
    const bool any_refused = refused;
    parallel_blocks(threads, triangles_->size(), kBlock, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i)
            for (const uint32_t v : (*triangles_)[i]) {
                if (v >= vertices_.size())
                    throw Error(ErrorKind::malformed, "triangle " + std::to_string(i) + " has vertex " + std::to_string(v) + ", of " +
                                                          std::to_string(vertices_.size()));
                if (any_refused && vertices_[v][0] == kFar && vertices_[v][1] == kRefused) refuse(v);
            }
    });
    if (!any_far_) return;
    for (size_t i = 0; i < triangles_->size(); ++i)
        if (const auto& t = (*triangles_)[i]; !is_near(i)) add({place(t[0]), place(t[1]), place(t[2])}, i);
}

void GridMesh::refuse(uint32_t vertex) const {
    if (!mesh_.positions[vertex].allFinite())
        throw Error(ErrorKind::malformed, "vertex " + std::to_string(vertex) + " is not finite");
    throw Error(ErrorKind::limit, "vertex " + std::to_string(vertex) + " lies more than 2^40 voxels outside the frame");
}

GridMesh::FarPoint GridMesh::place(uint32_t vertex) const {
    const Vec3d p = (mesh_.positions[vertex] - frame_.origin) * (std::ldexp(1.0, bits_) / frame_.voxel_size);
    return {int64_t(std::floor(p.x() + 0.5)), int64_t(std::floor(p.y() + 0.5)), int64_t(std::floor(p.z() + 0.5))};
}

bool GridMesh::near(const FarPoint& p) const {
    return std::all_of(p.begin(), p.end(), [&](int64_t c) { return c >= -margin_ && c <= side_ + margin_; });
}

// Which edges are halved depends on the edge alone, so that neighbors stay neighbors. All that counts above the frame is that it is
// there, for lines that go up from inside: ends that both are above count as if they lay at its top.
void GridMesh::add(const std::array<FarPoint, 3>& corners, size_t source) {
    const int64_t voxel = int64_t{1} << bits_, top = side_ + 2 * voxel;
    std::vector<std::array<FarPoint, 3>> waiting = {corners};
    while (!waiting.empty()) {
        const std::array<FarPoint, 3> t = waiting.back();
        waiting.pop_back();
        const auto beside = [&](size_t a, bool above_too) {
            const auto [low, high] = std::minmax({t[0][a], t[1][a], t[2][a]});
            return high < -voxel || (above_too && low > side_ + voxel);
        };
        if (beside(0, true) || beside(1, true) || beside(2, false)) continue;
        std::array<FarPoint, 3> part = t;
        if (std::min({t[0][2], t[1][2], t[2][2]}) >= top)
            for (FarPoint& p : part) p[2] = top;
        if (near(part[0]) && near(part[1]) && near(part[2])) {
            GridTriangle& added = added_.emplace_back();
            sources_.push_back(source);
            for (size_t k = 0; k < 3; ++k)
                for (size_t a = 0; a < 3; ++a) added.corners[k][a] = int32_t(part[k][a]);
            continue;
        }
        // A corner far out, and one that is not beyond the frame on that side: an edge between them is long.
        std::array<FarPoint, 3> middle;
        std::array<bool, 3> halved;
        int count = 0;
        for (size_t k = 0; k < 3; ++k) {
            FarPoint p = t[k], q = t[(k + 1) % 3];
            for (size_t a = 0; a < 3; ++a) middle[k][a] = (p[a] + q[a]) >> 1;
            if (p[2] >= top && q[2] >= top) p[2] = q[2] = top;
            int64_t extent = 0;
            for (size_t a = 0; a < 3; ++a) extent = std::max(extent, std::abs(p[a] - q[a]));
            halved[k] = extent >= margin_ / 2 && !(near(p) && near(q));
            count += halved[k];
        }
        assert(count > 0);
        if (count == 3) {
            for (size_t k = 0; k < 3; ++k) waiting.push_back({middle[(k + 2) % 3], t[k], middle[k]});
            waiting.push_back(middle);
            continue;
        }
        size_t k = 0;
        while (!halved[k] || (count == 2 && !halved[(k + 1) % 3])) ++k;
        const FarPoint &p = t[k], &q = t[(k + 1) % 3], &r = t[(k + 2) % 3];
        if (count == 1) {
            waiting.push_back({p, middle[k], r});
            waiting.push_back({middle[k], q, r});
        } else {
            const FarPoint& second = middle[(k + 1) % 3];
            waiting.push_back({middle[k], q, second});
            waiting.push_back({p, middle[k], second});
            waiting.push_back({p, second, r});
        }
    }
}

}  // namespace strata
