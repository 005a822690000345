#include "core/surface/normal_orientation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "core/error.h"

namespace strata {
namespace {

constexpr uint32_t kTurned = uint32_t{1} << 31;
constexpr float kDoubt = 0.9f;  // of two places one behind the other: both sides of a plate, or of one noisy sheet
constexpr uint32_t kNoEdge = ~uint32_t{0};
// Of what looks up or down in a component, the share by which one must exceed the other to decide; else its top looks up. Walls have no say.
constexpr double kPlainlyUp = 0.25;
// What cells that touch have joined, and looks one way by that share, as the ground does and roofs do, looks up for good, if it is that large, in cells.
constexpr double kGroundUp = 0.5, kGroundCells = 64.0;

constexpr int kMostReach = 3;  // cells from one to another that it may take its side from, where none is nearer

// The cells that far around one that come after it.
std::vector<std::array<int32_t, 3>> later_cells(int reach) {
    std::vector<std::array<int32_t, 3>> steps;
    for (int k = 0; k <= reach; ++k)
        for (int j = -reach; j <= reach; ++j)
            for (int i = -reach; i <= reach; ++i)
                if (std::max({k, std::abs(j), std::abs(i)}) == reach && (k > 0 || j > 0 || (j == 0 && i > 0))) steps.push_back({i, j, k});
    return steps;
}

// How well two normals agree, -1 to 1: one is mirrored at the plane between the places, so that an arc and a corner agree fully, and two sides of a plate weakly.
float agreement(const Vec3f& normal_a, const Vec3f& normal_b, const Vec3f& apart) {
    const float square = apart.squaredNorm();
    if (!(square > 0.0f)) return normal_a.dot(normal_b);
    const float across = apart.dot(normal_a) * apart.dot(normal_b) / square;
    return (normal_a.dot(normal_b) - 2.0f * across) * (1.0f - kDoubt * std::abs(across));
}

}  // namespace

void NormalOrientation::add(const std::vector<Cell>& cells) {
    for (const Cell& cell : cells) {
        keys_.push_back(key_of(cell.at));
        places_.push_back(cell.place);
        normals_.push_back(cell.normal);
    }
    if (keys_.size() >= kTurned) throw Error(ErrorKind::limit, "2147483648 cells of normals or more: a larger voxel size has fewer");
}

uint64_t NormalOrientation::memory_bytes() const {
    return keys_.capacity() * sizeof keys_[0] + (places_.capacity() + normals_.capacity()) * sizeof places_[0] + parents_.capacity() * sizeof parents_[0] + ranks_.capacity() +
           turned_.capacity() / 8;
}

void NormalOrientation::check_room(uint64_t more, uint64_t memory_bytes) const {
    if (const uint64_t needed = this->memory_bytes() + more; needed > memory_bytes)
        throw Error(ErrorKind::limit, "choosing sides for the normals needs " + std::to_string(needed) + " bytes of memory, " + std::to_string(memory_bytes) +
                                          " are left for it; a larger voxel size needs less, points with normals none");
}

uint32_t NormalOrientation::root_of(uint32_t cell, bool& turned) {
    turned = false;
    uint32_t root = cell;
    while ((parents_[root] & ~kTurned) != root) {
        turned ^= (parents_[root] & kTurned) != 0;
        root = parents_[root] & ~kTurned;
    }
    // The way is made short.
    for (bool left = turned; cell != root;) {
        const uint32_t parent = parents_[cell];
        parents_[cell] = root | (left ? kTurned : 0);
        left ^= (parent & kTurned) != 0;
        cell = parent & ~kTurned;
    }
    return root;
}

template <typename Use>
void NormalOrientation::for_neighbors(int reach, const Use& use) {
    const std::vector<std::array<int32_t, 3>> steps = later_cells(reach);
    std::vector<size_t> finders(steps.size());
    const size_t count = keys_.size();
    for (size_t a = 0; a < count; ++a) {
        const std::array<int32_t, 3> at = {int32_t(keys_[a] & 0xfffff), int32_t(keys_[a] >> 20 & 0xfffff), int32_t(keys_[a] >> 40)};
        for (size_t n = 0; n < steps.size(); ++n) {
            const auto& step = steps[n];
            if (at[0] + step[0] < 0 || at[1] + step[1] < 0) continue;
            const uint64_t wanted = key_of({at[0] + step[0], at[1] + step[1], at[2] + step[2]});
            size_t& b = finders[n];
            while (b < count && keys_[b] < wanted) ++b;
            if (b < count && keys_[b] == wanted) use(uint32_t(a), uint32_t(b), Vec3f(float(step[0]), float(step[1]), float(step[2])));
        }
    }
}

// Rounds, in each of which every part joins the neighbor that it agrees or disagrees with most: of two parts all edges between them have a vote,
// so that one that lies across a gap or a thin sheet does not decide for a wall.
void NormalOrientation::join(int reach, uint64_t memory_bytes) {
    struct Edge {
        uint32_t a, b;  // roots, the lesser first
        int64_t vote;   // for the same side, 2^12 a cell that agrees fully; negative: for the other
    };
    std::vector<Edge> edges;
    const auto between_parts = [&](const Edge& edge) {  // no longer between two: a is b
        bool a_turned = false, b_turned = false;
        const uint32_t a = root_of(edge.a, a_turned), b = root_of(edge.b, b_turned);
        return Edge{std::min(a, b), std::max(a, b), a_turned == b_turned ? edge.vote : -edge.vote};
    };
    uint64_t count = 0;
    for_neighbors(reach, [&](uint32_t a, uint32_t b, const Vec3f&) {
        bool turned = false;
        count += root_of(a, turned) != root_of(b, turned);
    });
    check_room(count * sizeof(Edge) + keys_.size() * sizeof(uint32_t), memory_bytes);
    if (count > kNoEdge) throw Error(ErrorKind::limit, "more than 4294967295 edges between cells of normals: a larger voxel size has fewer");
    edges.reserve(count);
    for_neighbors(reach, [&](uint32_t a, uint32_t b, const Vec3f& step) {
        const Edge edge = between_parts({a, b, std::lround(4096.0f * agreement(normals_[a], normals_[b], step + places_[b] - places_[a]))});
        if (edge.a != edge.b) edges.push_back(edge);
    });
    std::vector<uint32_t> strongest(keys_.size());  // [root] edge
    while (!edges.empty()) {
        std::sort(edges.begin(), edges.end(), [](const Edge& x, const Edge& y) { return x.a != y.a ? x.a < y.a : x.b < y.b; });
        size_t kept = 0;
        for (const Edge& edge : edges) {
            if (kept > 0 && edges[kept - 1].a == edge.a && edges[kept - 1].b == edge.b) edges[kept - 1].vote += edge.vote;
            else edges[kept++] = edge;
        }
        edges.resize(kept);
        std::fill(strongest.begin(), strongest.end(), kNoEdge);
        for (uint32_t e = 0; e < kept; ++e)
            for (const uint32_t end : {edges[e].a, edges[e].b}) {
                uint32_t& best = strongest[end];
                if (best == kNoEdge || std::abs(edges[e].vote) > std::abs(edges[best].vote)) best = e;
            }
        for (uint32_t part = 0; part < strongest.size(); ++part)
            if (strongest[part] != kNoEdge) unite(edges[strongest[part]].a, edges[strongest[part]].b, edges[strongest[part]].vote < 0);
        for (Edge& edge : edges) edge = between_parts(edge);
        std::erase_if(edges, [](const Edge& edge) { return edge.a == edge.b; });
    }
}

void NormalOrientation::unite(uint32_t a, uint32_t b, bool turned) {
    bool a_turned = false, b_turned = false;
    a = root_of(a, a_turned);
    b = root_of(b, b_turned);
    if (a == b) return;
    turned ^= a_turned ^ b_turned;
    if (ranks_[a] > ranks_[b]) std::swap(a, b);
    ranks_[b] = std::max<uint8_t>(ranks_[b], uint8_t(ranks_[a] + 1));
    parents_[a] = b | (turned ? kTurned : 0);
}

void NormalOrientation::solve(uint64_t memory_bytes) {
    const auto count = uint32_t(keys_.size());
    // What looks up, of each component; at its root.
    struct Up {
        double all = 0.0, either = 0.0, top = 0.0;
        uint64_t highest = 0;  // k
    };
    check_room(count * (sizeof parents_[0] + sizeof ranks_[0] + sizeof(Up)) + count / 8, memory_bytes);
    parents_.resize(count);
    for (uint32_t cell = 0; cell < count; ++cell) parents_[cell] = cell;
    ranks_.assign(count, 0);
    const auto find_ups = [&] {
        std::vector<Up> ups(count);
        for (uint32_t cell = 0; cell < count; ++cell) {
            bool turned = false;
            Up& up = ups[root_of(cell, turned)];
            const double z = double(normals_[cell].z());
            up.all += turned ? -z : z;
            up.either += std::abs(z);
            up.highest = std::max(up.highest, keys_[cell] >> 40);
        }
        return ups;
    };
    join(1, memory_bytes);
    components_ = 0;
    {
        // They agree without a vote, which across a gap few and scattered cells would have.
        const std::vector<Up> ups = find_ups();
        uint32_t first = count;
        for (uint32_t part = 0; part < count; ++part) {
            if (ups[part].either < kGroundCells || std::abs(ups[part].all) < kGroundUp * ups[part].either) continue;
            if (first == count) {
                first = part;
                continue;
            }
            unite(first, part, (ups[first].all < 0.0) != (ups[part].all < 0.0));
            ++components_;
        }
    }
    for (int reach = 2; reach <= kMostReach; ++reach) join(reach, memory_bytes);

    std::vector<Up> ups = find_ups();
    turned_.assign(count, false);
    for (uint32_t cell = 0; cell < count; ++cell) {
        bool turned = false;
        components_ += root_of(cell, turned) == cell;
        turned_[cell] = turned;
    }
    for (uint32_t cell = 0; cell < count; ++cell) {
        bool turned = false;
        Up& up = ups[root_of(cell, turned)];
        if ((keys_[cell] >> 40) + 1 >= up.highest) up.top += turned ? -double(normals_[cell].z()) : double(normals_[cell].z());
    }
    for (uint32_t cell = 0; cell < count; ++cell) {
        bool turned = false;
        const Up& up = ups[root_of(cell, turned)];
        const bool plainly = std::abs(up.all) > kPlainlyUp * up.either;
        if ((plainly ? up.all : up.top) < 0.0) turned_[cell] = !turned_[cell];
    }
    // Given back: to assign {} would keep the memory.
    places_ = std::vector<Vec3f>();
    normals_ = std::vector<Vec3f>();
    parents_ = std::vector<uint32_t>();
    ranks_ = std::vector<uint8_t>();
}

bool NormalOrientation::is_turned(const std::array<int32_t, 3>& at) const {
    const auto found = std::lower_bound(keys_.begin(), keys_.end(), key_of(at));
    return found != keys_.end() && *found == key_of(at) && turned_[size_t(found - keys_.begin())];
}

}  // namespace strata
