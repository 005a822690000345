// NRRD: 'field: value' lines up to an empty one. Facts from G. Kindlmann, "Definition of NRRD File Format", teem.
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "core/error.h"
#include "io/text_words.h"
#include "io/volume/volume_header.h"

namespace strata {
namespace {

constexpr size_t kMostDimensions = 16;

constexpr std::array<std::pair<std::string_view, SampleType>, 45> kTypes = {{
    {"signed char", SampleType::int8}, {"int8", SampleType::int8}, {"int8_t", SampleType::int8},
    {"uchar", SampleType::uint8}, {"unsigned char", SampleType::uint8}, {"uint8", SampleType::uint8}, {"uint8_t", SampleType::uint8},
    {"short", SampleType::int16}, {"short int", SampleType::int16}, {"signed short", SampleType::int16}, {"signed short int", SampleType::int16},
    {"int16", SampleType::int16}, {"int16_t", SampleType::int16},
    {"ushort", SampleType::uint16}, {"unsigned short", SampleType::uint16}, {"unsigned short int", SampleType::uint16},
    {"uint16", SampleType::uint16}, {"uint16_t", SampleType::uint16},
    {"int", SampleType::int32}, {"signed int", SampleType::int32}, {"int32", SampleType::int32}, {"int32_t", SampleType::int32},
    {"uint", SampleType::uint32}, {"unsigned int", SampleType::uint32}, {"uint32", SampleType::uint32}, {"uint32_t", SampleType::uint32},
    {"longlong", SampleType::int64}, {"long long", SampleType::int64}, {"long long int", SampleType::int64}, {"signed long long", SampleType::int64},
    {"signed long long int", SampleType::int64}, {"int64", SampleType::int64}, {"int64_t", SampleType::int64},
    {"ulonglong", SampleType::uint64}, {"unsigned long long", SampleType::uint64}, {"unsigned long long int", SampleType::uint64},
    {"uint64", SampleType::uint64}, {"uint64_t", SampleType::uint64},
    {"float", SampleType::float32}, {"float32", SampleType::float32}, {"float_t", SampleType::float32},
    {"double", SampleType::float64}, {"float64", SampleType::float64}, {"double_t", SampleType::float64}, {"char", SampleType::int8},
}};

// Names of fields are written with blanks or without.
std::string without_blanks(std::string text) {
    std::erase(text, ' ');
    return text;
}

class NrrdReader {
public:
    explicit NrrdReader(ByteStream& stream) : stream_(stream) {}

    VolumeHeader read() {
        std::string_view line;
        if (!stream_.next_line(line) || !looks_like_nrrd(line)) stream_.fail_at_line("NRRD0001 to NRRD0005 is expected");
        header_.format = std::string(trimmed(line));
        bool ends = false;
        while (!ends) {
            if (!stream_.next_line(line)) break;
            ends = trimmed(line).empty();
            if (!ends && line.front() != '#') take(line);
        }
        if (!ends && header_.data_file.empty()) stream_.fail_at_line("the file ends in its header, an empty line is expected");
        finish();
        return std::move(header_);
    }

private:
    struct Axis {
        uint64_t size = 0;
        std::optional<double> spacing, min, max;
        std::optional<Vec3d> direction;
        bool is_node_centered = false;
        std::string kind;
    };

