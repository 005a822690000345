#include "io/volume/volume_source.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>

#include "tests/io/volume/volume_file.h"

namespace strata {
namespace {

using test::Beside;
using test::deflated;
using test::packed;
using test::values_of;
using test::volume_of;
using test::volume_refusal;

struct TypeNames {
    const char *metaimage, *nrrd, *vtk;
};
template <typename T>
TypeNames names_of();
template <> TypeNames names_of<int8_t>() { return {"MET_CHAR", "signed char", "signed_char"}; }
template <> TypeNames names_of<uint8_t>() { return {"MET_UCHAR", "uchar", "unsigned_char"}; }
template <> TypeNames names_of<int16_t>() { return {"MET_SHORT", "short", "short"}; }
template <> TypeNames names_of<uint16_t>() { return {"MET_USHORT", "uint16_t", "unsigned_short"}; }
template <> TypeNames names_of<int32_t>() { return {"MET_INT", "int", "int"}; }
template <> TypeNames names_of<uint32_t>() { return {"MET_ULONG", "unsigned int", "unsigned_int"}; }
template <> TypeNames names_of<int64_t>() { return {"MET_LONG_LONG", "long long int", "long"}; }
template <> TypeNames names_of<uint64_t>() { return {"MET_ULONG_LONG", "uint64", "unsigned_long"}; }
template <> TypeNames names_of<float>() { return {"MET_FLOAT", "float", "float"}; }
template <> TypeNames names_of<double>() { return {"MET_DOUBLE", "double", "double"}; }

template <typename T>
class OfType : public testing::Test {};
using AllTypes = testing::Types<int8_t, uint8_t, int16_t, uint16_t, int32_t, uint32_t, int64_t, uint64_t, float, double>;
TYPED_TEST_SUITE(OfType, AllTypes);

std::string as_text(const auto& values) {
    std::string text;
    for (const auto value : values) text += std::to_string(value) + (text.size() % 5 ? " " : "\n");
    return text;
}

// Twelve values with the least and the greatest of the type, in every way that a format stores them.
TYPED_TEST(OfType, IsReadInEveryEncoding) {
    using T = TypeParam;
    std::vector<T> values;
    for (int i = 0; i < 10; ++i) values.push_back(T(i * 11));
    if constexpr (std::is_integral_v<T>) {
        values.push_back(std::numeric_limits<T>::min());
        values.push_back(std::numeric_limits<T>::max());
    } else {
        values.push_back(T(-0.5));
        values.push_back(T(1e30));
    }
    std::vector<float> expected(values.begin(), values.end());
    const TypeNames names = names_of<T>();
    const std::string meta = "ObjectType = Image\nNDims = 3\nDimSize = 2 3 2\nElementType = " + std::string(names.metaimage) + "\n";
    const std::string nrrd = "NRRD0004\n# a comment\ntype: " + std::string(names.nrrd) + "\ndimension: 3\nsizes: 2 3 2\nkey:=value\n";
    const std::string vtk = "# vtk DataFile Version 3.0\ntitle\n", vtk_points = "DATASET STRUCTURED_POINTS\nDIMENSIONS 2 3 2\nSPACING 1 1 1\nORIGIN 0 0 0\nPOINT_DATA 12\nSCALARS s " +
                            std::string(names.vtk) + " 1\nLOOKUP_TABLE default\n";
    for (const bool big : {false, true}) {
        const std::string bytes = packed(values, big), msb = big ? "True\n" : "False\n", endian = big ? "endian: big\n" : "endian: little\n";
        EXPECT_EQ(values_of(*volume_of(meta + "ElementByteOrderMSB = " + msb + "ElementDataFile = LOCAL\n" + bytes)), expected) << big;
        EXPECT_EQ(values_of(*volume_of(meta + "CompressedData = True\nBinaryDataByteOrderMSB = " + msb + "ElementDataFile = LOCAL\n" + deflated(bytes, 15))), expected) << big;
        EXPECT_EQ(values_of(*volume_of(meta + "ElementByteOrderMSB = " + msb + "ElementDataFile = x.raw\n", {"x.raw", bytes})), expected) << big;
        EXPECT_EQ(values_of(*volume_of(nrrd + "encoding: raw\n" + endian + "\n" + bytes)), expected) << big;
        EXPECT_EQ(values_of(*volume_of(nrrd + "encoding: gzip\n" + endian + "\n" + deflated(bytes, 31))), expected) << big;
        EXPECT_EQ(values_of(*volume_of(nrrd + "encoding: raw\n" + endian + "data file: x.raw\n", {"x.raw", bytes})), expected) << big;
    }
    EXPECT_EQ(values_of(*volume_of(meta + "BinaryData = False\nElementByteOrderMSB = True\nElementDataFile = LOCAL\n" + as_text(values))), expected);
    EXPECT_EQ(values_of(*volume_of(nrrd + "encoding: ascii\nendian: big\n\n" + as_text(values))), expected);
    EXPECT_EQ(values_of(*volume_of(vtk + "ASCII\n" + vtk_points + as_text(values))), expected);
    EXPECT_EQ(values_of(*volume_of(vtk + "BINARY\n" + vtk_points + packed(values, true))), expected);

    const VolumeRange range = volume_of(nrrd + "encoding: raw\nendian: little\n\n" + packed(values))->measure();
    EXPECT_EQ(range.values, 12u);
    EXPECT_EQ(range.min, double(*std::min_element(values.begin(), values.end())));
    EXPECT_EQ(range.max, double(*std::max_element(values.begin(), values.end())));
}

// Neighbours of 2^60 differ by 1, which neither a float nor a double would show.
TEST(VolumeSource, TheReferenceIsSubtractedBeforeRounding) {
    const int64_t base = int64_t{1} << 60;
    const std::string header = "NRRD0004\ndimension: 1\nsizes: 3\nencoding: raw\nendian: little\n";
    EXPECT_EQ(values_of(*volume_of(header + "type: int64\n\n" + packed<int64_t>({base - 1, base, base + 3})), double(base)), (std::vector<float>{-1.0f, 0.0f, 3.0f}));
    EXPECT_EQ(values_of(*volume_of(header + "type: float\n\n" + packed<float>({16777215.0f, 16777216.0f, 1.0f})), 16777215.5), (std::vector<float>{-0.5f, 0.5f, -16777214.5f}));
}

// A difference that a float cannot hold keeps its sign: what is below the isovalue must not become equal to it.
TEST(VolumeSource, DifferencesKeepTheirSignsAndAreFinite) {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    const std::vector<float> values = values_of(*volume_of("NRRD0004\ndimension: 1\nsizes: 7\nencoding: raw\nendian: little\ntype: double\n\n" +
                                                           packed<double>({-1e-300, 1e-300, 0.0, 1e300, -kInfinity, kInfinity, std::nan("")})));
    EXPECT_LT(values[0], 0.0f);
    EXPECT_GT(values[1], 0.0f);
    EXPECT_EQ(values[2], 0.0f);
    EXPECT_EQ(values[3], std::numeric_limits<float>::max());
    EXPECT_EQ(values[4], std::numeric_limits<float>::lowest());
    EXPECT_EQ(values[5], std::numeric_limits<float>::max());
    EXPECT_TRUE(std::isnan(values[6]));
}

TEST(VolumeSource, NotANumberIsCountedAndHasNoPartInTheRange) {
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const std::string header = "NRRD0004\ndimension: 1\nsizes: 3\nencoding: raw\nendian: little\ntype: float\n\n";
    const VolumeRange range = volume_of(header + packed<float>({nan, 2.0f, -1.0f}))->measure();
    EXPECT_EQ(range.nan, 1u);
    EXPECT_EQ(range.values, 2u);
    EXPECT_EQ(range.min, -1.0);
    EXPECT_EQ(range.max, 2.0);
    const VolumeRange none = volume_of(header + packed<float>({nan, nan, nan}))->measure();
    EXPECT_EQ(none.values, 0u);
    EXPECT_EQ(none.nan, 3u);
}

// Larger than every buffer on the way, in slices that are not its multiples.
TEST(VolumeSource, ManySlicesComeInOrder) {
    std::vector<uint16_t> values(97 * 101 * 61);
    for (size_t i = 0; i < values.size(); ++i) values[i] = uint16_t(i * 2654435761u >> 7);
    const std::vector<float> expected(values.begin(), values.end());
    const std::string nrrd = "NRRD0005\ntype: uint16\ndimension: 3\nsizes: 97 101 61\nendian: little\n";
    EXPECT_EQ(values_of(*volume_of(nrrd + "encoding: raw\n\n" + packed(values))), expected);
    const auto packed_twice = volume_of(nrrd + "encoding: gz\n\n" + deflated(packed(values), 31));
    EXPECT_EQ(packed_twice->measure().values, values.size());
    EXPECT_EQ(values_of(*packed_twice), expected);
    EXPECT_EQ(values_of(*packed_twice), expected) << "from the start again";
}

constexpr const char* kMeta = "NDims = 3\nDimSize = 2 2 2\nElementType = MET_UCHAR\n";
constexpr const char* kNrrd = "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 2 2\nencoding: raw\n";
const std::string kEight = "abcdefgh";

// The first three numbers of the matrix are where the first axis goes.
TEST(MetaImage, SpacingAndDirectionsPlaceSamples) {
    const auto plain = volume_of(std::string(kMeta) + "ElementSpacing = 2 3 4\nOffset = 10 20 30\nElementDataFile = LOCAL\n" + kEight);
    EXPECT_EQ(plain->placement().world_from_index(Vec3d(1, 1, 1)), Vec3d(12, 23, 34));
    const auto turned = volume_of(std::string(kMeta) + "ElementSize = 9 9 9\nElementSpacing = 2 3 4\nElementSize = 8 8 8\nPosition = 10 20 30\nOrientation = 0 1 0 0 0 1 1 0 0\nElementDataFile = LOCAL\n" + kEight);
    EXPECT_EQ(turned->placement().world_from_index(Vec3d(1, 0, 0)), Vec3d(10, 22, 30));
    EXPECT_EQ(turned->placement().world_from_index(Vec3d(0, 1, 0)), Vec3d(10, 20, 33));
    EXPECT_EQ(turned->placement().world_from_index(Vec3d(0, 0, 1)), Vec3d(14, 20, 30));
    const auto by_size = volume_of(std::string(kMeta) + "ElementSize = 2 3 4\nElementDataFile = LOCAL\n" + kEight);
    EXPECT_EQ(by_size->placement().world_from_index(Vec3d(1, 1, 1)), Vec3d(2, 3, 4));
}

TEST(Nrrd, SpacingsAndDirectionsPlaceSamples) {
    const auto at = [](const std::string& fields, const Vec3d& index) { return volume_of(kNrrd + fields + "\n" + kEight)->placement().world_from_index(index); };
    EXPECT_EQ(at("spacings: 2 NaN 4\nspace origin: (10,20,30)\nspace: RAS\n", Vec3d(1, 1, 1)), Vec3d(12, 21, 34));
    EXPECT_EQ(at("space directions: (0,2,0) (0,0,3) (4,0,0)\nspace origin: (10, 20, 30)\n", Vec3d(1, 0, 0)), Vec3d(10, 22, 30));
    EXPECT_EQ(at("space directions: (0,2,0) (0,0,3) (-4,0,0)\n", Vec3d(1, 1, 1)), Vec3d(-4, 2, 3));
    // Of two cells from 10 to 14 the first sample is at 11; of two nodes it is at 10, the second at 14.
    EXPECT_EQ(at("axis mins: 10 0 0\naxis maxs: 14 2 2\n", Vec3d(0, 0, 0)).x(), 11.0);
    EXPECT_EQ(at("axis mins: 10 0 0\naxismaxs: 14 2 2\n", Vec3d(1, 0, 0)).x(), 13.0);
    EXPECT_EQ(at("axis mins: 10 0 0\naxis maxs: 14 2 2\ncenterings: node node node\n", Vec3d(1, 0, 0)).x(), 14.0);
}

TEST(Vtk, OriginAndSpacingPlaceSamples) {
    const auto volume = volume_of("# vtk DataFile Version 1.0\n\nBINARY\n\ndataset structured_points\nOrigin 10 20 30\nAspect_Ratio 2 3 4\nDimensions 2 2 2\nPOINT_DATA 8\nSCALARS s unsigned_char\nLOOKUP_TABLE default\n" + kEight);
    EXPECT_EQ(volume->placement().world_from_index(Vec3d(1, 1, 1)), Vec3d(12, 23, 34));
    EXPECT_EQ(values_of(*volume)[7], float('h'));
}

// Axes of one sample are thin, whatever their number.
TEST(VolumeSource, FewerOrMoreDimensionsAreAcceptedWhereValuesAreSingle) {
    using Size = std::array<uint32_t, 3>;
    EXPECT_EQ(volume_of("NDims = 2\nDimSize = 4 2\nElementSpacing = 2 3\nOffset = 1 1\nTransformMatrix = 0 1 1 0\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n" + kEight)->size(), (Size{4, 2, 1}));
    EXPECT_EQ(volume_of("NDims = 4\nDimSize = 2 2 2 1\nElementSpacing = 1 1 1 5\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n" + kEight)->size(), (Size{2, 2, 2}));
    const std::string head = "NRRD0004\ntype: uchar\nencoding: raw\n";
    EXPECT_EQ(volume_of(head + "dimension: 4\nsizes: 1 2 2 2\nspace directions: none (1,0,0) (0,1,0) (0,0,1)\n\n" + kEight)->size(), (Size{2, 2, 2}));
    EXPECT_EQ(volume_of(head + "dimension: 4\nsizes: 1 4 1 2\nspace directions: none (1,0,0) (0,1,0) (0,0,1)\n\n" + kEight)->size(), (Size{4, 1, 2}));
    const auto image = volume_of(head + "dimension: 2\nsizes: 4 2\nspace directions: (0,1) (1,0)\nspace origin: (5,6)\n\n" + kEight);
    EXPECT_EQ(image->size(), (Size{4, 2, 1}));
    EXPECT_EQ(image->placement().world_from_index(Vec3d(1, 0, 1)), Vec3d(5, 7, -1));
}

// What lies between the header and the samples, and before them where these are the file's end.
TEST(VolumeSource, SkipsWhatItsHeaderSays) {
    const std::vector<float> eight(kEight.begin(), kEight.end());
    const std::string meta = std::string(kMeta) + "HeaderSize = ";
    const auto with_more = volume_of(meta + "5\nElementDataFile = x\n", {"x", "12345" + kEight + "more"});
    EXPECT_EQ(values_of(*with_more), eight);
    EXPECT_EQ(with_more->header().notes, (std::vector<std::string>{"x: 4 bytes behind the last sample are left out; are size and type right?"}));
    EXPECT_TRUE(volume_of(meta + "5\nElementDataFile = x\n", {"x", "12345" + kEight})->header().notes.empty());
    EXPECT_EQ(values_of(*volume_of(meta + "-1\nElementDataFile = x\n", {"x", "any header" + kEight})), eight);
    EXPECT_EQ(values_of(*volume_of(meta + "-1\nElementDataFile = LOCAL\n" + "padding" + kEight)), eight);
    const std::string packed_samples = deflated(kEight, 15);
    EXPECT_EQ(values_of(*volume_of(meta + "-1\nCompressedData = True\nCompressedDataSize = " + std::to_string(packed_samples.size()) + "\nElementDataFile = x\n", {"x", "any header" + packed_samples})), eight);

    const std::string nrrd(kNrrd);
    EXPECT_EQ(values_of(*volume_of(nrrd + "line skip: 2\nbyte skip: 3\ndatafile: x\n", {"x", "one\ntwo\n123" + kEight + "more"})), eight);
    EXPECT_EQ(values_of(*volume_of(nrrd + "byteskip: -1\ndata file: x\n\n", {"x", "one\ntwo\n123" + kEight})), eight);
    const std::string gzipped = "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 2 2\nencoding: gzip\n";
    EXPECT_EQ(values_of(*volume_of(gzipped + "line skip: 1\nbyte skip: 3\n\nline\n" + deflated("123" + kEight, 31))), eight) << "bytes are counted after decompression";
    EXPECT_EQ(values_of(*volume_of(gzipped + "\n" + deflated("abc", 31) + deflated("defgh", 31) + std::string(5, '\0'))), eight) << "one after the other, and padding";
}

TEST(VolumeSource, RawSamplesNeedALayout) {
    const std::string bytes = "header" + packed<int16_t>({1, -2, 3, 4}, true);
    const auto opened = [&](const RawVolumeLayout& layout) { return open_raw_volume(memory_source("x.raw", test::bytes_of(bytes)), layout); };
    const RawVolumeLayout layout = {.size = {2, 1, 2}, .type = SampleType::int16, .is_big_endian = true, .spacing = {2, 3, 4}, .origin = {1, 1, 1}};
    EXPECT_EQ(values_of(*opened(layout)), (std::vector<float>{1, -2, 3, 4})) << "at the end of the file";
    EXPECT_EQ(opened(layout)->header().notes, (std::vector<std::string>{"the first 6 bytes are taken for a header"}));
    EXPECT_THROW(open_raw_volume(memory_source("x.raw", test::bytes_of(std::string(5000, 'h') + packed<int16_t>({1, -2, 3, 4}, true))), layout), Error) << "no header is so much larger";
    RawVolumeLayout behind = layout;
    behind.offset = 6;
    EXPECT_EQ(values_of(*opened(behind)), (std::vector<float>{1, -2, 3, 4}));
    EXPECT_EQ(opened(behind)->placement().world_from_index(Vec3d(1, 0, 1)), Vec3d(3, 1, 5));
    behind.offset = 7;
    EXPECT_THROW(opened(behind), Error);
    behind = layout;
    behind.size = {0xFFFFFFFF, 0xFFFFFFFF, 0xFFFFFFFF};
    EXPECT_THROW(opened(behind), Error);
    behind = layout;
    behind.spacing = {1, 0, 1};
    EXPECT_THROW(opened(behind), Error);
}

// Wherever a file ends, it is refused in one line that names it; only numbers as text may lose their last digits unseen.
TEST(VolumeSource, IsRefusedWhereverItIsCutOff) {
    const std::vector<int16_t> values(2 * 3 * 2, 77);
    const std::string bytes = packed(values);
    const std::string meta = "NDims = 3\nDimSize = 2 3 2\nElementType = MET_SHORT\n", nrrd = "NRRD0004\ntype: short\ndimension: 3\nsizes: 2 3 2\nendian: little\n";
    const std::string files[] = {meta + "ElementDataFile = LOCAL\n" + bytes, meta + "CompressedData = True\nElementDataFile = LOCAL\n" + deflated(bytes, 15),
                                 nrrd + "encoding: raw\n\n" + bytes, nrrd + "encoding: gzip\n\n" + deflated(bytes, 31),
                                 "# vtk DataFile Version 3.0\ntitle\nBINARY\nDATASET STRUCTURED_POINTS\nDIMENSIONS 2 3 2\nPOINT_DATA 12\nSCALARS s short 1\nLOOKUP_TABLE default\n" + packed(values, true)};
    for (const std::string& file : files) {
        ASSERT_EQ(volume_refusal(file), "");
        for (size_t size = 0; size < file.size(); ++size) {
            const std::string refusal = volume_refusal(file.substr(0, size));
            EXPECT_TRUE(refusal.starts_with("volume: ")) << size << " of " << file.size() << " bytes: " << refusal;
            EXPECT_EQ(refusal.find('\n'), std::string::npos) << refusal;
        }
    }
    const std::string text = nrrd + "encoding: ascii\n\n1 2 3 4 5 6\n7 8 9 10 11 12";
    ASSERT_EQ(volume_refusal(text), "");
    for (size_t size = 0; size + 2 < text.size(); ++size) EXPECT_TRUE(volume_refusal(text.substr(0, size)).starts_with("volume: ")) << size;
}

// A changed byte of compressed samples is found by their checksum at the latest, or it changes nothing, as the bits behind the last code.
TEST(VolumeSource, AChangedByteOfCompressedSamplesIsFound) {
    std::vector<int16_t> values(400);
    for (size_t i = 0; i < values.size(); ++i) values[i] = int16_t(i * i);
    const std::string head = "NRRD0004\ntype: short\ndimension: 3\nsizes: 10 10 4\nendian: little\nencoding: gzip\n\n", body = deflated(packed(values), 31);
    int harmless = 0;
    for (size_t at = 10; at < body.size(); ++at) {  // before that is a name and a time, which are nobody's
        std::string damaged = body;
        damaged[at] = char(damaged[at] ^ 0x10);
        if (volume_refusal(head + damaged).empty()) {
            EXPECT_EQ(values_of(*volume_of(head + damaged)), std::vector<float>(values.begin(), values.end())) << at;
            ++harmless;
        }
    }
    EXPECT_LE(harmless, 1);
}

struct Lie {
    std::string file;
    const char* said;  // a part of the message
};

class HeaderLies : public testing::TestWithParam<Lie> {};

TEST_P(HeaderLies, AreRefusedWithAClearLine) {
    const std::string refusal = volume_refusal(GetParam().file, {"x", kEight});
    EXPECT_NE(refusal.find(GetParam().said), std::string::npos) << GetParam().file << "\n" << refusal;
    EXPECT_TRUE(refusal.starts_with("volume: ")) << refusal;
}

std::string meta_with(const std::string& lines) { return kMeta + lines + "ElementDataFile = LOCAL\n" + kEight; }
std::string nrrd_with(const std::string& lines) { return kNrrd + lines + "\n" + kEight; }

INSTANTIATE_TEST_SUITE_P(
    MetaImage, HeaderLies,
    testing::Values(Lie{meta_with("ElementSpacing = 1 0 1\n"), "line 4: spacings above 0 are expected, there is 0"},
                    Lie{meta_with("ElementSpacing = 1 -2 1\n"), "line 4: spacings above 0 are expected, there is -2"},
                    Lie{meta_with("ElementSpacing = 1 nan 1\n"), "line 4: spacings above 0"}, Lie{meta_with("ElementSpacing = 1 inf 1\n"), "spacings above 0"},
                    Lie{meta_with("ElementSpacing = 1 1e-300 1\n"), "steps between samples"}, Lie{meta_with("ElementSpacing = 1 1\n"), "line 4: 3 numbers are expected"},
                    Lie{meta_with("ElementSpacing = 1 1 1 1\n"), "there are more"}, Lie{meta_with("ElementSpacing = 1 1 one\n"), "3 numbers are expected"},
                    Lie{meta_with("TransformMatrix = 1 0 0 1 0 0 0 0 1\n"), "line 4: three directions are expected"},
                    Lie{meta_with("TransformMatrix = 0 0 0 0 1 0 0 0 1\n"), "steps between samples"}, Lie{meta_with("TransformMatrix = 1 0 0 0 1 0 0 0 nan\n"), "steps between samples"},
                    Lie{meta_with("Offset = 1 2 inf\n"), "an origin"}, Lie{meta_with("NDims = 4\n"), "the second"}, Lie{meta_with("DimSize = 2 2 0\n"), "1 to 4294967295 samples"},
                    Lie{meta_with("DimSize = 2 2 -2\n"), "numbers of samples are expected"}, Lie{meta_with("DimSize = 2 2 2.5\n"), "numbers of samples are expected"},
                    Lie{meta_with("DimSize = 2 2 3\n"), "12 bytes; 8 are left"}, Lie{meta_with("DimSize = 4294967295 4294967295 4294967295\n"), "2^63 bytes or more"},
                    Lie{meta_with("DimSize = 4294967296 1 1\n"), "1 to 4294967295 samples"}, Lie{meta_with("DimSize = 1e300 1 1\n"), "numbers of samples"},
                    Lie{meta_with("DimSize = 2000000000 2000000000 2\n"), "8 are left"}, Lie{meta_with("ElementNumberOfChannels = 3\n"), "one value a sample is expected, there are 3"},
                    Lie{meta_with("ElementType = MET_UCHAR_ARRAY\n"), "MET_UCHAR_ARRAY"}, Lie{meta_with("ObjectType = Mesh\n"), "of type Image are read, not Mesh"}, Lie{meta_with("no sign\n"), "'key = value' is expected"},
                    Lie{meta_with("HeaderSize = 3\n"), "the header ends at byte"}, Lie{meta_with("HeaderSize = -2\n"), "an integer from -1"}, Lie{meta_with("BinaryData = perhaps\n"), "True or False"},
                    Lie{meta_with("CompressedData = True\n"), "zlib or gzip are expected"}, Lie{meta_with("CompressedData = True\nCompressedDataSize = 9\n"), "9 bytes of compressed samples are expected, 8 are left"},
                    Lie{meta_with("CompressedData = True\nDimSize = 2000 2000 2\n"), "cannot be in 8 compressed bytes"},
                    Lie{meta_with("CompressedData = True\nHeaderSize = -1\n"), "CompressedDataSize is expected"}, Lie{meta_with("CompressedData = True\nBinaryData = False\n"), "not known"},
                    Lie{meta_with("BinaryData = False\n"), "numbers are expected"}, Lie{"NDims = 3\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n", "DimSize"},
                    Lie{"NDims = 3\nDimSize = 2 2 2\nElementDataFile = LOCAL\n", "ElementType"}, Lie{"DimSize = 2 2 2\n", "NDims"}, Lie{"NDims = 11\n", "1 to 10"},
                    Lie{"NDims = 4\nDimSize = 2 2 1 2\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n" + kEight, "three axes"},
                    Lie{std::string(kMeta) + "ElementDataFile = /etc/passwd\n", "a file beside this one"}, Lie{std::string(kMeta) + "ElementDataFile = a/../../x\n", "a file beside this one"},
                    Lie{std::string(kMeta) + "ElementDataFile =\n", "a file beside this one"}, Lie{std::string(kMeta) + "ElementDataFile = missing\n", "missing: no such file"},
                    Lie{std::string(kMeta) + "ElementDataFile = LIST\na\nb\n", "not a list"}, Lie{std::string(kMeta) + "ElementDataFile = x%02d.raw 1 2 1\n", "a pattern"},
                    Lie{std::string(kMeta) + "HeaderSize = 9\nElementDataFile = x\n", "beyond the file's 8"}));

INSTANTIATE_TEST_SUITE_P(
    Nrrd, HeaderLies,
    testing::Values(Lie{nrrd_with("spacings: 1 0 1\n"), "line 6: spacings above 0 are expected, there is 0"}, Lie{nrrd_with("spacings: 1 -1 1\n"), "there is -1"},
                    Lie{nrrd_with("spacings: 1 inf 1\n"), "spacings above 0"}, Lie{nrrd_with("spacings: 1 1\n"), "3 numbers are expected"},
                    Lie{nrrd_with("space directions: (1,0,0) (2,0,0) (0,0,1)\n"), "line 6: three directions are expected"},
                    Lie{nrrd_with("space directions: (1,0,0) (0,0,0) (0,0,1)\n"), "steps between samples"}, Lie{nrrd_with("space directions: (1,0,0) none (0,0,1)\n"), "one value a sample is expected, not 2"},
                    Lie{nrrd_with("space directions: (1,0,0) (0,1,0)\n"), "vectors as (x,y,z)"}, Lie{nrrd_with("space directions: (1,0,0) (0,1,0) (0,0,1) (0,0,1)\n"), "there are more"},
                    Lie{nrrd_with("space directions: (1,0,0) (0,1,0) (0,0,1\n"), "vectors as (x,y,z)"}, Lie{nrrd_with("space directions: (1,0,0,0) (0,1,0,0) (0,0,1,0)\n"), "there are 4"},
                    Lie{nrrd_with("space origin: none\n"), "a place as (x,y,z)"}, Lie{nrrd_with("space origin: (0,0,nan)\n"), "an origin"}, Lie{nrrd_with("axis mins: 0 0 0\naxis maxs: 0 1 1\n"), "spacings above 0"},
                    Lie{nrrd_with("kinds: RGB-color domain domain\n"), "of kind rgb-color"}, Lie{nrrd_with("dimension: 3\n"), "the second"}, Lie{nrrd_with("sizes: 2 2 0\n"), "samples above 0"},
                    Lie{nrrd_with("sizes: 2 2\n"), "samples above 0"}, Lie{nrrd_with("sizes: 2 2 2 2\n"), "there are more"}, Lie{nrrd_with("sizes: 2 2 99999999999999999999\n"), "samples above 0"},
                    Lie{nrrd_with("sizes: 4294967295 4294967295 4294967295\n"), "2^63 bytes or more"}, Lie{nrrd_with("sizes: 2 2 3\n"), "12 bytes; 8 are left"}, Lie{nrrd_with("type: block\n"), "not block"},
                    Lie{nrrd_with("type: short\n"), "the field endian"}, Lie{nrrd_with("endian: middle\n"), "little or big"}, Lie{nrrd_with("encoding: bzip2\n"), "not bzip2"},
                    Lie{nrrd_with("encoding: hex\n"), "not hex"}, Lie{nrrd_with("encoding: gzip\n"), "zlib or gzip are expected"}, Lie{nrrd_with("encoding: gzip\nbyte skip: -1\n"), "for raw data"},
                    Lie{nrrd_with("encoding: ascii\n"), "numbers are expected"}, Lie{nrrd_with("line skip: 2\n"), "the file ends in line 2"}, Lie{nrrd_with("byte skip: 1\n"), "7 are left"},
                    Lie{nrrd_with("byte skip: 9\n"), "9 bytes needed"}, Lie{nrrd_with("no colon\n"), "'field: value' is expected"}, Lie{nrrd_with("data file: ../x\n"), "a file beside this one"},
                    Lie{nrrd_with("data file: LIST\nx\n"), "not a list"}, Lie{nrrd_with("data file: x%d.raw 1 2 1\n"), "a pattern"}, Lie{"NRRD0004\nsizes: 2 2 2\n\n", "'dimension' is expected"},
                    Lie{"NRRD0004\ndimension: 17\n\n", "from 1 to 16"}, Lie{"NRRD0004\ntype: uchar\ndimension: 3\nencoding: raw\n\n", "sizes"},
                    Lie{"NRRD0004\ntype: uchar\nencoding: raw\ndimension: 4\nsizes: 3 2 2 2\n\n", "three axes of single values are expected, there are 4"}));

std::string vtk_with(const std::string& lines, const std::string& scalars = "SCALARS s unsigned_char\nLOOKUP_TABLE default\n") {
    return "# vtk DataFile Version 3.0\ntitle\nBINARY\nDATASET STRUCTURED_POINTS\n" + lines + scalars + kEight;
}
INSTANTIATE_TEST_SUITE_P(
    Vtk, HeaderLies,
    testing::Values(Lie{vtk_with("DIMENSIONS 2 2 2\nSPACING 1 0 1\nPOINT_DATA 8\n"), "line 6: spacings above 0"}, Lie{vtk_with("DIMENSIONS 2 2 2\nSPACING 1 1 -1\nPOINT_DATA 8\n"), "there is -1"},
                    Lie{vtk_with("DIMENSIONS 2 2 3\nPOINT_DATA 12\n"), "12 bytes; 8 are left"}, Lie{vtk_with("DIMENSIONS 2 2 3\nPOINT_DATA 8\n"), "12 points are expected"},
                    Lie{vtk_with("DIMENSIONS 2 2\nPOINT_DATA 8\n"), "an integer of at least 1"}, Lie{vtk_with("DIMENSIONS 2 2 0\nPOINT_DATA 8\n"), "an integer of at least 1"},
                    Lie{vtk_with("DIMENSIONS 4000000000 4000000000 4000000000\nPOINT_DATA 8\n"), "fewer than 2^62"}, Lie{vtk_with("POINT_DATA 8\n"), "DIMENSIONS is expected"},
                    Lie{vtk_with("DIMENSIONS 5000000000 1 1\nPOINT_DATA 5000000000\n"), "1 to 4294967295 samples"}, Lie{vtk_with("CELL_DATA 8\n"), "POINT_DATA is expected"},
                    Lie{vtk_with("DIMENSIONS 2 2 2\nORIGIN 0 0\nPOINT_DATA 8\n"), "three numbers"}, Lie{vtk_with("DIMENSIONS 2 2 2\nPOINT_DATA 8\n", "VECTORS v float\n"), "SCALARS are expected"},
                    Lie{vtk_with("DIMENSIONS 2 2 2\nPOINT_DATA 8\n", "SCALARS s unsigned_char 3\nLOOKUP_TABLE default\n"), "one value a point"},
                    Lie{vtk_with("DIMENSIONS 2 2 2\nPOINT_DATA 8\n", "SCALARS s bit\nLOOKUP_TABLE default\n"), "not bit"}, Lie{vtk_with("DIMENSIONS 2 2 2\nPOINT_DATA 8\n", "SCALARS s char\n"), "lookup_table is expected"},
                    Lie{"# vtk DataFile Version 3.0\ntitle\nBINARY\nDATASET POLYDATA\n", "not polydata"}, Lie{"# vtk DataFile Version 3.0\ntitle\nbase64\n", "ASCII or BINARY"}));

// The values that data/index.json states, and the places of samples that its boxes state.
TEST(VolumeSource, RealVolumesAreReadWhole) {
    const char* const data = std::getenv("STRATA_DATA");
    if (data == nullptr || !std::filesystem::exists(std::string(data) + "/volume")) GTEST_SKIP() << "the folder STRATA_DATA with real volumes is not there";
    struct Row {
        const char* file;
        std::array<uint32_t, 3> size;
        Vec3d least, greatest;
        double min, max;
    };
    const Row rows[] = {{"headsq_quarter.mha", {64, 64, 93}, {0, 0, 0}, {201.6, 201.6, 138.0}, 0, 3926},
                        {"HeadMRVolume.mhd", {48, 62, 42}, {0, 0, 0}, {188, 244, 164}, 0, 255},
                        {"carotid.vtk", {76, 49, 45}, {100, 80, 1}, {175, 128, 45}, 0, 580}};
    for (const Row& row : rows) {
        const auto volume = open_volume(std::string(data) + "/volume/" + row.file);
        EXPECT_EQ(volume->size(), row.size) << row.file;
        EXPECT_EQ(volume->placement().origin, row.least);
        EXPECT_LT((volume->placement().world_from_index(Vec3d(row.size[0] - 1.0, row.size[1] - 1.0, row.size[2] - 1.0)) - row.greatest).norm(), 1e-9);
        const VolumeRange range = volume->measure();
        EXPECT_EQ(range.min, row.min) << row.file;
        EXPECT_EQ(range.max, row.max) << row.file;
    }
}

}  // namespace
}  // namespace strata
