#include "core/cloud/attribute.h"

#include <charconv>
#include <cstring>

#include "core/error.h"

namespace strata {
namespace {

template <typename T>
double load_as_double(const std::byte* bytes) {
    T value;
    std::memcpy(&value, bytes, sizeof value);
    return double(value);
}

// "NAME[2]" in two; component -1 when there is none.
std::pair<std::string_view, int> split_component(std::string_view name) {
    const size_t bracket = name.rfind('[');
    if (bracket == std::string_view::npos || bracket == 0 || name.back() != ']') return {name, -1};
    int component = -1;
    const char* last = name.data() + name.size() - 1;
    const auto [stop, error] = std::from_chars(name.data() + bracket + 1, last, component);
    if (error != std::errc() || stop != last || component < 0) return {name, -1};
    return {name.substr(0, bracket), component};
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

std::string_view full_attribute_name(std::string_view name) {
    if (name == "class") return attribute_name::kClassification;
    if (name == "return") return attribute_name::kReturnNumber;
    if (name == "source") return attribute_name::kPointSourceId;
    return name;
}

AttributeComponent find_component(const std::vector<Attribute>& attributes, std::string_view name, std::string_view others) {
    const std::string quoted = "'" + std::string(name) + "'";
    // A name may end in brackets itself, and a cloud may have an attribute by the name that is short for another.
    int plain = find_attribute(attributes, name);
    if (plain < 0) plain = find_attribute(attributes, full_attribute_name(name));
    if (plain >= 0) {
        const int components = attributes[size_t(plain)].components;
        if (components > 1)
            throw Error(ErrorKind::usage, quoted + " has " + std::to_string(components) + " components; choose one, as " +
                                              std::string(name) + "[0]");
        return {.attribute = plain};
    }
    const auto [base, component] = split_component(name);
    const int attribute = component < 0 ? -1 : find_attribute(attributes, full_attribute_name(base));
    if (attribute < 0) {
        std::string list(others);
        for (const Attribute& known : attributes) list += (list.empty() ? "" : ", ") + known.name;
        throw Error(ErrorKind::usage, quoted + ": the cloud has only " + list);
    }
    if (component >= attributes[size_t(attribute)].components)
        throw Error(ErrorKind::usage,
                    quoted + ": components are 0 to " + std::to_string(attributes[size_t(attribute)].components - 1));
    return {attribute, component};
}

}  // namespace strata
