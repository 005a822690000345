#include "io/potree/potree_metadata.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "core/error.h"

namespace strata {
namespace {

using Json = nlohmann::json;

constexpr int kDeepestJson = 16;             // metadata.json is 4 deep
constexpr uint64_t kMostComponents = 1024;   // of one attribute
constexpr size_t kMostRecordBytes = 65'535;  // as in LAS
constexpr size_t kMortonPositionBytes = 16;
constexpr size_t kMortonRgbBytes = 8;

Error bad_key(const std::string& key, const std::string& expected) {
    return {ErrorKind::malformed, "'" + key + "': " + expected + " is expected"};
}

Json parse_json(std::span<const std::byte> text) {
    const auto* begin = reinterpret_cast<const char*>(text.data());
    const auto refuse_depth = [](int depth, Json::parse_event_t, Json&) {
        if (depth > kDeepestJson) throw Error(ErrorKind::malformed, "JSON nested too deep");
        return true;
    };
    try {
        return Json::parse(begin, begin + text.size(), refuse_depth);
    } catch (const Json::parse_error& problem) {
        throw Error(ErrorKind::malformed, "byte " + std::to_string(problem.byte) + ": not JSON");
    } catch (const Json::exception&) {
        throw Error(ErrorKind::malformed, "JSON with a number out of range");
    }
}

/// A JSON object and where it stands, so that a fault names its key in full.
class Keys {
public:
    Keys(const Json& object, std::string place) : object_(object), place_(std::move(place)) {
        if (!object_.is_object()) throw bad_key(place_, "an object");
    }

    std::string place(const char* key) const { return place_.empty() ? key : place_ + "." + key; }

