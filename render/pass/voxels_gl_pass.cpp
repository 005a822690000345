#include "render/pass/voxels_gl_pass.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <map>
#include <mutex>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/parallel.h"
#include "core/voxel/ray_walk.h"
#include "render/gl/buffer.h"
#include "render/gl/egl_context.h"
#include "render/gl/program.h"
#include "render/pass/voxel_clip.h"
#include "render/pass/voxel_light.h"
#include "render/pass/voxel_rays.h"

namespace strata {
namespace {

constexpr uint32_t kGroup = 8;             // pixels a side, of voxels.comp
constexpr size_t kPixelWords = 5;          // likewise
constexpr uint64_t kBandPixels = 1 << 20;  // drawn at a time
constexpr uint32_t kNone = ~uint32_t{0};
constexpr size_t kDepths = 2 * kMostVoxelLevels + 1;

using Wide = std::array<double, 4>;

// The uniform block of voxels.comp, by std140.
struct View {
    Wide origin, origin_per_x, origin_per_y, direction, direction_per_x, direction_per_y, towards_eye;
    double least_t, spread, footprint;
    double pixel_spread, pixel_footprint;
    double elevation_origin, voxel_size, range_low, range_extent;
    int32_t levels, node_levels, keeping, removing;
    uint32_t width, first_row, row_count, has_full;
    int32_t rule, smooth_shading;
    uint32_t has_attributes, has_normals;
    uint32_t y_upwards;
    uint32_t unused;
    std::array<uint32_t, 12> first_rows;
    std::array<uint32_t, 24> first_attributes, first_normals;
};
static_assert(offsetof(View, least_t) == 224 && offsetof(View, levels) == 296 && offsetof(View, first_rows) == 352 && sizeof(View) == 592);
static_assert(kDepths <= 24 && kMostVoxelLevels <= 12);

Wide wide(const Vec3d& v) { return {v.x(), v.y(), v.z(), 0.0}; }

// Words of entries of three bytes or four, and one more: the shader reads two words for three bytes.
template <typename Entry>
size_t words_of(const std::vector<Entry>& entries) {
    return (entries.size() * sizeof(Entry) + 3) / 4 + 1;
}

// A tree in the GPU's memory.
struct Held {
    std::optional<Buffer> nodes, full, odd, attributes, normals;
    std::array<uint32_t, 12> first_rows{};
    std::array<uint32_t, 24> first_attributes{}, first_normals{};
    VoxelColors::Rule rule = VoxelColors::Rule::plain;
    bool with_normals = false;
    uint64_t bytes = 0;
};

// Copies the arrays of a kind, depth after depth.
template <typename Entry>
void bring(const VoxelTree& tree, std::vector<Entry> CellAttributes::*kind, std::optional<Buffer>& buffer,
           std::array<uint32_t, 24>& first) {
    size_t words = 0;
    first.fill(kNone);
    for (const CellAttributes& of_depth : tree.attributes)
        if (!(of_depth.*kind).empty()) words += words_of(of_depth.*kind);
    if (words == 0) return;
    buffer.emplace(4 * words);
    size_t word = 0;
    for (size_t depth = 0; depth < tree.attributes.size(); ++depth) {
        const std::vector<Entry>& entries = tree.attributes[depth].*kind;
        if (entries.empty()) continue;
        first[depth] = uint32_t(word);
        buffer->write(4 * word, entries.data(), entries.size() * sizeof(Entry));
        word += words_of(entries);
    }
}

bool needs_normals(const VoxelModel& model) { return model.shading == VoxelShading::smooth; }

template <typename Entry>
uint64_t bytes_of(const VoxelTree& tree, std::vector<Entry> CellAttributes::*kind) {
    uint64_t words = 0;
    for (const CellAttributes& of_depth : tree.attributes) words += words_of(of_depth.*kind);
    return 4 * words;
}

// The largest of its buffers, and all together.
struct Sizes {
    uint64_t largest = 0, all = 0;
    void add(uint64_t bytes) {
        largest = std::max(largest, bytes);
        all += bytes;
    }
};

Sizes sizes_of(const VoxelModel& model) {
    const VoxelTree& tree = *model.tree;
    uint64_t rows = 0;
    bool full = false;
    for (const VoxelLevel& level : tree.levels) {
        rows += level.masks.size();
        full |= !level.full.empty();
    }
    Sizes sizes;
    sizes.add(16 * rows);
    if (full) sizes.add(8 * rows);
    if (!tree.cells_before_odd.empty()) sizes.add(4 * rows);
    if (model.colors.rule() == VoxelColors::Rule::rgb) sizes.add(bytes_of(tree, &CellAttributes::colors));
    if (model.colors.rule() == VoxelColors::Rule::count) sizes.add(bytes_of(tree, &CellAttributes::counts));
    if (needs_normals(model)) sizes.add(bytes_of(tree, &CellAttributes::normals));
    return sizes;
}

void bring_nodes(const VoxelTree& tree, Held& held) {
    uint64_t rows = 0;
    bool any_full = false;
    for (size_t level = 0; level < tree.levels.size(); ++level) {
        held.first_rows[level] = uint32_t(rows);
        rows += tree.levels[level].masks.size();
        any_full |= !tree.levels[level].full.empty();
    }
    const bool attributes = !tree.cells_before_even.empty();
    held.nodes.emplace(16 * rows);
    if (any_full) {
        held.full.emplace(8 * rows);
        held.full->clear(8 * rows);
    }
    if (attributes) held.odd.emplace(4 * rows);
    std::vector<std::array<uint32_t, 4>> packed;
    constexpr size_t kAtOnce = 1 << 16;  // rows
    for (size_t number = 0; number < tree.levels.size(); ++number) {
        const VoxelLevel& level = tree.levels[number];
        const uint64_t first = held.first_rows[number];
        for (size_t begin = 0; begin < level.masks.size(); begin += kAtOnce) {
            const size_t end = std::min(begin + kAtOnce, level.masks.size());
            packed.clear();
            for (size_t node = begin; node < end; ++node)
                packed.push_back({uint32_t(level.masks[node]), uint32_t(level.masks[node] >> 32),
                                  level.first_child.empty() ? 0 : level.first_child[node],
                                  attributes ? tree.cells_before_even[number][node] : 0});
            held.nodes->write(16 * (first + begin), packed.data(), 16 * packed.size());
        }
        if (!level.full.empty()) held.full->write(8 * first, level.full.data(), 8 * level.full.size());
        if (attributes) held.odd->write(4 * first, tree.cells_before_odd[number].data(), 4 * level.masks.size());
    }
}

// Draws what the shader found where it is nearer than what is there.
void merge(std::span<const uint32_t> found, size_t first_pixel, const VoxelTree& tree, uint32_t drawable, const VoxelRays& rays,
           const VoxelView& view, GBuffer& out, VoxelsDrawn& drawn) {
    std::mutex adding;
    parallel_blocks(view.threads, found.size() / kPixelWords, 1 << 16, [&](size_t begin, size_t end) {
        VoxelsDrawn part;
        for (size_t i = begin; i < end; ++i) {
            const uint32_t* const words = found.data() + i * kPixelWords;
            const size_t pixel = first_pixel + i;
            const int depth = int(words[1] >> 24);
            const float cell_t = std::bit_cast<float>(words[3]);
            if (depth == 0 || !(cell_t < out.depths[pixel])) continue;
            out.colors[pixel] = words[0];
            out.depths[pixel] = std::bit_cast<float>(words[4]);
            if (!out.splat_px.empty()) out.splat_px[pixel] = uint8_t(words[1] >> 16);
            if (!out.ids.empty()) out.ids[pixel] = make_pixel_id(words[1] & 0xffff, words[2], drawable);
            part.add_cell(tree, depth, rays.pixel_size(cell_t), view.error_px);
        }
        const std::lock_guard lock(adding);
        drawn.add(part);
    });
}

}  // namespace

struct VoxelsGlPass::Resources {
    Held* hold(const VoxelModel& model, uint64_t cap_bytes);
    void bring_tables(const VoxelColors& colors, bool pixels_stop);

