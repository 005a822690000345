#include "io/draco/draco_header.h"

#include <algorithm>
#include <array>

#include "core/error.h"
#include "io/byte_reader.h"

namespace strata::drc {
namespace {

constexpr uint64_t kFreeBytes = 128 << 20, kBytesPerByte = 2048, kMostBytes = uint64_t{4} << 30;  // of allowed_bytes
constexpr uint64_t kHeadBytes = 64 * 1024, kLongHeadBytes = 64 << 20;  // hold all before the values; the longer if metadata is long
constexpr int kMostDepth = 100;           // of metadata within metadata
constexpr uint16_t kMetadataFlag = 0x8000;
constexpr uint8_t kMesh = 1;                                       // geometries: points are 0
constexpr uint8_t kSequential = 0, kKdTree = 1, kEdgebreaker = 1;  // methods: of both, of points, of meshes
constexpr uint32_t kMostKdLevel = 6, kMostKdBits = 32;

int version_of(const Header& header) { return header.major_version * 10 + header.minor_version; }

std::string version_text(const Header& header) { return std::to_string(header.major_version) + "." + std::to_string(header.minor_version); }

// Seven bits a byte, the low ones first, the eighth says that more follow.
uint32_t read_varint(ByteReader& reader) {
    uint64_t value = 0;
    for (int shift = 0; shift < 35; shift += 7) {
        const uint8_t byte = reader.read<uint8_t>();
        value |= uint64_t(byte & 127) << shift;
        if (byte < 128) {
            if (value > UINT32_MAX) reader.fail("a number of 32 bits expected");
            return uint32_t(value);
        }
    }
    reader.fail("a number of at most five bytes expected");
}

std::string read_name(ByteReader& reader) {
    const std::span<const std::byte> text = reader.take(reader.read<uint8_t>());
    return {reinterpret_cast<const char*>(text.data()), text.size()};
}

// One element with those inside it, whose names nothing here asks for.
void read_entries(ByteReader& reader, Entries& entries, int depth) {
    if (depth > kMostDepth) reader.fail("metadata within metadata, " + std::to_string(kMostDepth) + " deep");
    for (uint32_t left = read_varint(reader); left > 0; --left) {
        std::string name = read_name(reader);
        const std::span<const std::byte> value = reader.take(read_varint(reader));
        entries[std::move(name)].assign(value.begin(), value.end());
    }
    for (uint32_t left = read_varint(reader); left > 0; --left) {
        read_name(reader);
        Entries ignored;
        read_entries(reader, ignored, depth + 1);
    }
}

void read_metadata(ByteReader& reader, Header& header) {
    for (uint32_t left = read_varint(reader); left > 0; --left) {
        const uint32_t id = read_varint(reader);
        read_entries(reader, header.attribute_metadata[id], 0);
    }
    read_entries(reader, header.metadata, 0);
}

AttributeHeader read_attribute(ByteReader& reader, int version) {
    AttributeHeader attribute;
    const uint8_t kind = reader.read<uint8_t>(), type = reader.read<uint8_t>();
    if (kind > uint8_t(AttributeKind::weights)) reader.fail("attribute type 0 to 8 expected, got " + std::to_string(kind));
    attribute.kind = AttributeKind(kind);
    const std::optional<ScalarType> scalar = scalar_of_data_type(type);
    if (!scalar) reader.fail("data type 1 to 11 expected, got " + std::to_string(type));
    attribute.type = *scalar;
    attribute.components = reader.read<uint8_t>();
    if (attribute.components == 0) reader.fail("an attribute without components");
    attribute.normalized = reader.read<uint8_t>() != 0;
    attribute.id = version < 13 ? reader.read<uint16_t>() : read_varint(reader);
    return attribute;
}

// Of the decoders that points have one behind the other; kd-trees are of one.
void read_attributes(ByteReader& reader, Header& header, bool kd_tree) {
    const int version = version_of(header);
    const int decoders = reader.read<uint8_t>();
    if (kd_tree && decoders != 1) reader.fail("one kd-tree expected, got " + std::to_string(decoders));
    for (int decoder = 0; decoder < decoders; ++decoder) {
        const uint32_t count = version < 20 ? reader.read<uint32_t>() : read_varint(reader);
        if (count == 0 || count > reader.left())
            reader.fail(std::to_string(count) + " attributes in " + std::to_string(reader.left()) + " bytes");
        for (uint32_t i = 0; i < count; ++i) header.attributes.push_back(read_attribute(reader, version));
        if (!kd_tree) reader.skip(count);  // how each is coded
    }
}

// Draco goes by the count of the kd-tree itself, far beyond that of the file.
void check_kd_tree(ByteReader& reader, const Header& header, uint64_t allowed) {
    if (const int level = reader.read<uint8_t>(); level > int(kMostKdLevel))
        reader.fail("compression level 0 to 6 expected, got " + std::to_string(level));
    if (const uint32_t bits = reader.read<uint32_t>(); bits > kMostKdBits)
        reader.fail("at most 32 bits expected, got " + std::to_string(bits));
    if (const uint32_t points = reader.read<uint32_t>(); points != header.points)
        reader.fail("a kd-tree of " + std::to_string(header.points) + " points expected, got " + std::to_string(points));
    uint64_t dimensions = 0;
    for (const AttributeHeader& attribute : header.attributes) dimensions += uint64_t(attribute.components);
    // Two stacks of 32 levels an axis, a number an axis each.
    if (dimensions * dimensions * 32 * 2 * sizeof(uint32_t) > allowed) reader.fail(std::to_string(dimensions) + " axes of a kd-tree");
}

void check_need(ByteReader& reader, uint64_t needed, uint64_t allowed, const std::string& what) {
    if (needed > allowed)
        reader.fail(what + " need about " + std::to_string(needed >> 20) + " MiB of memory, at most " + std::to_string(allowed >> 20) +
                    " MiB are expected of a file of this size");
}

void read_points(ByteReader& reader, Header& header, uint8_t method, uint64_t allowed) {
    if (method > kKdTree) reader.fail("encoding method 0 or 1 of points expected, got " + std::to_string(method));
    header.method = method == kSequential ? "sequential" : "kd-tree";
    if (method == kKdTree && version_of(header) < 23)
        reader.fail("a kd-tree of bitstream 2.3 expected, got " + version_text(header));  // older ones count again, unchecked
    const int32_t points = reader.read<int32_t>();
    if (points < 0) reader.fail("number of points: at most 2147483647 expected");
    header.points = uint64_t(points);
    read_attributes(reader, header, method == kKdTree);
    check_need(reader, decoding_bytes(header.points, header.attributes), allowed, std::to_string(points) + " points");
    if (method == kKdTree) check_kd_tree(reader, header, allowed);
}

void read_mesh(ByteReader& reader, Header& header, uint8_t method, uint64_t allowed) {
    if (method > kEdgebreaker) reader.fail("encoding method 0 or 1 of a mesh expected, got " + std::to_string(method));
    const int version = version_of(header);
    const auto count = [&](int newer) { return version < newer ? reader.read<uint32_t>() : read_varint(reader); };
    uint64_t needed = 0;
    if (method == kSequential) {
        header.method = "sequential";
        header.faces = count(22);
        header.points = count(22);
        needed = header.faces * 6 * sizeof(uint32_t);
    } else {
        header.method = "edgebreaker";
        reader.skip(1);  // kind of traversal
        const uint64_t more_vertices = version < 22 ? count(20) : 0;
        const uint64_t vertices = count(20);
        header.faces = count(20);
        const uint64_t seams = reader.read<uint8_t>();  // attributes with faces of their own
        header.points = 3 * header.faces;
        // Corners, their opposites, what was visited, lists of the way; for each attribute with seams about as much again.
        needed = (header.faces * 96 + (vertices + more_vertices) * 16) * (1 + seams);
    }
    if (header.points > 3 * header.faces)
        reader.fail(std::to_string(header.points) + " points of " + std::to_string(header.faces) + " faces");
    check_need(reader, needed, allowed, std::to_string(header.faces) + " faces");
}

Header parse(std::span<const std::byte> head, uint64_t file_bytes, const std::string& name) {
    ByteReader reader(head, name + ": header");
    Header header;
    if (text_before_nul(reader.take(5)) != "DRACO") reader.fail("DRACO expected");
    header.major_version = reader.read<uint8_t>();
    header.minor_version = reader.read<uint8_t>();
    const uint8_t geometry = reader.read<uint8_t>(), method = reader.read<uint8_t>();
    const uint16_t flags = reader.read<uint16_t>();
    if (geometry > kMesh) reader.fail("points (0) or a mesh (1) expected, got " + std::to_string(geometry));
    header.mesh = geometry == kMesh;
    if (header.major_version < 1 || header.minor_version > 9 || version_of(header) > (header.mesh ? 22 : 23))
        throw Error(ErrorKind::unsupported, name + ": bitstream " + version_text(header) + " of " +
                                                (header.mesh ? "a mesh; 1.0 to 2.2 are read" : "points; 1.0 to 2.3 are read"));
    if ((flags & kMetadataFlag) != 0 && version_of(header) >= 13) read_metadata(reader, header);
    const uint64_t allowed = allowed_bytes(file_bytes);
    header.mesh ? read_mesh(reader, header, method, allowed) : read_points(reader, header, method, allowed);
    return header;
}

}  // namespace

uint64_t allowed_bytes(uint64_t file_bytes) {
    return std::min(kMostBytes, kFreeBytes + std::min(file_bytes, kMostBytes) * kBytesPerByte);
}

uint64_t decoding_bytes(uint64_t points, const std::vector<AttributeHeader>& attributes) {
    constexpr uint64_t kOrderBytes = 8;  // the order of the points and one list beside
    uint64_t of_point = kOrderBytes;
    // As decoded, as integers before, and once more where it is handed over; a map from points to values.
    for (const AttributeHeader& attribute : attributes)
        of_point += 2 * attribute.size_bytes() + uint64_t(attribute.components) * sizeof(int32_t) + sizeof(uint32_t);
    return points > UINT64_MAX / of_point ? UINT64_MAX : points * of_point;
}

std::optional<ScalarType> scalar_of_data_type(int type) {
    constexpr std::array kTypes = {ScalarType::int8,  ScalarType::uint8,  ScalarType::int16,   ScalarType::uint16,  ScalarType::int32, ScalarType::uint32,
                                   ScalarType::int64, ScalarType::uint64, ScalarType::float32, ScalarType::float64, ScalarType::uint8};  // the last: bool
    if (type < 1 || type > int(kTypes.size())) return std::nullopt;
    return kTypes[size_t(type) - 1];
}

Header read_header(const ByteSource& bytes) {
    std::vector<std::byte> head(size_t(std::min(kHeadBytes, bytes.size())));
    bytes.read(0, head);
    try {
        return parse(head, bytes.size(), bytes.name());
    } catch (const Error& error) {
        if (error.kind != ErrorKind::malformed || bytes.size() == head.size()) throw;
    }
    head.resize(size_t(std::min(kLongHeadBytes, bytes.size())));
    bytes.read(0, head);
    return parse(head, bytes.size(), bytes.name());
}

}  // namespace strata::drc
