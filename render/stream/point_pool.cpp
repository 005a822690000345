#include "render/stream/point_pool.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace strata {
namespace {

constexpr uint32_t kPageChunks = 512;  // 28 MB: few draws for what lies in a page, and no more memory than a small cloud needs

static_assert(sizeof(PointShape) == 8, "points.comp reads a float and three bytes");

uint64_t points_in(const ResidentNode& node, uint32_t first) {
    return uint64_t(std::min<size_t>(PointPool::kChunkPoints, node.size() - first));
}

}  // namespace

void PointPool::clear() {
    chunks_.clear();
    found_.clear();
    pages_.clear();
}

void PointPool::release(uint64_t cap_bytes) {
    const uint64_t most_chunks = std::max<uint64_t>(cap_bytes / kChunkBytes, 1);
    if (most_chunks != most_chunks_) clear();
    most_chunks_ = most_chunks;
    ++releases_;
    // Those that cannot be found again are the first to be replaced.
    for (auto next = chunks_.begin(); next != chunks_.end();) {
        const auto chunk = next++;
        if (chunk->key.first != 0 || chunk->last_held == 0) continue;
        chunk->last_held = 0;
        chunks_.splice(chunks_.end(), chunks_, chunk);
    }
}

void PointPool::add_page() {
    const uint64_t chunks = std::min<uint64_t>(kPageChunks, most_chunks_ - chunks_.size());
    pages_.emplace_back(uint32_t(chunks));
    for (uint32_t i = uint32_t(chunks); i-- > 0;) chunks_.push_back({.place = {pages() - 1, i}});
}

// Makes the chunk at the end the first one, if it may be replaced.
bool PointPool::take_chunk() {
    if (chunks_.empty() || (chunks_.back().last_held != 0 && chunks_.size() < most_chunks_)) add_page();
    const auto last = std::prev(chunks_.end());
    if (last->last_held == releases_) return false;
    if (last->key.first != 0) found_.erase(last->key);
    chunks_.splice(chunks_.begin(), chunks_, last);
    return true;
}

void PointPool::upload(Buffer& to, uint64_t offset, const void* bytes, uint64_t count) {
    to.write(offset, bytes, count);
    uploaded_bytes_ += count;
}

void PointPool::upload_positions(const Place& place, const ResidentNode& node, uint32_t first) {
    uint64_t offset = place.chunk * kChunkPoints * kPositionBytes;
    for (const auto* quanta : {&node.x, &node.y, &node.z}) {
        upload(pages_[place.page].positions, offset, quanta->data() + first, points_in(node, first) * sizeof(int32_t));
        offset += kChunkPoints * sizeof(int32_t);
    }
}

// bytes: of point `first`
void PointPool::upload_column(std::optional<Buffer>& to, uint64_t point_bytes, const Place& place, const ResidentNode& node, uint32_t first,
                              const void* bytes) {
    if (!to) to.emplace(pages_[place.page].points * point_bytes);
    upload(*to, place.chunk * kChunkPoints * point_bytes, bytes, points_in(node, first) * point_bytes);
}

bool PointPool::hold(const ResidentNode& node, uint32_t first, Columns columns, Place& place) {
    const Key key = {node.serial, first};
    const auto found = node.serial != 0 ? found_.find(key) : found_.end();
    if (found == found_.end()) {
        if (!take_chunk()) return false;
        chunks_.front() = {.place = chunks_.front().place, .key = key};
        if (node.serial != 0) found_.emplace(key, chunks_.begin());
        upload_positions(chunks_.front().place, node, first);
    } else {
        chunks_.splice(chunks_.begin(), chunks_, found->second);
    }
    Chunk& chunk = chunks_.front();
    Page& page = pages_[chunk.place.page];
    if (columns.shapes && chunk.shapes_version != node.shapes_version) {
        upload_column(page.shapes, kShapeBytes, chunk.place, node, first, &node.shapes[first]);
        chunk.shapes_version = node.shapes_version;
    }
    if (columns.normals && !std::exchange(chunk.normals, true))
        upload_column(page.normals, kNormalBytes, chunk.place, node, first, &node.normals[first]);
    if (columns.colors && !std::exchange(chunk.colors, true))
        upload_column(page.colors, kColorBytes, chunk.place, node, first, &node.colors[first]);
    chunk.last_held = releases_;
    place = chunk.place;
    return true;
}

}  // namespace strata
