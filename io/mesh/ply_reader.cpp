#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <utility>

#include "core/error.h"
#include "io/mesh/concave_faces.h"
#include "io/mesh/mesh_memory.h"
#include "io/mesh/mesh_reader.h"
#include "io/mesh/nowhere.h"
#include "io/mesh/ply_header.h"
#include "io/text_words.h"

namespace strata {
namespace {

using namespace ply;

// Values one after the other, of binary data or of text, in which each element has a line of its own.
class BinaryValues {
public:
    BinaryValues(ByteStream& stream, bool swapped) : stream_(stream), swapped_(swapped) {}

    void begin_row() {}
    void end_row() {}
    double number(Scalar type) {
        std::array<std::byte, 8> bytes;
        const size_t size = size_of(type);
        std::memcpy(bytes.data(), stream_.take(size).data(), size);
        if (swapped_) std::reverse(bytes.begin(), bytes.begin() + ptrdiff_t(size));
        switch (type) {
            case Scalar::int8: return as<int8_t>(bytes);
            case Scalar::uint8: return as<uint8_t>(bytes);
            case Scalar::int16: return as<int16_t>(bytes);
            case Scalar::uint16: return as<uint16_t>(bytes);
            case Scalar::int32: return as<int32_t>(bytes);
            case Scalar::uint32: return as<uint32_t>(bytes);
            case Scalar::float32: return as<float>(bytes);
            case Scalar::float64: break;
        }
        return as<double>(bytes);
    }
    int64_t integer(Scalar type) { return int64_t(number(type)); }  // of at most 32 bits, so that a double holds it
    uint64_t list_length(const Property& property) {
        const int64_t count = integer(property.count_type);
        if (count < 0 || uint64_t(count) > stream_.left() / size_of(property.type))
            fail("a list of " + std::to_string(count) + " values of " + std::to_string(size_of(property.type)) + " bytes is beyond the " +
                 std::to_string(stream_.left()) + " bytes left");
        return uint64_t(count);
    }
    void skip(uint64_t count, Scalar type) { stream_.skip(count * size_of(type)); }
    [[noreturn]] void fail(const std::string& expectation) const { stream_.fail_at_byte(expectation); }
    void expect_end() {
        for (uint64_t left = stream_.left(); left > 0; --left)
            if (const char c = char(stream_.take(1)[0]); c != '\0' && !TextWords::is_blank(c))
                fail("the file's end is expected behind the last element, " + std::to_string(left) + " bytes are left");
    }

private:
    template <typename T>
    static T as(const std::array<std::byte, 8>& bytes) {
        T value;
        std::memcpy(&value, bytes.data(), sizeof value);
        return value;
    }

    ByteStream& stream_;
    bool swapped_;
};

class TextValues {
public:
    explicit TextValues(ByteStream& stream) : stream_(stream) {}

    void begin_row() {
        do
            if (std::string_view line; stream_.next_line(line))
                words_ = TextWords(line);
            else
                fail("the file ends, more elements are expected");
        while (!words_.more());
    }
    void end_row() {
        if (words_.more()) fail("more values than the header's properties");
    }
    double number(Scalar) {
        double value = 0.0;
        if (!words_.number(value)) fail("a number is expected");
        return value;
    }
    int64_t integer(Scalar) {
        int64_t value = 0;
        if (!words_.more() || !words_.integer(value) || !words_.at_word_end()) fail("an integer is expected");
        return value;
    }
    uint64_t list_length(const Property& property) {
        const int64_t count = integer(property.count_type);
        if (count < 0) fail("a list of " + std::to_string(count) + " values");
        return uint64_t(count);
    }
    void skip(uint64_t count, Scalar type) {
        for (uint64_t i = 0; i < count; ++i) number(type);
    }
    [[noreturn]] void fail(const std::string& expectation) const { stream_.fail_at_line(expectation); }
    void expect_end() {
        for (std::string_view line; stream_.next_line(line);)
            if (TextWords(line).more()) fail("the file's end is expected behind the last element");
    }

private:
    ByteStream& stream_;
    TextWords words_{std::string_view()};
};

constexpr int kUnused = -1;
constexpr int kNormal = 3, kColor = 6, kWanted = kDiffuse;  // places of x y z, nx ny nz, red green blue alpha among what a vertex has; then scalars
constexpr size_t kMostScalars = 32;

int place_of(const std::string& name) {
    const int meaning = meaning_of(name);
    if (meaning < kDiffuse) return meaning;
    return meaning < kTexture ? kColor + meaning - kDiffuse : kUnused;
}

bool is_texture_coordinate(const std::string& name) { return meaning_of(name) >= kTexture && meaning_of(name) < kCornerList; }

bool is_corner_list(const Property& property) {
    const int meaning = meaning_of(property.name);
    return property.is_list && meaning >= kCornerList && meaning < int(kNamesWithMeaning.size());
}

// A part of a color in its type's range as a byte; text may say anything, and is clamped.
uint8_t color_byte(double part, Scalar type) {
    if (!(part == part)) return 0;
    if (type == Scalar::int8 && part < 0.0) part += 256.0;  // a byte, by a writer that knows no unsigned ones
    if (!is_integer(type)) part *= 255.0;
    if (type == Scalar::uint16) part *= 255.0 / 65535.0;
    return uint8_t(std::clamp(part, 0.0, 255.0) + 0.5);
}

class PlyReader {
public:
    PlyReader(const ByteSource& source, const MeshReadSettings& settings) : stream_(source), memory_(stream_, settings.most_bytes), concave_(memory_), header_(read_header(stream_)), wants_scalars_(settings.scalars) {}

