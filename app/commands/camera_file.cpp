#include "app/commands/camera_file.h"

#include <Eigen/Geometry>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "core/error.h"
#include "io/byte_source.h"

namespace strata {
namespace {

using nlohmann::json;

constexpr uint64_t kMostBytes = 1 << 20;

Error malformed(const std::string& message) { return {ErrorKind::malformed, message}; }

// JSON has no NaN, but 1e999 parses to infinity.
double number_from(const json& value, const std::string& key) {
    if (!value.is_number() || !std::isfinite(value.get<double>())) throw malformed("\"" + key + "\": a number is expected");
    return value.get<double>();
}

Vec3d point_from(const json& value, const std::string& key) {
    if (!value.is_array() || value.size() != 3) throw malformed("\"" + key + "\": three numbers [x, y, z] are expected");
    return {number_from(value[0], key), number_from(value[1], key), number_from(value[2], key)};
}

}  // namespace

CameraSpec parse_camera(std::string_view text) {
    const json object = json::parse(text, nullptr, false);
    if (!object.is_object()) throw malformed("a JSON object such as {\"eye\": [0, 0, 100], \"target\": [0, 0, 0]} is expected");
    CameraSpec camera;
    for (const auto& [key, value] : object.items()) {
        if (key == "eye") camera.eye = point_from(value, key);
        else if (key == "target") camera.target = point_from(value, key);
        else if (key == "up") camera.up = point_from(value, key);
        else if (key == "fov") camera.fov_deg = number_from(value, key);
        else if (key == "ortho_height") camera.ortho_height = number_from(value, key);
        else throw malformed(json(key).dump(-1, ' ', true, json::error_handler_t::replace) +
                             ": is no key of a camera; there are eye, target, up, fov, ortho_height");
    }
    for (const char* key : {"eye", "target"})
        if (!object.contains(key)) throw malformed(std::string("\"") + key + "\" is missing");
    if (object.contains("fov") && object.contains("ortho_height")) throw malformed("\"fov\" and \"ortho_height\" exclude each other");
    if (!(camera.fov_deg > 0.0 && camera.fov_deg <= 179.0)) throw malformed("\"fov\": degrees above 0 and up to 179 are expected");
    if (camera.ortho_height && !(*camera.ortho_height > 0.0)) throw malformed("\"ortho_height\": a length above 0 is expected");
    const Vec3d view = camera.target - camera.eye;
    if (!(view.norm() > 0.0)) throw malformed("\"eye\" and \"target\" are the same point");
    if (!(view.normalized().cross(camera.up.normalized()).norm() > 1e-9)) throw malformed("\"up\" must not lie along the view");
    return camera;
}

CameraSpec read_camera_file(const std::string& path) {
    const std::unique_ptr<ByteSource> source = open_file(path);
    if (source->size() > kMostBytes)
        throw Error(ErrorKind::limit, path + ": a camera of at most " + std::to_string(kMostBytes) + " bytes is expected, these are " +
                                          std::to_string(source->size()));
    std::string text(source->size(), '\0');
    source->read(0, std::as_writable_bytes(std::span(text)));
    try {
        return parse_camera(text);
    } catch (const Error& error) {
        throw error.within(path);
    }
}

Camera camera_of(const CameraSpec& spec) {
    Camera camera;
    camera.eye = spec.eye;
    camera.view_from_world = look_along(spec.target - spec.eye, spec.up);
    camera.fov_rad = spec.fov_deg * std::numbers::pi / 180.0;
    if (spec.ortho_height) {
        camera.projection = Projection::orthographic;
        camera.height = *spec.ortho_height;
    }
    return camera;
}

}  // namespace strata
