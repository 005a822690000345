#pragma once

#include <cstdint>
#include <iterator>
#include <map>

namespace strata {

/// Byte ranges of a file, none of which meets another. A hierarchy whose every page claims its bytes has no cycle and is
/// never larger than its file.
class ClaimedRanges {
public:
    /// Claims `size` > 0 bytes that lie within 64 bits.
    /// returns  false, and changes nothing: some are claimed already
    bool claim(uint64_t offset, uint64_t size) {
        const auto next = ends_.lower_bound(offset);
        const bool meets = (next != ends_.end() && next->first < offset + size) || (next != ends_.begin() && std::prev(next)->second > offset);
        if (!meets) ends_.emplace_hint(next, offset, offset + size);
        return !meets;
    }
    /// Gives up what was claimed from `offset` on.
    void release(uint64_t offset) { ends_.erase(offset); }

private:
    std::map<uint64_t, uint64_t> ends_;  // by begin
};

}  // namespace strata
