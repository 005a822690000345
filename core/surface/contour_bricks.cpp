#include <Eigen/LU>
#include <algorithm>
#include <bit>
#include <cmath>
#include <deque>
#include <future>
#include <limits>
#include <mutex>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/parallel.h"
#include "core/simd_target.h"
#include "core/surface/cell_cases.h"
#include "core/surface/contour.h"
#include "core/surface/edge_cut.h"
#include "core/surface/field_slope.h"
#include "core/surface/inner_vertex.h"
#include "core/surface/sample_masks.h"

namespace strata {
namespace {

constexpr int kSide = kFieldBrickSide;
constexpr size_t kBlock = 32;  // bricks that a thread takes at a time
constexpr float kInfinity = std::numeric_limits<float>::infinity();
using Corner = std::array<int32_t, 2>;

bool is_same(const Corner& a, const Corner& b) { return a[0] == b[0] && a[1] == b[1]; }
bool comes_before(const Corner& a, const Corner& b) { return a[1] != b[1] ? a[1] < b[1] : a[0] < b[0]; }

using Planes = std::array<uint64_t, kSide>;  // a word a plane of constant k, bit 8 j + i

// Samples of a layer and, for every isovalue, which of them are inside; where surfaces are open at NaN, then which of them are not NaN.
struct Samples {
    FieldBrickLayer layer;
    std::vector<Planes> masks;  // [level * bricks + brick]
};

// The surface in the cells whose least corner is in a brick's place, and on the edges that begin at its samples.
struct Part {
    std::array<Planes, 3> crossed;                       // edges along i, j, k that have a vertex: [axis][plane]
    std::array<std::array<uint32_t, kSide>, 3> first;    // the number of the first vertex on those
    uint32_t first_inner = 0, inner = 0;
    uint64_t first_triangle = 0;
    uint32_t triangles = 0;
};

// The bricks with cells of one layer: those that hold samples and those just below them along any axes.
struct Cells {
    int32_t k = 0;
    std::vector<Corner> corners;
    std::vector<std::array<int32_t, 8>>
        samples;                   // [corners] the bricks at + (n & 1, n >> 1 & 1, n >> 2) in their layers; -1 - n: constants[n]
    std::vector<float> constants;  // of bricks that are not given
    std::vector<Planes> whole;     // [corners] the cells without a NaN sample; empty: all are taken for such
    std::vector<Part> parts;       // [isovalue * corners + brick]

    uint64_t whole_cells(size_t brick, size_t plane) const { return whole.empty() ? ~uint64_t{0} : whole[brick][plane]; }
};

// Finds corners in a sorted list, asked for in ascending order.
class Finder {
public:
    explicit Finder(const std::vector<Corner>* corners) : corners_(corners) {}

    int32_t find(const Corner& wanted) {
        if (corners_ == nullptr) return -1;
        while (at_ < corners_->size() && comes_before((*corners_)[at_], wanted)) ++at_;
        return at_ < corners_->size() && is_same((*corners_)[at_], wanted) ? int32_t(at_) : -1;
    }

private:
    const std::vector<Corner>* corners_;
    size_t at_ = 0;
};

Corner moved(const Corner& corner, int32_t bricks_i, int32_t bricks_j) {
    return {corner[0] + kSide * bricks_i, corner[1] + kSide * bricks_j};
}

std::vector<Corner> united(const std::vector<Corner>& a, const std::vector<Corner>& b) {
    std::vector<Corner> all;
    all.reserve(a.size() + b.size());
    std::set_union(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(all), comes_before);
    return all;
}
std::vector<Corner> all_moved(std::vector<Corner> corners, int32_t bricks_i, int32_t bricks_j) {
    for (Corner& corner : corners) corner = moved(corner, bricks_i, bricks_j);
    return corners;
}

constexpr uint64_t kFirstColumn = 0x0101010101010101, kLastColumn = kFirstColumn << 7;
uint64_t along_i(uint64_t plane, uint64_t next) { return (plane >> 1 & ~kLastColumn) | (next & kFirstColumn) << 7; }
uint64_t along_j(uint64_t plane, uint64_t next) { return plane >> 8 | next << 56; }
uint64_t back_along_i(uint64_t plane, uint64_t last) { return (plane & ~kLastColumn) << 1 | (last & kLastColumn) >> 7; }
uint64_t back_along_j(uint64_t plane, uint64_t last) { return plane << 8 | last >> 56; }

class BrickContour {
public:
    /// sink  or none: all is kept in `mesh`, else the piece that was made last
    BrickContour(FieldBrickSource& source, const ContourSettings& settings, SurfaceSink* sink, ContourMesh& mesh)
        : source_(source),
          settings_(settings),
          sink_(sink),
          mesh_(mesh),
          below_(settings.inside == ContourInside::below),
          mirrored_(source.placement().is_mirrored()),
          axes_{source.placement().axes.col(0), source.placement().axes.col(1), source.placement().axes.col(2)},
          normal_from_gradient_(source.placement().axes.inverse().transpose()) {
        if (!settings.colors.empty() && settings.colors.size() != settings.isovalues.size())
            throw Error(ErrorKind::usage, std::to_string(settings.isovalues.size()) + " isovalues have " +
                                              std::to_string(settings.colors.size()) + " colors");
        for (const double isovalue : settings.isovalues) {
            if (!std::isfinite(isovalue)) throw Error(ErrorKind::usage, "an isovalue is not finite");
            levels_.push_back(level_of(isovalue, below_));
        }
        // With what every number is inside of, masks say which samples are numbers.
        if (settings.open_at_nan) levels_.push_back(below_ ? kInfinity : -kInfinity);
    }

