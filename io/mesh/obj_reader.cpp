// Wavefront OBJ. Source: "Advanced Visualizer Manual", appendix B1, Object Files, version 3.0; colors of vertices as MeshLab
// writes them, behind the coordinates.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string_view>

#include "core/error.h"
#include "io/mesh/concave_faces.h"
#include "io/mesh/mesh_memory.h"
#include "io/mesh/mesh_reader.h"
#include "io/mesh/nowhere.h"
#include "io/text_words.h"

namespace strata {
namespace {

constexpr uint64_t kMostIndices = 0xFFFFFFFF;
constexpr float kNoColor = -1.0f;
constexpr float kAgreeingCosine = 0.9396926f;  // 20 degrees: normals of a vertex's corners that are farther from the mean of those before say that there is an edge

// Statements that say nothing of triangles.
constexpr std::array<std::string_view, 31> kPassed = {
    "vt", "vp", "g", "s", "o", "mg", "mtllib", "usemtl", "maplib", "usemap", "bevel", "c_interp", "d_interp", "lod", "shadow_obj", "trace_obj",
    "ctech", "stech", "cstype", "deg", "bmat", "step", "parm", "trim", "hole", "scrv", "sp", "end", "con", "csh", "call"};
// Statements whose shapes are no triangles: their loss is said.
constexpr std::array<std::string_view, 10> kOther = {"p", "l", "curv", "curv2", "surf", "bsp", "bzp", "cdc", "cdp", "res"};

struct Corner {
    uint32_t vertex = 0;
    int64_t normal = -1;  // from 0; less: none
};

class ObjReader {
public:
    ObjReader(const ByteSource& source, uint64_t most_bytes) : stream_(source), memory_(stream_, most_bytes), concave_(memory_) {}

    TriangleMesh read(MeshReport& report) {
        for (std::string_view line; stream_.next_line(line, ByteStream::Continued::by_backslash);) read_line(line);
        if (mesh_.positions.empty())
            throw Error(ErrorKind::malformed, stream_.name() + ": no vertices: lines of 'v x y z' are expected");
        if (farthest_vertex_ >= mesh_.positions.size())
            fail_index(farthest_vertex_line_, "vertex", farthest_vertex_, mesh_.positions.size());
        if (farthest_normal_ >= int64_t(normals_.size()))
            fail_index(farthest_normal_line_, "normal", uint64_t(farthest_normal_), normals_.size());
        concave_.finish(mesh_, report.notes);
        finish_normals();
        finish_colors();
        remove_nowhere(mesh_, nowhere_, report.notes);
        if (incomplete_faces_ > 0) report.notes.push_back(std::to_string(incomplete_faces_) + " faces with fewer than 3 corners are left out");
        if (other_shapes_ > 0) report.notes.push_back(std::to_string(other_shapes_) + " statements of points, lines, curves and surfaces are left out");
        report.format = "OBJ";
        report.faces = faces_;
        return std::move(mesh_);
    }

private:
    void read_line(std::string_view line) {
        TextWords words(line);
        const std::string_view keyword = words.word();
        if (keyword == "v")
            read_vertex(words);
        else if (keyword == "vn")
            read_normal(words);
        else if (keyword == "f" || keyword == "fo")  // fo: of version 2
            read_face(words);
        else if (keyword.empty() || keyword.front() == '#' || std::find(kPassed.begin(), kPassed.end(), keyword) != kPassed.end())
            return;
        else if (std::find(kOther.begin(), kOther.end(), keyword) != kOther.end())
            ++other_shapes_;
        else
            stream_.fail_at_line("a statement of OBJ is expected, such as v or f");
    }

    // The line's numbers, up to a comment.
    template <size_t Most>
    size_t read_numbers(TextWords& words, std::array<double, Most>& numbers) {
        size_t count = 0;
        while (words.more() && words.peek() != '#') {
            if (count == Most) stream_.fail_at_line("at most " + std::to_string(Most) + " numbers are expected");
            if (!words.number(numbers[count++])) stream_.fail_at_line("number " + std::to_string(count) + " of the line is none");
        }
        return count;
    }

