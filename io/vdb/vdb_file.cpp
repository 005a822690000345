#include "io/vdb/vdb_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <string_view>

#include "core/error.h"

namespace strata {
namespace {

constexpr std::string_view kMagic("\x20\x42\x44\x56\0\0\0\0", 8);
constexpr uint32_t kOldest = 222, kNewest = 224;  // before it, nodes were compressed in another way

std::string read_text(ByteStream& stream) {
    const uint32_t size = stream.number<uint32_t>();
    if (size > 4096) stream.fail_at_byte("a text of at most 4096 bytes is expected, its length is " + std::to_string(size));
    std::string text(size, '\0');
    stream.read(std::as_writable_bytes(std::span(text)));
    return text;
}

// A value whose type is not looked for is stepped over.
void read_metadata(ByteStream& stream, VdbGrid* grid) {
    const uint32_t count = stream.number<uint32_t>();
    for (uint32_t i = 0; i < count; ++i) {
        const std::string name = read_text(stream), type = read_text(stream);
        const uint32_t size = stream.number<uint32_t>();
        const uint64_t end = stream.position() + size;
        if (size > stream.left()) stream.fail_at_byte("metadata of " + std::to_string(size) + " bytes, " + std::to_string(stream.left()) + " are left");
        const auto index = [&] {
            Vec3i place;
            for (int& part : place) part = stream.number<int32_t>();
            return place;
        };
        if (!grid) {
        } else if (name == "class" && type == "string" && size <= 64) {
            grid->grid_class.resize(size);
            stream.read(std::as_writable_bytes(std::span(grid->grid_class)));
            if (grid->grid_class == "unknown") grid->grid_class.clear();
        } else if (name == "file_voxel_count" && type == "int64" && size == 8) {
            if (const int64_t voxels = stream.number<int64_t>(); voxels >= 0) grid->active_voxels = uint64_t(voxels);
        } else if (name == "file_bbox_min" && type == "vec3i" && size == 12) {
            grid->least_index = index();
        } else if (name == "file_bbox_max" && type == "vec3i" && size == 12) {
            grid->greatest_index = index();
        } else if (name == "strata_levels" && type == "int32" && size == 4) {
            if (const int32_t levels = stream.number<int32_t>(); levels >= 1 && levels <= 10) grid->strata_levels = levels;
        }
        stream.seek(end);
    }
}

Vec3d read_vector(ByteStream& stream) {
    Vec3d vector;
    for (double& part : vector) part = stream.number<double>();
    return vector;
}

// returns  whether the stream is behind it: of a map that is not known the size is not
bool read_transform(ByteStream& stream, VdbGrid& grid) {
    grid.map = read_text(stream);
    Vec3d scale = Vec3d::Ones(), shift = Vec3d::Zero();
    const bool scales = grid.map.ends_with("ScaleMap") || grid.map.ends_with("ScaleTranslateMap");
    if (grid.map == "TranslationMap" || grid.map.ends_with("ScaleTranslateMap")) shift = read_vector(stream);
    if (scales) {
        scale = read_vector(stream);
        stream.skip(4 * 24);  // its absolute value, its inverse and two squares
    } else if (grid.map == "AffineMap" || grid.map == "UnitaryMap") {
        // Rows multiply a row vector from the right: the last row is the shift.
        std::array<double, 16> matrix;
        for (double& part : matrix) part = stream.number<double>();
        scale = {matrix[0], matrix[5], matrix[10]};
        shift = {matrix[12], matrix[13], matrix[14]};
        for (const size_t other : {1, 2, 3, 4, 6, 7, 8, 9, 11})
            if (matrix[other] != 0.0) return true;
        if (matrix[15] != 1.0) return true;
    } else if (grid.map != "TranslationMap") {
        return false;  // a frustum
    }
    if (!scale.allFinite() || !shift.allFinite() || scale.minCoeff() <= 0.0) return true;
    grid.voxel_size = scale;
    grid.place_of_0 = shift;
    return true;
}

// "Tree_float_5_4_3_HalfFloat"
void read_type(const std::string& text, VdbGrid& grid) {
    std::string_view type = text;
    constexpr std::string_view kHalf = "_HalfFloat", kBranches = "_5_4_3", kTree = "Tree_";
    if (type.ends_with(kHalf)) {
        grid.is_half = true;
        type.remove_suffix(kHalf.size());
    }
    if (type.starts_with(kTree)) type.remove_prefix(kTree.size());
    if (type.ends_with(kBranches)) {
        grid.is_common = true;
        type.remove_suffix(kBranches.size());
    }
    grid.type = std::string(type);
}

struct Descriptor {
    std::string unique_name, parent;
    uint64_t begin = 0, end = 0;
};

}  // namespace

bool is_vdb(std::string_view head) { return head.starts_with(kMagic); }

std::optional<Box3d> VdbGrid::bounds() const {
    if (!voxel_size || !least_index || !greatest_index || (greatest_index->array() < least_index->array()).any()) return std::nullopt;
    Box3d box;
    box.extend(Vec3d(place_of_0 + voxel_size->cwiseProduct(least_index->cast<double>())));
    box.extend(Vec3d(place_of_0 + voxel_size->cwiseProduct(greatest_index->cast<double>())));
    return box;
}

VdbFile read_vdb_header(ByteStream& stream) {
    VdbFile file;
    const std::span<const std::byte> magic = stream.take(8);
    if (std::memcmp(magic.data(), kMagic.data(), 8) != 0) stream.fail_at_byte("OpenVDB's signature is expected");
    file.version = stream.number<uint32_t>();
    if (file.version < kOldest || file.version > kNewest)
        throw Error(ErrorKind::unsupported, stream.name() + ": file versions 222 to 224 of OpenVDB are read, this is " + std::to_string(file.version));
    const uint32_t major = stream.number<uint32_t>();
    file.library = std::to_string(major) + "." + std::to_string(stream.number<uint32_t>());
    if (stream.number<uint8_t>() == 0)
        throw Error(ErrorKind::unsupported, stream.name() + ": offsets of grids are expected, it was written as a stream without");
    stream.skip(36);  // its own name, a UUID as text
    read_metadata(stream, nullptr);

    const int32_t count = stream.number<int32_t>();
    if (count < 0 || uint64_t(count) > stream.left() / 36) stream.fail_at_byte(std::to_string(count) + " grids are beyond the bytes left");
    std::vector<Descriptor> descriptors;
    for (int32_t i = 0; i < count; ++i) {
        VdbGrid grid;
        Descriptor descriptor;
        descriptor.unique_name = read_text(stream);
        grid.name = descriptor.unique_name.substr(0, descriptor.unique_name.find('\x1e'));  // what follows tells equal names apart
        read_type(read_text(stream), grid);
        descriptor.parent = read_text(stream);
        const int64_t begin = stream.number<int64_t>(), blocks = stream.number<int64_t>(), end = stream.number<int64_t>();
        const uint64_t next = stream.position();
        const bool has_tree = descriptor.parent.empty();  // else its blocks are at 0
        if (begin < int64_t(next) || end < begin || uint64_t(end) > stream.size() || (has_tree && (blocks < begin || end < blocks)))
            stream.fail_at_byte("grid " + std::to_string(i) + ": offsets within the file's " + std::to_string(stream.size()) + " bytes are expected, they are " +
                                std::to_string(begin) + ", " + std::to_string(blocks) + " and " + std::to_string(end));
        descriptor.begin = uint64_t(begin);
        descriptor.end = uint64_t(end);
        stream.seek(descriptor.begin);
        grid.compression = stream.number<uint32_t>();
        read_metadata(stream, &grid);
        if (read_transform(stream, grid)) grid.tree_offset = stream.position();
        grid.tree_end = descriptor.end;
        if (grid.tree_offset > grid.tree_end) stream.fail_at_byte("grid " + std::to_string(i) + ": its tree begins beyond its end");
        // Each grid's descriptor stands right before it, the next one's right behind its end.
        stream.seek(descriptor.end);
        descriptors.push_back(std::move(descriptor));
        file.grids.push_back(std::move(grid));
    }
    for (size_t i = 0; i < descriptors.size(); ++i) {
        if (descriptors[i].parent.empty()) continue;
        const auto parent = std::find_if(descriptors.begin(), descriptors.end(), [&](const Descriptor& other) {
            return other.unique_name == descriptors[i].parent && other.parent.empty();
        });
        if (parent == descriptors.end())
            throw Error(ErrorKind::malformed, stream.name() + ": grid " + std::to_string(i) + " shares the tree of another, which is not there");
        const VdbGrid& shared = file.grids[size_t(parent - descriptors.begin())];
        file.grids[i].tree_offset = shared.tree_offset;
        file.grids[i].tree_end = shared.tree_end;
        file.grids[i].compression = shared.compression;
    }
    return file;
}

}  // namespace strata