    ContourReport run() {
        if (settings_.isovalues.empty()) return report_;
        read_to(std::numeric_limits<int32_t>::min());
        if (window_.empty()) return report_;
        first_k_ = window_.front().layer.k;
        first_corner_ = window_.front().layer.corners.front();
        mesh_.origin = source_.placement().world_from_index(Vec3d(first_corner_[0], first_corner_[1], first_k_));

        for (int32_t k = first_k_ - kSide;;) {
            read_to(k + 2 * kSide);
            if (!cells_) {
                cells_ = make_cells(k, nullptr);
                if (cells_ && crosses_early(*cells_)) refuse_absent(*cells_);  // no layer was before that it could have come with
            }
            above_ = make_cells(k + kSide, cells_ ? &*cells_ : nullptr);
            if (cells_) pass_on(*cells_, above_ ? &*above_ : nullptr);
            if (cells_) spare_cells_ = std::move(*cells_);
            cells_ = std::move(above_);
            for (; !window_.empty() && window_.front().layer.k < k; window_.pop_front())  // k itself is below the next: slopes ask for it
                spare_samples_ = std::move(window_.front());
            if (cells_) {
                k += kSide;
                continue;
            }
            const auto next =
                std::find_if(window_.begin(), window_.end(), [&](const Samples& samples) { return samples.layer.k > k + kSide; });
            if (next == window_.end()) break;
            k = next->layer.k - kSide;
        }
        return report_;
    }

private:
    // Reads layers until one at k or above is there, or there is no more.
    void read_to(int32_t k) {
        while (!ended_ && (window_.empty() || window_.back().layer.k < k)) {
            std::optional<Samples> next = ahead_.valid() ? ahead_.get() : next_samples(std::exchange(spare_samples_, {}));
            if (!next) {
                ended_ = true;
                break;
            }
            Samples& samples = *next;
            const FieldBrickLayer& layer = samples.layer;
            const auto out_of_place = [](int32_t c) { return c % kSide != 0 || std::abs(int64_t{c}) > int64_t{1} << 30; };
            const bool in_order = window_.empty() ? last_k_ < layer.k : window_.back().layer.k < layer.k;
            if (!in_order || out_of_place(layer.k))
                throw Error(ErrorKind::malformed, "a layer of bricks at k = " + std::to_string(layer.k) + " is out of order or place");
            if (layer.values.size() != layer.corners.size() * kFieldBrickSamples)
                throw Error(ErrorKind::malformed,
                            std::to_string(layer.corners.size()) + " bricks have " + std::to_string(layer.values.size()) + " samples");
            for (size_t b = 0; b < layer.corners.size(); ++b)
                if (out_of_place(layer.corners[b][0]) || out_of_place(layer.corners[b][1]) ||
                    (b > 0 && !comes_before(layer.corners[b - 1], layer.corners[b])))
                    throw Error(ErrorKind::malformed, "a brick at (" + std::to_string(layer.corners[b][0]) + ", " +
                                                          std::to_string(layer.corners[b][1]) + ", " + std::to_string(layer.k) +
                                                          ") is out of order or place");
            last_k_ = layer.k;
            if (layer.corners.empty()) continue;
            check_memory(bytes_of(layer) + levels_.size() * layer.corners.size() * sizeof samples.masks[0]);
            find_masks(samples);
            window_.push_back(std::move(samples));
        }
    }

    // used  for its memory
    std::optional<Samples> next_samples(Samples used) {
        return source_.next_layer(used.layer) ? std::optional(std::move(used)) : std::nullopt;
    }

    // Reads the next layer while this one's surface is made. Slopes ask the source for values meanwhile: then it is not. Nor where one like
    // the last would not fit beside this.
    void read_ahead() {
        if (settings_.threads < 2 || settings_.normals || ended_ || ahead_.valid()) return;
        const uint64_t wanted = bytes_of(window_.back().layer), spare = bytes_of(spare_samples_.layer);
        if (bytes_held() + wanted - std::min(wanted, spare) > settings_.memory_bytes) return;
        try {
            ahead_ = std::async(std::launch::async,
                                [this, used = std::exchange(spare_samples_, {})]() mutable { return next_samples(std::move(used)); });
        } catch (const std::system_error&) {
            // No thread is to be had: it is read when it is wanted.
        }
    }

    void find_masks(Samples& samples) {
        const size_t bricks = samples.layer.corners.size();
        samples.masks.resize(levels_.size() * bricks);
        std::mutex mutex;
        SampleStatistics all;
        parallel_blocks(settings_.threads, bricks, kBlock, [&](size_t begin, size_t end) {
            SampleStatistics found;
            std::vector<uint64_t*> words(levels_.size());
            for (size_t b = begin; b < end; ++b) {
                for (size_t s = 0; s < levels_.size(); ++s) words[s] = samples.masks[s * bricks + b].data();
                find_inside({samples.layer.values.data() + b * kFieldBrickSamples, kFieldBrickSamples}, levels_, below_, words.data(),
                            found, simd_level_);
            }
            const std::lock_guard lock(mutex);
            all.add(found);
        });
        report_.nan_samples += all.nan;
        report_.least = std::min(report_.least, all.least);
        report_.greatest = std::max(report_.greatest, all.greatest);
    }