    void take(std::string_view line) {
        const size_t colon = line.find(':');
        if (colon == std::string_view::npos) stream_.fail_at_line("'field: value' is expected");
        if (colon + 1 < line.size() && line[colon + 1] == '=') return;  // 'key:=value' is for whom it may concern
        const std::string field = without_blanks(lower_case(trimmed(line.substr(0, colon))));
        const std::string_view value = trimmed(line.substr(colon + 1));
        if (field == "dimension") {
            if (!axes_.empty()) stream_.fail_at_line("one field 'dimension' is expected, this is the second");
            axes_.resize(size_t(integer_of(stream_, value, 1, int64_t(kMostDimensions))));
        } else if (field == "type") {
            set_type(value);
        } else if (field == "sizes") {
            TextWords words(value);
            for (Axis& axis : axes()) {
                int64_t size = 0;
                if (!words.more() || !words.integer(size) || !words.at_word_end() || size < 1) stream_.fail_at_line(count_text() + " numbers of samples above 0 are expected");
                axis.size = uint64_t(size);
            }
            end(words);
            sizes_place_ = stream_.place_of_line();
        } else if (field == "encoding") {
            set_encoding(lower_case(value));
        } else if (field == "endian") {
            const std::string order = lower_case(value);
            if (order != "little" && order != "big") stream_.fail_at_line("little or big is expected");
            header_.is_big_endian = order == "big";
            has_endian_ = true;
        } else if (field == "spacings") {
            each_number(value, [&](Axis& axis, double number) { axis.spacing = number; });
            placement_place_ = stream_.place_of_line();
        } else if (field == "axismins") {
            each_number(value, [&](Axis& axis, double number) { axis.min = number; });
            placement_place_ = stream_.place_of_line();
        } else if (field == "axismaxs") {
            each_number(value, [&](Axis& axis, double number) { axis.max = number; });
            placement_place_ = stream_.place_of_line();
        } else if (field == "centers" || field == "centerings") {
            each_word(value, [&](Axis& axis, std::string_view word) { axis.is_node_centered = lower_case(word) == "node"; });
        } else if (field == "kinds") {
            each_word(value, [&](Axis& axis, std::string_view word) { axis.kind = lower_case(word); });
        } else if (field == "spacedirections") {
            std::string_view left = value;
            for (Axis& axis : axes()) axis.direction = vector(left);
            if (!trimmed(left).empty()) stream_.fail_at_line(count_text() + " directions are expected, there are more");
            placement_place_ = stream_.place_of_line();
            has_directions_ = true;
        } else if (field == "spaceorigin") {
            std::string_view left = value;
            const std::optional<Vec3d> origin = vector(left);
            if (!origin || !trimmed(left).empty()) stream_.fail_at_line("a place as (x,y,z) is expected");
            origin_ = *origin;
            placement_place_ = stream_.place_of_line();
        } else if (field == "datafile") {
            if (value.starts_with("LIST") || value.find('%') != std::string_view::npos)
                throw Error(ErrorKind::unsupported, stream_.place_of_line() + ": all samples in one file are expected, not a list or a pattern of files");
            header_.data_file = checked_data_file(value, stream_.place_of_line());
        } else if (field == "lineskip") {
            header_.lines_before = uint64_t(integer_of(stream_, value, 0, INT64_MAX));
        } else if (field == "byteskip") {
            const int64_t skip = integer_of(stream_, value, -1, INT64_MAX);
            header_.is_at_end = skip < 0;
            header_.bytes_before = skip < 0 ? 0 : uint64_t(skip);
        }  // others say nothing of where samples lie
    }

    void set_type(std::string_view value) {
        const std::string name = lower_case(value);
        const auto* const found = std::find_if(kTypes.begin(), kTypes.end(), [&](const auto& type) { return type.first == name; });
        if (found == kTypes.end()) throw Error(ErrorKind::unsupported, stream_.place_of_line() + ": a type such as uchar, short or float is expected, not " + std::string(value));
        header_.type = found->second;
        has_type_ = true;
    }
    void set_encoding(const std::string& name) {
        if (name == "raw") header_.encoding = VolumeEncoding::raw;
        else if (name == "gz" || name == "gzip") header_.encoding = VolumeEncoding::deflated;
        else if (name == "txt" || name == "text" || name == "ascii") header_.encoding = VolumeEncoding::text;
        else throw Error(ErrorKind::unsupported, stream_.place_of_line() + ": encoding raw, gzip or ascii is expected, not " + name);
        has_encoding_ = true;
    }

    std::vector<Axis>& axes() {
        if (axes_.empty()) stream_.fail_at_line("the field 'dimension' is expected before this");
        return axes_;
    }
    std::string count_text() const { return std::to_string(axes_.size()); }
    void end(TextWords& words) const {
        if (words.more()) stream_.fail_at_line(count_text() + " values are expected, there are more");
    }
    template <typename Take>
    void each_number(std::string_view value, const Take& take_number) {
        TextWords words(value);
        for (Axis& axis : axes()) {
            double number = 0.0;
            if (!words.number(number)) stream_.fail_at_line(count_text() + " numbers are expected");
            if (!std::isnan(number)) take_number(axis, number);  // not a number: not known
        }
        end(words);
    }
    template <typename Take>
    void each_word(std::string_view value, const Take& take_word) {
        TextWords words(value);
        for (Axis& axis : axes()) {
            const std::string_view word = words.word();
            if (word.empty()) stream_.fail_at_line(count_text() + " words are expected");
            take_word(axis, word);
        }
        end(words);
    }

    // "(1,0,0)" or "none", from the start of `left`, which it is taken from. In two dimensions z is 0.
    std::optional<Vec3d> vector(std::string_view& left) const {
        left = trimmed(left);
        if (lower_case(left.substr(0, 4)) == "none") {
            left.remove_prefix(4);
            return std::nullopt;
        }
        const size_t close = left.find(')');
        if (left.empty() || left.front() != '(' || close == std::string_view::npos) stream_.fail_at_line("vectors as (x,y,z), or none, are expected");
        std::string text(left.substr(1, close - 1));
        left.remove_prefix(close + 1);
        size_t parts = 1 + size_t(std::count(text.begin(), text.end(), ','));
        std::replace(text.begin(), text.end(), ',', ' ');
        if (parts != 2 && parts != 3) throw Error(ErrorKind::unsupported, stream_.place_of_line() + ": vectors of three numbers are expected, there are " + std::to_string(parts));
        TextWords words(text);
        Vec3d result = Vec3d::Zero();
        for (size_t k = 0; k < parts; ++k)
            if (!words.number(result[Eigen::Index(k)])) stream_.fail_at_line("vectors as (x,y,z), or none, are expected");
        if (words.more()) stream_.fail_at_line("vectors as (x,y,z), or none, are expected");
        return result;
    }

