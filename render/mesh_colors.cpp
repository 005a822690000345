#include "render/mesh_colors.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "core/cloud/attribute.h"
#include "core/error.h"
#include "render/colormap.h"
#include "render/srgb.h"

namespace strata {
namespace {

constexpr Rgba8 kPlain = make_rgba(206, 200, 190);  // as voxels
constexpr Rgba8 kNoValue = make_rgba(128, 128, 128);  // as points
constexpr size_t kSampleVertices = 50'000;
constexpr size_t kCategories = 256;  // colors of numbers without an order

constexpr std::pair<std::string_view, MeshColors::Rule> kRules[] = {{"rgb", MeshColors::Rule::rgb},
                                                                    {"elevation", MeshColors::Rule::elevation},
                                                                    {"normal", MeshColors::Rule::normal},
                                                                    {"plain", MeshColors::Rule::plain}};

// From a sample of what triangles use.
template <typename ValueOf>
ColorRange range_of(const TriangleMesh& mesh, const ValueOf& value_of) {
    const size_t step = 3 * mesh.triangles.size() / kSampleVertices + 1;
    std::vector<double> values;
    for (size_t i = 0; i < mesh.triangles.size(); i += step)
        for (const uint32_t vertex : mesh.triangles[i]) values.push_back(value_of(vertex));
    return percentile_range(values);
}

std::string attributes_of(const TriangleMesh& mesh) {
    std::string names;
    for (const MeshScalars& scalars : mesh.scalars) names += ", " + scalars.name;
    return names;
}

}  // namespace

Vec3f linear_light(Rgba8 color) {
    const std::array<float, 256>& linear = linear_from_srgb8();
    return {linear[red_of(color)], linear[green_of(color)], linear[blue_of(color)]};
}

bool MeshColors::is_rule(std::string_view name) {
    return std::any_of(std::begin(kRules), std::end(kRules), [&](const auto& rule) { return rule.first == name; });
}

size_t find_mesh_scalars(const TriangleMesh& mesh, std::string_view name) {
    const auto find = [&](const auto& matches) { return size_t(std::find_if(mesh.scalars.begin(), mesh.scalars.end(), matches) - mesh.scalars.begin()); };
    const size_t same = find([&](const MeshScalars& scalars) { return scalars.name == name; });
    if (same < mesh.scalars.size()) return same;
    name = full_attribute_name(name);
    const auto are_alike = [](char in_file, char typed) { return in_file == typed || (in_file == '_' && std::isalnum(static_cast<unsigned char>(typed)) == 0); };
    return find([&](const MeshScalars& scalars) { return std::equal(scalars.name.begin(), scalars.name.end(), name.begin(), name.end(), are_alike); });
}

MeshColors::MeshColors(const TriangleMesh& mesh, std::string_view name, std::optional<ColorRange> range, std::string_view colormap) {
    if (name.empty()) name = mesh.colors.empty() ? "plain" : "rgb";
    name_ = name;
    AttributeLook look;
    if (is_rule(name)) {
        rule_ = std::find_if(std::begin(kRules), std::end(kRules), [&](const auto& rule) { return rule.first == name; })->second;
    } else {
        scalars_ = find_mesh_scalars(mesh, name);
        if (scalars_ == mesh.scalars.size())
            throw Error(ErrorKind::usage, "meshes have no '" + name_ + "'; expected rgb, elevation, normal, plain or an attribute of vertices, which this one has " +
                                              (mesh.scalars.empty() ? "none of" : "these of: " + attributes_of(mesh).substr(2)));
        look = look_of_attribute(mesh.scalars[scalars_].name);
        rule_ = look.rule == ColorChannel::Rule::ramp ? Rule::ramp : Rule::category;
    }
    if (rule_ == Rule::rgb && mesh.colors.empty()) throw Error(ErrorKind::usage, "this mesh has no colors of vertices");
    table_.fill(kPlain);
    if (rule_ == Rule::category) {
        for (size_t number = 0; number < kCategories; ++number)
            table_[number] = look.rule == ColorChannel::Rule::classification ? classification_colors()[number] : category_color(number);
        return;
    }
    if (rule_ != Rule::elevation && rule_ != Rule::ramp) return;
    table_ = Colormap(colormap.empty() ? look.colormap : colormap).colors();
    if (range) range_ = *range;
    else if (rule_ == Rule::elevation) range_ = range_of(mesh, [&](uint32_t vertex) { return mesh.positions[vertex].z(); });
    else range_ = range_of(mesh, [&](uint32_t vertex) { return double(mesh.scalars[scalars_].values[vertex]); });
}

Rgba8 MeshColors::ramp(double value) const {
    if (!(value == value)) return kNoValue;
    const double extent = range_.high - range_.low, place = extent == 0.0 ? 0.5 : (value - range_.low) / extent;
    return table_[size_t(std::clamp(place, 0.0, 1.0) * double(table_.size() - 1) + 0.5)];
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
        case Rule::elevation: return linear_light(ramp(z));
        case Rule::ramp: {
            const std::vector<float>& values = mesh.scalars[scalars_].values;
            double sum = 0.0;
            for (size_t corner = 0; corner < 3; ++corner) sum += double(weights[int(corner)]) * double(values[mesh.triangles[triangle][corner]]);
            return linear_light(ramp(sum));
        }
        case Rule::category: {
            Eigen::Index corner;
            weights.maxCoeff(&corner);
            const double value = double(mesh.scalars[scalars_].values[mesh.triangles[triangle][size_t(corner)]]);
            if (!(std::abs(value) < 0x1p62)) return linear_light(kNoValue);
            return linear_light(table_[size_t(int64_t(value)) % kCategories]);
        }
        case Rule::normal: return linear_light(direction_color(normal));
    }
    return linear_light(kPlain);
}

}  // namespace strata
