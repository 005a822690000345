// Wavefront OBJ: vertices and faces of each piece as it comes.
#include <algorithm>
#include <charconv>
#include <cmath>

#include "io/mesh/gathered_bytes.h"
#include "io/mesh/surface_writer.h"

namespace strata {
namespace {

constexpr size_t kLongestLine = 512;  // of numbers below 1e30 with the decimals that there may be

class ObjWriter : public SurfaceWriter {
public:
    ObjWriter(const std::string& path, const SurfaceWriteSettings& settings)
        : file_(path, settings.overwrite),
          bytes_(file_),
          normals_(settings.normals),
          colors_(settings.colors),
          scalars_(settings.scalars.size()),
          decimals_(settings.edge > 0.0 ? std::clamp(int(std::ceil(-std::log10(settings.edge))) + 5, 0, 40) : -1) {
        bytes_.text("# made by strata\n");
    }

    void add(const SurfacePiece& piece) override {
        for (size_t i = 0; i < piece.positions.size(); ++i) {
            begin("v");
            const Vec3d position = piece.origin + piece.positions[i].cast<double>();
            for (const double part : position) number(part, decimals_);
            if (colors_) {
                for (size_t k = 0; k < 3; ++k) number(piece.colors[i][k] / 255.0, 4);
                loses_opacity_ |= piece.colors[i][3] < 255;
            }
            end();
            if (!normals_) continue;
            begin("vn");
            for (const float part : piece.normals[i]) number(double(part), 5);
            end();
        }
        for (const auto& triangle : piece.triangles) face(triangle);
        for (const auto& quad : piece.quads) face(quad);
    }

    uint64_t commit(Durability durability) override {
        bytes_.flush();
        file_.commit(durability);
        return bytes_.size();
    }

    std::vector<std::string> notes() const override {
        std::vector<std::string> lines;
        if (loses_opacity_) lines.emplace_back("OBJ has no opacity of vertices: what could be seen through is opaque; .ply and .glb keep it");
        if (scalars_ > 0) lines.emplace_back("OBJ has no attributes of vertices: they are left out; .ply and .glb keep them");
        return lines;
    }

private:
    void begin(std::string_view keyword) {
        at_ = std::copy(keyword.begin(), keyword.end(), line_);
    }
    void end() {
        *at_++ = '\n';
        bytes_.text({line_, size_t(at_ - line_)});
    }
    // decimals  below 0: all digits that the number has
    void number(double value, int decimals) {
        *at_++ = ' ';
        char* const begin = at_;
        if (decimals < 0) {
            at_ = std::to_chars(at_, line_ + kLongestLine, value).ptr;
            return;
        }
        at_ = std::to_chars(at_, line_ + kLongestLine, value, std::chars_format::fixed, decimals).ptr;
        if (decimals > 0) {
            while (at_[-1] == '0') --at_;
            if (at_[-1] == '.') --at_;
        }
        if (at_ - begin == 2 && begin[0] == '-' && begin[1] == '0') *begin = '0', at_ = begin + 1;
    }
    template <size_t Corners>
    void face(const std::array<uint32_t, Corners>& corners) {
        begin("f");
        for (const uint32_t corner : corners) {
            *at_++ = ' ';
            char* const begin = at_;
            at_ = std::to_chars(at_, line_ + kLongestLine, uint64_t{corner} + 1).ptr;
            if (!normals_) continue;
            const char* const last = at_;
            *at_++ = '/';
            *at_++ = '/';
            at_ = std::copy(static_cast<const char*>(begin), last, at_);
        }
        end();
    }

    OutputFile file_;
    GatheredBytes bytes_;
    bool normals_, colors_;
    size_t scalars_;
    int decimals_;
    bool loses_opacity_ = false;
    char line_[kLongestLine];
    char* at_ = line_;
};

}  // namespace

std::unique_ptr<SurfaceWriter> make_obj_writer(const std::string& path, const SurfaceWriteSettings& settings) { return std::make_unique<ObjWriter>(path, settings); }

}  // namespace strata
