#include "io/mesh/ply_header.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <utility>

#include "core/error.h"
#include "io/text_words.h"

namespace strata::ply {
namespace {

constexpr std::array<std::pair<std::string_view, Scalar>, 16> kNames = {{
    {"char", Scalar::int8}, {"int8", Scalar::int8}, {"uchar", Scalar::uint8}, {"uint8", Scalar::uint8},
    {"short", Scalar::int16}, {"int16", Scalar::int16}, {"ushort", Scalar::uint16}, {"uint16", Scalar::uint16},
    {"int", Scalar::int32}, {"int32", Scalar::int32}, {"uint", Scalar::uint32}, {"uint32", Scalar::uint32},
    {"float", Scalar::float32}, {"float32", Scalar::float32}, {"double", Scalar::float64}, {"float64", Scalar::float64},
}};

Scalar scalar_of(std::string_view word, const ByteStream& stream) {
    const auto found = std::find_if(kNames.begin(), kNames.end(), [&](const auto& name) { return name.first == word; });
    if (found == kNames.end()) stream.fail_at_line("a type is expected, such as uchar, int or float");
    return found->second;
}

Encoding encoding_of(TextWords& words, const ByteStream& stream) {
    const std::string_view word = words.word();
    const std::string version(words.word());
    constexpr std::array<std::string_view, 3> kEncodings = {"ascii", "binary_little_endian", "binary_big_endian"};
    const auto found = std::find(kEncodings.begin(), kEncodings.end(), word);
    if (found == kEncodings.end()) stream.fail_at_line("format ascii, binary_little_endian or binary_big_endian is expected");
    if (version != "1.0") stream.fail_at_line("version 1.0 is expected");
    return Encoding(found - kEncodings.begin());
}

Element element_of(TextWords& words, const ByteStream& stream) {
    Element element{.name = std::string(words.word())};
    const std::string_view count = words.word();
    const auto [end, problem] = std::from_chars(count.data(), count.data() + count.size(), element.count);
    if (element.name.empty() || count.empty() || problem != std::errc() || end != count.data() + count.size())
        stream.fail_at_line("an element's name and count are expected");
    return element;
}

Property property_of(TextWords& words, const ByteStream& stream) {
    Property property;
    std::string_view type = words.word();
    if (type == "list") {
        property.is_list = true;
        property.count_type = scalar_of(words.word(), stream);
        if (!is_integer(property.count_type)) stream.fail_at_line("a list's length is expected to be an integer");
        type = words.word();
    }
    property.type = scalar_of(type, stream);
    property.name = std::string(words.word());
    if (property.name.empty()) stream.fail_at_line("a property's name is expected");
    return property;
}

// The fewest bytes of one element: lists may be empty, and a value in text is a digit and a blank.
uint64_t least_size(const Element& element, Encoding encoding) {
    if (encoding == Encoding::ascii) return 2 * uint64_t{element.properties.size()};
    uint64_t size = 0;
    for (const Property& property : element.properties) size += size_of(property.is_list ? property.count_type : property.type);
    return size;
}

void check_counts(const Header& header, const ByteStream& stream) {
    uint64_t left = stream.left() + (header.encoding == Encoding::ascii ? 1 : 0);  // the last blank may be missing
    for (const Element& element : header.elements) {
        const uint64_t size = least_size(element, header.encoding);
        if (size == 0) continue;
        if (element.count > left / size)
            stream.fail_at_byte("the header counts " + std::to_string(element.count) + " of element " + element.name + ", at least " +
                                std::to_string(size) + " bytes each, " + std::to_string(left) + " are left");
        left -= element.count * size;
    }
}

}  // namespace

Header read_header(ByteStream& stream) {
    Header header;
    bool has_format = false;
    std::string_view line;
    if (!stream.next_line(line) || TextWords(line).word() != "ply") stream.fail_at_line("'ply' is expected");
    for (;;) {
        if (!stream.next_line(line)) stream.fail_at_line("the file ends in its header, 'end_header' is expected");
        TextWords words(line);
        const std::string_view keyword = words.word();
        if (keyword == "comment" || keyword == "obj_info" || keyword.empty()) continue;
        if (keyword == "end_header") break;
        if (keyword == "format" && !has_format) {
            header.encoding = encoding_of(words, stream);
            has_format = true;
        } else if (keyword == "element") {
            header.elements.push_back(element_of(words, stream));
        } else if (keyword == "property" && !header.elements.empty()) {
            header.elements.back().properties.push_back(property_of(words, stream));
        } else {
            stream.fail_at_line("format, element, property, comment or end_header is expected");
        }
    }
    if (!has_format) stream.fail_at_line("a line 'format ...' is expected before the header's end");
    check_counts(header, stream);
    return header;
}

}  // namespace strata::ply
