#include "render/stream/point_pool.h"

#include <algorithm>
#include <iterator>

namespace strata {
namespace {

constexpr uint32_t kPageChunks = 512;  // 20 MB: few draws for what lies in a page, and no more memory than a small cloud needs

static_assert(sizeof(PointShape) == 8, "points.comp reads a float and three bytes");

uint32_t points_in(const ResidentNode& node, uint32_t first) {
    return uint32_t(std::min<size_t>(PointPool::kChunkPoints, node.size() - first));
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

void PointPool::upload_positions(const Place& place, const ResidentNode& node, uint32_t first) {
    Buffer& positions = pages_[place.page].positions;
    const uint64_t count = points_in(node, first) * sizeof(int32_t), column = kChunkPoints * sizeof(int32_t);
    uint64_t offset = place.chunk * kChunkPoints * kPositionBytes;
    for (const auto* quanta : {&node.x, &node.y, &node.z}) {
        positions.write(offset, quanta->data() + first, count);
        offset += column;
        uploaded_bytes_ += count;
    }
}

void PointPool::upload_shapes(Chunk& chunk, const ResidentNode& node, uint32_t first) {
    const uint64_t count = points_in(node, first) * kShapeBytes;
    pages_[chunk.place.page].shapes.write(chunk.place.chunk * kChunkPoints * kShapeBytes, node.shapes.data() + first, count);
    chunk.shapes_version = node.shapes_version;
    uploaded_bytes_ += count;
}

bool PointPool::hold(const ResidentNode& node, uint32_t first, bool shapes, Place& place) {
    const Key key = {node.serial, first};
    const auto found = node.serial != 0 ? found_.find(key) : found_.end();
    if (found == found_.end()) {
        if (!take_chunk()) return false;
        Chunk& chunk = chunks_.front();
        chunk.key = key;
        chunk.shapes_version = 0;
        if (node.serial != 0) found_.emplace(key, chunks_.begin());
        upload_positions(chunk.place, node, first);
        if (shapes) upload_shapes(chunk, node, first);
    } else {
        chunks_.splice(chunks_.begin(), chunks_, found->second);
        if (shapes && chunks_.front().shapes_version != node.shapes_version) upload_shapes(chunks_.front(), node, first);
    }
    chunks_.front().last_held = releases_;
    place = chunks_.front().place;
    return true;
}

}  // namespace strata
