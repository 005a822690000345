#include "core/cloud/attribute.h"

#include <cstring>

namespace strata {
namespace {

template <typename T>
double load_as_double(const std::byte* bytes) {
    T value;
    std::memcpy(&value, bytes, sizeof value);
    return double(value);
}

}  // namespace

size_t scalar_size(ScalarType type) {
    switch (type) {
        case ScalarType::int8:
        case ScalarType::uint8: return 1;
        case ScalarType::int16:
        case ScalarType::uint16: return 2;
        case ScalarType::int32:
        case ScalarType::uint32:
        case ScalarType::float32: return 4;
        case ScalarType::int64:
        case ScalarType::uint64:
        case ScalarType::float64: return 8;
    }
    return 0;
}

std::string_view scalar_name(ScalarType type) {
    switch (type) {
        case ScalarType::int8: return "int8";
        case ScalarType::uint8: return "uint8";
        case ScalarType::int16: return "int16";
        case ScalarType::uint16: return "uint16";
        case ScalarType::int32: return "int32";
        case ScalarType::uint32: return "uint32";
        case ScalarType::int64: return "int64";
        case ScalarType::uint64: return "uint64";
        case ScalarType::float32: return "float";
        case ScalarType::float64: return "double";
    }
    return "";
}

double load_scalar(ScalarType type, const std::byte* bytes) {
    switch (type) {
        case ScalarType::int8: return load_as_double<int8_t>(bytes);
        case ScalarType::uint8: return load_as_double<uint8_t>(bytes);
        case ScalarType::int16: return load_as_double<int16_t>(bytes);
        case ScalarType::uint16: return load_as_double<uint16_t>(bytes);
        case ScalarType::int32: return load_as_double<int32_t>(bytes);
        case ScalarType::uint32: return load_as_double<uint32_t>(bytes);
        case ScalarType::int64: return load_as_double<int64_t>(bytes);
        case ScalarType::uint64: return load_as_double<uint64_t>(bytes);
        case ScalarType::float32: return load_as_double<float>(bytes);
        case ScalarType::float64: return load_as_double<double>(bytes);
    }
    return 0.0;
}

int find_attribute(const std::vector<Attribute>& attributes, std::string_view name) {
    for (size_t i = 0; i < attributes.size(); ++i)
        if (attributes[i].name == name) return int(i);
    return -1;
}

}  // namespace strata
