#include "render/pass/mesh_pass.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "core/parallel.h"
#include "render/pass/mesh_clip.h"
#include "render/pass/mesh_cut.h"
#include "render/pass/mesh_gl_pass.h"
#include "render/pass/mesh_kernel.h"
#include "render/pass/mesh_shade.h"

namespace strata {
namespace {

constexpr uint32_t kRound = 1 << 18;     // triangles that are drawn before large ones are, so that few of these wait
constexpr uint32_t kUnit = 1 << 12;      // triangles that a thread takes at a time
constexpr uint32_t kBandRows = 16;       // that one thread draws large triangles into
constexpr size_t kProjectUnit = 1 << 14;  // vertices

// Rows and columns of a G-buffer's picture that something may be seen in, the last ones excluded.
struct PixelBox {
    uint32_t left, top, right, bottom;
    bool empty() const { return left >= right || top >= bottom; }
};

// What a box can cover of a target, two pixels more at each side for rounding; everything where it reaches before the near plane.
PixelBox pixels_of(const Box3d& box, const MeshProjection& view, uint32_t width, uint32_t first_row, uint32_t rows) {
    const PixelBox all = {0, first_row, width, first_row + rows};
    double left = std::numeric_limits<double>::infinity(), top = left, right = -left, bottom = -left;
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3d p((corner & 1 ? box.max : box.min).x(), (corner & 2 ? box.max : box.min).y(), (corner & 4 ? box.max : box.min).z());
        const Vec3d d = p - view.eye;
        const double depth = view.forward.dot(d), w = view.perspective ? depth : 1.0;
        if (view.perspective && !(depth >= view.near_depth)) return all;
        const double x = view.center_x + view.x_row.dot(d) / w, y = view.center_y + view.y_row.dot(d) / w;
        if (!(std::isfinite(x) && std::isfinite(y))) return all;
        left = std::min(left, x - 2.0), top = std::min(top, y - 2.0), right = std::max(right, x + 2.0), bottom = std::max(bottom, y + 2.0);
    }
    const auto within = [](double value, uint32_t least, uint32_t most) { return uint32_t(std::clamp(value, double(least), double(most))); };
    return {within(left, 0, width), within(top, all.top, all.bottom), within(right, 0, width), within(bottom, all.top, all.bottom)};
}

// Of a worker: large triangles that wait to be drawn, each once in each band it touches, or where it touches more than two once for all.
struct Waiting {
    struct Item {
        RasterTriangle triangle;
        bool clipped;  // by boxes, pixel by pixel
    };
    std::vector<std::vector<Item>> bands;
    std::vector<Item> tall;

    void clear(size_t band_count) {
        bands.resize(std::max(bands.size(), band_count));
        for (std::vector<Item>& band : bands) band.clear();
        tall.clear();
    }
};

}  // namespace

struct MeshPass::Buffers {
    std::vector<ProjectedVertex> vertices;
    std::vector<uint64_t> words;
    std::vector<Waiting> waiting;  // by worker
};

namespace {

// One mesh in one picture.
class MeshDrawing {
public:
    MeshDrawing(const TriangleMesh& mesh, const MeshView& view, const MeshProjection& projection, const MeshTarget& target, const PixelBox& seen,
                std::span<const ProjectedVertex> vertices, std::vector<Waiting>& waiting, const MeshKernels& kernels)
        : mesh_(mesh), view_(view), projection_(projection), target_(target), seen_(seen), clip_(view.clips, projection),
          geometry_{mesh.triangles.data(), vertices.data()}, waiting_(waiting), kernels_(kernels),
          bands_((seen.bottom - seen.top + kBandRows - 1) / kBandRows) {}

    /// What does not lie within the reach; the words of all else are there.
    void draw_beyond(const MeshGlPass::Reach& reach) {
        const auto holds = [&](const ProjectedVertex& v) { return reach.holds(v); };
        if (std::all_of(geometry_.vertices, geometry_.vertices + mesh_.positions.size(), holds)) return;
        within_ = reach;
        draw();
    }