    const Samples* samples_at(int32_t k) const {
        for (const Samples& samples : window_)
            if (samples.layer.k == k) return &samples;
        return nullptr;
    }

    // What the cells of a brick's place see: samples of the brick and of the seven around its upper side.
    struct View {
        std::array<const float*, 8> values;
        std::array<unsigned, 8> reach;  // of indices: 0 where all samples are one
        Vec3d start;                    // in the world, less the origin: of its least sample
        std::array<int64_t, 3> least;   // of its samples

        double at(unsigned i, unsigned j, unsigned k) const {  // each 0 to 8
            const unsigned brick = i >> 3 | j >> 3 << 1 | k >> 3 << 2;
            return double(values[brick][(((k & 7) * kSide + (j & 7)) * kSide + (i & 7)) & reach[brick]]);
        }
    };

    View view_of(const Cells& cells, size_t brick) const {
        View view;
        const std::array<const Samples*, 2> layers = {samples_at(cells.k), samples_at(cells.k + kSide)};
        for (size_t n = 0; n < 8; ++n) {
            const int32_t there = cells.samples[brick][n];
            view.values[n] =
                there < 0 ? &cells.constants[size_t(-1 - there)] : layers[n >> 2]->layer.values.data() + size_t(there) * kFieldBrickSamples;
            view.reach[n] = there < 0 ? 0 : kFieldBrickSamples - 1;
        }
        view.least = {cells.corners[brick][0], cells.corners[brick][1], cells.k};
        view.start = double(view.least[0] - first_corner_[0]) * axes_[0] + double(view.least[1] - first_corner_[1]) * axes_[1] +
                     double(view.least[2] - first_k_) * axes_[2];
        return view;
    }

    CellValues values_of(const View& view, double isovalue, unsigned i, unsigned j, unsigned k) const {
        CellValues values;
        for (unsigned c = 0; c < 8; ++c) {
            const double v = view.at(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2));
            values[c] = below_ ? isovalue - v : v - isovalue;
        }
        return values;
    }

    // Which samples of plane k, 0 to 8, that the corners of a brick's cells with that k lie in, are inside of a level.
    std::array<uint64_t, 4> corners_of(const Cells& cells, const std::array<const Samples*, 2>& layers, size_t level, size_t brick,
                                       int k) const {
        std::array<uint64_t, 4> words;
        for (size_t n = 0; n < 4; ++n) {
            const size_t upper = size_t(k) / kSide;
            const int32_t there = cells.samples[brick][4 * upper + n];
            words[n] = there < 0 ? mask_of(cells.constants[size_t(-1 - there)], level)
                                 : layers[upper]->masks[level * layers[upper]->layer.corners.size() + size_t(there)][size_t(k) % kSide];
        }
        const uint64_t up = along_j(words[0], words[2]), up_next = along_j(words[1], words[3]);
        return {words[0], along_i(words[0], words[1]), up, along_i(up, up_next)};
    }

    uint64_t mask_of(float constant, size_t level) const {
        const bool inside = below_ ? constant <= levels_[level] : constant >= levels_[level];
        return inside ? ~uint64_t{0} : 0;
    }

    // below  those of the layer below, if it has any
    std::optional<Cells> make_cells(int32_t k, const Cells* below) {
        const std::array<const Samples*, 2> layers = {samples_at(k), samples_at(k + kSide)};
        if (layers[0] == nullptr && layers[1] == nullptr) return std::nullopt;
        Cells cells = std::exchange(spare_cells_, {});  // for its memory
        cells.k = k;
        cells.corners.clear();
        cells.constants.clear();
        cells.whole.clear();
        cells.parts.clear();
        for (const Samples* layer : layers)
            if (layer != nullptr) cells.corners = united(cells.corners, layer->layer.corners);
        cells.corners = united(cells.corners, all_moved(cells.corners, -1, 0));
        cells.corners = united(cells.corners, all_moved(cells.corners, 0, -1));
        const size_t bricks = cells.corners.size();
        check_memory(bricks * (sizeof cells.corners[0] + sizeof cells.samples[0] + sizeof neighbors_[0] + isovalues() * sizeof(Part) +
                               (settings_.open_at_nan ? sizeof cells.whole[0] : 0)));
        cells.samples.resize(bricks);
        find_around(
            cells, {layers[0] != nullptr ? &layers[0]->layer.corners : nullptr, layers[1] != nullptr ? &layers[1]->layer.corners : nullptr},
            cells.samples);
        for (size_t b = 0; b < bricks; ++b)
            for (size_t n = 0; n < 8; ++n) {
                if (cells.samples[b][n] >= 0) continue;
                const Corner corner = moved(cells.corners[b], int32_t(n & 1), int32_t(n >> 1 & 1));
                cells.samples[b][n] = constant_of(cells, source_.absent_value({corner[0], corner[1], k + (n < 4 ? 0 : kSide)}));
            }
        if (settings_.open_at_nan) find_whole(cells, layers, below);
        cells.parts.resize(isovalues() * bricks);
        std::mutex mutex;
        const auto count = kernel(count_baseline, count_avx2, count_avx512);
        parallel_blocks(settings_.threads, bricks, kBlock, [&](size_t begin, size_t end) {
            Ambiguous found;
            bool is_open = false;
            for (size_t s = 0; s < isovalues(); ++s)
                for (size_t b = begin; b < end; ++b) {
                    count(*this, cells, layers, s, b, found);
                    if (!cells.whole.empty()) is_open |= leave_out_unused(cells, below, s, b);
                }
            const std::lock_guard lock(mutex);
            report_.ambiguous_cells += found.cells;
            report_.tunnel_cells += found.tunnels;
            report_.meets_boundary |= is_open;
        });
        return cells;
    }

