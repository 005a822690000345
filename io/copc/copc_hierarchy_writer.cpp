#include "io/copc/copc_hierarchy_writer.h"

#include <algorithm>
#include <cstring>

namespace strata::copc {
namespace {

constexpr size_t kEntryBytes = 32;
constexpr uint32_t kPageLevels = 4;
constexpr uint32_t kLeastPageNodes = 50;
constexpr int32_t kIsPage = -1;
constexpr size_t kNoParent = SIZE_MAX;

// A tree as arrays: nodes level by level, so that each comes behind the one above it.
struct Tree {
    std::vector<BuiltNode> nodes;
    std::vector<size_t> parents;
    std::vector<uint32_t> sizes;  // nodes of the branch, itself counted; 0: nothing with points

    explicit Tree(std::vector<BuiltNode> all) : nodes(std::move(all)), parents(nodes.size(), kNoParent), sizes(nodes.size(), 0) {
        std::sort(nodes.begin(), nodes.end(), [](const BuiltNode& a, const BuiltNode& b) {
            return a.key.level != b.key.level ? a.key.level < b.key.level : octant_order(a.key, b.key);
        });
        // Children come in the order of their parents.
        for (size_t i = 1, parent = 0; i < nodes.size(); parents[i++] = parent)
            while (nodes[parent].key != nodes[i].key.parent()) ++parent;
        for (size_t i = nodes.size(); i-- > 0;) {
            if (nodes[i].points > 0 || sizes[i] > 0 || i == 0) ++sizes[i];
            if (i > 0) sizes[parents[i]] += sizes[i];
        }
    }

    bool begins_page(size_t i) const { return i == 0 || (nodes[i].key.level % kPageLevels == 0 && sizes[i] > kLeastPageNodes); }
};

struct PageRange {
    uint64_t offset = 0, bytes = 0;
};

void put_entry(std::byte* out, const NodeKey& key, uint64_t offset, uint64_t bytes, int32_t points) {
    const int32_t words[] = {int32_t(key.level), int32_t(key.x), int32_t(key.y), int32_t(key.z)};
    const int32_t size = int32_t(bytes);
    std::memcpy(out, words, 16);
    std::memcpy(out + 16, &offset, 8);
    std::memcpy(out + 24, &size, 4);
    std::memcpy(out + 28, &points, 4);
}

}  // namespace

HierarchyPages write_hierarchy(std::vector<BuiltNode> nodes, uint64_t offset) {
    if (nodes.empty()) nodes.push_back({});  // readers want a root
    const Tree tree(std::move(nodes));
    std::vector<PageRange> pages;
    std::vector<size_t> page_of(tree.nodes.size());
    for (size_t i = 0; i < tree.nodes.size(); ++i) {
        if (tree.sizes[i] == 0) continue;
        if (tree.begins_page(i)) {
            if (i > 0) pages[page_of[tree.parents[i]]].bytes += kEntryBytes;  // the entry that names the page
            page_of[i] = pages.size();
            pages.push_back({});
        } else {
            page_of[i] = page_of[tree.parents[i]];
        }
        pages[page_of[i]].bytes += kEntryBytes;
    }
    uint64_t end = offset;
    for (PageRange& page : pages) {
        page.offset = end;
        end += page.bytes;
    }

    HierarchyPages written{std::vector<std::byte>(end - offset), pages[0].offset, pages[0].bytes};
    std::vector<uint64_t> next;  // where each page goes on
    for (const PageRange& page : pages) next.push_back(page.offset - offset);
    const auto append = [&](size_t page, const NodeKey& key, uint64_t entry_offset, uint64_t bytes, int32_t points) {
        put_entry(written.bytes.data() + next[page], key, entry_offset, bytes, points);
        next[page] += kEntryBytes;
    };
    for (size_t i = 0; i < tree.nodes.size(); ++i) {
        if (tree.sizes[i] == 0) continue;
        const BuiltNode& node = tree.nodes[i];
        const PageRange& page = pages[page_of[i]];
        if (i > 0 && tree.begins_page(i)) append(page_of[tree.parents[i]], node.key, page.offset, page.bytes, kIsPage);
        append(page_of[i], node.key, node.points > 0 ? node.byte_offset : 0, node.points > 0 ? node.byte_size : 0, int32_t(node.points));
    }
    return written;
}

}  // namespace strata::copc