    void draw() {
        const uint64_t count = mesh_.triangles.size();
        waiting_.resize(std::max(waiting_.size(), size_t(view_.threads)));
        for (uint64_t begin = 0; begin < count; begin += kRound) draw_round(uint32_t(begin), uint32_t(std::min<uint64_t>(begin + kRound, count)));
    }

private:
    void draw_round(uint32_t begin, uint32_t end) {
        for (Waiting& waiting : waiting_) waiting.clear(bands_);
        const uint32_t units = (end - begin + kUnit - 1) / kUnit;
        const int threads = std::min<int>(view_.threads, int(units));
        const Sharing sharing = threads > 1 ? Sharing::shared : Sharing::alone;
        std::atomic<uint32_t> next_unit = 0;
        parallel_workers(threads, [&](int worker) {
            TriangleBlock block;
            for (uint32_t unit = next_unit++; unit < units; unit = next_unit++) {
                const uint32_t first = begin + unit * kUnit, last = std::min(first + kUnit, end);
                for (block.first = first; block.first < last; block.first += kTriangleBlock) {
                    block.count = std::min<size_t>(kTriangleBlock, last - block.first);
                    draw_block(block, sharing, waiting_[size_t(worker)]);
                }
            }
        });
        std::atomic<uint32_t> next_band = 0;
        parallel_workers(std::min<int>(view_.threads, int(bands_)), [&](int) {
            for (uint32_t band = next_band++; band < bands_; band = next_band++) draw_band(band);
        });
    }

    void draw_block(TriangleBlock& block, Sharing sharing, Waiting& waiting) const {
        kernels_.sort(geometry_, target_, block);
        for (size_t i = 0; i < block.count; ++i) {
            TriangleKind& kind = block.kinds[i];
            if (kind == TriangleKind::nothing) continue;
            if (within_ && all_within(block.first + uint32_t(i))) {
                kind = TriangleKind::nothing;
                continue;
            }
            bool clipped = false;
            if (!clip_.everything()) {
                const Coverage left = clip_.coverage(corners_of(block.first + uint32_t(i)));
                clipped = left == Coverage::part;
                if (left == Coverage::none) {
                    kind = TriangleKind::nothing;
                    continue;
                }
            }
            if (kind == TriangleKind::small && !clipped) continue;
            put(block.first + uint32_t(i), kind == TriangleKind::unsnapped, clipped, waiting);
            kind = TriangleKind::nothing;
        }
        kernels_.draw_small(target_, block, sharing);
    }

    bool all_within(uint32_t number) const {
        const std::array<uint32_t, 3>& corners = mesh_.triangles[number];
        return std::all_of(corners.begin(), corners.end(), [&](uint32_t vertex) { return within_->holds(geometry_.vertices[vertex]); });
    }

    std::array<Vec3d, 3> corners_of(uint32_t number) const {
        const auto& [a, b, c] = mesh_.triangles[number];
        return {mesh_.positions[a], mesh_.positions[b], mesh_.positions[c]};
    }

    void put(uint32_t number, bool unsnapped, bool clipped, Waiting& waiting) const {
        const auto& [i, j, k] = mesh_.triangles[number];
        const std::array<ProjectedVertex, 3> v = {geometry_.vertices[i], geometry_.vertices[j], geometry_.vertices[k]};
        if (!unsnapped) {
            wait({{{v[0].x, v[1].x, v[2].x}, {v[0].y, v[1].y, v[2].y}, {v[0].key, v[1].key, v[2].key}, number}, clipped}, waiting);
            return;
        }
        std::array<RasterTriangle, kMostPieces> pieces;
        const size_t count = cut_triangle(projection_, view_.width_px, view_.height_px, corners_of(number), v, number, pieces);
        for (size_t piece = 0; piece < count; ++piece) wait({pieces[piece], clipped}, waiting);
    }

    void wait(const Waiting::Item& item, Waiting& waiting) const {
        const auto [least, most] = std::minmax({item.triangle.y[0], item.triangle.y[1], item.triangle.y[2]});
        const int64_t first_row = std::max<int64_t>(least >> kSubpixelBits, seen_.top), last_row = std::min<int64_t>(most >> kSubpixelBits, int64_t{seen_.bottom} - 1);
        if (first_row > last_row) return;
        const size_t first = size_t(first_row - seen_.top) / kBandRows, last = size_t(last_row - seen_.top) / kBandRows;
        if (last > first + 1) {
            waiting.tall.push_back(item);
            return;
        }
        for (size_t band = first; band <= last; ++band) waiting.bands[band].push_back(item);
    }

