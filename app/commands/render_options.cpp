#include "app/commands/render_options.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <numbers>
#include <tuple>

#include "app/commands/camera_file.h"
#include "app/commands/isovalues.h"
#include "app/cut_options.h"
#include "core/error.h"
#include "render/colormap.h"
#include "render/named_view.h"
#include "render/sample_sums.h"

namespace strata {
namespace {

constexpr OptionRow kRows[] = {
    {"--output", "-o", "FILE.png", "", "the picture; a world file (.pgw) comes beside it for georeferenced --ortho top views"},
    {"--size", "-s", "WIDTHxHEIGHT", "1920x1080", "pixels, each side at most 16384"},
    {"--view", "-v", "NAME", "iso", "iso, top, front, back, left or right, framed around what is drawn; front looks north"},
    {"--eye", "", "X,Y,Z", "", "free camera: where it stands, CRS units"},
    {"--target", "", "X,Y,Z", "", "what it looks at; default: the cloud's center"},
    {"--up", "", "z|y|X,Y,Z", "z", "which axis points upwards, for views and for the light of voxels and meshes: many models have y; or, of a free camera, any direction. Views straight down have north upwards"},
    {"--fov", "", "DEGREES", "45", "angle from the bottom to the top of the picture"},
    {"--camera", "", "FILE.json", "", "the camera of a file, {\"eye\": [x,y,z], \"target\": ..., \"up\": ..., \"fov\": degrees} or with ortho_height; --stats prints one"},
    {"--ortho", "", "", "", "parallel projection: equal lengths look equal at any distance"},
    {"--meters-per-pixel", "", "UNITS", "", "CRS units a pixel, for --ortho; sets the size too unless --size is given"},
    {"--color", "-c", "MODE", "", "rgb, intensity, elevation, classification, return, gps-time, source, lod, normal, density, or an attribute; default: rgb, else elevation. Of voxels rgb, elevation, count, normal, lod or plain, of meshes rgb, elevation, normal, plain or an attribute of the vertices of a .ply; default: rgb, else plain. Of isosurfaces elevation, normal or plain"},
    {"--colormap", "", "NAME", "", "color map for quantities"},
    {"--range", "", "LOW,HIGH", "", "values that the color map reaches over; default: 2nd to 98th percentile"},
    {"--preview", "", "", "", "of LAS and LAZ files, the first of each run of points only, 2 million at most: a first look at any size"},
    {"--voxels", "", "flat|smooth", "flat", "how voxels are drawn: as cubes, or lit and with the depth of the surface that they stand for"},
    {"--iso", "", "V,...", "", "draw the surfaces where the values of volumes, or of .vdb grids, are V; without a mesh, exactly in the interpolated values"},
    {"--opacity", "", "V,...", "1", "how much of what is behind it an isosurface hides, above 0 to 1: one for all of --iso, or one for each"},
    {"--mesh", "", "flat|smooth", "smooth", "how meshes are lit: each triangle as the plane that it is, or by normals that change evenly except at creases of more than 45 degrees"},
    {"--wireframe", "", "", "", "draw the edges of the triangles of meshes, where those look larger than a few pixels"},
    {"--backfaces", "", "", "", "give triangles of meshes that are seen from behind a color of their own: shows which way they turn"},
    {"--splat", "", "KIND", "paraboloid", "how a point is drawn: square, disc, paraboloid (they meet where they overlap on a surface), gaussian (paraboloids whose colors are averaged: smooth) or surfel (a disc across the point's normal, of 'convert --normals')"},
    {"--point-size", "", "adaptive|PIXELS", "adaptive", "diameter of a point; adaptive: from the spacing of the points, so that surfaces close"},
    {"--min-point-size", "", "PIXELS", "1", "least diameter of adaptive sizes"},
    {"--max-point-size", "", "PIXELS", "255", "largest diameter of adaptive sizes, at most 256"},
    {"--rasterizer", "", "auto|cpu|gpu", "auto", "what draws points, voxels and meshes; both draw the same picture. gpu: shaders, also of software OpenGL; auto: gpu where there is one"},
    {"--error", "", "PIXELS", "1", "detail: points left out lie this near to drawn ones, and cells of voxels that look no larger are drawn whole"},
    {"--budget", "", "POINTS", "20000000", "most points to draw; the root is always drawn"},
    {"--clip", "", "BOX[;BOX...]", "", "draw only what is in a box: xmin,ymin,zmin,xmax,ymax,zmax, CRS units, faces included; a number left out is open. Views are framed around the boxes"},
    {"--clip-out", "", "BOX[;BOX...]", "", "draw nothing that is in a box"},
    {"--filter", "", "NAME=VALUES[;...]", "", "draw only points whose values are among these: 'class=2,6;return=1;intensity=100:2000'; names as for --color"},
    {"--fill", "", "[PIXELS]", "auto", "close gaps between the samples of a surface, up to so wide, at most 16; auto: as wide as the points there, up to 16. Off unless given"},
    {"--ssao", "", "[RADIUS]", "auto", "ambient occlusion: darken what little of the sky reaches past its surroundings within a radius, CRS units; auto: a hundredth of the cloud's diagonal. Off unless given"},
    {"--edl", "", "STRENGTH[,RADIUS]", "0.7", "eye-dome lighting: how dark slopes get, and how far neighbors lie, in thousandths of the height; default radius: 2, or a splat where larger; 0: off"},
    {"--samples", "", "N", "1", "average so many pictures a fraction of a pixel apart: smooth edges; depth and sizes are as with 1"},
    {"--time-budget", "", "MILLISECONDS", "0", "stop reading and drawing finer nodes so that the picture takes about so long; 0: take the time it needs"},
    {"--background", "", "COLOR", "#181c24", "'#rrggbb'"},
    {"--transparent", "", "", "", "no background: alpha 0 where there are no points"},
    {"--depth", "", "FILE.pfm", "", "also writes the depth along the view direction, CRS units, infinite at the background"},
    {"--reference", "", "FILE.png", "", "compare with this picture; exit code 1 and a difference picture beside the output when over --threshold"},
    {"--threshold", "", "STEPS", "4", "largest difference that passes: root mean square of the worst 16 x 16 pixels, 8-bit steps"},
    {"--stats", "", "", "", "one JSON object about the frame on standard output"},
    {"--tile", "", "ROWS", "0", "rows of the picture in memory at a time; 0: as many as suit. Does not show in the picture"},
    shared_option::kOverwrite,
    shared_option::kThreads,
    shared_option::kMemory,
    shared_option::kQuiet,
};

[[noreturn]] void refuse(std::string_view flag, const std::string& expected, const std::string& text) {
    throw Error(ErrorKind::usage, std::string(flag) + ": expected " + expected + ", got '" + text + "'");
}

double parse_double(std::string_view flag, std::string_view text, const std::string& expected, const std::string& whole) {
    double value = 0.0;
    const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (status != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) refuse(flag, expected, whole);
    return value;
}

}  // namespace

std::pair<uint32_t, uint32_t> parse_size(const std::string& text) {
    const std::string expected = "WIDTHxHEIGHT with sides from 1 to " + std::to_string(kLargestSide);
    uint32_t sides[2] = {0, 0};
    const char* const end = text.data() + text.size();
    const auto [x, first] = std::from_chars(text.data(), end, sides[0]);
    if (first != std::errc() || x == end || *x != 'x') refuse("--size", expected, text);
    const auto [rest, second] = std::from_chars(x + 1, end, sides[1]);
    if (second != std::errc() || rest != end) refuse("--size", expected, text);
    for (const uint32_t side : sides)
        if (side < 1 || side > kLargestSide) refuse("--size", expected, text);
    return {sides[0], sides[1]};
}

namespace {

Rgba8 parse_color(const std::string& text) {
    uint32_t value = 0;
    const bool sharp = !text.empty() && text[0] == '#';
    const char* const begin = text.data() + (sharp ? 1 : 0);
    const char* const end = text.data() + text.size();
    const auto [rest, status] = std::from_chars(begin, end, value, 16);
    if (end - begin != 6 || status != std::errc() || rest != end) refuse("--background", "a color such as '#203040'", text);
    return make_rgba(uint8_t(value >> 16), uint8_t(value >> 8), uint8_t(value));
}

EdlSettings parse_edl(const std::string& text) {
    const std::string expected = "STRENGTH or STRENGTH,RADIUS, such as 1 or 0.8,2";
    EdlSettings edl;
    const size_t comma = std::min(text.find(','), text.size());
    edl.strength = float(parse_double("--edl", std::string_view(text).substr(0, comma), expected, text));
    edl.follow_splats = comma == text.size();
    if (comma < text.size()) edl.radius = 1e-3f * float(parse_double("--edl", std::string_view(text).substr(comma + 1), expected, text));
    if (!(edl.strength >= 0.0f && edl.strength <= 1000.0f)) refuse("--edl", "a strength from 0 to 1000", text);
    if (!(edl.radius >= 1e-4f && edl.radius <= 0.05f)) refuse("--edl", "a radius from 0.1 to 50 thousandths of the height", text);
    return edl;
}

FillSettings parse_fill(const Options& options) {
    if (!options.given("--fill")) return {};
    const std::string text = options.text("--fill");
    if (text == "auto") return {.gap_px = FillSettings::kWidestGap};
    const std::string expected = "the width of gaps, from 1 to 16 pixels, or auto";
    const double gap_px = parse_double("--fill", text, expected, text);
    if (!(gap_px >= 1.0 && gap_px <= FillSettings::kWidestGap)) refuse("--fill", expected, text);
    return {.gap_px = float(gap_px), .follow_splats = false};
}

// The radius as given; 0 where it is left to the cloud.
double parse_ssao(const Options& options) {
    const std::string text = options.text("--ssao");
    if (text == "auto") return 0.0;
    const double radius = parse_double("--ssao", text, "a positive radius or auto", text);
    if (!(radius > 0.0)) refuse("--ssao", "a positive radius or auto", text);
    return radius;
}

// A hundredth of the cloud's diagonal: corners and eaves show, hills do not.
double sensible_ssao_radius(std::span<const Vec3d> points) {
    Box3d box;
    for (const Vec3d& p : points) box.extend(p);
    return box.empty() ? 1.0 : std::max(0.01 * box.size().norm(), 1e-6);
}

SplatShape parse_shape(const std::string& text) {
    constexpr std::pair<std::string_view, SplatShape> kShapes[] = {{"square", SplatShape::square},
                                                                  {"disc", SplatShape::disc},
                                                                  {"paraboloid", SplatShape::paraboloid},
                                                                  {"gaussian", SplatShape::gaussian},
                                                                  {"surfel", SplatShape::surfel}};
    for (const auto& [name, shape] : kShapes)
        if (text == name) return shape;
    refuse("--splat", "square, disc, paraboloid, gaussian or surfel", text);
}

float parse_diameter(const Options& options, std::string_view flag, const std::string& expected) {
    const std::string text = options.text(flag);
    const double diameter = parse_double(flag, text, expected, text);
    if (!(diameter >= 1.0 && diameter <= 256.0)) refuse(flag, expected, text);
    return float(diameter);
}

SplatStyle parse_splat(const Options& options) {
    SplatStyle splat;
    splat.shape = parse_shape(options.text("--splat"));
    splat.least_px = parse_diameter(options, "--min-point-size", "a diameter from 1 to 256 pixels");
    splat.most_px = parse_diameter(options, "--max-point-size", "a diameter from 1 to 256 pixels");
    if (splat.least_px > splat.most_px) throw Error(ErrorKind::usage, "--min-point-size is larger than --max-point-size");
    if (options.text("--point-size") == "adaptive") return splat;
    splat.fixed_px = parse_diameter(options, "--point-size", "adaptive, or a diameter from 1 to 256 pixels");
    for (const std::string_view flag : {"--min-point-size", "--max-point-size"})
        if (options.given(flag)) throw Error(ErrorKind::usage, std::string(flag) + " is for adaptive sizes, --point-size says another");
    return splat;
}

Rasterizer parse_rasterizer(const Options& options) {
    const std::string name = options.text("--rasterizer");
    if (name == "auto") return Rasterizer::automatic;
    if (name == "cpu") return Rasterizer::cpu;
    if (name == "gpu") return Rasterizer::gpu;
    refuse("--rasterizer", "auto, cpu or gpu", name);
}

Vec3d vector_of(const Options& options, std::string_view flag) {
    const std::vector<double> values = options.numbers(flag, 3);
    return {values[0], values[1], values[2]};
}

double parse_fov(const Options& options) {
    const double degrees = options.number("--fov");
    if (!(degrees > 0.0 && degrees <= 179.0)) refuse("--fov", "an angle above 0 and at most 179 degrees", options.text("--fov"));
    return degrees * std::numbers::pi / 180.0;
}

double parse_units_per_pixel(const Options& options) {
    const double units = options.number("--meters-per-pixel");
    if (!(units > 0.0)) refuse("--meters-per-pixel", "a positive length", options.text("--meters-per-pixel"));
    if (!options.given("--ortho")) throw Error(ErrorKind::usage, "--meters-per-pixel needs --ortho");
    return units;
}

std::vector<ClipBox> parse_clips(const Options& options) {
    std::vector<ClipBox> clips;
    for (const auto& [flag, action] : {std::pair{"--clip", ClipBox::Action::keep}, std::pair{"--clip-out", ClipBox::Action::remove}}) {
        if (!options.given(flag)) continue;
        const std::vector<ClipBox> boxes = parse_clip_boxes(flag, options.text(flag), action);
        clips.insert(clips.end(), boxes.begin(), boxes.end());
    }
    return clips;
}

// What views are framed around where boxes keep a part of the cloud: corners of what they share with it.
std::vector<Vec3d> kept_corners(std::span<const ClipBox> clips, const Box3d& bounds) {
    std::vector<Vec3d> corners;
    for (const ClipBox& clip : clips) {
        const Box3d shared = {.min = clip.box.min.cwiseMax(bounds.min), .max = clip.box.max.cwiseMin(bounds.max)};
        if (clip.action != ClipBox::Action::keep || shared.empty()) continue;
        for (int corner = 0; corner < 8; ++corner)
            corners.emplace_back((corner & 1 ? shared.max : shared.min).x(), (corner & 2 ? shared.max : shared.min).y(),
                                 (corner & 4 ? shared.max : shared.min).z());
    }
    return corners;
}

bool is_axis(const std::string& text) { return text == "y" || text == "z"; }

UpAxis parse_up(const Options& options) { return options.text("--up") == "y" ? UpAxis::y : UpAxis::z; }

Camera free_camera(const Options& options, const Box3d& bounds, std::span<const Vec3d> points) {
    Camera camera;
    camera.projection = options.given("--ortho") ? Projection::orthographic : Projection::perspective;
    camera.fov_rad = parse_fov(options);
    Box3d box;
    for (const Vec3d& p : points) box.extend(p);
    if (box.empty()) box = bounds;
    camera.eye = vector_of(options, "--eye");
    const Vec3d target = options.given("--target") ? vector_of(options, "--target") : box.center();
    const Vec3d forward = target - camera.eye;
    const bool y_upwards = parse_up(options) == UpAxis::y;
    const Vec3d axis = y_upwards ? Vec3d::UnitY() : Vec3d::UnitZ(), north = y_upwards ? Vec3d(-Vec3d::UnitZ()) : Vec3d::UnitY();
    const bool as_vector = options.given("--up") && !is_axis(options.text("--up"));
    const bool vertical = forward.cross(axis).norm() <= 1e-6 * forward.norm();
    const Vec3d up = as_vector ? vector_of(options, "--up") : vertical ? north : axis;
    camera.view_from_world = look_along(forward, up);
    if (camera.projection == Projection::orthographic) {
        // As much as a perspective camera with this angle sees at the target.
        camera.height = 2.0 * forward.norm() * std::tan(0.5 * camera.fov_rad);
    }
    return camera;
}

// The size that shows the whole cloud at that scale, with the eye over its middle. A map must not lose its borders, so
// the stated bounds count, unless strays or a lying header made them far larger than the cloud.
void fit_size(Camera& camera, const Box3d& stated, std::span<const Vec3d> points, double units_per_pixel,
              RenderSettings& settings) {
    Box3d box;
    for (const Vec3d& p : points) box.extend(p);
    if (!stated.empty() && (stated.size().array() <= 1.5 * box.size().array()).all()) box.extend(stated);
    Box3d seen;
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3d p((corner & 1 ? box.max : box.min).x(), (corner & 2 ? box.max : box.min).y(),
                      (corner & 4 ? box.max : box.min).z());
        seen.extend(camera.view_from_world * (p - camera.eye));
    }
    const Vec3d sides_px = seen.size() / units_per_pixel;
    if (!(sides_px.x() < kLargestSide - 1 && sides_px.y() < kLargestSide - 1)) {
        char size[64];
        std::snprintf(size, sizeof size, "%.0f x %.0f", sides_px.x(), sides_px.y());
        throw Error(ErrorKind::usage, "--meters-per-pixel: the picture would have " + std::string(size) + " pixels, at most " +
                                          std::to_string(kLargestSide) + " a side are possible; --size takes a part");
    }
    settings.width = uint32_t(std::ceil(sides_px.x())) + 1;
    settings.height = uint32_t(std::ceil(sides_px.y())) + 1;
    const Vec3d middle(seen.center().x(), seen.center().y(), 0.0);
    camera.eye += camera.view_from_world.transpose() * middle;
}

VoxelShading parse_voxels(const Options& options) {
    const std::string name = options.text("--voxels");
    if (name == "flat") return VoxelShading::flat;
    if (name == "smooth") return VoxelShading::smooth;
    refuse("--voxels", "flat or smooth", name);
}

MeshStyle parse_mesh(const Options& options) {
    const std::string name = options.text("--mesh");
    if (name != "flat" && name != "smooth") refuse("--mesh", "flat or smooth", name);
    return {name == "flat" ? MeshShading::flat : MeshShading::smooth, options.given("--wireframe"), options.given("--backfaces")};
}

// Of each isovalue.
std::vector<double> parse_opacities(const Options& options) {
    const std::vector<double> opacities = parse_list("--opacity", options.text("--opacity"));
    for (const double opacity : opacities)
        if (!(opacity > 0.0 && opacity <= 1.0)) refuse("--opacity", "numbers above 0 and at most 1", options.text("--opacity"));
    if (!options.given("--opacity")) return opacities;
    if (!options.given("--iso")) throw Error(ErrorKind::usage, "--opacity is of the surfaces of --iso, and there are none");
    const size_t isovalues = parse_isovalues(options.text("--iso")).size();
    if (opacities.size() != 1 && opacities.size() != isovalues)
        throw Error(ErrorKind::usage, "--opacity: one number, or one for each of the " + std::to_string(isovalues) + " of --iso, is expected, " +
                                          std::to_string(opacities.size()) + " are given");
    return opacities;
}

// Colors of the cloud, of the voxels and of the meshes, by one name where one is given: what does not have it shows what it does by default, but
// something must have it.
void choose_colors(const Options& options, SceneFiles& files, RenderRequest& request) {
    RenderSettings& settings = request.settings;
    const std::string name = options.text("--color");
    std::optional<Error> refused;
    bool taken = name.empty();
    if (files.cloud) {
        try {
            settings.color = find_color_channel(files.cloud->info(), name.empty() ? sensible_color(*files.cloud) : name);
            taken = true;
        } catch (const Error& error) {
            refused = error;
            settings.color = find_color_channel(files.cloud->info(), sensible_color(*files.cloud));
        }
        // Of one scene, equal heights have one color, and equal values of an attribute.
        const bool of_heights = settings.color.rule == ColorChannel::Rule::elevation && !(files.voxels.empty() && files.meshes.empty() && files.fields.empty());
        const bool of_values = settings.color.rule == ColorChannel::Rule::ramp && std::any_of(files.meshes.begin(), files.meshes.end(), [&](const OpenedMesh& model) {
                                   return find_mesh_scalars(*model.mesh, name) < model.mesh->scalars.size();
                               });
        if (!settings.range && (of_heights || of_values)) settings.range = derive_range(*files.cloud, settings.color);
    }
    const VoxelShading shading = parse_voxels(options);
    for (const OpenedVoxels& model : files.voxels) {
        std::optional<VoxelColors> colors;
        try {
            colors.emplace(*model.tree, name, settings.range, settings.colormap);
            taken = true;
        } catch (const Error& error) {
            if (!refused) refused = files.voxels.size() > 1 ? error.within(model.path) : error;
            colors.emplace(*model.tree, "", settings.range, settings.colormap);
        }
        request.scene.voxels.emplace_back(*model.tree, std::move(*colors), shading);
    }
    for (const OpenedMesh& model : files.meshes) {
        std::optional<MeshColors> colors;
        try {
            colors.emplace(*model.mesh, name, settings.range, settings.colormap);
            taken = true;
        } catch (const Error& error) {
            if (!refused) refused = files.meshes.size() > 1 ? error.within(model.path) : error;
            colors.emplace(*model.mesh, "", settings.range, settings.colormap);
        }
        request.scene.meshes.emplace_back(*model.mesh, std::move(*colors), parse_mesh(options), settings.threads);
    }
    const std::vector<double> opacities = parse_opacities(options);
    for (OpenedField& field : files.fields)
        for (size_t n = 0; n < field.surfaces.size(); ++n) {
            const size_t number = request.scene.isosurfaces.size();
            std::optional<IsosurfaceColors> colors;
            try {
                colors.emplace(*field.field, name, number, settings.range, settings.colormap);
                taken = true;
            } catch (const Error& error) {
                if (!refused) refused = error;
                colors.emplace(*field.field, "", number, settings.range, settings.colormap);
            }
            request.scene.isosurfaces.emplace_back(std::move(field.surfaces[n]), std::move(*colors), float(opacities[opacities.size() == 1 ? 0 : n]));
        }
    if (!taken && refused) throw *refused;
    request.color_name = files.cloud ? settings.color.name : !request.scene.voxels.empty() ? request.scene.voxels[0].colors.name() : !request.scene.meshes.empty() ? request.scene.meshes[0].colors.name() : request.scene.isosurfaces[0].colors.name();
}

// Whether more than one isosurface of a field is drawn: of two one is inside of the other.
bool has_nested_surfaces(const Scene& scene) {
    std::map<const FieldBricks*, size_t> surfaces;
    for (const IsosurfaceModel& model : scene.isosurfaces)
        if (!model.surface.empty() && ++surfaces[model.surface.field] > 1) return true;
    return false;
}

// The picture is a PNG whatever it is called; a name that says otherwise misleads whoever opens it.
bool is_png_name(const std::string& path) {
    std::string ending = std::filesystem::path(path).extension().string();
    std::transform(ending.begin(), ending.end(), ending.begin(), [](unsigned char c) { return char(std::tolower(c)); });
    return ending == ".png";
}

}  // namespace