    TriangleMesh read(MeshReport& report) {
        find_elements();
        if (header_.encoding == Encoding::ascii)
            read_elements(TextValues(stream_));
        else
            read_elements(BinaryValues(stream_, header_.encoding == Encoding::big_endian));
        constexpr std::array<const char*, 3> kEncodings = {"PLY, ASCII", "PLY, binary little-endian", "PLY, binary big-endian"};
        report.format = kEncodings[size_t(header_.encoding)];
        report.faces = faces_ ? faces_->count : 0;
        if (scalars_left_out_ > 0) report.notes.push_back(std::to_string(scalars_left_out_) + " properties of vertices beyond the first " + std::to_string(kMostScalars) + " are left out");
        concave_.finish(mesh_, report.notes);
        remove_nowhere(mesh_, nowhere_, report.notes);
        if (incomplete_faces_ > 0) report.notes.push_back(std::to_string(incomplete_faces_) + " faces with fewer than 3 corners are left out");
        for (const Element& element : header_.elements)
            if (&element != vertices_ && &element != faces_ && element.count > 0)
                report.notes.push_back(std::to_string(element.count) + " of element " + element.name + " are left out");
        return std::move(mesh_);
    }

private:
    [[noreturn]] void fail_header(const std::string& expectation) const { throw Error(ErrorKind::malformed, stream_.name() + ": header: " + expectation); }

    void find_elements() {
        for (const Element& element : header_.elements) {
            const Element*& found = element.name == "vertex" ? vertices_ : faces_;
            if (element.name != "vertex" && element.name != "face") continue;
            if (found) fail_header("one element " + element.name + " is expected");
            found = &element;
        }
        if (!vertices_) fail_header("an element vertex is expected");
        if (vertices_->count > 0xFFFFFFFF) throw Error(ErrorKind::limit, stream_.name() + ": at most 4,294,967,295 vertices can be read");
        std::array<bool, kWanted> has{};
        for (const Property& property : vertices_->properties) {
            const int place = property.is_list ? kUnused : place_of(property.name);
            places_.push_back(place == kUnused && !property.is_list && wants_scalars_ ? place_of_scalar(property.name) : place);
            if (place != kUnused && std::exchange(has[size_t(place)], true)) fail_header("one property " + property.name + " is expected");
        }
        const auto has_all = [&](int first) { return has[size_t(first)] && has[size_t(first) + 1] && has[size_t(first) + 2]; };
        if (!has_all(0)) fail_header("properties x, y and z of element vertex are expected");
        has_normals_ = has_all(kNormal);
        has_colors_ = has_all(kColor);
        if (!faces_ || faces_->count == 0) return;
        const ptrdiff_t lists = std::count_if(faces_->properties.begin(), faces_->properties.end(), is_corner_list);
        if (lists != 1) fail_header("one list vertex_indices or vertex_index of element face is expected");
        for (const Property& property : faces_->properties)
            if (is_corner_list(property) && !is_integer(property.type)) fail_header("indices are expected to be integers");
    }

    int place_of_scalar(const std::string& name) {
        const auto is_it = [&](const MeshScalars& scalars) { return scalars.name == name; };
        if (is_texture_coordinate(name) || std::any_of(mesh_.scalars.begin(), mesh_.scalars.end(), is_it)) return kUnused;
        if (mesh_.scalars.size() == kMostScalars) {
            ++scalars_left_out_;
            return kUnused;
        }
        mesh_.scalars.push_back({name, {}});
        return kWanted + int(mesh_.scalars.size()) - 1;
    }

