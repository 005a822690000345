#include "render/pass/points_gl_pass.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "render/gl/buffer.h"
#include "render/gl/egl_context.h"
#include "render/gl/program.h"
#include "render/pass/blend_kernel.h"
#include "render/pass/point_block.h"
#include "render/pass/points_kernel.h"
#include "render/stream/point_pool.h"

namespace strata {
namespace {

constexpr uint32_t kGroupPoints = 256;    // of points.comp
constexpr uint64_t kBandWords = 4 << 20;  // drawn at a time: every driver takes a buffer of 128 MiB
constexpr uint32_t kWide = 1;             // row flag of points.comp

// The uniform block of points.comp, by std140.
struct View {
    std::array<float, 4> x_row, y_row, depth_row, right, down, forward;
    std::array<int32_t, 4> eye_low, eye_high;
    float center_x, center_y, near_depth, key_scale;
    float key_offset, inverse_key_scale, inverse_unit, fixed_px;
    float size_scale, least_px, most_px;
    int32_t perspective, shape;
    uint32_t stride, first_row, row_count, width;
    uint32_t unused[3];
};
static_assert(offsetof(View, center_x) == 128 && offsetof(View, size_scale) == 160 && offsetof(View, width) == 192 && sizeof(View) == 208);

View view_of(const PointProjection& projection, const SplatStyle& style) {
    const auto padded = [](const std::array<float, 3>& v) { return std::array{v[0], v[1], v[2], 0.0f}; };
    View view = {.x_row = projection.x_row,
                 .y_row = projection.y_row,
                 .depth_row = projection.depth_row,
                 .right = padded(projection.right),
                 .down = padded(projection.down),
                 .forward = padded(projection.forward)};
    for (size_t axis = 0; axis < 3; ++axis) {
        view.eye_low[axis] = int32_t(projection.eye_quanta[axis]);
        view.eye_high[axis] = int32_t(projection.eye_quanta[axis] >> 32);
    }
    view.center_x = projection.center_x;
    view.center_y = projection.center_y;
    view.near_depth = projection.near_depth;
    view.key_scale = projection.key_scale;
    view.key_offset = projection.key_offset;
    view.inverse_key_scale = 1.0f / projection.key_scale;
    view.inverse_unit = 1.0f / projection.pixels_per_unit;
    view.fixed_px = style.fixed_px;
    view.size_scale = style.spacing_factor * projection.pixels_per_unit;
    view.least_px = style.least_px;
    view.most_px = style.most_px;
    view.perspective = projection.perspective;
    view.shape = int32_t(style.shape);
    return view;
}

// Some points of a node: a chunk of the pool, when they are there.
struct Piece {
    const PointNode* node;
    uint32_t first;
    bool wide;
};

// Times that the points are gone through, as points.comp has them.
enum class Stage { keys, ranks, light };

using Row = std::array<uint32_t, 4>;  // chunk, points in it, rank of the first, flags

}  // namespace

struct PointsGlPass::Resources {
    explicit Resources(const EglContext& context) : pool(context) {}

    size_t bring(std::span<const Piece> pieces, PointPool::Columns columns, uint64_t cap_bytes);
    void dispatch(Stage stage);

