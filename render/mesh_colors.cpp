#include "render/mesh_colors.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "core/error.h"
#include "render/colormap.h"
#include "render/srgb.h"

namespace strata {
namespace {

constexpr Rgba8 kPlain = make_rgba(206, 200, 190);  // as voxels
constexpr size_t kSampleVertices = 50'000;

constexpr std::pair<std::string_view, MeshColors::Rule> kRules[] = {{"rgb", MeshColors::Rule::rgb},
                                                                    {"elevation", MeshColors::Rule::elevation},
                                                                    {"normal", MeshColors::Rule::normal},
                                                                    {"plain", MeshColors::Rule::plain}};

ColorRange range_of_elevations(const TriangleMesh& mesh) {
    const size_t step = mesh.triangles.size() / kSampleVertices + 1;
    std::vector<double> values;
    for (size_t i = 0; i < mesh.triangles.size(); i += step) values.push_back(mesh.positions[mesh.triangles[i][0]].z());
    if (values.empty()) return {};
    return percentile_range(values);
}

}  // namespace

Vec3f linear_light(Rgba8 color) {
    const std::array<float, 256>& linear = linear_from_srgb8();
    return {linear[red_of(color)], linear[green_of(color)], linear[blue_of(color)]};
}

MeshColors::MeshColors(const TriangleMesh& mesh, std::string_view name, std::optional<ColorRange> range, std::string_view colormap) {
    if (name.empty()) name = mesh.colors.empty() ? "plain" : "rgb";
    const auto* const found = std::find_if(std::begin(kRules), std::end(kRules), [&](const auto& rule) { return rule.first == name; });
    if (found == std::end(kRules)) throw Error(ErrorKind::usage, "meshes have no '" + std::string(name) + "'; expected rgb, elevation, normal or plain");
    name_ = name;
    rule_ = found->second;
    if (rule_ == Rule::rgb && mesh.colors.empty()) throw Error(ErrorKind::usage, "this mesh has no colors of vertices");
    table_.fill(kPlain);
    if (rule_ != Rule::elevation) return;
    table_ = Colormap(colormap.empty() ? "fjord" : colormap).colors();
    range_ = range ? *range : range_of_elevations(mesh);
}

Vec3f MeshColors::light(const TriangleMesh& mesh, uint32_t triangle, const Vec3f& weights, double z, const Vec3f& normal) const {
    switch (rule_) {
        case Rule::plain: break;
        case Rule::rgb: {
            const std::array<float, 256>& linear = linear_from_srgb8();
            Vec3f sum = Vec3f::Zero();
            for (size_t corner = 0; corner < 3; ++corner) {
                const std::array<uint8_t, 4>& color = mesh.colors[mesh.triangles[triangle][corner]];
                sum += weights[int(corner)] * Vec3f(linear[color[0]], linear[color[1]], linear[color[2]]);
            }
            return sum;
        }
        case Rule::elevation: {
            const double extent = range_.high - range_.low, place = extent == 0.0 ? 0.5 : (z - range_.low) / extent;
            return linear_light(table_[size_t(std::clamp(place, 0.0, 1.0) * double(table_.size() - 1) + 0.5)]);
        }
        case Rule::normal: return linear_light(direction_color(normal));
    }
    return linear_light(kPlain);
}

}  // namespace strata
