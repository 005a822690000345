// Legacy VTK files of structured points. Facts from "VTK File Formats", Kitware.
#include <algorithm>
#include <array>
#include <utility>

#include "core/error.h"
#include "io/text_words.h"
#include "io/volume/volume_header.h"

namespace strata {
namespace {

constexpr std::array<std::pair<std::string_view, SampleType>, 13> kTypes = {{
    {"unsigned_char", SampleType::uint8}, {"char", SampleType::int8}, {"signed_char", SampleType::int8}, {"unsigned_short", SampleType::uint16},
    {"short", SampleType::int16}, {"unsigned_int", SampleType::uint32}, {"int", SampleType::int32}, {"unsigned_long", SampleType::uint64},
    {"long", SampleType::int64}, {"vtktypeuint64", SampleType::uint64}, {"vtktypeint64", SampleType::int64}, {"float", SampleType::float32},
    {"double", SampleType::float64},
}};

class VtkReader {
public:
    explicit VtkReader(ByteStream& stream) : stream_(stream) {}

    VolumeHeader read() {
        std::string_view line;
        if (!stream_.next_line(line) || !looks_like_vtk(line)) stream_.fail_at_line("'# vtk DataFile Version' is expected");
        header_.format = "VTK, legacy";
        header_.more_follows = true;
        if (!stream_.next_line(line)) stream_.fail_at_line("a title is expected");
        read_encoding();
        expect("dataset");
        if (const std::string kind = word(); kind != "structured_points") throw Error(ErrorKind::unsupported, stream_.place_of_line() + ": a data set of STRUCTURED_POINTS is expected, not " + kind);
        std::string keyword;
        while ((keyword = next()) != "point_data") take(keyword);
        if (size_place_.empty()) stream_.fail_at_line("DIMENSIONS is expected before this");
        if (const int64_t points = integer(0); uint64_t(points) != samples_) stream_.fail_at_line(std::to_string(samples_) + " points are expected, as DIMENSIONS says");
        read_scalars();
        set_size(header_, size_, size_place_);
        check_placement(header_.placement, header_.size, spacing_place_.empty() ? size_place_ : spacing_place_);
        header_.offset = stream_.position();
        return std::move(header_);
    }

private:
    void read_encoding() {
        const std::string encoding = next();
        if (encoding != "ascii" && encoding != "binary") stream_.fail_at_line("ASCII or BINARY is expected");
        header_.encoding = encoding == "ascii" ? VolumeEncoding::text : VolumeEncoding::raw;
        header_.is_big_endian = encoding == "binary";
    }

    void take(const std::string& keyword) {
        if (keyword == "dimensions") {
            samples_ = 1;
            for (uint64_t& size : size_) {
                size = uint64_t(integer(1));
                if (size > (uint64_t{1} << 62) / samples_) stream_.fail_at_line("fewer than 2^62 points are expected");
                samples_ *= size;
            }
            size_place_ = stream_.place_of_line();
        } else if (keyword == "spacing" || keyword == "aspect_ratio") {
            spacing_place_ = stream_.place_of_line();
            for (Eigen::Index axis = 0; axis < 3; ++axis) header_.placement.axes(axis, axis) = checked_spacing(number(), spacing_place_);
        } else if (keyword == "origin") {
            for (double& part : header_.placement.origin) part = number();
        } else {
            stream_.fail_at_line("DIMENSIONS, SPACING, ORIGIN or POINT_DATA is expected");
        }
    }

    void read_scalars() {
        if (next() != "scalars") throw Error(ErrorKind::unsupported, stream_.place_of_line() + ": SCALARS are expected first of what points have");
        word();  // their name
        const std::string name = word();
        const auto* const found = std::find_if(kTypes.begin(), kTypes.end(), [&](const auto& type) { return type.first == name; });
        if (found == kTypes.end()) throw Error(ErrorKind::unsupported, stream_.place_of_line() + ": a type such as unsigned_char, short or float is expected, not " + name);
        header_.type = found->second;
        if (words_.more() && integer(1) != 1) throw Error(ErrorKind::unsupported, stream_.place_of_line() + ": one value a point is expected");
        expect("lookup_table");
        word();
    }

    std::string next() {
        std::string_view line;
        do {
            if (!stream_.next_line(line)) stream_.fail_at_line("the file ends in its header, POINT_DATA with SCALARS is expected");
            words_ = TextWords(line);
        } while (!words_.more());
        return lower_case(words_.word());
    }
    void expect(std::string_view wanted) {
        if (next() != wanted) stream_.fail_at_line(std::string(wanted) + " is expected");
    }
    std::string word() {
        const std::string_view found = words_.word();
        if (found.empty()) stream_.fail_at_line("one more word is expected");
        return lower_case(found);
    }
    double number() {
        double value = 0.0;
        if (!words_.number(value)) stream_.fail_at_line("three numbers are expected");
        return value;
    }
    int64_t integer(int64_t least) {
        int64_t value = 0;
        if (!words_.more() || !words_.integer(value) || !words_.at_word_end() || value < least) stream_.fail_at_line("an integer of at least " + std::to_string(least) + " is expected");
        return value;
    }

    ByteStream& stream_;
    VolumeHeader header_;
    TextWords words_{std::string_view()};
    std::array<uint64_t, 3> size_ = {0, 0, 0};
    uint64_t samples_ = 0;
    std::string size_place_, spacing_place_;
};

}  // namespace

bool looks_like_vtk(std::string_view head) { return head.starts_with("# vtk DataFile Version"); }

VolumeHeader read_vtk_header(ByteStream& stream) { return VtkReader(stream).read(); }

}  // namespace strata