    Program program{"points.comp"};
    PointPool pool;
    Buffer view{sizeof(View)};
    std::optional<Buffer> lights;  // of color codes
    std::optional<Buffer> words, sums, rows;
    std::vector<std::vector<Row>> page_rows;  // [page] what is there to draw
};

PointsGlPass::PointsGlPass(const EglContext& context) : resources_(std::make_unique<Resources>(context)) {}
PointsGlPass::~PointsGlPass() = default;

void PointsGlPass::forget_nodes() { resources_->pool.clear(); }
uint64_t PointsGlPass::uploaded_bytes() const { return resources_->pool.uploaded_bytes(); }

// Brings as many as there is room for. returns how many: at least one of some
size_t PointsGlPass::Resources::bring(std::span<const Piece> pieces, PointPool::Columns columns, uint64_t cap_bytes) {
    pool.release(cap_bytes);
    for (std::vector<Row>& of_page : page_rows) of_page.clear();
    size_t count = 0;
    for (PointPool::Place place; count < pieces.size(); ++count) {
        const auto& [node, first, wide] = pieces[count];
        if (!pool.hold(*node->points, first, columns, place)) break;
        const uint32_t points = uint32_t(std::min<size_t>(PointPool::kChunkPoints, node->points->size() - first));
        if (page_rows.size() < pool.pages()) page_rows.resize(pool.pages());
        page_rows[place.page].push_back({place.chunk, points, node->first_rank + first, wide ? kWide : 0});
    }
    if (!rows || rows->size_bytes() < count * sizeof(Row)) {
        rows.reset();
        rows.emplace(count * sizeof(Row));
    }
    uint64_t offset = 0;
    for (const std::vector<Row>& of_page : page_rows) {
        if (!of_page.empty()) rows->write(offset, of_page.data(), of_page.size() * sizeof(Row));
        offset += of_page.size() * sizeof(Row);
    }
    return count;
}

// Draws what was brought.
void PointsGlPass::Resources::dispatch(Stage stage) {
    program.use();
    view.bind_uniforms(0);
    if (lights) lights->bind_uniforms(1);
    rows->bind_storage(2);
    words->bind_storage(3);
    if (sums) sums->bind_storage(6);
    program.set(1, int32_t(stage));
    size_t first = 0;
    for (uint32_t page = 0; page < page_rows.size(); ++page) {
        const std::vector<Row>& of_page = page_rows[page];
        if (of_page.empty()) continue;
        const PointPool::Page& points = pool.page(page);
        points.positions.bind_storage(0);
        if (points.shapes) points.shapes->bind_storage(1);
        if (points.normals) points.normals->bind_storage(4);
        if (points.colors) points.colors->bind_storage(5);
        program.set(0, int32_t(first));
        Program::dispatch(PointPool::kChunkPoints / kGroupPoints, uint32_t(of_page.size()));
        first += of_page.size();
    }
    Program::finish_writes();
}

void PointsGlPass::draw(const WordRows& target, LightSum* sums, std::span<const PointNode> nodes, const PointProjection& projection,
                        const SplatStyle& style, uint64_t cap_bytes) {
    Resources& gl = *resources_;
    const PixelRows& pixels = target.rows;
    const bool blend = style.shape == SplatShape::gaussian;
    const PointPool::Columns columns = {.shapes = style.fixed_px <= 0.0f, .normals = style.shape == SplatShape::surfel, .colors = blend};
    const uint64_t most_words = blend ? kBandWords * sizeof(uint64_t) / sizeof(LightSum) : kBandWords;
    const uint32_t most_rows = uint32_t(std::clamp<uint64_t>(most_words / pixels.stride, 1, pixels.rows));
    const uint64_t row_bytes = uint64_t{pixels.stride} * sizeof(uint64_t), sum_bytes = uint64_t{pixels.stride} * sizeof(LightSum);
    const auto make_room = [](std::optional<Buffer>& buffer, uint64_t bytes) {
        if (buffer && buffer->size_bytes() >= bytes) return;
        buffer.reset();
        buffer.emplace(bytes);
    };
    make_room(gl.words, most_rows * row_bytes);
    if (blend) {
        make_room(gl.sums, most_rows * sum_bytes);
        if (!gl.lights) {
            gl.lights.emplace(sizeof light_of_codes());
            gl.lights->write(0, light_of_codes().data(), gl.lights->size_bytes());
        }
    }
    View view = view_of(projection, style);
    view.stride = pixels.stride;
    view.width = pixels.width;
    std::vector<Piece> pieces;
    for (uint32_t row = 0; row < pixels.rows; row += most_rows) {
        view.first_row = pixels.first_row + row;
        view.row_count = std::min(most_rows, pixels.rows - row);
        gl.view.write(0, &view, sizeof view);
        gl.words->clear(view.row_count * row_bytes);
        if (blend) gl.sums->clear(view.row_count * sum_bytes);
        pieces.clear();
        for (const PointNode& node : nodes) {
            if (node.bottom_row < float(view.first_row) || node.top_row >= float(view.first_row + view.row_count)) continue;
            const bool wide = !is_near(*node.points, projection);
            for (uint64_t first = 0; first < node.points->size(); first += PointPool::kChunkPoints)
                pieces.push_back({&node, uint32_t(first), wide});
        }
        size_t brought = 0;
        for (const Stage stage : {Stage::keys, Stage::ranks, Stage::light}) {
            if (stage == Stage::light && !blend) continue;
            for (size_t begin = 0; begin < pieces.size(); begin += brought) {
                // All that are drawn may still be there.
                if (brought < pieces.size()) brought = gl.bring(std::span(pieces).subspan(begin), columns, cap_bytes);
                gl.dispatch(stage);
            }
        }
        const uint64_t first_word = uint64_t{row} * pixels.stride;
        gl.words->read(0, target.words + first_word, view.row_count * row_bytes);
        if (blend) gl.sums->read(0, sums + first_word, view.row_count * sum_bytes);
    }
}

}  // namespace strata
