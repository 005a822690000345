#include "io/volume/volume_header.h"

#include <Eigen/LU>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <limits>

#include "core/error.h"
#include "io/text_words.h"

namespace strata {
namespace {

constexpr std::array<std::string_view, 10> kTypeNames = {"int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64", "float", "double"};

// World units a step: squares and cubes of them and of 2^32 of them are far from what a double holds, and the former from a float's.
constexpr double kLeastStep = 1e-30, kGreatestStep = 1e+20;

std::string text_of(double value) {
    std::array<char, 32> text;
    return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr};
}

}  // namespace

std::string_view name_of(SampleType type) { return kTypeNames[size_t(type)]; }

std::optional<SampleType> sample_type_named(std::string_view name) {
    const auto* const found = std::find(kTypeNames.begin(), kTypeNames.end(), name);
    if (found != kTypeNames.end()) return SampleType(found - kTypeNames.begin());
    if (name == "float32") return SampleType::float32;
    if (name == "float64") return SampleType::float64;
    return std::nullopt;
}

Box3d VolumeHeader::box_around(double beyond) const {
    Box3d box;
    for (int corner = 0; corner < 8; ++corner) {
        Vec3d index;
        for (int axis = 0; axis < 3; ++axis) index[axis] = corner >> axis & 1 ? double(size[size_t(axis)]) - 1.0 + beyond : -beyond;
        box.extend(placement.world_from_index(index));
    }
    return box;
}

void set_size(VolumeHeader& header, const std::array<uint64_t, 3>& size, const std::string& place) {
    uint64_t bytes = size_of(header.type);
    for (size_t axis = 0; axis < 3; ++axis) {
        if (size[axis] == 0 || size[axis] > std::numeric_limits<uint32_t>::max())
            throw Error(ErrorKind::malformed, place + ": 1 to 4294967295 samples along an axis are expected, there are " + std::to_string(size[axis]));
        if (bytes > (uint64_t{1} << 63) / size[axis])
            throw Error(ErrorKind::malformed, place + ": " + std::to_string(size[0]) + " x " + std::to_string(size[1]) + " x " + std::to_string(size[2]) +
                                                  " samples are 2^63 bytes or more");
        bytes *= size[axis];
        header.size[axis] = uint32_t(size[axis]);
    }
}

void check_placement(const GridPlacement& placement, const std::array<uint32_t, 3>& size, const std::string& place) {
    Mat3d directions;
    for (int axis = 0; axis < 3; ++axis) {
        const Vec3d step = placement.axes.col(axis);
        const double length = step.allFinite() ? step.stableNorm() : std::numeric_limits<double>::infinity();
        if (!(length >= kLeastStep && length <= kGreatestStep))
            throw Error(ErrorKind::malformed, place + ": steps between samples of " + text_of(kLeastStep) + " to " + text_of(kGreatestStep) + " are expected, along axis " +
                                                  std::to_string(axis) + " it is " + text_of(length));
        directions.col(axis) = step / length;
    }
    if (std::abs(directions.determinant()) < 1e-9)
        throw Error(ErrorKind::malformed, place + ": three directions are expected, those of the axes lie in one plane");
    const Vec3d last = placement.world_from_index(Vec3d(size[0] - 1.0, size[1] - 1.0, size[2] - 1.0));
    if (!placement.origin.allFinite() || placement.origin.cwiseAbs().maxCoeff() > 1e30 || !last.allFinite())
        throw Error(ErrorKind::malformed, place + ": an origin of at most 1e30 is expected");
}

int64_t integer_of(const ByteStream& stream, std::string_view value, int64_t least, int64_t most) {
    TextWords words(value);
    int64_t number = 0;
    if (!words.more() || !words.integer(number) || words.more() || number < least || number > most)
        stream.fail_at_line("an integer from " + std::to_string(least) + " to " + std::to_string(most) + " is expected");
    return number;
}

double checked_spacing(double spacing, const std::string& place) {
    if (!(spacing > 0.0) || !std::isfinite(spacing))
        throw Error(ErrorKind::malformed, place + ": spacings above 0 are expected, there is " + text_of(spacing));
    return spacing;
}

std::string checked_data_file(std::string_view name, const std::string& place) {
    const std::filesystem::path path(name);
    const bool leaves = std::any_of(path.begin(), path.end(), [](const auto& part) { return part == ".."; });
    if (path.empty() || path.is_absolute() || leaves || name.find('\0') != std::string_view::npos)
        throw Error(ErrorKind::unsupported, place + ": a file beside this one or in a folder below is expected, not '" + std::string(name) + "'");
    return std::string(name);
}

}  // namespace strata