std::span<const OptionRow> render_option_rows() { return kRows; }

void check_render_options(const Options& options) {
    if (!options.given("--output")) throw Error(ErrorKind::usage, "render: -o FILE.png is missing");
    if (!is_png_name(options.text("--output"))) refuse("--output", "a name that ends in .png", options.text("--output"));
    if (options.given("--depth") && options.text("--depth") == options.text("--output"))
        throw Error(ErrorKind::usage, "--depth: a file of its own is expected, not that of -o");
    if (options.given("--depth") && options.text("--depth").ends_with(".png")) refuse("--depth", "a name of a PFM file, such as out.pfm", options.text("--depth"));
    parse_size(options.text("--size"));
    parse_color(options.text("--background"));
    parse_fill(options);
    parse_ssao(options);
    parse_edl(options.text("--edl"));
    parse_splat(options);
    parse_rasterizer(options);
    parse_voxels(options);
    parse_mesh(options);
    parse_opacities(options);
    parse_fov(options);
    if (options.given("--colormap")) Colormap(options.text("--colormap"));  // refuses names that it does not know
    if (options.given("--range")) options.numbers("--range", 2);
    if (options.given("--meters-per-pixel")) parse_units_per_pixel(options);
    if (!(options.number("--error") > 0.0)) refuse("--error", "a positive number of pixels", options.text("--error"));
    options.integer("--budget", 1, 0xfffffffe);
    options.integer("--tile", 0, kLargestSide);
    options.integer("--samples", 1, kMostSamples);
    if (!(options.number("--time-budget") >= 0.0)) refuse("--time-budget", "milliseconds, not negative", options.text("--time-budget"));
    parse_clips(options);
    if (options.given("--filter")) parse_filter("--filter", options.text("--filter"));
    if (!(options.number("--threshold") >= 0.0)) refuse("--threshold", "a number that is not negative", options.text("--threshold"));
    if (options.given("--threshold") && !options.given("--reference")) throw Error(ErrorKind::usage, "--threshold needs --reference");
    if (options.given("--camera") && options.given("--ortho")) throw Error(ErrorKind::usage, "--ortho: a camera file says it by ortho_height");
    if (options.given("--target") && !options.given("--eye")) throw Error(ErrorKind::usage, "--target needs --eye");
    if (options.given("--up") && !is_axis(options.text("--up"))) {
        if (!options.given("--eye")) throw Error(ErrorKind::usage, "--up: a direction needs --eye; y or z needs none");
        vector_of(options, "--up");
    }
    if (options.given("--eye") + options.given("--view") + options.given("--camera") > 1)
        throw Error(ErrorKind::usage, "--view, --eye and --camera exclude each other");
    if (options.given("--eye")) vector_of(options, "--eye");
    thread_count(options);
    memory_cap(options);
}

