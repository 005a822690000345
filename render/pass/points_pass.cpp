#include "render/pass/points_pass.h"

#include <algorithm>
#include <vector>

#include "core/parallel.h"
#include "render/pass/blend_kernel.h"
#include "render/pass/point_block.h"
#include "render/pass/points_kernel.h"
#include "render/pass/resolve_kernel.h"

namespace strata {
namespace {

constexpr size_t kUnitPoints = 1 << 14;  // points a thread takes at a time
static_assert(kBlendPixelBytes == sizeof(LightSum));

}  // namespace

PointsPass::PointsPass() = default;
PointsPass::~PointsPass() = default;

WordRows PointsPass::resize(uint32_t width, uint32_t first_row, uint32_t rows) {
    stride_ = width + PixelRows::kPadding;
    const size_t needed = size_t(stride_) * rows;
    if (needed > capacity_) {
        words_.reset();
        words_ = std::make_unique_for_overwrite<uint64_t[]>(needed);  // threads touch their own pages first
        capacity_ = needed;
    }
    if (rows != rows_) locks_ = std::make_unique<BandLocks>(rows);
    width_ = width;
    first_row_ = first_row;
    rows_ = rows;
    return {{stride_, width_, first_row_, rows_, *locks_}, words_.get()};
}

void PointsPass::clear(uint32_t width, uint32_t first_row, uint32_t rows, int threads) {
    resize(width, first_row, rows);
    parallel_blocks(threads, size_t(stride_) * rows, 1 << 17,
                    [&](size_t begin, size_t end) { std::fill(words_.get() + begin, words_.get() + end, uint64_t{0}); });
}

void PointsPass::draw(std::span<const PointNode> nodes, const PointProjection& projection, const SplatStyle& style, int threads,
                      SimdLevel level) {
    struct Unit {
        const PointNode* node;
        size_t begin, end;
    };
    std::vector<Unit> units;
    for (const PointNode& node : nodes) {
        if (node.bottom_row < float(first_row_) || node.top_row >= float(first_row_ + rows_)) continue;
        for (size_t begin = 0; begin < node.points->size(); begin += kUnitPoints)
            units.push_back({&node, begin, std::min(begin + kUnitPoints, node.points->size())});
    }
    const PixelRows rows = {stride_, width_, first_row_, rows_, *locks_};
    const auto each_unit = [&](const auto& body) {
        parallel_blocks(threads, units.size(), 1, [&](size_t begin, size_t end) {
            for (size_t i = begin; i < end; ++i) body(units[i]);
        });
    };
    const WordRows words = {rows, words_.get()};
    const DrawPoints draw_points = points_kernel(level);
    each_unit([&](const Unit& unit) { draw_points(words, *unit.node, unit.begin, unit.end, projection, style); });
    if (style.shape != SplatShape::gaussian) return;

    resize_sums();
    parallel_blocks(threads, size_t(stride_) * rows_, 1 << 15,
                    [&](size_t begin, size_t end) { std::fill(sums_.get() + begin, sums_.get() + end, LightSum{}); });
    const BlendRows sums = {rows, words_.get(), sums_.get()};
    const BlendPoints blend_points = blend_kernel(level);
    each_unit([&](const Unit& unit) { blend_points(sums, *unit.node, unit.begin, unit.end, projection, style); });
}

LightSum* PointsPass::resize_sums() {
    const size_t needed = size_t(stride_) * rows_;
    if (needed > sums_capacity_) {
        sums_.reset();
        sums_ = std::make_unique_for_overwrite<LightSum[]>(needed);
        sums_capacity_ = needed;
    }
    return sums_.get();
}

void PointsPass::resolve(std::span<const PointNode> nodes, const PointProjection& projection, const SplatStyle& style,
                         const ResolveOptions& options, int threads, GBuffer& out, SimdLevel level) const {
    const size_t pixels = size_t(width_) * rows_;
    out.width = width_;
    out.first_row = first_row_;
    out.rows = rows_;
    out.colors.resize(pixels);
    out.depths.resize(pixels);
    out.splat_px.resize(options.splat_px ? pixels : 0);
    out.ids.resize(options.ids ? pixels : 0);
    const bool near = std::all_of(nodes.begin(), nodes.end(), [&](const PointNode& node) { return is_near(*node.points, projection); });
    std::vector<uint32_t> slots;
    for (uint32_t slot = 0; slot < nodes.size(); ++slot)
        while (slots.size() * ResolveInput::kSlotRanks < nodes[slot].first_rank + nodes[slot].points->size()) slots.push_back(slot);
    const ResolveInput input = {nodes, slots, projection, style, options, near};
    const ResolveRow resolve_row = resolve_kernel(level);
    parallel_blocks(threads, rows_, 16, [&](size_t first, size_t last) {
        for (size_t row = first; row < last; ++row) {
            const uint64_t* const words = words_.get() + row * stride_;
            resolve_row(input, words, first_row_ + uint32_t(row), out, row * width_);
            if (style.shape == SplatShape::gaussian) average_light(sums_.get() + row * stride_, words, {out.colors.data() + row * width_, width_});
        }
    });
}

}  // namespace strata
