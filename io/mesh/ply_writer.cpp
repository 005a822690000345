// PLY, binary little-endian. Faces wait in a scratch file until all vertices are written, and the header, whose size is fixed, comes last.
#include <array>
#include <string>
#include <vector>

#include "core/error.h"
#include "io/mesh/gathered_bytes.h"
#include "io/mesh/ply_header.h"
#include "io/mesh/surface_writer.h"
#include "io/scratch_file.h"

namespace strata {
namespace {

constexpr size_t kHeader = 512, kHeaderScalar = 100;  // the longest is shorter; of each attribute likewise

class PlyWriter : public SurfaceWriter {
public:
    PlyWriter(const std::string& path, const SurfaceWriteSettings& settings)
        : file_(path, settings.overwrite),
          scratch_(make_scratch_file(settings.scratch_folder)),
          vertices_(file_),
          faces_(*scratch_),
          normals_(settings.normals),
          colors_(settings.colors),
          doubles_(float_error(settings.bounds) > settings.edge / 1000.0),
          scalars_(plain_names(settings.scalars, ply::kNamesWithMeaning)),
          header_bytes_(kHeader + kHeaderScalar * scalars_.size()) {
        vertices_.text(std::string(header_bytes_, ' '));
    }

    void add(const SurfacePiece& piece) override {
        for (size_t i = 0; i < piece.positions.size(); ++i) {
            const Vec3d position = piece.origin + piece.positions[i].cast<double>();
            if (doubles_) vertices_.put(std::array<double, 3>{position.x(), position.y(), position.z()});
            else put(position.cast<float>());
            if (normals_) put(piece.normals[i]);
            if (colors_) vertices_.put(piece.colors[i]);
            for (size_t s = 0; s < scalars_.size(); ++s) vertices_.put(piece.scalars[s].values[i]);
        }
        count_ += piece.positions.size();
        for (const std::array<uint32_t, 3>& triangle : piece.triangles) put_face(triangle);
        for (const std::array<uint32_t, 4>& quad : piece.quads) put_face(quad);
    }

    uint64_t commit(Durability durability) override {
        vertices_.copy(faces_);
        const std::string text = header();
        file_.write_at(0, std::as_bytes(std::span(text)));
        file_.commit(durability);
        return vertices_.size();
    }

private:
    void put(const Vec3f& v) { vertices_.put(std::array<float, 3>{v.x(), v.y(), v.z()}); }

    template <size_t Corners>
    void put_face(const std::array<uint32_t, Corners>& corners) {
        std::byte* const at = faces_.room(1 + sizeof corners);
        at[0] = std::byte{Corners};
        std::memcpy(at + 1, corners.data(), sizeof corners);
        ++face_count_;
    }

    // A comment fills it up.
    std::string header() const {
        const std::string type = doubles_ ? "double" : "float";
        std::string text = "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(count_) + "\nproperty " + type + " x\nproperty " + type + " y\nproperty " + type + " z\n";
        if (normals_) text += "property float nx\nproperty float ny\nproperty float nz\n";
        if (colors_) text += "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar alpha\n";
        for (const std::string& name : scalars_) text += "property float " + name + '\n';
        // Most programs know signed numbers of vertices best.
        text += "element face " + std::to_string(face_count_) + "\nproperty list uchar " + (count_ > 0x7FFFFFFF ? "uint" : "int") + " vertex_indices\n";
        const std::string made = "comment made by strata", end = "\nend_header\n";
        return text + made + std::string(header_bytes_ - text.size() - made.size() - end.size(), ' ') + end;
    }

    OutputFile file_;
    std::unique_ptr<ScratchStore> scratch_;
    GatheredBytes vertices_, faces_;
    bool normals_, colors_, doubles_;
    std::vector<std::string> scalars_;
    size_t header_bytes_;
    uint64_t count_ = 0, face_count_ = 0;
};

}  // namespace

std::unique_ptr<SurfaceWriter> make_ply_writer(const std::string& path, const SurfaceWriteSettings& settings) { return std::make_unique<PlyWriter>(path, settings); }

}  // namespace strata