    template <typename Values>
    void read_elements(Values values) {
        memory_.expect(vertices_->count * (sizeof(Vec3d) + (has_normals_ ? sizeof(Vec3f) : 0) + (has_colors_ ? 4 : 0) + mesh_.scalars.size() * sizeof(float)) +
                       most_triangles_ahead() * sizeof(mesh_.triangles[0]));
        memory_.reserve(mesh_.positions, vertices_->count);
        if (has_normals_) memory_.reserve(mesh_.normals, vertices_->count);
        if (has_colors_) memory_.reserve(mesh_.colors, vertices_->count);
        for (MeshScalars& scalars : mesh_.scalars) memory_.reserve(scalars.values, vertices_->count);
        memory_.reserve(mesh_.triangles, most_triangles_ahead());
        for (const Element& element : header_.elements) {
            if (element.properties.empty()) continue;
            for (uint64_t i = 0; i < element.count; ++i) {
                values.begin_row();
                if (&element == vertices_)
                    read_vertex(values);
                else if (&element == faces_)
                    read_face(values);
                else
                    for (const Property& property : element.properties) pass(values, property);
                values.end_row();
            }
        }
        values.expect_end();
    }

    // Room is made for a triangle a face, as far as the bytes left could hold triangles.
    uint64_t most_triangles_ahead() const {
        if (!faces_) return 0;
        uint64_t least_bytes = 8;  // "3 0 1 2\n"
        for (const Property& property : faces_->properties)
            if (is_corner_list(property) && header_.encoding != Encoding::ascii) least_bytes = size_of(property.count_type) + 3 * size_of(property.type);
        return std::min(faces_->count, stream_.left() / least_bytes);
    }

    template <typename Values>
    static void pass(Values& values, const Property& property) {
        values.skip(property.is_list ? values.list_length(property) : 1, property.type);
    }

    template <typename Values>
    void read_vertex(Values& values) {
        std::array<double, kWanted> found{};
        std::array<uint8_t, 4> color = {0, 0, 0, 255};
        for (size_t p = 0; p < places_.size(); ++p) {
            const Property& property = vertices_->properties[p];
            const int place = places_[p];
            if (place == kUnused) {
                pass(values, property);
                continue;
            }
            if (place >= kWanted) {
                mesh_.scalars[size_t(place - kWanted)].values.push_back(float(values.number(property.type)));
                continue;
            }
            found[size_t(place)] = values.number(property.type);
            if (place >= kColor) color[size_t(place - kColor)] = color_byte(found[size_t(place)], property.type);
        }
        const Vec3d position(found[0], found[1], found[2]);
        if (!position.allFinite()) memory_.push(nowhere_, uint32_t(mesh_.positions.size()));
        mesh_.positions.push_back(position);
        if (has_normals_) {
            const Vec3f normal = Vec3d(found[kNormal], found[kNormal + 1], found[kNormal + 2]).cast<float>();
            mesh_.normals.push_back(normal.allFinite() ? normal : Vec3f(Vec3f::Zero()));
        }
        if (has_colors_) mesh_.colors.push_back(color);
    }

    template <typename Values>
    void read_face(Values& values) {
        for (const Property& property : faces_->properties) {
            if (!is_corner_list(property)) {
                pass(values, property);
                continue;
            }
            const uint64_t count = values.list_length(property);
            const size_t begin = mesh_.triangles.size();
            std::array<uint32_t, 2> fan{};  // the first corner and the last
            for (uint64_t i = 0; i < count; ++i) {
                const int64_t index = values.integer(property.type);
                if (index < 0 || uint64_t(index) >= vertices_->count)
                    values.fail("vertex " + std::to_string(index) + " is not among the " + std::to_string(vertices_->count) + " of the file, which count from 0");
                if (i >= 2) {
                    if (mesh_.triangles.size() == 0xFFFFFFFF) throw Error(ErrorKind::limit, stream_.name() + ": at most 4,294,967,295 triangles can be read");
                    memory_.push(mesh_.triangles, {fan[0], fan[1], uint32_t(index)});
                }
                fan[i == 0 ? 0 : 1] = uint32_t(index);
            }
            concave_.add_fan(mesh_, begin, mesh_.positions.size() == vertices_->count);
            if (count < 3) ++incomplete_faces_;
        }
    }

    ByteStream stream_;
    MeshMemory memory_;
    ConcaveFaces concave_;
    Header header_;
    bool wants_scalars_;
    const Element* vertices_ = nullptr;
    const Element* faces_ = nullptr;
    std::vector<int> places_;      // of the vertex's properties
    size_t scalars_left_out_ = 0;  // properties
    TriangleMesh mesh_;
    std::vector<uint32_t> nowhere_;
    bool has_normals_ = false, has_colors_ = false;
    uint64_t incomplete_faces_ = 0;
};

}  // namespace

TriangleMesh read_ply(const ByteSource& source, const MeshReadSettings& settings, MeshReport& report) { return PlyReader(source, settings).read(report); }

}  // namespace strata
