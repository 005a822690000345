#include "core/surface/vertex_positions.h"

#include <algorithm>
#include <limits>
#include <span>

namespace strata {
namespace {

constexpr uint64_t kPageBytes = 32'768 * sizeof(Vec3d);
constexpr size_t kLeastPages = 4;

}  // namespace

VertexPositions::VertexPositions(ScratchStore* scratch, uint64_t memory_bytes)
    : scratch_(scratch), most_pages_(scratch ? std::max<size_t>(kLeastPages, size_t(memory_bytes / kPageBytes)) : std::numeric_limits<size_t>::max()) {}

void VertexPositions::append(const SurfacePiece& piece) {
    for (size_t done = 0; done < piece.positions.size();) {
        const size_t in_page = size_t(size_ % kPageVertices);
        if (in_page == 0) {
            std::unique_ptr<Vec3d[]> room = free_page();
            pages_.push_back({.vertices = std::move(room)});
        }
        Page& page = pages_.back();
        if (!page.vertices) load(pages_.size() - 1);
        const size_t count = std::min(kPageVertices - in_page, piece.positions.size() - done);
        for (size_t i = 0; i < count; ++i) page.vertices[in_page + i] = piece.origin + piece.positions[done + i].cast<double>();
        page.used = true;
        page.stored = false;
        done += count;
        size_ += count;
    }
}

// Room for a page more, that of another one where there are as many as may be. Pages that were not used of late go first.
std::unique_ptr<Vec3d[]> VertexPositions::free_page() {
    if (loaded_ < most_pages_) {
        ++loaded_;
        return std::make_unique<Vec3d[]>(kPageVertices);
    }
    for (;; hand_ = (hand_ + 1) % pages_.size()) {
        Page& page = pages_[hand_];
        if (!page.vertices) continue;
        if (page.used) {
            page.used = false;
            continue;
        }
        if (!page.stored) scratch_->write(hand_ * kPageBytes, std::as_bytes(std::span(page.vertices.get(), kPageVertices)));
        page.stored = true;
        return std::move(page.vertices);
    }
}

void VertexPositions::load(size_t page) {
    std::unique_ptr<Vec3d[]> room = free_page();
    scratch_->read(page * kPageBytes, std::as_writable_bytes(std::span(room.get(), kPageVertices)));
    pages_[page].vertices = std::move(room);
}

}  // namespace strata