    const Json* find(const char* key) const {
        const auto found = object_.find(key);
        return found == object_.end() ? nullptr : &*found;
    }
    const Json& get(const char* key, const char* expected) const {
        if (const Json* value = find(key)) return *value;
        throw bad_key(place(key), expected);
    }
    std::string text(const char* key) const {
        const Json& value = get(key, "a text");
        if (!value.is_string()) throw bad_key(place(key), "a text");
        return value.get<std::string>();
    }
    std::string text_or_empty(const char* key) const {
        const Json* value = find(key);
        return value && value->is_string() ? value->get<std::string>() : std::string();
    }
    uint64_t count(const char* key, uint64_t most) const {
        const Json& value = get(key, "a count");
        if (!value.is_number_unsigned() || value.get<uint64_t>() > most)
            throw bad_key(place(key), "a count up to " + std::to_string(most));
        return value.get<uint64_t>();
    }
    double number(const char* key) const {
        const Json& value = get(key, "a finite number");
        if (!value.is_number() || !std::isfinite(value.get<double>())) throw bad_key(place(key), "a finite number");
        return value.get<double>();
    }
    std::vector<double> numbers(const char* key, size_t size) const {
        if (auto values = numbers_if_whole(key, size)) return *values;
        throw bad_key(place(key), "an array of " + std::to_string(size) + " finite numbers");
    }
    /// Nothing where the key is absent or holds anything else.
    std::optional<std::vector<double>> numbers_if_whole(const char* key, size_t size) const {
        const Json* value = find(key);
        if (!value || !value->is_array() || value->size() != size) return {};
        std::vector<double> values;
        for (const Json& number : *value) {
            if (!number.is_number() || !std::isfinite(number.get<double>())) return {};
            values.push_back(number.get<double>());
        }
        return values;
    }
    Vec3d vector(const char* key) const {
        const std::vector<double> values = numbers(key, 3);
        return {values[0], values[1], values[2]};
    }

private:
    const Json& object_;
    std::string place_;
};

std::optional<ScalarType> scalar_from_name(const std::string& name) {
    for (int type = 0; type <= int(ScalarType::float64); ++type)
        if (scalar_name(ScalarType(type)) == name) return ScalarType(type);
    return {};
}

Attribute read_attribute(const Keys& keys) {
    Attribute attribute;
    attribute.name = keys.text("name");
    attribute.description = keys.text_or_empty("description");
    const std::string type = keys.text("type");
    const uint64_t components = keys.count("numElements", kMostComponents);
    const uint64_t element_bytes = keys.count("elementSize", kMostRecordBytes);
    const uint64_t size_bytes = keys.count("size", kMostRecordBytes);
    if (components == 0 || size_bytes != components * element_bytes)
        throw bad_key(keys.place("size"), "numElements x elementSize, more than 0,");
    if (const auto scalar = scalar_from_name(type)) {
        if (element_bytes != scalar_size(*scalar)) throw bad_key(keys.place("elementSize"), "the size of " + type);
        attribute.type = *scalar;
        attribute.components = int(components);
    } else {  // LAS extra bytes without a type: PotreeConverter calls them "undefined"
        attribute.type = ScalarType::uint8;
        attribute.components = int(size_bytes);
        if (size_bytes == 0) throw bad_key(keys.place("type"), "int8 ... uint64, float or double");
    }
    const auto scale = keys.numbers_if_whole("scale", components);
    const auto offset = keys.numbers_if_whole("offset", components);
    if (scale && (*scale)[0] != 0.0) attribute.scale = (*scale)[0];
    if (offset) attribute.offset = (*offset)[0];
    if (const auto no_data = keys.numbers_if_whole("noData", components)) attribute.no_data = (*no_data)[0];
    return attribute;
}

void add_field(const Keys& keys, const Attribute& attribute, PotreeMetadata& metadata) {
    PotreeField field;
    field.size_bytes = field.packed_bytes = attribute.size_bytes();
    field.record_offset = metadata.record_bytes;
    if (attribute.name == "position") {
        if (attribute.type != ScalarType::int32 || attribute.components != 3)
            throw bad_key(keys.place("type"), "int32 x 3 for the position");
        for (const PotreeField& other : metadata.fields)
            if (other.attribute < 0) throw bad_key(keys.place("name"), "one attribute 'position'");
        field.packed_bytes = kMortonPositionBytes;
        const auto low = keys.numbers_if_whole("min", 3), high = keys.numbers_if_whole("max", 3);
        if (low && high) {
            const Box3d stated{.min = Vec3d(low->data()), .max = Vec3d(high->data())};
            if (!stated.empty()) metadata.tight = stated;
        }
    } else {
        field.attribute = int(metadata.attributes.size());
        if (metadata.encoding == PotreeEncoding::brotli && attribute.name == attribute_name::kRgb) {
            if (attribute.type != ScalarType::uint16 || attribute.components != 3)
                throw bad_key(keys.place("type"), "uint16 x 3 for rgb in a BROTLI set");
            field.packed_bytes = kMortonRgbBytes;
            field.rgb_morton = true;
        }
        metadata.attributes.push_back(attribute);
        const size_t components = size_t(attribute.components);
        metadata.attribute_min.push_back(keys.numbers_if_whole("min", components).value_or(std::vector<double>()));
        metadata.attribute_max.push_back(keys.numbers_if_whole("max", components).value_or(std::vector<double>()));
    }
    metadata.record_bytes += field.size_bytes;
    metadata.column_bytes += field.packed_bytes;
    if (metadata.record_bytes > kMostRecordBytes)
        throw bad_key(keys.place("size"), "a record of at most " + std::to_string(kMostRecordBytes) + " bytes");
    metadata.fields.push_back(field);
}

PotreeEncoding read_encoding(const Keys& root) {
    const std::string encoding = root.text("encoding");
    if (encoding == "DEFAULT" || encoding == "UNCOMPRESSED") return PotreeEncoding::plain;
    if (encoding == "BROTLI") return PotreeEncoding::brotli;
    throw bad_key("encoding", "DEFAULT or BROTLI");
}

Box3d read_cube(const Keys& root) {
    const Keys keys(root.get("boundingBox", "an object"), "boundingBox");
    const Box3d cube{.min = keys.vector("min"), .max = keys.vector("max")};
    if (cube.empty() || !cube.size().allFinite()) throw bad_key("boundingBox", "min below max");
    return cube;
}

}  // namespace

PotreeMetadata parse_potree_metadata(std::span<const std::byte> text) {
    const Json json = parse_json(text);
    if (!json.is_object()) throw Error(ErrorKind::malformed, "a JSON object is expected");
    const Keys root(json, "");
    const std::string version = root.text("version");
    if (!version.starts_with("2."))
        throw Error(ErrorKind::unsupported, "'version': Potree 2.x is expected, '" + version.substr(0, 16) + "' found");

    PotreeMetadata metadata;
    metadata.name = root.text_or_empty("name");
    metadata.projection = root.text_or_empty("projection");
    metadata.points = root.count("points", uint64_t{1} << 48);
    const Keys hierarchy(root.get("hierarchy", "an object"), "hierarchy");
    metadata.first_chunk_bytes = hierarchy.count("firstChunkSize", uint64_t{1} << 48);
    metadata.quantization = {.scale = root.vector("scale"), .offset = root.vector("offset")};
    if (!(metadata.quantization.scale.array() > 0.0).all()) throw bad_key("scale", "a positive scale on each axis");
    metadata.spacing = root.number("spacing");
    if (!(metadata.spacing > 0.0)) throw bad_key("spacing", "a positive number");
    metadata.tight = metadata.cube = read_cube(root);
    metadata.encoding = read_encoding(root);

    const Json& attributes = root.get("attributes", "an array");
    if (!attributes.is_array()) throw bad_key("attributes", "an array");
    for (size_t i = 0; i < attributes.size(); ++i) {
        const Keys keys(attributes[i], "attributes[" + std::to_string(i) + "]");
        add_field(keys, read_attribute(keys), metadata);
    }
    const bool has_position = std::any_of(metadata.fields.begin(), metadata.fields.end(),
                                          [](const PotreeField& field) { return field.attribute < 0; });
    if (!has_position) throw bad_key("attributes", "an attribute 'position'");
    return metadata;
}

}  // namespace strata
