// MetaImage: 'key = value' lines up to ElementDataFile. Facts from the documentation of MetaIO and from what ITK reads.
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "core/error.h"
#include "io/text_words.h"
#include "io/volume/volume_header.h"

namespace strata {
namespace {

constexpr size_t kMostDimensions = 10;

constexpr std::array<std::pair<std::string_view, SampleType>, 12> kTypes = {{
    {"MET_CHAR", SampleType::int8}, {"MET_UCHAR", SampleType::uint8}, {"MET_SHORT", SampleType::int16}, {"MET_USHORT", SampleType::uint16},
    {"MET_INT", SampleType::int32}, {"MET_UINT", SampleType::uint32}, {"MET_LONG", SampleType::int32}, {"MET_ULONG", SampleType::uint32},  // of 4 bytes
    {"MET_LONG_LONG", SampleType::int64}, {"MET_ULONG_LONG", SampleType::uint64}, {"MET_FLOAT", SampleType::float32}, {"MET_DOUBLE", SampleType::float64},
}};

// The key of a line 'key = value', and that; an empty key: it is no such line.
std::pair<std::string_view, std::string_view> key_and_value(std::string_view line) {
    const size_t sign = line.find('=');
    if (sign == std::string_view::npos) return {};
    return {trimmed(line.substr(0, sign)), trimmed(line.substr(sign + 1))};
}

class MetaImageReader {
public:
    explicit MetaImageReader(ByteStream& stream) : stream_(stream) {}

    VolumeHeader read() {
        header_.format = "MetaImage";
        std::string_view line;
        for (bool more = true; more;) {
            if (!stream_.next_line(line)) stream_.fail_at_line("the file ends in its header, 'ElementDataFile = ...' is expected");
            if (trimmed(line).empty()) continue;
            const auto [key, value] = key_and_value(line);
            if (key.empty()) stream_.fail_at_line("'key = value' is expected");
            more = take(key, value);
        }
        finish();
        return std::move(header_);
    }

private:
    // false: it was the last line
    bool take(std::string_view key, std::string_view value) {
        if (key == "ObjectType") {
            if (value != "Image") throw Error(ErrorKind::unsupported, stream_.place_of_line() + ": objects of type Image are read, not " + std::string(value));
        } else if (key == "NDims") {
            if (dimensions_ != 0) stream_.fail_at_line("one line 'NDims = ...' is expected, this is the second");
            dimensions_ = size_t(integer_of(stream_, value, 1, int64_t(kMostDimensions)));
        } else if (key == "DimSize") {
            sizes_.clear();
            for (const double size : numbers(value, dimensions())) {
                // 2^53 and beyond are refused as too many; below, a double is the integer.
                if (!(size >= 0.0) || size != std::floor(size) || size > 0x1p53) stream_.fail_at_line("numbers of samples are expected");
                sizes_.push_back(uint64_t(size));
            }
            size_place_ = stream_.place_of_line();
        } else if (key == "ElementSpacing" || key == "ElementSize") {
            std::vector<double> values = numbers(value, dimensions());
            if (key == "ElementSpacing" || !has_spacing_) {
                spacing_ = std::move(values);
                spacing_place_ = stream_.place_of_line();
            }
            has_spacing_ |= key == "ElementSpacing";
        } else if (key == "Offset" || key == "Origin" || key == "Position") {
            origin_ = numbers(value, dimensions());
        } else if (key == "TransformMatrix" || key == "Rotation" || key == "Orientation") {
            directions_ = numbers(value, dimensions() * dimensions());
            directions_place_ = stream_.place_of_line();
        } else if (key == "ElementType") {
            set_type(value);
        } else if (key == "ElementNumberOfChannels") {
            if (const int64_t channels = integer_of(stream_, value, 1, 1 << 20); channels != 1)
                throw Error(ErrorKind::unsupported, stream_.place_of_line() + ": one value a sample is expected, there are " + std::to_string(channels));
        } else if (key == "BinaryData") {
            if (!truth(value)) header_.encoding = VolumeEncoding::text;
        } else if (key == "CompressedData") {
            is_compressed_ = truth(value);
        } else if (key == "BinaryDataByteOrderMSB" || key == "ElementByteOrderMSB") {
            header_.is_big_endian = truth(value);
        } else if (key == "CompressedDataSize") {
            header_.stored_bytes = uint64_t(integer_of(stream_, value, 0, INT64_MAX));
        } else if (key == "HeaderSize") {
            header_size_ = integer_of(stream_, value, -1, INT64_MAX);
        } else if (key == "ElementToIntensityFunctionSlope" || key == "ElementToIntensityFunctionOffset") {
            if (const double number = numbers(value, 1)[0]; number != (key.ends_with("Slope") ? 1.0 : 0.0))
                header_.notes.push_back(std::string(key) + " is " + std::string(value) + ": values are taken as they are stored");
        } else if (key == "ElementDataFile") {
            set_data_file(value);
            return false;
        }
        return true;  // others say nothing of where samples lie
    }