    // Which cells have no NaN sample, and where those are that lie before them.
    void find_whole(Cells& cells, const std::array<const Samples*, 2>& layers, const Cells* below) {
        cells.whole.resize(cells.corners.size());
        parallel_blocks(settings_.threads, cells.corners.size(), kBlock, [&](size_t begin, size_t end) {
            const auto all = [](const std::array<uint64_t, 4>& words) { return words[0] & words[1] & words[2] & words[3]; };
            for (size_t b = begin; b < end; ++b) {
                uint64_t low = all(corners_of(cells, layers, isovalues(), b, 0));
                for (int k = 0; k < kSide; ++k) {
                    const uint64_t high = all(corners_of(cells, layers, isovalues(), b, k + 1));
                    cells.whole[b][size_t(k)] = low & high;
                    low = high;
                }
            }
        });
        find_around(cells, {&cells.corners, below != nullptr ? &below->corners : nullptr}, neighbors_, -1);
    }

    // Takes the vertices away that no cell has: all four around their edge have a NaN sample. Returns whether the surface is open at an
    // edge, which some of the four have.
    bool leave_out_unused(Cells& cells, const Cells* below, size_t isovalue, size_t brick) const {
        Part& part = cells.parts[isovalue * cells.corners.size() + brick];
        const std::array<int32_t, 8>& before = neighbors_[brick];
        uint64_t open = 0;
        for (size_t k = 0; k < kSide; ++k) {
            std::array<uint64_t, 8> whole;  // the cells at - (n & 1, n >> 1 & 1, n >> 2)
            for (size_t lower = 0; lower < 2; ++lower) {
                std::array<uint64_t, 4> planes;
                for (size_t n = 0; n < 4; ++n) {
                    const bool is_below = lower > k;
                    const int32_t there = before[n + (is_below ? 4 : 0)];
                    planes[n] = there < 0 ? 0 : (is_below ? *below : cells).whole[size_t(there)][(k - lower) % kSide];
                }
                const uint64_t back = back_along_j(planes[0], planes[2]), back_last = back_along_j(planes[1], planes[3]);
                whole[4 * lower] = planes[0];
                whole[4 * lower + 1] = back_along_i(planes[0], planes[1]);
                whole[4 * lower + 2] = back;
                whole[4 * lower + 3] = back_along_i(back, back_last);
            }
            for (size_t axis = 0; axis < 3; ++axis) {
                const size_t u = size_t(1) << (axis + 1) % 3, v = size_t(1) << (axis + 2) % 3;
                uint64_t& crossed = part.crossed[axis][k];
                crossed &= whole[0] | whole[u] | whole[v] | whole[u + v];
                open |= crossed & ~(whole[0] & whole[u] & whole[v] & whole[u + v]);
            }
        }
        return open != 0;
    }

    size_t isovalues() const { return settings_.isovalues.size(); }

    // Most neighbors have the value of the one before; there may be many values.
    static int32_t constant_of(Cells& cells, float value) {
        if (cells.constants.empty() || std::bit_cast<uint32_t>(cells.constants.back()) != std::bit_cast<uint32_t>(value))
            cells.constants.push_back(value);
        return -int32_t(cells.constants.size());
    }

    static std::array<uint64_t, 8> corner_words(const std::array<uint64_t, 4>& low, const std::array<uint64_t, 4>& high) {
        return {low[0], low[1], low[2], low[3], high[0], high[1], high[2], high[3]};
    }
    static uint64_t active_cells(const std::array<uint64_t, 8>& corner) {
        uint64_t any = 0, all = ~uint64_t{0};
        for (const uint64_t word : corner) {
            any |= word;
            all &= word;
        }
        return any & ~all;
    }

    struct Ambiguous {
        uint64_t cells = 0, tunnels = 0;
    };

    void count(Cells& cells, const std::array<const Samples*, 2>& layers, size_t isovalue, size_t brick, Ambiguous& found) const {
        Part& part = cells.parts[isovalue * cells.corners.size() + brick];
        std::array<uint64_t, 4> low = corners_of(cells, layers, isovalue, brick, 0);
        int64_t triangles = 0;
        std::optional<View> view;
        for (int k = 0; k < kSide; ++k) {
            const std::array<uint64_t, 4> high = corners_of(cells, layers, isovalue, brick, k + 1);
            const std::array<uint64_t, 8> corner = corner_words(low, high);
            for (size_t axis = 0; axis < 3; ++axis) part.crossed[axis][size_t(k)] = corner[0] ^ corner[size_t(1) << axis];
            const uint64_t whole = cells.whole_cells(brick, size_t(k));
            if (const uint64_t active = active_cells(corner) & whole; active != 0) {
                // As many triangles as crossings, less two for each loop of them; a plain cell has one.
                for (const CellEdge& edge : kCellEdge) triangles += std::popcount((corner[edge.lower] ^ corner[edge.upper]) & whole);
                triangles -= 2 * std::popcount(active);
                for (uint64_t left = undecided_cells(corner) & whole; left != 0; left &= left - 1) {
                    const auto bit = unsigned(std::countr_zero(left));
                    unsigned cell_case = 0;
                    for (unsigned c = 0; c < 8; ++c) cell_case |= unsigned(corner[c] >> bit & 1) << c;
                    if (!view) view = view_of(cells, brick);
                    const CellDecision decision =
                        CellCases::get().decide(cell_case, values_of(*view, settings_.isovalues[isovalue], bit & 7, bit >> 3, unsigned(k)));
                    triangles += decision.patch->triangles + 2 - std::popcount(kCrossedEdges[cell_case]);
                    part.inner += decision.patch->inner;
                    ++found.cells;
                    found.tunnels += decision.tunnel;
                }
            }
            low = high;
        }
        part.triangles = uint32_t(triangles);
    }