RenderRequest make_render_request(const Options& options, SceneFiles& files) {
    RenderRequest request;
    request.scene.cloud = files.cloud.get();
    RenderSettings& settings = request.settings;
    request.output = options.text("--output");
    request.depth_output = options.text("--depth");
    request.reference = options.text("--reference");
    request.threshold = options.number("--threshold");
    request.overwrite = options.given("--overwrite");
    request.stats = options.given("--stats");
    request.quiet = options.given("--quiet");

    std::tie(settings.width, settings.height) = parse_size(options.text("--size"));
    settings.background = options.given("--transparent") ? 0 : parse_color(options.text("--background"));
    settings.fill = parse_fill(options);
    settings.edl = parse_edl(options.text("--edl"));
    settings.up = parse_up(options);
    settings.splat = parse_splat(options);
    settings.rasterizer = parse_rasterizer(options);
    settings.selection.error_px = options.number("--error");
    settings.selection.point_budget = uint64_t(options.integer("--budget", 1, 0xfffffffe));
    settings.tile_rows = uint32_t(options.integer("--tile", 0, kLargestSide));
    settings.threads = thread_count(options);
    settings.memory_bytes = memory_cap(options);
    settings.colormap = options.text("--colormap");
    if (options.given("--range")) {
        const std::vector<double> range = options.numbers("--range", 2);
        settings.range = ColorRange{range[0], range[1]};
    }
    choose_colors(options, files, request);
    for (const std::string_view flag : {"--wireframe", "--backfaces"})
        if (options.given(flag) && files.meshes.empty() && !request.quiet)
            std::fprintf(stderr, "note: %s is for triangles of meshes, and there are none%s\n", std::string(flag).c_str(),
                         files.fields.empty() ? "" : "; `strata surface` makes one of an isosurface");
    if (!options.given("--opacity") && !request.quiet && has_nested_surfaces(request.scene))
        std::fprintf(stderr, "note: isosurfaces hide those inside of them; --opacity 0.3 lets all be seen through, a list such as 0.3,1 has a number for each\n");

    settings.samples = uint32_t(options.integer("--samples", 1, kMostSamples));
    settings.time_budget_ms = options.number("--time-budget");
    settings.clips = parse_clips(options);
    if (options.given("--filter")) {
        if (!files.cloud) throw Error(ErrorKind::usage, "--filter: it chooses among points, and there are none");
        try {
            settings.filter = PointFilter(files.cloud->info(), parse_filter("--filter", options.text("--filter")));
        } catch (const Error& error) {
            throw error.within("--filter");
        }
    }

    const Box3d bounds = request.scene.bounds();
    std::vector<Vec3d> points;
    const bool whole = kept_corners(settings.clips, bounds).empty();
    if (whole) {
        points = sample_positions(request.scene, settings.clips);
    } else {
        points = kept_corners(settings.clips, request.scene.bounds_but_isosurfaces());
        for (const IsosurfaceModel& model : request.scene.isosurfaces) add_sample(model, settings.clips, points);
        if (points.empty()) points = kept_corners(settings.clips, bounds);
    }
    if (options.given("--ssao"))
        settings.ssao.radius = float(parse_ssao(options) > 0.0 ? parse_ssao(options) : sensible_ssao_radius(points));
    const double aspect = double(settings.width) / settings.height;
    if (options.given("--camera")) {
        request.camera = camera_of(read_camera_file(options.text("--camera")));
    } else if (options.given("--eye")) {
        request.camera = free_camera(options, bounds, points);
    } else {
        const Projection projection = options.given("--ortho") ? Projection::orthographic : Projection::perspective;
        request.camera = named_view(options.text("--view"), projection, parse_fov(options), points, aspect, settings.up);
    }
    if (options.given("--meters-per-pixel")) {
        const double units_per_pixel = parse_units_per_pixel(options);
        if (!options.given("--size")) fit_size(request.camera, whole ? bounds : Box3d(), points, units_per_pixel, settings);
        request.camera.height = units_per_pixel * settings.height;
    }
    fit_depth_range(request.camera, bounds);
    check_camera(request.camera);
    return request;
}

}  // namespace strata
