#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/math/vec.h"
#include "core/octree/scratch_store.h"
#include "core/surface/surface_sink.h"

namespace strata {

/// The places of a surface's vertices by number, in pages of which only some are in memory: faces of a surface that grows refer to the
/// vertices of late, and to any.
class VertexPositions {
public:
    /// scratch       where pages go that do not fit; null: all stay in memory
    /// memory_bytes  for pages; some are kept however little it is
    VertexPositions(ScratchStore* scratch, uint64_t memory_bytes);

    void append(const SurfacePiece& piece);
    uint64_t size() const { return size_; }
    /// Where a vertex is, world. Of one page after another it costs as much as an array.
    Vec3d operator[](uint32_t vertex) {
        const size_t page = vertex / kPageVertices;
        if (!pages_[page].vertices) load(page);
        pages_[page].used = true;
        return pages_[page].vertices[vertex % kPageVertices];
    }

private:
    static constexpr size_t kPageVertices = 32'768;
    struct Page {
        std::unique_ptr<Vec3d[]> vertices;  // null: in the scratch store
        bool used = false;                  // since the hand came by
        bool stored = false;                // in the scratch store, as it is
    };

    std::unique_ptr<Vec3d[]> free_page();
    void load(size_t page);

    ScratchStore* scratch_;
    size_t most_pages_, loaded_ = 0;
    size_t hand_ = 0;  // a page: the next to be asked whether it may go
    std::vector<Page> pages_;
    uint64_t size_ = 0;
};

}  // namespace strata