    // Vertices on edges along i and j in the least plane of a layer's bricks come with the layer before.
    static bool comes_early(size_t axis, size_t plane) { return axis < 2 && plane == 0; }

    static bool crosses_early(const Cells& cells) {
        return std::any_of(cells.parts.begin(), cells.parts.end(),
                           [](const Part& part) { return (part.crossed[0][0] | part.crossed[1][0]) != 0; });
    }

    template <typename Use>
    void for_vertices(Cells& cells, size_t isovalue, bool early, const Use& use) {
        const size_t bricks = cells.corners.size();
        for (size_t b = 0; b < bricks; ++b) {
            Part& part = cells.parts[isovalue * bricks + b];
            for (size_t plane = 0; plane < kSide; ++plane)
                for (size_t axis = 0; axis < 3; ++axis)
                    if (comes_early(axis, plane) == early) use(part.first[axis][plane], uint32_t(std::popcount(part.crossed[axis][plane])));
            if (!early) use(part.first_inner, part.inner);
        }
    }

    void pass_on(Cells& cells, Cells* above) {
        const uint64_t before = report_.vertices;
        uint64_t next = before, triangles = 0;
        const auto number = [&](uint32_t& first, uint32_t count) {
            first = uint32_t(next);
            next += count;
        };
        std::vector<uint64_t> ends;  // of the vertices of each isovalue: first those of the cells, then the early ones of the next
        for (size_t s = 0; s < isovalues(); ++s) {
            for_vertices(cells, s, false, number);
            ends.push_back(next);
        }
        for (size_t s = 0; s < isovalues() && above != nullptr; ++s) {
            for_vertices(*above, s, true, number);
            ends.push_back(next);
        }
        if (next > std::numeric_limits<uint32_t>::max())
            throw Error(ErrorKind::limit, "the surface has more than 4294967295 vertices: take a coarser field, or a part of it");
        for (Part& part : cells.parts) {
            part.first_triangle = triangles;
            triangles += part.triangles;
        }
        if (next == before && triangles == 0) return;
        if (sink_ != nullptr) {
            const uint64_t vertex_bytes = sizeof(Vec3f) * (settings_.normals ? 2 : 1) + (settings_.colors.empty() ? 0 : sizeof settings_.colors[0]);
            piece_bytes_ = std::max(piece_bytes_, (next - before) * vertex_bytes + triangles * sizeof(std::array<uint32_t, 3>));
        }
        check_memory(0);

        first_vertex_ = sink_ != nullptr ? before : 0;
        first_triangle_ = sink_ != nullptr ? 0 : report_.triangles;
        mesh_.positions.resize(size_t(next - first_vertex_));
        if (settings_.normals) mesh_.normals.resize(size_t(next - first_vertex_));
        mesh_.triangles.resize(size_t(first_triangle_ + triangles));
        const size_t bricks = cells.corners.size();
        find_around(cells, {&cells.corners, above != nullptr ? &above->corners : nullptr}, neighbors_);
        std::mutex mutex;
        const auto keep = [&](const CutStatistics& cuts) {
            const std::lock_guard lock(mutex);
            report_.clamped_vertices += cuts.clamped;
            report_.largest_shift_cells = std::max(report_.largest_shift_cells, cuts.largest_shift);
        };
        read_ahead();
        const auto put_vertices = kernel(vertices_baseline, vertices_avx2, vertices_avx512);
        const auto put_triangles = kernel(triangles_baseline, triangles_avx2, triangles_avx512);
        parallel_blocks(settings_.threads, bricks, kBlock, [&](size_t begin, size_t end) {
            CutStatistics cuts;
            for (size_t b = begin; b < end; ++b)
                for (size_t s = 0; s < isovalues(); ++s) {
                    put_vertices(*this, cells, s, b, false, cuts);
                    put_triangles(*this, cells, above, s, b);
                }
            keep(cuts);
        });
        if (above != nullptr)
            parallel_blocks(settings_.threads, above->corners.size(), kBlock, [&](size_t begin, size_t end) {
                CutStatistics cuts;
                for (size_t b = begin; b < end; ++b)
                    for (size_t s = 0; s < isovalues(); ++s) put_vertices(*this, *above, s, b, true, cuts);
                keep(cuts);
            });

        report_.vertices = next;
        report_.triangles += triangles;
        if (sink_ == nullptr) return;
        colors_.clear();
        if (!settings_.colors.empty())
            for (size_t n = 0; n < ends.size(); ++n) colors_.resize(size_t(ends[n] - before), settings_.colors[n % isovalues()]);
        sink_->add({.origin = mesh_.origin,
                    .positions = {mesh_.positions.data(), mesh_.positions.size()},
                    .normals = {mesh_.normals.data(), mesh_.normals.size()},
                    .colors = colors_,
                    .triangles = {mesh_.triangles.data(), mesh_.triangles.size()},
                    .quads = {}});
    }

    static uint64_t bytes_of(const FieldBrickLayer& layer) { return layer.corners.size() * sizeof layer.corners[0] + layer.values.size() * sizeof layer.values[0]; }