    void set_type(std::string_view value) {
        const auto* const found = std::find_if(kTypes.begin(), kTypes.end(), [&](const auto& type) { return type.first == value; });
        if (found == kTypes.end())
            throw Error(ErrorKind::unsupported, stream_.place_of_line() + ": one number a sample is expected, of a type such as MET_UCHAR, MET_SHORT or MET_FLOAT, not " + std::string(value));
        header_.type = found->second;
        has_type_ = true;
    }

    void set_data_file(std::string_view value) {
        if (value == "LOCAL" || value == "Local" || value == "local") return;
        if (value.starts_with("LIST") || value.find('%') != std::string_view::npos)
            throw Error(ErrorKind::unsupported, stream_.place_of_line() + ": all samples in one file are expected, not a list or a pattern of files");
        header_.data_file = checked_data_file(value, stream_.place_of_line());
    }

    size_t dimensions() const {
        if (dimensions_ == 0) stream_.fail_at_line("'NDims = ...' is expected before this");
        return dimensions_;
    }
    std::vector<double> numbers(std::string_view value, size_t count) const {
        TextWords words(value);
        std::vector<double> values(count);
        for (double& number : values)
            if (!words.number(number)) stream_.fail_at_line(std::to_string(count) + " numbers are expected");
        if (words.more()) stream_.fail_at_line(std::to_string(count) + " numbers are expected, there are more");
        return values;
    }
    bool truth(std::string_view value) const {
        if (value == "True" || value == "true" || value == "TRUE" || value == "T" || value == "t" || value == "1") return true;
        if (value == "False" || value == "false" || value == "FALSE" || value == "F" || value == "f" || value == "0") return false;
        stream_.fail_at_line("True or False is expected");
    }

    void finish() {
        if (sizes_.empty()) stream_.fail_at_line("'DimSize = ...' is expected before this");
        if (!has_type_) stream_.fail_at_line("'ElementType = ...' is expected before this");
        std::array<uint64_t, 3> size = {1, 1, 1};
        for (size_t axis = 0; axis < sizes_.size(); ++axis)
            if (axis < 3) size[axis] = sizes_[axis];
            else if (sizes_[axis] != 1) throw Error(ErrorKind::unsupported, size_place_ + ": three axes of samples are expected, there are " + std::to_string(sizes_.size()));
        set_size(header_, size, size_place_);
        place_samples();

        if (is_compressed_) {
            if (header_.encoding == VolumeEncoding::text) stream_.fail_at_line("compressed data that is not binary is not known");
            header_.encoding = VolumeEncoding::deflated;
        } else {
            header_.stored_bytes.reset();
        }
        header_.offset = header_.data_file.empty() ? stream_.position() : 0;
        if (header_size_ == -1) {
            header_.is_at_end = true;
        } else if (header_size_ > 0) {  // counts from the start of the file, whichever it is
            if (uint64_t(header_size_) < header_.offset)
                stream_.fail_at_line("HeaderSize is " + std::to_string(header_size_) + ", but the header ends at byte " + std::to_string(header_.offset));
            header_.offset = uint64_t(header_size_);
        }
    }

    // The first three numbers of the matrix are the direction of the first axis, and so on.
    void place_samples() {
        const size_t used = std::min<size_t>(sizes_.size(), 3);
        GridPlacement& placement = header_.placement;
        for (size_t axis = 0; axis < used && !origin_.empty(); ++axis) placement.origin[Eigen::Index(axis)] = origin_[axis];
        for (size_t axis = 0; axis < used; ++axis) {
            Vec3d direction = Vec3d::Unit(Eigen::Index(axis));
            for (size_t k = 0; k < used && !directions_.empty(); ++k) direction[Eigen::Index(k)] = directions_[axis * sizes_.size() + k];
            if (!spacing_.empty()) direction *= checked_spacing(spacing_[axis], spacing_place_);
            placement.axes.col(Eigen::Index(axis)) = direction;
        }
        check_placement(placement, header_.size, !directions_place_.empty() ? directions_place_ : !spacing_place_.empty() ? spacing_place_ : size_place_);
    }

    ByteStream& stream_;
    VolumeHeader header_;
    size_t dimensions_ = 0;
    std::vector<uint64_t> sizes_;
    std::vector<double> spacing_, origin_, directions_;
    std::string size_place_, spacing_place_, directions_place_;
    int64_t header_size_ = 0;
    bool has_spacing_ = false, has_type_ = false, is_compressed_ = false;
};

}  // namespace

bool looks_like_metaimage(std::string_view head) {
    constexpr std::array<std::string_view, 7> kFirst = {"ObjectType", "NDims", "Comment", "ObjectSubType", "TransformType", "Name", "ID"};
    const auto [key, value] = key_and_value(head.substr(0, head.find('\n')));
    return std::find(kFirst.begin(), kFirst.end(), key) != kFirst.end() && (key != "ObjectType" || value == "Image") && head.find("NDims") != std::string_view::npos;
}

VolumeHeader read_metaimage_header(ByteStream& stream) { return MetaImageReader(stream).read(); }

}  // namespace strata