    void read_vertex(TextWords& words) {
        std::array<double, 7> numbers;  // x y z, x y z weight, x y z r g b, x y z r g b a
        const size_t count = read_numbers(words, numbers);
        if (count < 3 || count == 5) stream_.fail_at_line("3, 4, 6 or 7 numbers are expected, there are " + std::to_string(count));
        const size_t index = mesh_.positions.size();
        if (index == kMostIndices) throw Error(ErrorKind::limit, stream_.name() + ": at most 4,294,967,295 vertices can be read");
        const Vec3d position(numbers[0], numbers[1], numbers[2]);
        if (!position.allFinite()) memory_.push(nowhere_, uint32_t(index));
        memory_.push(mesh_.positions, position);
        if (count < 6) return;
        memory_.lengthen(colors_, index, Vec4f::Constant(kNoColor).eval());
        memory_.push(colors_, Vec4f(float(numbers[3]), float(numbers[4]), float(numbers[5]), count == 7 ? float(numbers[6]) : kNoColor));
    }

    void read_normal(TextWords& words) {
        std::array<double, 3> numbers;
        if (const size_t count = read_numbers(words, numbers); count != 3)
            stream_.fail_at_line("3 numbers are expected, there are " + std::to_string(count));
        const Vec3d normal(numbers[0], numbers[1], numbers[2]);
        const double length = normal.norm();
        const bool known = std::isfinite(length) && length > 0.0;
        memory_.push(normals_, known ? Vec3f((normal / length).cast<float>()) : Vec3f(Vec3f::Zero()));
    }

    void read_face(TextWords& words) {
        std::array<Corner, 2> fan;  // the first corner and the last
        const size_t begin = mesh_.triangles.size();
        uint64_t count = 0;
        uint32_t farthest = 0;
        for (; words.more() && words.peek() != '#'; ++count) {
            const Corner corner = read_corner(words);
            if (count >= 2) {
                if (mesh_.triangles.size() == kMostIndices) throw Error(ErrorKind::limit, stream_.name() + ": at most 4,294,967,295 triangles can be read");
                memory_.push(mesh_.triangles, {fan[0].vertex, fan[1].vertex, corner.vertex});
            }
            fan[count == 0 ? 0 : 1] = corner;
            farthest = std::max(farthest, corner.vertex);
            if (corner.normal >= 0) use_normal(corner);
        }
        concave_.add_fan(mesh_, begin, farthest < mesh_.positions.size());
        ++faces_;
        if (count < 3) ++incomplete_faces_;
    }

    // vertex, vertex/texture, vertex//normal or vertex/texture/normal
    Corner read_corner(TextWords& words) {
        Corner corner;
        const int64_t vertex = index_of(words, "vertex", mesh_.positions.size());
        corner.vertex = uint32_t(vertex);
        if (uint64_t(vertex) > farthest_vertex_ || farthest_vertex_line_ == 0) {
            farthest_vertex_ = uint64_t(vertex);
            farthest_vertex_line_ = stream_.line_number();
        }
        if (words.peek() != '/') return end_of(corner, words);
        words.skip(1);
        int64_t texture = 0;  // not kept, and so not looked for
        if (words.peek() != '/' && !words.at_word_end() && !words.integer(texture)) fail_at_corner();
        if (words.peek() != '/') return end_of(corner, words);
        words.skip(1);
        if (words.at_word_end()) return corner;
        corner.normal = index_of(words, "normal", normals_.size());
        if (corner.normal > farthest_normal_) {
            farthest_normal_ = corner.normal;
            farthest_normal_line_ = stream_.line_number();
        }
        return end_of(corner, words);
    }
    Corner end_of(const Corner& corner, const TextWords& words) const {
        if (!words.at_word_end()) fail_at_corner();
        return corner;
    }
    [[noreturn]] void fail_at_corner() const { stream_.fail_at_line("corners such as 1, 1/2, 1//3 or 1/2/3 are expected"); }