    // By layers, their cells, and the surface in them.
    uint64_t bytes_held() const {
        uint64_t bytes = piece_bytes_;
        for (const Samples& samples : window_) bytes += bytes_of(samples.layer) + samples.masks.size() * sizeof samples.masks[0];
        bytes += bytes_of(spare_samples_.layer) + spare_samples_.masks.size() * sizeof spare_samples_.masks[0];
        for (const std::optional<Cells>* cells : {&cells_, &above_})
            if (*cells)
                bytes += (*cells)->corners.size() * (sizeof (*cells)->corners[0] + sizeof (*cells)->samples[0] + sizeof neighbors_[0]) + (*cells)->constants.size() * sizeof(float) +
                         (*cells)->whole.size() * sizeof(Planes) + (*cells)->parts.size() * sizeof(Part);
        return bytes;
    }

    // Before memory is taken.
    // more  than what is held
    void check_memory(uint64_t more) {
        if (bytes_held() + more > settings_.memory_bytes) spare_samples_ = {};
        if (const uint64_t bytes = bytes_held() + more; bytes > settings_.memory_bytes)
            throw Error(ErrorKind::limit, "a layer of bricks and the surface in it need " + std::to_string(bytes) + " bytes of memory, " +
                                              std::to_string(settings_.memory_bytes) + " are allowed");
    }

    // The places in the lists of a layer and of the next of what is at each corner + (n & 1, n >> 1 & 1, n >> 2) bricks; -1: not there.
    // step  -1: of the one before, and at each corner - that
    void find_around(const Cells& cells, const std::array<const std::vector<Corner>*, 2>& lists,
                     std::vector<std::array<int32_t, 8>>& found, int32_t step = 1) const {
        found.resize(cells.corners.size());
        parallel_blocks(settings_.threads, 8, 1, [&](size_t begin, size_t end) {
            for (size_t n = begin; n < end; ++n) {
                Finder finder(lists[n >> 2]);
                for (size_t b = 0; b < found.size(); ++b)
                    found[b][n] = finder.find(moved(cells.corners[b], step * int32_t(n & 1), step * int32_t(n >> 1 & 1)));
            }
        });
    }

    void put(uint64_t number, const Vec3d& position) {
        mesh_.positions[number] = {float(position.x()), float(position.y()), float(position.z())};
    }

    void put_vertices(const Cells& cells, size_t isovalue, size_t brick, bool early, CutStatistics& cuts) {
        const Part& part = cells.parts[isovalue * cells.corners.size() + brick];
        const double level = settings_.isovalues[isovalue];
        uint64_t any = 0;
        for (size_t axis = 0; axis < 3; ++axis)
            for (size_t plane = 0; plane < kSide; ++plane) any |= comes_early(axis, plane) == early ? part.crossed[axis][plane] : 0;
        if (any == 0) return;
        const View view = view_of(cells, brick);
        for (size_t plane = 0; plane < kSide; ++plane)
            for (size_t axis = 0; axis < 3; ++axis) {
                if (comes_early(axis, plane) != early) continue;
                uint64_t number = part.first[axis][plane] - first_vertex_;
                for (uint64_t left = part.crossed[axis][plane]; left != 0; left &= left - 1, ++number) {
                    const auto bit = unsigned(std::countr_zero(left));
                    const unsigned i = bit & 7, j = bit >> 3, k = unsigned(plane);
                    const double t = cut_edge(view.at(i, j, k), view.at(i + (axis == 0), j + (axis == 1), k + (axis == 2)), level, cuts);
                    put(number, view.start + double(i) * axes_[0] + double(j) * axes_[1] + double(k) * axes_[2] + t * axes_[axis]);
                    if (!settings_.normals) continue;
                    std::array<int, 3> upper = {int(i), int(j), int(k)};
                    ++upper[axis];
                    const Vec3d slope = (1.0 - t) * slope_at(view, {int(i), int(j), int(k)}) + t * slope_at(view, upper);
                    mesh_.normals[number] = normal_of(below_ ? slope : Vec3d(-slope));
                }
            }
    }

    // A sample near a brick's place.
    double value_at(const View& view, const std::array<int, 3>& at) const {
        if (std::all_of(at.begin(), at.end(), [](int c) { return c >= 0 && c <= kSide; }))
            return view.at(unsigned(at[0]), unsigned(at[1]), unsigned(at[2]));
        const auto brick_of = [](int64_t c) { return int32_t(c & ~int64_t{kSide - 1}); };
        const std::array<int64_t, 3> p = {view.least[0] + at[0], view.least[1] + at[1], view.least[2] + at[2]};
        const Corner corner = {brick_of(p[0]), brick_of(p[1])};
        const auto absent = [&] {
            const std::lock_guard lock(source_mutex_);
            return double(source_.absent_value({corner[0], corner[1], brick_of(p[2])}));
        };
        const Samples* const samples = samples_at(brick_of(p[2]));
        if (samples == nullptr) return absent();
        const auto& corners = samples->layer.corners;
        const auto found = std::lower_bound(corners.begin(), corners.end(), corner, comes_before);
        if (found == corners.end() || *found != corner) return absent();
        const auto in_brick = [](int64_t c) { return size_t(c & (kSide - 1)); };
        return double(samples->layer.values[size_t(found - corners.begin()) * kFieldBrickSamples +
                                            (in_brick(p[2]) * kSide + in_brick(p[1])) * kSide + in_brick(p[0])]);
    }