    void finish() {
        if (!has_type_ || !has_encoding_ || sizes_place_.empty()) stream_.fail_at_line("the fields type, dimension, sizes and encoding are expected before this");
        if (header_.encoding == VolumeEncoding::raw && size_of(header_.type) > 1 && !has_endian_) stream_.fail_at_line("the field endian is expected before this");
        if (header_.is_at_end && header_.encoding != VolumeEncoding::raw) stream_.fail_at_line("byte skip -1 is for raw data");
        if (header_.encoding == VolumeEncoding::text) header_.is_big_endian = false;
        header_.offset = header_.data_file.empty() ? stream_.position() : 0;

        reduce_axes();
        std::array<uint64_t, 3> size = {1, 1, 1};
        for (size_t axis = 0; axis < axes_.size(); ++axis) size[axis] = axes_[axis].size;
        set_size(header_, size, sizes_place_);
        place_samples();
    }

    // Leaves three axes or fewer: those of one sample that are in no space go first.
    void reduce_axes() {
        for (const bool placed_too : {false, true})
            for (size_t axis = axes_.size(); axis-- > 0 && axes_.size() > 3;)
                if (axes_[axis].size == 1 && (placed_too || !axes_[axis].direction)) axes_.erase(axes_.begin() + ptrdiff_t(axis));
        if (axes_.size() > 3)
            throw Error(ErrorKind::unsupported, sizes_place_ + ": three axes of single values are expected, there are " + std::to_string(axes_.size()) + " of more than one sample");
        constexpr std::array<std::string_view, 6> kPlaces = {"", "domain", "space", "time", "none", "???"};
        for (const Axis& axis : axes_)
            if (axis.size > 1 && (std::find(kPlaces.begin(), kPlaces.end(), axis.kind) == kPlaces.end() || (has_directions_ && !axis.direction)))
                throw Error(ErrorKind::unsupported, sizes_place_ + ": one value a sample is expected, not " + std::to_string(axis.size) + (axis.kind.empty() || axis.kind == "none" ? "" : " of kind " + axis.kind));
    }

    void place_samples() {
        GridPlacement& placement = header_.placement;
        if (origin_) placement.origin = *origin_;
        for (size_t i = 0; i < axes_.size(); ++i) {
            const Axis& axis = axes_[i];
            const auto k = Eigen::Index(i);
            if (has_directions_) {
                placement.axes.col(k) = axis.direction ? *axis.direction : Vec3d::Zero();
                continue;
            }
            const double step = checked_spacing(step_of(axis), placement_place_);
            placement.axes.col(k) = step * Vec3d::Unit(k);
            // The least place of an axis is the border of its first cell, or the first sample where samples are nodes.
            if (!origin_ && axis.min) placement.origin[k] = *axis.min + (axis.is_node_centered ? 0.0 : 0.5 * step);
        }
        if (has_directions_) complete_directions();
        check_placement(placement, header_.size, placement_place_.empty() ? sizes_place_ : placement_place_);
    }
    double step_of(const Axis& axis) const {
        if (axis.spacing) return *axis.spacing;
        const double steps = double(axis.size) - (axis.is_node_centered ? 1.0 : 0.0);
        return axis.min && axis.max && steps > 0.0 ? (*axis.max - *axis.min) / steps : 1.0;
    }
    // Axes of one sample without a direction stand upright on the others.
    void complete_directions() {
        for (Eigen::Index k = 0; k < 3; ++k) {
            if (size_t(k) < axes_.size() && axes_[size_t(k)].direction) continue;
            const Vec3d a = header_.placement.axes.col((k + 1) % 3), b = header_.placement.axes.col((k + 2) % 3);
            const Vec3d upright = a.stableNormalized().cross(b.stableNormalized());
            header_.placement.axes.col(k) = upright.squaredNorm() > 0.0 ? upright.normalized() : Vec3d::Unit(k);
        }
    }

    ByteStream& stream_;
    VolumeHeader header_;
    std::vector<Axis> axes_;
    std::optional<Vec3d> origin_;
    std::string sizes_place_, placement_place_;
    bool has_type_ = false, has_encoding_ = false, has_endian_ = false, has_directions_ = false;
};

}  // namespace

bool looks_like_nrrd(std::string_view head) { return head.size() >= 8 && head.starts_with("NRRD000") && head[7] >= '1' && head[7] <= '5'; }

VolumeHeader read_nrrd_header(ByteStream& stream) { return NrrdReader(stream).read(); }

}  // namespace strata
