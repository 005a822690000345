#pragma once

#include <cstdint>
#include <list>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "render/gl/buffer.h"
#include "render/stream/resident_node.h"

namespace strata {

class EglContext;

/// Points in the GPU's memory, in chunks of one size, under a byte cap: what is drawn again is there already. A chunk that
/// is not held for what is drawn now is replaced when its room is needed, the least recently held first.
class PointPool {
public:
    static constexpr uint32_t kChunkPoints = 2048;
    static constexpr uint64_t kPositionBytes = 3 * sizeof(int32_t), kShapeBytes = sizeof(PointShape);
    static constexpr uint64_t kNormalBytes = sizeof(PackedNormal), kColorBytes = sizeof(Rgba8);
    static constexpr uint64_t kChunkBytes = kChunkPoints * (kPositionBytes + kShapeBytes + kNormalBytes + kColorBytes);

    /// Chunks by column; positions are x of a chunk's points, then y, then z. Columns that nothing wanted are not there.
    struct Page {
        explicit Page(uint32_t chunks) : points(uint64_t{chunks} * kChunkPoints), positions(points * kPositionBytes) {}

        uint64_t points;
        Buffer positions;
        std::optional<Buffer> shapes, normals, colors;
    };
    /// Columns beside positions.
    struct Columns {
        bool shapes = false, normals = false, colors = false;
    };
    struct Place {
        uint32_t page = 0, chunk = 0;
    };

    /// The context must be current while this lives.
    explicit PointPool(const EglContext&) {}

    /// Lets go of what is held. cap_bytes: at most; at least one chunk fits. Another cap than before forgets all.
    void release(uint64_t cap_bytes);

    /// Brings points [first, first + kChunkPoints) of a node, as far as it has them, and holds them. Nodes with a serial are
    /// found again until they are replaced, others are not.
    /// columns  what is wanted; the node has them
    /// returns  false: there is no room left beside what is held; always true after release
    /// throws   Error{device} where the GPU has less memory than the cap
    bool hold(const ResidentNode& node, uint32_t first, Columns columns, Place& place);

    /// Forgets all: serials mean other nodes from now on.
    void clear();

    const Page& page(uint32_t index) const { return pages_[index]; }
    uint32_t pages() const { return uint32_t(pages_.size()); }
    uint64_t uploaded_bytes() const { return uploaded_bytes_; }  // so far

private:
    using Key = std::pair<uint64_t, uint32_t>;  // serial, first point
    struct Chunk {
        Place place;
        Key key;                               // serial 0: is not to be found
        uint64_t shapes_version = 0;           // 0: not there
        bool normals = false, colors = false;  // whether they are there
        uint64_t last_held = 0;                // how many releases went before; 0: holds nothing that is wanted
    };
    using Chunks = std::list<Chunk>;

    bool take_chunk();
    void add_page();
    void upload(Buffer& to, uint64_t offset, const void* bytes, uint64_t count);
    void upload_positions(const Place& place, const ResidentNode& node, uint32_t first);
    void upload_column(std::optional<Buffer>& to, uint64_t point_bytes, const Place& place, const ResidentNode& node, uint32_t first,
                       const void* bytes);

    uint64_t most_chunks_ = 0, releases_ = 0, uploaded_bytes_ = 0;
    std::vector<Page> pages_;
    Chunks chunks_;  // the most recently held first
    std::map<Key, Chunks::iterator> found_;
};

}  // namespace strata