    Program program{"voxels.comp"};
    Buffer view{sizeof(View)};
    Buffer tables{4 * (1024 + 16384 + 1024)};
    Buffer nothing{16};  // bound where a tree has no such thing
    std::optional<Buffer> boxes, pixels;
    std::vector<uint32_t> read;
    std::map<uint64_t, Held> trees;  // by serials of models: the oldest first
    uint64_t held_bytes = 0;
    const uint64_t most_buffer_bytes = Buffer::most_storage_bytes();
};

VoxelsGlPass::VoxelsGlPass(const EglContext&) : resources_(std::make_unique<Resources>()) {}
VoxelsGlPass::~VoxelsGlPass() = default;

// returns  none: it would not fit into what it may take
// throws   Error{device}, and holds no part of it: the GPU has no room
Held* VoxelsGlPass::Resources::hold(const VoxelModel& model, uint64_t cap_bytes) {
    const VoxelTree& tree = *model.tree;
    const auto found = trees.find(model.serial);
    if (found != trees.end()) {
        Held& held = found->second;
        if (held.rule == model.colors.rule() && held.with_normals >= needs_normals(model)) return &held;
        held_bytes -= held.bytes;
        trees.erase(found);
    }
    const Sizes sizes = sizes_of(model);
    if (sizes.largest > most_buffer_bytes || sizes.all > cap_bytes) return nullptr;
    while (held_bytes + sizes.all > cap_bytes) {
        held_bytes -= trees.begin()->second.bytes;
        trees.erase(trees.begin());
    }
    Held held;  // not in the map until all of it is there: the GPU may have no room
    bring_nodes(tree, held);
    held.rule = model.colors.rule();
    held.with_normals = needs_normals(model);
    held.bytes = sizes.all;
    if (held.rule == VoxelColors::Rule::rgb) bring(tree, &CellAttributes::colors, held.attributes, held.first_attributes);
    if (held.rule == VoxelColors::Rule::count) bring(tree, &CellAttributes::counts, held.attributes, held.first_attributes);
    if (held.with_normals) bring(tree, &CellAttributes::normals, held.normals, held.first_normals);
    Held& kept = trees.emplace(model.serial, std::move(held)).first->second;
    held_bytes += kept.bytes;
    return &kept;
}

void VoxelsGlPass::Resources::bring_tables(const VoxelColors& colors, bool pixels_stop) {
    uint64_t offset = 0;
    const auto append = [&](const void* bytes, size_t count) {
        tables.write(offset, bytes, count);
        offset += count;
    };
    for (const auto& of_signs : kCellsAhead[pixels_stop]) append(of_signs.data(), sizeof of_signs);
    append(dimmed_colors().data(), sizeof dimmed_colors());
    append(colors.table().data(), sizeof colors.table());
}

bool VoxelsGlPass::draw(const VoxelModel& model, uint32_t drawable, const VoxelView& view, uint64_t cap_bytes, GBuffer& out,
                        VoxelsDrawn& drawn) {
    const VoxelTree& tree = *model.tree;
    if (tree.empty()) return true;
    Resources& gl = *resources_;
    const VoxelRays rays(view.camera, tree.frame, view.width_px, view.height_px, view.offset_px);
    const VoxelTile& picture = rays.picture();
    // Others the shader would have to scale.
    for (const double x : {0.0, double(view.width_px)})
        for (const double y : {0.0, double(view.height_px)}) {
            const double longest = picture.ray(int(x), int(y)).direction.cwiseAbs().maxCoeff();
            if (!(longest > 0x1p-100 && longest < 0x1p100)) return false;
        }
    Held* const held = gl.hold(model, cap_bytes);
    if (held == nullptr) return false;

    const VoxelClip clip(view.clips, tree.frame);
    const ColorRange range = model.colors.range();
    View block = {.origin = wide(picture.first.origin),
                  .origin_per_x = wide(picture.origin_per_x),
                  .origin_per_y = wide(picture.origin_per_y),
                  .direction = wide(picture.first.direction),
                  .direction_per_x = wide(picture.direction_per_x),
                  .direction_per_y = wide(picture.direction_per_y),
                  .towards_eye = wide(-view.camera.forward()),
                  .least_t = rays.near_depth(),
                  .spread = view.error_px * rays.spread(),
                  .footprint = view.error_px * rays.footprint(),
                  .pixel_spread = rays.spread(),
                  .pixel_footprint = rays.footprint(),
                  .elevation_origin = tree.frame.origin.z(),
                  .voxel_size = tree.frame.voxel_size,
                  .range_low = range.low,
                  .range_extent = range.high - range.low,
                  .levels = tree.frame.levels,
                  .node_levels = int32_t(tree.levels.size()),
                  .keeping = int32_t(clip.keeping().size()),
                  .removing = int32_t(clip.removing().size()),
                  .width = out.width,
                  .has_full = held->full.has_value(),
                  .rule = int32_t(model.colors.rule()),
                  .smooth_shading = model.shading == VoxelShading::smooth,
                  .has_attributes = held->attributes.has_value(),
                  .has_normals = held->normals.has_value(),
                  .y_upwards = view.up == UpAxis::y,
                  .first_rows = held->first_rows,
                  .first_attributes = held->first_attributes,
                  .first_normals = held->first_normals};
    gl.bring_tables(model.colors, block.spread > 0.0 || block.footprint > 0.0);
    std::vector<Box3d> boxes = clip.keeping();
    boxes.insert(boxes.end(), clip.removing().begin(), clip.removing().end());
    if (!boxes.empty()) {
        std::vector<double> corners;
        for (const Box3d& box : boxes)
            corners.insert(corners.end(), {box.min.x(), box.min.y(), box.min.z(), box.max.x(), box.max.y(), box.max.z()});
        if (!gl.boxes || gl.boxes->size_bytes() < corners.size() * sizeof(double)) gl.boxes.emplace(corners.size() * sizeof(double));
        gl.boxes->write(0, corners.data(), corners.size() * sizeof(double));
    }

    const uint32_t most_rows = uint32_t(std::clamp<uint64_t>(kBandPixels / out.width, 1, out.rows));
    const uint64_t band_words = uint64_t{most_rows} * out.width * kPixelWords;
    if (!gl.pixels || gl.pixels->size_bytes() < 4 * band_words) {
        gl.pixels.reset();
        gl.pixels.emplace(4 * band_words);
    }
    gl.read.resize(band_words);
    gl.program.use();
    gl.view.bind_uniforms(0);
    const auto bind = [&](const std::optional<Buffer>& buffer, uint32_t binding) { (buffer ? *buffer : gl.nothing).bind_storage(binding); };
    bind(held->nodes, 0);
    bind(held->full, 1);
    bind(held->odd, 2);
    bind(held->attributes, 3);
    bind(held->normals, 4);
    gl.tables.bind_storage(5);
    bind(gl.boxes, 6);
    bind(gl.pixels, 7);
    for (uint32_t row = 0; row < out.rows; row += most_rows) {
        block.first_row = out.first_row + row;
        block.row_count = std::min(most_rows, out.rows - row);
        gl.view.write(0, &block, sizeof block);
        Program::dispatch((out.width + kGroup - 1) / kGroup, (block.row_count + kGroup - 1) / kGroup);
        Program::finish_writes();
        gl.pixels->read(0, gl.read.data(), 4 * uint64_t{block.row_count} * out.width * kPixelWords);
        merge(std::span(gl.read).first(size_t{block.row_count} * out.width * kPixelWords), size_t{row} * out.width, tree, drawable, rays,
              view, out, drawn);
    }
    return true;
}

}  // namespace strata
