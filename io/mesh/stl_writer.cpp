// STL, binary: each triangle with the places of its corners, as floats.
#include <Eigen/Geometry>
#include <array>
#include <cassert>
#include <cstdio>
#include <limits>

#include "core/error.h"
#include "io/mesh/gathered_bytes.h"
#include "io/mesh/surface_writer.h"

namespace strata {
namespace {

constexpr size_t kHeader = 84, kCountAt = 80;

class StlWriter : public SurfaceWriter {
public:
    StlWriter(const std::string& path, const SurfaceWriteSettings& settings)
        : file_(path, settings.overwrite), bytes_(file_), positions_(*settings.positions), loss_(float_error(settings.bounds)), edge_(settings.edge), loses_more_(settings.normals || settings.colors), loses_scalars_(!settings.scalars.empty()) {
        std::string header = "binary STL made by strata";  // no 'solid', which would tell of text
        header.resize(kHeader, ' ');
        bytes_.text(header);
    }

    void add(const SurfacePiece& piece) override {
        for (const auto& t : piece.triangles) triangle(t[0], t[1], t[2]);
        for (const auto& q : piece.quads) {
            triangle(q[0], q[1], q[2]);
            triangle(q[0], q[2], q[3]);
        }
    }

    bool keeps_quads() const override { return false; }
    uint64_t commit(Durability durability) override {
        bytes_.flush();
        const auto count = uint32_t(count_);
        file_.write_at(kCountAt, std::as_bytes(std::span(&count, 1)));
        file_.commit(durability);
        return bytes_.size();
    }

    std::vector<std::string> notes() const override {
        std::vector<std::string> notes;
        if (loss_ > edge_ / 1000.0 && count_ > 0) {
            char line[160];
            std::snprintf(line, sizeof line, "coordinates are floats in STL: up to %.2g units are lost; .ply and .obj keep them", loss_);
            notes.emplace_back(line);
            if (loss_ > edge_ / 10.0) notes.back() += ", and faces as small as these collapse: what is reported here is the surface before that";
        }
        if (loses_more_) notes.emplace_back("STL has no colors and no normals of vertices");
        if (loses_scalars_) notes.emplace_back("STL has no attributes of vertices: they are left out; .ply and .glb keep them");
        return notes;
    }

private:
    void triangle(uint32_t a, uint32_t b, uint32_t c) {
        if (++count_ > std::numeric_limits<uint32_t>::max()) throw Error(ErrorKind::limit, file_.path() + ": STL holds at most 4294967295 triangles");
        const std::array<Vec3d, 3> corners = {positions_[a], positions_[b], positions_[c]};
        const Vec3f normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).stableNormalized().cast<float>();
        std::array<float, 12> numbers;
        for (size_t k = 0; k < 3; ++k) {
            numbers[k] = normal[Eigen::Index(k)];
            for (size_t corner = 0; corner < 3; ++corner) numbers[3 + 3 * corner + k] = float(corners[corner][Eigen::Index(k)]);
        }
        bytes_.put(numbers);
        bytes_.put(uint16_t{0});
    }

    OutputFile file_;
    GatheredBytes bytes_;
    VertexPositions& positions_;
    double loss_, edge_;
    bool loses_more_, loses_scalars_;
    uint64_t count_ = 0;
};

}  // namespace

std::unique_ptr<SurfaceWriter> make_stl_writer(const std::string& path, const SurfaceWriteSettings& settings) {
    assert(settings.positions);
    return std::make_unique<StlWriter>(path, settings);
}

}  // namespace strata
