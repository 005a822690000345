#include "app/commands/info_volume.h"

#include <nlohmann/json.hpp>

#include "app/commands/info_json.h"
#include "io/volume/volume_source.h"

namespace strata {
namespace {

using nlohmann::ordered_json;

std::string encoding_text(const VolumeHeader& header) {
    if (header.encoding == VolumeEncoding::text) return "text";
    const std::string order = size_of(header.type) == 1 ? "" : header.is_big_endian ? ", big-endian" : ", little-endian";
    return (header.encoding == VolumeEncoding::raw ? "raw" : "compressed") + order;
}

}  // namespace

ordered_json volume_report(const std::string& path, const Format& format) {
    const std::unique_ptr<VolumeSource> volume = open_volume(path);
    const VolumeHeader& header = volume->header();
    const VolumeRange range = volume->measure();
    const Mat3d& axes = header.placement.axes;
    const Vec3d spacing = axes.colwise().norm().transpose();
    ordered_json directions = ordered_json::array();
    for (int axis = 0; axis < 3; ++axis) directions.push_back(vector_json(axes.col(axis) / spacing[axis]));
    const bool has_values = range.values > 0;
    const ordered_json least = has_values ? ordered_json(range.min) : ordered_json(), greatest = has_values ? ordered_json(range.max) : ordered_json();
    ordered_json report = {{"path", path},
                           {"format", format.name},
                           {"detail", header.format},
                           {"dimensions", header.size},
                           {"spacing", vector_json(spacing)},
                           {"origin", vector_json(header.placement.origin)},
                           {"directions", directions},
                           {"encoding", encoding_text(header)},
                           {"data_file", header.data_file.empty() ? ordered_json() : ordered_json(header.data_file)},
                           {"bounds", box_json(header.box_around())},
                           {"range", {{"min", least}, {"max", greatest}}},
                           {"nan_samples", range.nan},
                           {"attributes", ordered_json::array({{{"name", "value"}, {"type", name_of(header.type)}, {"components", 1}, {"min", least}, {"max", greatest}}})}};
    if (!header.notes.empty()) report["notes"] = header.notes;
    return report;
}

}  // namespace strata
