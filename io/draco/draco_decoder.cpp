#include "io/draco/draco_decoder.h"

#include <draco/attributes/attribute_quantization_transform.h>
#include <draco/compression/mesh/mesh_edgebreaker_decoder.h>
#include <draco/compression/mesh/mesh_sequential_decoder.h>
#include <draco/compression/point_cloud/point_cloud_kd_tree_decoder.h>
#include <draco/compression/point_cloud/point_cloud_sequential_decoder.h>
#include <draco/mesh/mesh.h>

#include <cstring>
#include <memory>
#include <new>

#include "core/error.h"

namespace strata::drc {
namespace {

AttributeHeader header_of(const draco::PointAttribute& attribute) {
    // Draco has checked the numbers behind both.
    return {.kind = AttributeKind(attribute.attribute_type()),
            .type = scalar_of_data_type(attribute.data_type()).value_or(ScalarType::uint8),
            .components = attribute.num_components(),
            .normalized = attribute.normalized(),
            .id = attribute.unique_id()};
}

// A mesh may state 2^31 orientations of triangles for each attribute of texture coordinates, whose seconds Draco then spends
// before it finds that there is nothing: few such attributes, few seconds.
constexpr int kMostTextures = 4;

// A decoder that stops before it allocates values, when a file asks for more than its size explains: of a mesh the
// attributes are known only there.
template <typename Decoder>
class BoundedDecoder : public Decoder {
public:
    explicit BoundedDecoder(uint64_t allowed) : allowed_(allowed) {}
    bool stopped() const { return stopped_; }

protected:
    bool DecodeAllAttributes() override {
        std::vector<AttributeHeader> attributes;
        for (int i = 0; i < this->point_cloud()->num_attributes(); ++i) attributes.push_back(header_of(*this->point_cloud()->attribute(i)));
        stopped_ = decoding_bytes(this->point_cloud()->num_points(), attributes) > allowed_ ||
                   this->point_cloud()->NumNamedAttributes(draco::GeometryAttribute::TEX_COORD) > kMostTextures;
        return !stopped_ && Decoder::DecodeAllAttributes();
    }

private:
    uint64_t allowed_;
    bool stopped_ = false;
};

template <typename Decoder, typename Geometry>
void decode_into(Geometry& geometry, std::span<const std::byte> bytes, const std::string& name) {
    draco::DecoderOptions options;
    options.SetAttributeBool(draco::GeometryAttribute::POSITION, "skip_attribute_transform", true);
    draco::DecoderBuffer buffer;
    buffer.Init(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    BoundedDecoder<Decoder> decoder(allowed_bytes(bytes.size()));
    const draco::Status status = decoder.Decode(options, &buffer, &geometry);
    if (decoder.stopped()) throw Error(ErrorKind::limit, name + ": its attributes need more memory or time than is expected of a file of this size");
    if (!status.ok())
        throw Error(ErrorKind::malformed, name + ": byte " + std::to_string(buffer.decoded_size()) + ": Draco stopped: " + status.error_msg());
}

std::unique_ptr<draco::PointCloud> decode_geometry(std::span<const std::byte> bytes, const Header& header, const std::string& name) {
    const bool sequential = header.method == "sequential";
    if (!header.mesh) {
        auto points = std::make_unique<draco::PointCloud>();
        sequential ? decode_into<draco::PointCloudSequentialDecoder>(*points, bytes, name)
                   : decode_into<draco::PointCloudKdTreeDecoder>(*points, bytes, name);
        return points;
    }
    auto mesh = std::make_unique<draco::Mesh>();
    sequential ? decode_into<draco::MeshSequentialDecoder>(*mesh, bytes, name) : decode_into<draco::MeshEdgebreakerDecoder>(*mesh, bytes, name);
    return mesh;
}

std::optional<Lattice> lattice_of(const draco::PointAttribute& attribute) {
    draco::AttributeQuantizationTransform transform;
    if (attribute.attribute_type() != draco::GeometryAttribute::POSITION || !transform.InitFromAttribute(attribute)) return std::nullopt;
    Lattice lattice{.range = transform.range(), .bits = transform.quantization_bits()};
    for (int axis = 0; axis < 3; ++axis) lattice.min[size_t(axis)] = transform.min_value(axis);
    return lattice;
}

// A value a point; meshes share values among points, and what a file says of that may be wrong.
std::vector<std::byte> values_of(const draco::PointAttribute& attribute, uint32_t points, const std::string& name) {
    const size_t size = size_t(attribute.byte_stride());
    const draco::DataBuffer& buffer = *attribute.buffer();
    const size_t held = std::min<size_t>(attribute.size(), size > 0 ? buffer.data_size() / size : 0);
    std::vector<std::byte> values(points * size);
    const auto fail = [&] { throw Error(ErrorKind::malformed, name + ": an attribute has fewer values than there are points"); };
    if (attribute.is_mapping_identity()) {
        if (held < points) fail();
        if (points > 0) std::memcpy(values.data(), buffer.data(), values.size());
        return values;
    }
    if (attribute.indices_map_size() < points) fail();
    for (uint32_t i = 0; i < points; ++i) {
        const uint32_t value = attribute.mapped_index(draco::PointIndex(i)).value();
        if (value >= held) fail();
        std::memcpy(values.data() + i * size, buffer.data() + value * size, size);
    }
    return values;
}

}  // namespace

DecodedPoints decode(std::span<const std::byte> bytes, const Header& header, const std::string& name) try {
    const std::unique_ptr<draco::PointCloud> geometry = decode_geometry(bytes, header, name);
    DecodedPoints decoded;
    decoded.points = geometry->num_points();
    while (geometry->num_attributes() > 0) {  // the first goes once its values are taken, so that there is one copy at a time
        const draco::PointAttribute& attribute = *geometry->attribute(0);
        Column column{.header = header_of(attribute), .values = {}, .lattice = {}};
        const bool position = column.header.kind == AttributeKind::position;
        if (position && column.header.components != 3)
            throw Error(ErrorKind::malformed, name + ": positions of 3 components expected, got " + std::to_string(column.header.components));
        if (position) column.lattice = lattice_of(attribute);
        column.values = values_of(attribute, geometry->num_points(), name);
        decoded.columns.push_back(std::move(column));
        geometry->DeleteAttribute(0);
    }
    return decoded;
} catch (const std::bad_alloc&) {
    throw Error(ErrorKind::limit, name + ": not enough memory to decode it");
}

}  // namespace strata::drc
