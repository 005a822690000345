// glTF 2.0, binary. Written here: libraries for it hold all of a mesh in memory before they write its first byte. The vertices go to
// the file as they come, faces wait in a scratch file, and the JSON before them, whose size is fixed, comes last.
#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>

#include "core/error.h"
#include "io/mesh/gathered_bytes.h"
#include "io/mesh/surface_writer.h"
#include "io/scratch_file.h"

namespace strata {
namespace {

using nlohmann::ordered_json;

// Section 4.4, "GLB File Format Specification", of glTF 2.0.
constexpr uint32_t kMagic = 0x46546C67, kJsonChunk = 0x4E4F534A, kBinaryChunk = 0x004E4942;
constexpr uint32_t kJsonBytes = 2048, kJsonScalar = 320;  // the longest is shorter, of each attribute likewise; the rest is blanks
constexpr int kArrayBuffer = 34962, kElementArrayBuffer = 34963, kUint16 = 5123, kUint32 = 5125, kFloat = 5126;
constexpr uint64_t kMostStride = 252;  // of a buffer view, section 5.11

// Colors of vertices are linear there, in 16 bits, so that dark ones stay apart.
std::array<uint16_t, 256> linear_table() {
    std::array<uint16_t, 256> table;
    for (size_t i = 0; i < table.size(); ++i) {
        const double v = double(i) / 255.0;
        table[i] = uint16_t(std::lround(65535.0 * (v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4))));
    }
    return table;
}

class GlbWriter : public SurfaceWriter {
public:
    GlbWriter(const std::string& path, const SurfaceWriteSettings& settings)
        : file_(path, settings.overwrite),
          scratch_(make_scratch_file(settings.scratch_folder)),
          vertices_(file_),
          faces_(*scratch_),
          normals_(settings.normals),
          colors_(settings.colors),
          scalars_(plain_names(settings.scalars, {})),
          stride_(12 + (settings.normals ? 12 : 0) + (settings.colors ? 8 : 0) + 4 * scalars_.size()),
          json_bytes_(uint32_t(kJsonBytes + kJsonScalar * scalars_.size())),
          binary_at_(12 + 8 + json_bytes_ + 8),
          linear_(linear_table()) {
        if (stride_ > kMostStride) throw Error(ErrorKind::limit, path + ": GLB has room for " + std::to_string(scalars_.size() - (stride_ - kMostStride) / 4) + " attributes of vertices; .ply has no such limit");
        vertices_.text(std::string(binary_at_, ' '));
    }

    void add(const SurfacePiece& piece) override {
        if (!origin_ && !piece.positions.empty()) origin_ = piece.origin;
        for (size_t i = 0; i < piece.positions.size(); ++i) {
            const Vec3f position = origin_ == piece.origin ? piece.positions[i] : Vec3f((piece.origin - *origin_ + piece.positions[i].cast<double>()).cast<float>());
            least_ = least_.cwiseMin(position);
            greatest_ = greatest_.cwiseMax(position);
            put(position);
            if (normals_) put(piece.normals[i].squaredNorm() > 0.0f ? piece.normals[i] : Vec3f(0, 0, 1));  // of unit length is asked for
            if (colors_) {
                const auto& c = piece.colors[i];
                vertices_.put(std::array<uint16_t, 4>{linear_[c[0]], linear_[c[1]], linear_[c[2]], uint16_t(c[3] * 257)});
                is_seen_through_ |= c[3] < 255;
            }
            for (size_t s = 0; s < scalars_.size(); ++s) {
                const float value = piece.scalars[s].values[i];  // section 3.6.2.2: no infinity and no NaN
                unknown_ += !(value == value);
                vertices_.put(value == value ? std::clamp(value, std::numeric_limits<float>::lowest(), std::numeric_limits<float>::max()) : 0.0f);
            }
        }
        count_ += piece.positions.size();
        for (const auto& t : piece.triangles) faces_.put(t);
        for (const auto& q : piece.quads) {
            faces_.put(std::array{q[0], q[1], q[2]});
            faces_.put(std::array{q[0], q[2], q[3]});
        }
        // A part of what is bound to be too large is not written.
        if (vertices_.size() + faces_.size() > std::numeric_limits<uint32_t>::max())
            throw Error(ErrorKind::limit, file_.path() + ": a GLB file holds at most 4 GiB; .ply and .obj have no such limit");
    }

    bool keeps_quads() const override { return false; }
    uint64_t commit(Durability durability) override {
        const std::string json = document().dump();
        assert(json.size() <= json_bytes_);
        vertices_.copy(faces_);
        const auto total = uint32_t(vertices_.size());
        const bool has_binary = total > binary_at_;
        std::vector<std::byte> head(binary_at_, std::byte{' '});
        const auto put_at = [&](size_t at, uint32_t value) { std::memcpy(head.data() + at, &value, sizeof value); };
        put_at(0, kMagic);
        put_at(4, 2);
        put_at(8, has_binary ? total : binary_at_ - 8);
        put_at(12, json_bytes_);
        put_at(16, kJsonChunk);
        std::memcpy(head.data() + 20, json.data(), json.size());
        put_at(binary_at_ - 8, total - binary_at_);
        put_at(binary_at_ - 4, kBinaryChunk);
        file_.write_at(0, head);
        if (!has_binary) file_.truncate(binary_at_ - 8);
        file_.commit(durability);
        return has_binary ? total : binary_at_ - 8;
    }