    void draw_band(uint32_t band) const {
        const uint32_t first_row = seen_.top + band * kBandRows, rows = std::min(kBandRows, seen_.bottom - first_row);
        const MeshTarget target = {target_.words + size_t(first_row - target_.first_row) * target_.width, target_.width, first_row, rows};
        const auto draw = [&](const Waiting::Item& item) {
            if (!item.clipped) {
                kernels_.draw(item.triangle, target);
                return;
            }
            visit_pixels(item.triangle, target, [&](int32_t column, int32_t row, float key) {
                uint64_t& word = target.words[size_t(uint32_t(row) - first_row) * target.width + size_t(column)];
                const uint64_t own = make_word(key, item.triangle.number);
                if (own > word && clip_.keeps(column, row, double(key))) word = own;
            });
        };
        for (const Waiting& waiting : waiting_) {
            for (const Waiting::Item& item : waiting.bands[band]) draw(item);
            for (const Waiting::Item& item : waiting.tall) draw(item);
        }
    }

    const TriangleMesh& mesh_;
    const MeshView& view_;
    const MeshProjection& projection_;
    const MeshTarget& target_;
    PixelBox seen_;
    MeshClip clip_;
    MeshGeometry geometry_;
    std::vector<Waiting>& waiting_;
    const MeshKernels& kernels_;
    uint32_t bands_;
    std::optional<MeshGlPass::Reach> within_;  // triangles in it are drawn already
};

void clear_words(const MeshTarget& target, int threads) {
    parallel_blocks(threads, target.rows, 64, [&](size_t begin, size_t end) {
        std::fill(target.words + begin * target.width, target.words + end * target.width, uint64_t{0});
    });
}

}  // namespace

MeshPass::MeshPass() : buffers_(std::make_unique<Buffers>()) {}
MeshPass::~MeshPass() = default;

uint64_t MeshPass::working_bytes(uint64_t vertices, uint64_t pixels) {
    return vertices * sizeof(ProjectedVertex) + pixels * sizeof(uint64_t) + kRound * 2 * sizeof(Waiting::Item);
}

bool MeshPass::draw(const MeshModel& model, uint32_t drawable, const MeshView& view, GBuffer& out, SimdLevel level) {
    const TriangleMesh& mesh = *model.mesh;
    if (mesh.triangles.empty()) return false;
    const MeshProjection projection(view.camera, view.width_px, view.height_px, view.offset_px);
    const PixelBox seen = pixels_of(model.bounds, projection, out.width, out.first_row, out.rows);
    if (seen.empty()) return false;
    const MeshKernels& kernels = mesh_kernels(level);

    auto& [vertices, words, waiting] = *buffers_;
    vertices.resize(mesh.positions.size());
    parallel_blocks(view.threads, vertices.size(), kProjectUnit, [&](size_t begin, size_t end) {
        kernels.project(projection, mesh.positions.data() + begin, end - begin, vertices.data() + begin);
    });
    const uint32_t rows = seen.bottom - seen.top;
    words.resize(std::max(words.size(), size_t(out.width) * rows));
    const MeshTarget target = {words.data(), out.width, seen.top, rows};
    MeshDrawing drawing(mesh, view, projection, target, seen, vertices, waiting, kernels);
    if (view.gpu != nullptr && view.clips.empty() && view.gpu->takes(vertices.size(), mesh.triangles.size())) {
        view.gpu->draw({model.serial, mesh.triangles, vertices}, target);
        drawing.draw_beyond(view.gpu->reach(target));
    } else {
        clear_words(target, view.threads);
        drawing.draw();
    }

    const MeshShade shade = {model, drawable, projection, target, mesh_shade_kernel(level), sky_of(view.up)};
    std::atomic<bool> drawn = false;
    GBuffer& gbuffer = out;
    parallel_blocks(view.threads, rows, 8, [&](size_t begin, size_t end) {
        for (size_t row = begin; row < end; ++row)
            if (shade.draw_row(uint32_t(row), seen.left, seen.right, gbuffer)) drawn = true;
    });
    return drawn;
}

}  // namespace strata