    Vec3d slope_at(const View& view, const std::array<int, 3>& at) const {
        const double here = value_at(view, at);
        Vec3d slope = Vec3d::Zero();
        for (size_t axis = 0; axis < 3; ++axis) {
            std::array<int, 3> before = at, after = at;
            --before[axis];
            ++after[axis];
            slope[int(axis)] = slope_between(value_at(view, before), here, value_at(view, after));
        }
        return slope.allFinite() ? slope : Vec3d::Zero();
    }

    Vec3f normal_of(const Vec3d& outward) const { return unit_normal(normal_from_gradient_ * outward); }

    // Whether cells of a plane have a crossed edge that begins in the place of a brick without cells.
    static bool crosses_unowned(const std::array<const Part*, 8>& around, const std::array<uint64_t, 8>& corner, uint64_t whole, unsigned k) {
        constexpr uint64_t kLastRow = uint64_t{0xff} << 56;
        const auto beyond = [](bool is_at_end, uint64_t last, bool upper) { return is_at_end ? last : upper ? ~last : ~uint64_t{0}; };
        for (unsigned n = 1; n < 8; ++n) {
            if (around[n] != nullptr) continue;
            for (const CellEdge& edge : kCellEdge) {
                const unsigned c = edge.lower;
                if ((c & n) != n || ((n & 4) != 0) != ((c & 4) != 0 && k == kSide - 1)) continue;
                const uint64_t there = beyond((n & 1) != 0, kLastColumn, (c & 1) != 0) & beyond((n & 2) != 0, kLastRow, (c & 2) != 0);
                if (((corner[edge.lower] ^ corner[edge.upper]) & there & whole) != 0) return true;
            }
        }
        return false;
    }

    void put_triangles(const Cells& cells, const Cells* above, size_t isovalue, size_t brick) {
        const Part& part = cells.parts[isovalue * cells.corners.size() + brick];
        if (part.triangles == 0) return;
        const CellCases& cases = CellCases::get();
        const CellCases::Plain& plain = cases.plain(mirrored_);
        const std::array<const Samples*, 2> layers = {samples_at(cells.k), samples_at(cells.k + kSide)};
        std::array<const Part*, 8> around;
        for (size_t n = 0; n < 8; ++n) {
            const Cells* const there = n < 4 ? &cells : above;
            const int32_t at = neighbors_[brick][n];
            around[n] = at < 0 ? nullptr : &there->parts[isovalue * there->corners.size() + size_t(at)];
        }
        // Edges without a vertex may have no owner, and get a number that is not used.
        static constexpr Part kNobody = {};
        std::array<const Part*, 8> owners = around;
        bool all_owned = true;
        for (const Part*& owner : owners)
            if (owner == nullptr) {
                owner = &kNobody;
                all_owned = false;
            }
        const auto vertex_on = [&](const CellEdge& edge, unsigned i, unsigned j, unsigned k) {
            i += edge.lower & 1;
            j += edge.lower >> 1 & 1;
            k += edge.lower >> 2;
            const Part& owner = *owners[i >> 3 | j >> 3 << 1 | k >> 3 << 2];
            const uint64_t before = (uint64_t{1} << ((j & 7) * 8 + (i & 7))) - 1;
            return owner.first[edge.axis][k & 7] + uint32_t(std::popcount(owner.crossed[edge.axis][k & 7] & before));
        };

        std::array<uint32_t, CellPatch::kPlaces> ids = {};
        std::array<uint32_t, 3>* triangle = mesh_.triangles.data() + first_triangle_ + part.first_triangle;
        uint32_t inner = part.first_inner;
        std::optional<View> view;
        std::array<uint64_t, 4> low = corners_of(cells, layers, isovalue, brick, 0);
        for (unsigned k = 0; k < kSide; ++k) {
            const std::array<uint64_t, 4> high = corners_of(cells, layers, isovalue, brick, int(k) + 1);
            const std::array<uint64_t, 8> corner = corner_words(low, high);
            low = high;
            const uint64_t whole = cells.whole_cells(brick, k);
            if (!all_owned && crosses_unowned(around, corner, whole, k)) refuse_absent(cells);
            for (uint64_t left = active_cells(corner) & whole; left != 0; left &= left - 1) {
                const auto bit = unsigned(std::countr_zero(left));
                const unsigned i = bit & 7, j = bit >> 3;
                unsigned cell_case = 0;
                for (unsigned c = 0; c < 8; ++c) cell_case |= unsigned(corner[c] >> bit & 1) << c;
#pragma GCC unroll 12
                for (size_t e = 0; e < kCellEdges; ++e) ids[CellPatch::place_of_edge(e)] = vertex_on(kCellEdge[e], i, j, k);
                const uint8_t count = plain.triangles[cell_case];
                if (count != CellCases::kUndecided) {
                    const auto& vertices = plain.vertices[cell_case];
                    for (size_t t = 0; t < count; ++t)
                        *triangle++ = {ids[vertices[3 * t]], ids[vertices[3 * t + 1]], ids[vertices[3 * t + 2]]};
                    continue;
                }
                if (!view) view = view_of(cells, brick);
                const CellValues values = values_of(*view, settings_.isovalues[isovalue], i, j, k);
                const CellPatch& patch = *cases.decide(cell_case, values).patch;
                for (size_t n = 0; n < patch.inner; ++n) {
                    const Vec3d p_cell = place_inner_vertex(values, patch.inner_edges[n]);
                    const uint64_t at = inner - first_vertex_;
                    put(at, view->start + (i + p_cell.x()) * axes_[0] + (j + p_cell.y()) * axes_[1] + (k + p_cell.z()) * axes_[2]);
                    if (settings_.normals) mesh_.normals[at] = normal_of(-inside_slope(values, p_cell));
                    ids[CellPatch::place_of_inner(n)] = inner++;
                }
                for (size_t t = 0; t < patch.triangles; ++t) {
                    *triangle = {ids[patch.vertices[3 * t]], ids[patch.vertices[3 * t + 1]], ids[patch.vertices[3 * t + 2]]};
                    if (mirrored_) std::swap((*triangle)[0], (*triangle)[2]);
                    ++triangle;
                }
            }
        }
    }