    std::vector<std::string> notes() const override {
        if (unknown_ == 0) return {};
        return {"GLB has no unknown values: " + std::to_string(unknown_) + " of attributes are 0 there; .ply keeps them as NaN"};
    }

private:
    void put(const Vec3f& v) { vertices_.put(std::array<float, 3>{v.x(), v.y(), v.z()}); }

    ordered_json document() const {
        ordered_json document = {{"asset", {{"version", "2.0"}, {"generator", "strata"}}}, {"scene", 0}};
        if (faces_.size() == 0) {  // no part of it may be empty
            document["scenes"] = ordered_json::array({ordered_json::object()});
            return document;
        }
        const uint64_t vertex_bytes = count_ * stride_;
        const Vec3d origin = *origin_;
        document["scenes"] = {{{"nodes", {0}}}};
        // z is up here, y is up there: a quarter turn about x brings (x, y, z) to (x, z, -y).
        document["nodes"] = {{{"mesh", 0}, {"rotation", {-std::sqrt(0.5), 0.0, 0.0, std::sqrt(0.5)}}, {"translation", {origin.x(), origin.z(), -origin.y()}}}};
        ordered_json attributes = {{"POSITION", 0}};
        ordered_json accessors = {{{"bufferView", 0}, {"componentType", kFloat}, {"count", count_}, {"type", "VEC3"},
                                   {"min", {least_.x(), least_.y(), least_.z()}}, {"max", {greatest_.x(), greatest_.y(), greatest_.z()}}}};
        if (normals_) {
            attributes["NORMAL"] = accessors.size();
            accessors.push_back({{"bufferView", 0}, {"byteOffset", 12}, {"componentType", kFloat}, {"count", count_}, {"type", "VEC3"}});
        }
        if (colors_) {
            attributes["COLOR_0"] = accessors.size();
            accessors.push_back({{"bufferView", 0}, {"byteOffset", normals_ ? 24 : 12}, {"componentType", kUint16}, {"normalized", true}, {"count", count_}, {"type", "VEC4"}});
        }
        for (size_t s = 0; s < scalars_.size(); ++s) {
            attributes['_' + scalars_[s]] = accessors.size();
            accessors.push_back({{"bufferView", 0}, {"byteOffset", stride_ - 4 * (scalars_.size() - s)}, {"componentType", kFloat}, {"count", count_}, {"type", "SCALAR"}});
        }
        document["meshes"] = {{{"primitives", {{{"attributes", attributes}, {"indices", accessors.size()}, {"material", 0}}}}}};
        accessors.push_back({{"bufferView", 1}, {"componentType", kUint32}, {"count", faces_.size() / 4}, {"type", "SCALAR"}});
        document["accessors"] = accessors;
        const double gray = colors_ ? 1.0 : 0.6;
        document["materials"] = {{{"pbrMetallicRoughness", {{"baseColorFactor", {gray, gray, gray, 1.0}}, {"metallicFactor", 0.0}, {"roughnessFactor", 1.0}}}, {"doubleSided", true}}};
        if (is_seen_through_) document["materials"][0]["alphaMode"] = "BLEND";  // else the alpha of colors is not looked at
        document["buffers"] = {{{"byteLength", vertex_bytes + faces_.size()}}};
        document["bufferViews"] = {{{"buffer", 0}, {"byteLength", vertex_bytes}, {"byteStride", stride_}, {"target", kArrayBuffer}},
                                   {{"buffer", 0}, {"byteOffset", vertex_bytes}, {"byteLength", faces_.size()}, {"target", kElementArrayBuffer}}};
        return document;
    }

    OutputFile file_;
    std::unique_ptr<ScratchStore> scratch_;
    GatheredBytes vertices_, faces_;
    bool normals_, colors_;
    std::vector<std::string> scalars_;
    uint64_t stride_;
    uint32_t json_bytes_, binary_at_;
    std::array<uint16_t, 256> linear_;  // of sRGB
    std::optional<Vec3d> origin_;       // world: of positions in the file
    Vec3f least_ = Vec3f::Constant(std::numeric_limits<float>::max()), greatest_ = Vec3f::Constant(std::numeric_limits<float>::lowest());
    uint64_t count_ = 0, unknown_ = 0;  // vertices; values of attributes that are NaN
    bool is_seen_through_ = false;      // a color of less than full opacity came
};

}  // namespace

std::unique_ptr<SurfaceWriter> make_glb_writer(const std::string& path, const SurfaceWriteSettings& settings) { return std::make_unique<GlbWriter>(path, settings); }

}  // namespace strata