    // From 0. Positive indices count from 1 and may run ahead of the vertices; negative ones count back from the last so far.
    int64_t index_of(TextWords& words, const char* what, size_t count) {
        int64_t index = 0;
        if (!words.integer(index)) fail_at_corner();
        const int64_t from_0 = index > 0 ? index - 1 : int64_t(count) + index;
        if (index == 0 || index < -int64_t(count) || from_0 >= int64_t(kMostIndices))
            stream_.fail_at_line(std::string(what) + " " + std::to_string(index) + " is not among the " + std::to_string(count) + " before this line");
        return from_0;
    }
    [[noreturn]] void fail_index(uint64_t line, const char* what, uint64_t from_0, size_t count) const {
        throw Error(ErrorKind::malformed, stream_.name() + ": line " + std::to_string(line) + ": " + what + " " + std::to_string(from_0 + 1) +
                                              " is not among the " + std::to_string(count) + " of the file");
    }

    // Each vertex sums the unit normals of its corners, as long as they agree; where either comes later in the file, the sum waits.
    void use_normal(const Corner& corner) {
        if (corner.vertex >= mesh_.positions.size() || corner.normal >= int64_t(normals_.size())) {
            memory_.push(waiting_, {corner.vertex, uint32_t(corner.normal)});
            return;
        }
        memory_.lengthen(mesh_.normals, corner.vertex + size_t{1}, Vec3f(Vec3f::Zero()));
        add(normals_[size_t(corner.normal)], mesh_.normals[corner.vertex]);
    }
    // What disagrees once stays NaN: at an edge no mean is the normal of either side.
    static void add(const Vec3f& normal, Vec3f& sum) {
        if (!sum.isZero() && sum.dot(normal) < kAgreeingCosine * sum.norm() * normal.norm()) sum.fill(std::numeric_limits<float>::quiet_NaN());
        sum += normal;
    }

    void finish_normals() {
        if (mesh_.normals.empty() && waiting_.empty()) return;
        memory_.lengthen(mesh_.normals, mesh_.positions.size(), Vec3f(Vec3f::Zero()));
        for (const auto& [vertex, normal] : waiting_) add(normals_[normal], mesh_.normals[vertex]);
        for (Vec3f& sum : mesh_.normals) {
            const float length = sum.norm();
            sum = length > 0.0f ? Vec3f(sum / length) : Vec3f(Vec3f::Zero());
        }
    }

    // From 0 to 1, or to 255, or to 65535, whichever holds all. What has no color is white.
    void finish_colors() {
        if (colors_.empty()) return;
        float most = 0.0f;
        for (const Vec4f& color : colors_)
            for (const float part : color)
                if (std::isfinite(part)) most = std::max(most, part);
        const float scale = most <= 1.0f ? 255.0f : most <= 255.0f ? 1.0f : 255.0f / 65535.0f;
        const auto byte = [&](float part) { return uint8_t(std::clamp(part * scale, 0.0f, 255.0f) + 0.5f); };
        memory_.lengthen(mesh_.colors, mesh_.positions.size(), {255, 255, 255, 255});
        for (size_t i = 0; i < colors_.size(); ++i) {
            const Vec4f color = colors_[i].unaryExpr([](float part) { return std::isnan(part) ? 0.0f : part; });
            if (color.head<3>() != Vec3f::Constant(kNoColor))
                mesh_.colors[i] = {byte(color[0]), byte(color[1]), byte(color[2]), color[3] == kNoColor ? uint8_t{255} : byte(color[3])};
        }
    }

    ByteStream stream_;
    MeshMemory memory_;
    ConcaveFaces concave_;
    TriangleMesh mesh_;
    std::vector<uint32_t> nowhere_;
    std::vector<Vec3f> normals_;  // of vn, of length 1 or 0
    std::vector<std::array<uint32_t, 2>> waiting_;  // vertex and normal
    std::vector<Vec4f> colors_;   // of v, as they stand there
    uint64_t farthest_vertex_ = 0, farthest_vertex_line_ = 0, farthest_normal_line_ = 0;
    int64_t farthest_normal_ = -1;
    uint64_t faces_ = 0, incomplete_faces_ = 0, other_shapes_ = 0;
};

}  // namespace

TriangleMesh read_obj(const ByteSource& source, const MeshReadSettings& settings, MeshReport& report) { return ObjReader(source, settings.most_bytes).read(report); }

}  // namespace strata
