#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/octree/scratch_room.h"

namespace strata {

/// An array that grows at its end, in pages of which only some are in memory. Of one page after another it costs as much as an array.
template <typename T, size_t kPage>
class PagedArray {
    static_assert(std::is_trivially_destructible_v<T>);

public:
    static constexpr uint64_t kPageBytes = kPage * sizeof(T);

    /// scratch       where pages go that do not fit; null: all stay in memory
    /// memory_bytes  for pages; some are kept however little it is
    PagedArray(ScratchRoom* scratch, uint64_t memory_bytes)
        : scratch_(scratch),
          most_pages_(scratch ? std::max<size_t>(kLeastPages, size_t(memory_bytes / kPageBytes)) : std::numeric_limits<size_t>::max()) {}

    uint64_t size() const { return size_; }
    /// Valid until another element is asked for, as what the others return.
    const T& operator[](uint64_t at) { return page_of(at).elements[at % kPage]; }
    void set(uint64_t at, const T& value) {
        Page& page = page_of(at);
        page.is_stored = false;
        page.elements[at % kPage] = value;
    }
    /// As many new elements, at least one and at most so many, as the last page has room for; not set.
    std::span<T> grow(uint64_t most) {
        const auto begin = size_t(size_ % kPage);
        if (begin == 0) pages_.push_back({.elements = free_page()});
        Page& page = pages_.back();
        if (!page.elements) load(page);
        page.is_used = true;
        page.is_stored = false;
        const size_t count = size_t(std::min<uint64_t>(most, kPage - begin));
        size_ += count;
        return {page.elements.get() + begin, count};
    }

private:
    static constexpr size_t kLeastPages = 4;
    static constexpr uint64_t kNowhere = std::numeric_limits<uint64_t>::max();

    struct Page {
        std::unique_ptr<T[]> elements;  // null: in the scratch store
        uint64_t offset = kNowhere;     // there
        bool is_used = false;           // since the hand came by
        bool is_stored = false;         // in the scratch store, as it is
    };

    Page& page_of(uint64_t at) {
        Page& page = pages_[at / kPage];
        if (!page.elements) load(page);
        page.is_used = true;
        return page;
    }

    // Room for a page more, that of another one where there are as many as may be. Pages that were not used of late go first.
    std::unique_ptr<T[]> free_page() {
        if (loaded_ < most_pages_) {
            ++loaded_;
            return std::make_unique<T[]>(kPage);
        }
        for (;; hand_ = (hand_ + 1) % pages_.size()) {
            Page& page = pages_[hand_];
            if (!page.elements) continue;
            if (page.is_used) {
                page.is_used = false;
                continue;
            }
            if (page.offset == kNowhere) page.offset = scratch_->take(kPageBytes);
            if (!page.is_stored) scratch_->store().write(page.offset, std::as_bytes(std::span(page.elements.get(), kPage)));
            page.is_stored = true;
            return std::move(page.elements);
        }
    }

    void load(Page& page) {
        std::unique_ptr<T[]> room = free_page();
        scratch_->store().read(page.offset, std::as_writable_bytes(std::span(room.get(), kPage)));
        page.elements = std::move(room);
    }

    ScratchRoom* scratch_;
    size_t most_pages_, loaded_ = 0;
    size_t hand_ = 0;  // a page: the next to be asked whether it may go
    std::vector<Page> pages_;
    uint64_t size_ = 0;
};

}  // namespace strata
