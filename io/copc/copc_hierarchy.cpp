#include "io/copc/copc_hierarchy.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/error.h"
#include "io/byte_reader.h"
#include "io/las/laz_chunk_table.h"

namespace strata::copc {
namespace {

constexpr uint64_t kInfoBytes = 160;
constexpr uint64_t kEntryBytes = 32;
constexpr uint64_t kMostPageBytes = uint64_t{256} << 20;  // 8 million nodes
constexpr int32_t kDeepestLevel = 31;  // indices are int32
constexpr int32_t kIsPage = -1;

Error at_entry(const ByteSource& source, const NodeKey& key, const std::string& message) {
    return {ErrorKind::malformed, source.name() + ": hierarchy: node " + entry_name(key) + ": " + message};
}

Entry read_entry(const ByteSource& source, ByteReader& reader) {
    const auto level = reader.read<int32_t>(), x = reader.read<int32_t>(), y = reader.read<int32_t>(), z = reader.read<int32_t>();
    if (level < 0 || level > kDeepestLevel) reader.fail("a level of 0 to " + std::to_string(kDeepestLevel) + " is expected, " + std::to_string(level) + " found");
    for (const int32_t index : {x, y, z})
        if (index < 0 || int64_t{index} >= int64_t{1} << level)
            reader.fail("indices of 0 to " + std::to_string((int64_t{1} << level) - 1) + " are expected at level " + std::to_string(level) + ", " +
                        std::to_string(index) + " found");
    Entry entry;
    entry.key = {uint32_t(level), uint32_t(x), uint32_t(y), uint32_t(z)};
    entry.offset = reader.read<uint64_t>();
    const auto bytes = reader.read<int32_t>(), points = reader.read<int32_t>();
    if (points < kIsPage) throw at_entry(source, entry.key, std::to_string(points) + " points");
    entry.is_page = points == kIsPage;
    entry.points = entry.is_page ? 0 : uint32_t(points);
    if (points == 0) {
        entry.offset = 0;  // nothing is there, whatever the file says
        return entry;
    }
    if (bytes <= 0 || entry.offset > source.size() || uint64_t(bytes) > source.size() - entry.offset)
        throw at_entry(source, entry.key, "its " + std::to_string(bytes) + " bytes at " + std::to_string(entry.offset) + " lie beyond the file's " +
                                              std::to_string(source.size()) + " bytes");
    entry.bytes = uint64_t(bytes);
    if (entry.points / las::kMostLazPointsPerByte > entry.bytes)
        throw at_entry(source, entry.key, std::to_string(entry.points) + " points cannot lie in " + std::to_string(bytes) + " bytes");
    return entry;
}

}  // namespace

std::string entry_name(const NodeKey& key) {
    return std::to_string(key.level) + "-" + std::to_string(key.x) + "-" + std::to_string(key.y) + "-" + std::to_string(key.z);
}

Info read_info(const ByteSource& source, const las::Header& header) {
    if (header.records.empty() || !header.records.front().is("copc", 1))
        throw Error(ErrorKind::malformed, source.name() + ": the first record must be \"copc\", 1");
    const std::vector<std::byte> bytes = las::read_record(source, header.records.front(), kInfoBytes);
    ByteReader reader(bytes, source.name() + ": record copc", header.records.front().offset);
    Info info;
    for (int axis = 0; axis < 3; ++axis) info.center[axis] = reader.read<double>();
    info.half_size = reader.read<double>();
    info.spacing = reader.read<double>();
    const bool sound = info.center.allFinite() && std::isfinite(info.half_size) && info.half_size >= 0.0 && std::isfinite(info.spacing) && info.spacing >= 0.0;
    if (!sound) reader.fail("finite numbers are expected for center, half size and spacing, none of the last two below 0");
    info.root_offset = reader.read<uint64_t>();
    info.root_bytes = reader.read<uint64_t>();
    return info;
}

Page::Page(const ByteSource& source, const NodeKey& root, uint64_t offset, uint64_t bytes) {
    if (offset > source.size() || bytes > source.size() - offset || bytes % kEntryBytes != 0)
        throw at_entry(source, root, "a page of 32-byte entries is expected, " + std::to_string(bytes) + " bytes at " + std::to_string(offset) + " of " +
                                         std::to_string(source.size()) + " stated");
    if (bytes > kMostPageBytes) throw Error(ErrorKind::limit, at_entry(source, root, "a page of more than 256 MiB").what());
    std::vector<std::byte> page(static_cast<size_t>(bytes));
    source.read(offset, page);
    ByteReader reader(page, source.name() + ": hierarchy", offset);
    entries_.reserve(page.size() / kEntryBytes);
    while (reader.left() > 0) entries_.push_back(read_entry(source, reader));
    std::sort(entries_.begin(), entries_.end(), [](const Entry& a, const Entry& b) { return a.key < b.key; });
    for (size_t i = 0; i < entries_.size(); ++i) {
        const NodeKey& key = entries_[i].key;
        if (i > 0 && entries_[i - 1].key == key) throw at_entry(source, key, "two entries in one page");
        if (key == root) {
            if (entries_[i].is_page) throw at_entry(source, key, "its page only names another page");
            continue;
        }
        const Entry* const parent = key.level > root.level ? find(key.parent()) : nullptr;
        if (parent == nullptr || parent->is_page) throw at_entry(source, key, "its parent is not in its page, that of node " + entry_name(root));
    }
    if (!entries_.empty() && find(root) == nullptr) throw at_entry(source, root, "it is missing from its page");
}

const Entry* Page::find(const NodeKey& key) const {
    const auto found = std::lower_bound(entries_.begin(), entries_.end(), key, [](const Entry& entry, const NodeKey& k) { return entry.key < k; });
    return found != entries_.end() && found->key == key ? &*found : nullptr;
}

}  // namespace strata::copc