    // The loops over a brick, compiled for each instruction set.
    template <typename Kernel>
    Kernel* kernel(Kernel* baseline, Kernel* avx2, Kernel* avx512) const {
        return simd_level_ == SimdLevel::avx512 ? avx512 : simd_level_ == SimdLevel::avx2 ? avx2 : baseline;
    }
    STRATA_KERNEL_BASELINE static void count_baseline(const BrickContour& contour, Cells& cells,
                                                      const std::array<const Samples*, 2>& layers, size_t isovalue, size_t brick,
                                                      Ambiguous& found) {
        contour.count(cells, layers, isovalue, brick, found);
    }
    STRATA_KERNEL_AVX2 static void count_avx2(const BrickContour& contour, Cells& cells, const std::array<const Samples*, 2>& layers,
                                              size_t isovalue, size_t brick, Ambiguous& found) {
        contour.count(cells, layers, isovalue, brick, found);
    }
    STRATA_KERNEL_AVX512 static void count_avx512(const BrickContour& contour, Cells& cells, const std::array<const Samples*, 2>& layers,
                                                  size_t isovalue, size_t brick, Ambiguous& found) {
        contour.count(cells, layers, isovalue, brick, found);
    }
    STRATA_KERNEL_BASELINE static void vertices_baseline(BrickContour& contour, const Cells& cells, size_t isovalue, size_t brick,
                                                         bool early, CutStatistics& cuts) {
        contour.put_vertices(cells, isovalue, brick, early, cuts);
    }
    STRATA_KERNEL_AVX2 static void vertices_avx2(BrickContour& contour, const Cells& cells, size_t isovalue, size_t brick, bool early,
                                                 CutStatistics& cuts) {
        contour.put_vertices(cells, isovalue, brick, early, cuts);
    }
    STRATA_KERNEL_AVX512 static void vertices_avx512(BrickContour& contour, const Cells& cells, size_t isovalue, size_t brick, bool early,
                                                     CutStatistics& cuts) {
        contour.put_vertices(cells, isovalue, brick, early, cuts);
    }
    STRATA_KERNEL_BASELINE static void triangles_baseline(BrickContour& contour, const Cells& cells, const Cells* above, size_t isovalue,
                                                          size_t brick) {
        contour.put_triangles(cells, above, isovalue, brick);
    }
    STRATA_KERNEL_AVX2 static void triangles_avx2(BrickContour& contour, const Cells& cells, const Cells* above, size_t isovalue,
                                                  size_t brick) {
        contour.put_triangles(cells, above, isovalue, brick);
    }
    STRATA_KERNEL_AVX512 static void triangles_avx512(BrickContour& contour, const Cells& cells, const Cells* above, size_t isovalue,
                                                      size_t brick) {
        contour.put_triangles(cells, above, isovalue, brick);
    }

    [[noreturn]] static void refuse_absent(const Cells& cells) {
        throw Error(ErrorKind::malformed, "bricks near k = " + std::to_string(cells.k) + " touch, have different values and are not given");
    }

    FieldBrickSource& source_;
    const ContourSettings& settings_;
    SurfaceSink* sink_;
    ContourMesh& mesh_;
    const SimdLevel simd_level_ = best_simd_level();
    bool below_, mirrored_;
    std::array<Vec3d, 3> axes_;
    Mat3d normal_from_gradient_;
    std::vector<float> levels_;  // of isovalues, and then perhaps of what is a number

    std::deque<Samples> window_;  // of layers, ascending
    Samples spare_samples_;
    std::future<std::optional<Samples>> ahead_;
    std::optional<Cells> cells_, above_;  // of the layer that is passed on, and of the next
    Cells spare_cells_;
    uint64_t piece_bytes_ = 0;  // of the largest so far, whose memory the next ones use
    bool ended_ = false;
    int32_t last_k_ = std::numeric_limits<int32_t>::min();
    int32_t first_k_ = 0;
    Corner first_corner_ = {0, 0};

    std::vector<std::array<int32_t, 8>> neighbors_;   // of the cells passed on, or of those made
    mutable std::mutex source_mutex_;                 // of absent_value
    uint64_t first_vertex_ = 0, first_triangle_ = 0;  // the number of the first in the mesh, and the place of the first triangle passed on
    std::vector<std::array<uint8_t, 4>> colors_;
    ContourReport report_;
};

}  // namespace

ContourReport contour_bricks(FieldBrickSource& source, const ContourSettings& settings, SurfaceSink& sink) {
    ContourMesh piece;
    return BrickContour(source, settings, &sink, piece).run();
}

ContourReport contour_bricks(FieldBrickSource& source, const ContourSettings& settings, ContourMesh& out) {
    out = {};
    return BrickContour(source, settings, nullptr, out).run();
}

}  // namespace strata
