#include "io/crs/geotiff_crs.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <random>

#include "io/crs/crs_text.h"
#include "tests/support/las_file.h"

namespace strata {
namespace {

using Bytes = std::vector<std::byte>;

// The three records of GeoTIFF keys, put together key by key.
struct Keys {
    Bytes directory, doubles, texts;
    uint16_t count = 0;
    std::vector<std::string> notes;

    Keys() {
        for (const uint16_t word : {1, 1, 0, 0}) test::put(directory, uint16_t(word));
    }
    Keys& code(int id, int value) { return key(id, 0, 1, value); }
    Keys& number(int id, std::initializer_list<double> values) {
        key(id, 34736, int(values.size()), int(doubles.size() / 8));
        for (const double value : values) test::put(doubles, value);
        return *this;
    }
    Keys& text(int id, const std::string& value) {
        key(id, 34737, int(value.size()) + 1, int(texts.size()));
        for (const char c : value + "|") texts.push_back(std::byte(c));
        return *this;
    }
    Keys& key(int id, int location, int size, int value) {
        for (const int word : {id, location, size, value}) test::put(directory, uint16_t(word));
        test::poke(directory, 6, ++count);
        return *this;
    }
    std::string crs() {
        notes.clear();
        return crs_of_geotiff_keys(ByteReader(directory, "keys"), doubles, texts, notes);
    }
};

TEST(GeotiffCrs, CodesSayAll) {
    Keys projected;
    EXPECT_EQ(projected.code(1024, 1).code(3072, 25832).code(3076, 9001).crs(), "EPSG:25832");
    EXPECT_TRUE(projected.notes.empty());
    EXPECT_EQ(Keys().code(1024, 2).code(2048, 4326).code(2054, 9102).crs(), "EPSG:4326");
    EXPECT_EQ(Keys().code(1024, 3).code(2048, 4978).crs(), "EPSG:4978");
    EXPECT_EQ(Keys().code(1024, 1).code(3072, 2225).code(3076, 9003).crs(), "EPSG:2225");
    EXPECT_EQ(Keys().code(1024, 1).crs(), "");
}

TEST(GeotiffCrs, AVerticalCodeJoinsTheHorizontalOne) {
    Keys keys;
    EXPECT_EQ(keys.code(1024, 1).code(3072, 25832).code(4096, 7837).code(4099, 9001).crs(), "EPSG:25832+7837");
    EXPECT_TRUE(keys.notes.empty());
    EXPECT_EQ(Keys().code(2048, 4326).code(4096, 5773).crs(), "EPSG:4326+5773");
    // GeoTIFF 1.0 had the number of the datum NAVD88 here, and numbers for heights above ellipsoids.
    EXPECT_EQ(Keys().code(3072, 26915).code(4096, 5103).crs(), "EPSG:26915+5703");
    EXPECT_EQ(Keys().code(3072, 26915).code(4096, 5030).crs(), "EPSG:26915");
}

TEST(GeotiffCrs, HeightsInAnotherUnitThanTheirCodeSays) {
    const std::string crs = Keys().code(3072, 2903).code(3076, 9003).code(4096, 5703).code(4099, 9003).crs();
    const auto described = describe_crs(crs);
    ASSERT_TRUE(described) << crs;
    EXPECT_EQ(described->unit, "US survey foot");
    EXPECT_EQ(described->vertical_unit, "US survey foot");
    EXPECT_TRUE(same_crs(crs, "EPSG:2903+6360")) << crs;  // NAVD88 in these feet
}

TEST(GeotiffCrs, AVerticalSystemThatIsNoneIsLeftOutAndSaid) {
    Keys unknown, horizontal, named;
    EXPECT_EQ(unknown.code(3072, 25832).code(4096, 9999).crs(), "EPSG:25832");
    EXPECT_EQ(unknown.notes, std::vector<std::string>{"PROJ knows no vertical system EPSG:9999, which its GeoTIFF keys name: it is left out"});
    EXPECT_EQ(horizontal.code(3072, 25832).code(4096, 4326).crs(), "EPSG:25832");
    EXPECT_EQ(horizontal.notes.size(), 1u);
    EXPECT_EQ(named.code(3072, 25832).text(4097, "NAVD88 - Geoid03 (Feet)").crs(), "EPSG:25832");
    EXPECT_EQ(named.notes.size(), 1u);
}

TEST(GeotiffCrs, ACodeThatProjLacksIsKeptAndSaid) {
    Keys keys;
    EXPECT_EQ(keys.code(1024, 1).code(3072, 12345).crs(), "EPSG:12345");
    EXPECT_EQ(keys.notes, std::vector<std::string>{"PROJ knows no EPSG:12345, which its GeoTIFF keys name"});
}

// Many scans in feet name the zone by its code in meters.
TEST(GeotiffCrs, AUnitOfTheFilesOwnWins) {
    Keys keys;
    const std::string crs = keys.code(1024, 1).code(3072, 26995).code(3076, 9003).crs();
    const auto described = describe_crs(crs);
    ASSERT_TRUE(described) << crs;
    EXPECT_EQ(described->name, "NAD83 / Mississippi West");
    EXPECT_DOUBLE_EQ(described->unit_meters, 1200.0 / 3937.0);
    EXPECT_NE(crs.find("PARAMETER[\"false_easting\",2296583.3333"), std::string::npos) << crs;  // 700 km
    EXPECT_EQ(keys.notes.size(), 1u);
    EXPECT_EQ(Keys().code(3072, 26995).code(3076, 32632).crs(), "EPSG:26995");  // no unit at all
}

// Systems that EPSG defines, spelled out as parameters. The judge is PROJ's own definition of the code.
struct SpelledOut {
    const char* epsg;
    int method, base;
    int unit;
    std::vector<std::pair<int, double>> parameters;
};
const SpelledOut kSpelledOut[] = {
    {"EPSG:32632", 1, 4326, 9001, {{3081, 0}, {3080, 9}, {3092, 0.9996}, {3082, 500000}, {3083, 0}}},
    {"EPSG:2154", 8, 4171, 9001, {{3078, 49}, {3079, 44}, {3085, 46.5}, {3084, 3}, {3086, 700000}, {3087, 6600000}}},
    {"EPSG:2994", 8, 4152, 9002, {{3078, 43}, {3079, 45.5}, {3085, 41.75}, {3084, -120.5}, {3086, 1312335.958}, {3087, 0}}},
    {"EPSG:3448", 9, 4758, 9001, {{3081, 18}, {3080, -77}, {3092, 1}, {3082, 750000}, {3083, 650000}}},
    {"EPSG:3395", 7, 4326, 9001, {{3081, 0}, {3080, 0}, {3092, 1}, {3082, 0}, {3083, 0}}},
    {"EPSG:3035", 10, 4258, 9001, {{3089, 52}, {3088, 10}, {3082, 4321000}, {3083, 3210000}}},
    {"EPSG:5070", 11, 4269, 9001, {{3078, 29.5}, {3079, 45.5}, {3081, 23}, {3080, -96}, {3082, 0}, {3083, 0}}},
    {"EPSG:28992", 16, 4289, 9001, {{3081, 52.15616055555555}, {3080, 5.38763888888889}, {3092, 0.9999079}, {3082, 155000}, {3083, 463000}}},
    {"EPSG:5880", 22, 4674, 9001, {{3081, 0}, {3080, -54}, {3082, 5000000}, {3083, 10000000}}},
    {"EPSG:3078", 3, 4269, 9001,
     {{3089, 45.30916666666666}, {3088, -86}, {3094, 337.25556}, {3096, 337.25556}, {3093, 0.9996}, {3082, 2546731.496}, {3083, -4354009.816}}},
    {"EPSG:29873", 9815, 4298, 9001,
     {{3089, 4}, {3088, 115}, {3094, 53.31582047222222}, {3096, 53.13010236111111}, {3093, 0.99984}, {3082, 590476.87}, {3083, 442857.65}}},
};

TEST(GeotiffCrs, ParametersAreTranslated) {
    for (const SpelledOut& system : kSpelledOut) {
        Keys keys;
        keys.code(1024, 1).code(2048, system.base).code(3072, 32767).code(3074, 32767).code(3075, system.method).code(3076, system.unit);
        for (const auto& [id, value] : system.parameters) keys.number(id, {value});
        keys.text(1026, "mine");
        const std::string crs = keys.crs();
        EXPECT_TRUE(same_crs(crs, system.epsg)) << system.epsg << " " << crs << "\n" << wkt1_of_crs(system.epsg);
        EXPECT_TRUE(crs.starts_with("PROJCS[\"mine\"")) << crs;
        EXPECT_TRUE(keys.notes.empty()) << keys.notes[0];
        // A parameter that is off by a meter or a degree is another system.
        test::poke(keys.doubles, keys.doubles.size() - 16, system.parameters[system.parameters.size() - 2].second + 1.0);
        EXPECT_FALSE(same_crs(keys.crs(), system.epsg)) << system.epsg;
    }
}

TEST(GeotiffCrs, AProjectionOfItsOwnNumber) {
    // UTM zone 32N (EPSG:16032) over WGS 84, without a code of the whole.
    const std::string crs = Keys().code(1024, 1).code(2048, 4326).code(3072, 32767).code(3074, 16032).code(3076, 9001).crs();
    EXPECT_TRUE(same_crs(crs, "EPSG:32632")) << crs;
    const std::string unsaid = Keys().code(1024, 1).code(2048, 4326).code(3074, 16032).code(3076, 9001).crs();
    EXPECT_TRUE(same_crs(unsaid, "EPSG:32632")) << unsaid;
}

// The base by its datum alone, as ESRI writes it; by numbers of the ellipsoid where there is no more.
TEST(GeotiffCrs, TheBaseMayBeADatumOrAnEllipsoid) {
    const auto lambert = [](Keys keys) {
        for (const auto& [id, value] : kSpelledOut[1].parameters) keys.number(id, {value});
        return keys.code(3072, 32767).code(3075, 8).crs();
    };
    const std::string datum = lambert(Keys().code(1024, 1).code(2048, 32767).code(2050, 6171).code(3076, 9001));
    EXPECT_TRUE(same_crs(datum, "EPSG:2154")) << datum;
    const std::string ellipsoid =
        lambert(Keys().code(1024, 1).code(2048, 32767).code(2050, 32767).number(2057, {6378137}).number(2059, {298.257222101}).code(3076, 9001));
    EXPECT_TRUE(ellipsoid.starts_with("PROJCS[")) << ellipsoid;
    EXPECT_NE(ellipsoid.find("SPHEROID[\"GRS 1980\",6378137,298.257222101"), std::string::npos) << ellipsoid;
    EXPECT_FALSE(same_crs(ellipsoid, "EPSG:2154"));
    EXPECT_EQ(lambert(Keys().code(1024, 1).code(2048, 32767).text(1026, "nowhere")), "nowhere");
    const std::string geographic = Keys().code(1024, 2).code(2048, 32767).number(2057, {6377397.155}).number(2059, {299.1528128}).crs();
    EXPECT_NE(geographic.find("SPHEROID[\"Bessel 1841\""), std::string::npos) << geographic;
    EXPECT_TRUE(same_crs(Keys().code(1024, 2).code(2048, 32767).code(2050, 6326).crs(), "EPSG:4326"));
}

TEST(GeotiffCrs, AShiftToWgs84IsKept) {
    const std::string crs = Keys()
                                .code(1024, 2)
                                .code(2048, 32767)
                                .number(2057, {6377397.155})
                                .number(2059, {299.1528128})
                                .number(2062, {582.0, 105.0, 414.0, 1.04, 0.35, -3.08, 8.3})
                                .crs();
    EXPECT_NE(crs.find("TOWGS84[582,105,414,1.04,0.35,-3.08,8.3]"), std::string::npos) << crs;
}

TEST(GeotiffCrs, AUnitOfTheParametersOwnSize) {
    Keys keys;
    keys.code(1024, 1).code(2048, 4326).code(3072, 32767).code(3075, 1).code(3076, 32767).number(3077, {2.0});
    keys.number(3081, {0}).number(3080, {9}).number(3092, {0.9996}).number(3082, {250000}).number(3083, {0});
    const std::string crs = keys.crs();
    const auto described = describe_crs(crs);
    ASSERT_TRUE(described) << crs;
    EXPECT_EQ(described->unit_meters, 2.0);
    EXPECT_NE(crs.find("PARAMETER[\"false_easting\",250000]"), std::string::npos) << crs;
}

TEST(GeotiffCrs, WhatCannotBeTranslatedKeepsItsName) {
    constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
    const auto mercator = [](int method, double longitude) {
        return Keys().code(1024, 1).code(2048, 4326).code(3072, 32767).code(3075, method).number(3080, {longitude}).number(3081, {0.0}).text(1026, "mine");
    };
    for (Keys keys : {mercator(25, 9.0), mercator(12345, 9.0), mercator(1, kNaN), mercator(1, 1e300), mercator(7, -INFINITY)}) {
        EXPECT_EQ(keys.crs(), "mine");
        ASSERT_EQ(keys.notes.size(), 1u);
        EXPECT_NE(keys.notes[0].find("no more than its name is known"), std::string::npos) << keys.notes[0];
    }
}

TEST(GeotiffCrs, WithoutTheDatabaseCodesAreTakenUnseen) {
    setenv("PROJ_DATA", "/nowhere", 1);
    Keys codes, parameters;
    EXPECT_EQ(codes.code(3072, 25832).code(3076, 9003).code(4096, 7837).crs(), "EPSG:25832+7837");
    EXPECT_EQ(parameters.code(2048, 4326).code(3072, 32767).code(3075, 1).code(3076, 9001).text(1026, "mine").crs(), "mine");
    unsetenv("PROJ_DATA");
    for (const Keys& keys : {codes, parameters}) {
        ASSERT_EQ(keys.notes.size(), 1u);
        EXPECT_NE(keys.notes[0].find("proj.db"), std::string::npos) << keys.notes[0];
    }
}

// Whatever is cut off or turned over, there is a text or one line, and nothing is read that is not there.
TEST(GeotiffCrs, DamagedKeysAreTextOrOneLine) {
    Keys whole;
    whole.code(1024, 1).code(2048, 32767).code(2050, 6171).number(2057, {6378137}).number(2059, {298.257222101}).number(2062, {1, 2, 3});
    whole.code(3072, 32767).code(3074, 32767).code(3075, 8).code(3076, 9001).text(1026, "a").text(2049, "b");
    for (const auto& [id, value] : kSpelledOut[1].parameters) whole.number(id, {value});
    whole.code(4096, 5703).text(4097, "c").code(4099, 9003);
    const auto survives = [](const Keys& keys) {
        Keys damaged = keys;
        try {
            damaged.crs();
        } catch (const Error& error) {
            EXPECT_EQ(error.kind, ErrorKind::malformed) << error.what();
        }
    };
    for (size_t size = 0; size <= whole.directory.size(); size += 2) {
        Keys cut = whole;
        cut.directory.resize(size);
        survives(cut);
        cut = whole;
        cut.doubles.resize(std::min(size, cut.doubles.size()));
        survives(cut);
        cut = whole;
        cut.texts.resize(std::min(size / 2, cut.texts.size()));
        survives(cut);
    }
    std::mt19937 random(1);
    for (int i = 0; i < 1500; ++i) {
        Keys flipped = whole;
        for (int flips = 0; flips < 1 + i % 4; ++flips) {
            Bytes& bytes = random() % 3 == 0 ? flipped.doubles : flipped.directory;
            bytes[random() % bytes.size()] ^= std::byte(1u << random() % 8);
        }
        survives(flipped);
    }
}

}  // namespace
}  // namespace strata
