#include "core/octree/record_layout.h"

namespace strata {

std::span<std::byte> drop_attributes(const RecordLayout& layout, const std::vector<bool>& kept, std::span<std::byte> records) {
    struct Piece {
        size_t offset, size;
    };
    std::vector<Piece> pieces = {{0, 12}};  // runs of bytes that stay
    for (size_t a = 0; a < layout.attributes.size(); ++a) {
        if (!kept[a]) continue;
        const size_t size = layout.attributes[a].size_bytes();
        if (pieces.back().offset + pieces.back().size == layout.offsets[a])
            pieces.back().size += size;
        else
            pieces.push_back({layout.offsets[a], size});
    }
    if (pieces.size() == 1 && pieces[0].size == layout.size) return records;
    std::byte* to = records.data();
    for (const std::byte* from = records.data(); from != records.data() + records.size(); from += layout.size)
        for (const Piece& piece : pieces) {
            std::memmove(to, from + piece.offset, piece.size);
            to += piece.size;
        }
    return records.first(size_t(to - records.data()));
}

}  // namespace strata
