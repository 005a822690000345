#include "io/crs/crs_text.h"

#include <gtest/gtest.h>

#include <cstdlib>

namespace strata {
namespace {

// Hides PROJ's database for the time of a test.
class WithoutDatabase {
public:
    WithoutDatabase() {
        if (const char* const data = std::getenv("PROJ_DATA")) before_ = data;
        setenv("PROJ_DATA", "/nowhere", 1);
    }
    ~WithoutDatabase() {
        if (before_.empty())
            unsetenv("PROJ_DATA");
        else
            setenv("PROJ_DATA", before_.c_str(), 1);
    }

private:
    std::string before_;
};

TEST(CrsText, CodesBecomeWkt1) {
    const std::string utm = wkt1_of_crs("EPSG:25832");
    EXPECT_TRUE(utm.starts_with("PROJCS[\"ETRS89 / UTM zone 32N\",GEOGCS[\"ETRS89\"")) << utm;
    EXPECT_TRUE(utm.ends_with("AUTHORITY[\"EPSG\",\"25832\"]]")) << utm;
    EXPECT_EQ(utm.find('\n'), std::string::npos);
    const std::string compound = wkt1_of_crs("EPSG:25832+7837");
    EXPECT_TRUE(compound.starts_with("COMPD_CS[\"ETRS89 / UTM zone 32N + DHHN2016 height\",PROJCS[")) << compound;
    EXPECT_NE(compound.find("VERT_CS[\"DHHN2016 height\""), std::string::npos) << compound;
    EXPECT_TRUE(wkt1_of_crs("EPSG:4978").starts_with("GEOCCS[\"WGS 84\"")) << wkt1_of_crs("EPSG:4978");
    // WKT 1 has no third axis of degrees: heights above the ellipsoid are a part of their own.
    const std::string geographic = wkt1_of_crs("EPSG:4979");
    EXPECT_TRUE(geographic.starts_with("COMPD_CS[\"WGS 84 + Ellipsoid (metre)\",GEOGCS[\"WGS 84\"")) << geographic;
}

TEST(CrsText, Wkt2BecomesWkt1) {
    const std::string wkt2 =
        "GEOGCRS[\"WGS 84\",DATUM[\"World Geodetic System 1984\",ELLIPSOID[\"WGS 84\",6378137,298.257223563]],CS[ellipsoidal,2],"
        "AXIS[\"latitude\",north],AXIS[\"longitude\",east],ANGLEUNIT[\"degree\",0.0174532925199433]]";
    EXPECT_TRUE(wkt1_of_crs(wkt2).starts_with("GEOGCS[\"WGS 84\",DATUM[\"WGS_1984\"")) << wkt1_of_crs(wkt2);
    EXPECT_TRUE(same_crs(wkt2, "EPSG:4326"));
}

// Names are no systems: PROJ would take the first that resembles them.
TEST(CrsText, WhatIsNoSystemBecomesNothing) {
    for (const char* const text : {"", "EPSG:99999", "EPSG:25832+", "EPSG:25832+99999", "mine", "WGS 84", "NAD83 / UTM zone 15N", "GEOGCRS[\"WGS 84\"]",
                                   "PROJCRS[", "+proj=", "{}", "EPSG:7030"}) {
        EXPECT_EQ(wkt1_of_crs(text), "") << text;
        EXPECT_FALSE(describe_crs(text)) << text;
    }
}

TEST(CrsText, Wkt1StaysAsItIs) {
    for (const char* const wkt : {"GEOGCS[\"WGS 84\"]", "LOCAL_CS[\"here\"]", "PROJCS["}) {
        EXPECT_EQ(wkt1_of_crs(wkt), wkt);
    }
    EXPECT_FALSE(describe_crs("GEOGCS[\"WGS 84\"]"));
}

TEST(CrsText, EqualSystemsMayBeSaidDifferently) {
    for (const char* const code : {"EPSG:2056", "EPSG:4326", "EPSG:25832+7837", "EPSG:4978", "EPSG:2225"})
        EXPECT_TRUE(same_crs(code, wkt1_of_crs(code))) << code;
    EXPECT_TRUE(same_crs("+proj=utm +zone=32 +datum=WGS84", "EPSG:32632"));
    EXPECT_FALSE(same_crs("EPSG:2056", "EPSG:21781"));
    EXPECT_FALSE(same_crs("EPSG:2225", "EPSG:26941"));  // feet and meters of one zone
    EXPECT_FALSE(same_crs("EPSG:25832", "EPSG:25832+7837"));
    EXPECT_FALSE(same_crs("EPSG:25832", ""));
    EXPECT_TRUE(same_crs("mine", "mine"));
    EXPECT_FALSE(same_crs("mine", "yours"));
}

TEST(CrsText, ADescriptionNamesTheUnits) {
    const auto mtm = describe_crs("EPSG:2949+5713");
    ASSERT_TRUE(mtm);
    EXPECT_EQ(mtm->id, "EPSG:2949+5713");
    EXPECT_EQ(mtm->name, "NAD83(CSRS) / MTM zone 7 + CGVD28 height");
    EXPECT_EQ(mtm->unit, "metre");
    EXPECT_EQ(mtm->unit_meters, 1.0);
    EXPECT_EQ(mtm->vertical_unit, "metre");

    const auto feet = describe_crs(wkt1_of_crs("EPSG:2225+5703"));
    ASSERT_TRUE(feet);
    EXPECT_EQ(feet->id, "EPSG:2225+5703");
    EXPECT_EQ(feet->unit, "US survey foot");
    EXPECT_DOUBLE_EQ(feet->unit_meters, 1200.0 / 3937.0);
    EXPECT_EQ(feet->vertical_unit, "metre");

    const auto degrees = describe_crs("EPSG:4326");
    ASSERT_TRUE(degrees);
    EXPECT_EQ(degrees->unit, "degree");
    EXPECT_EQ(degrees->unit_meters, 0.0);
    EXPECT_EQ(degrees->vertical_unit, "");

    const auto ellipsoidal = describe_crs("EPSG:4979");
    ASSERT_TRUE(ellipsoidal);
    EXPECT_EQ(ellipsoidal->unit, "degree");
    EXPECT_EQ(ellipsoidal->vertical_unit, "metre");

    const auto earth_centered = describe_crs("EPSG:4978");
    ASSERT_TRUE(earth_centered);
    EXPECT_EQ(earth_centered->unit, "metre");
    EXPECT_EQ(earth_centered->vertical_unit, "metre");
}

TEST(CrsText, ALocalSystemHasTheUnitThatItSays) {
    EXPECT_EQ(describe_crs("LOCAL_CS[\"here\"]").value().unit, "");
    EXPECT_EQ(describe_crs("LOCAL_CS[\"here\",UNIT[\"foot\",0.3048]]").value().unit, "foot");
    EXPECT_EQ(describe_crs("LOCAL_CS[\"here\",UNIT[\"foot\",0.3048]]").value().unit_meters, 0.3048);
}

TEST(CrsText, AShiftToWgs84DoesNotHideTheSystem) {
    const auto described = describe_crs("+proj=utm +zone=33 +ellps=bessel +towgs84=582,105,414,1.04,0.35,-3.08,8.3");
    ASSERT_TRUE(described);
    EXPECT_EQ(described->unit, "metre");
}

TEST(CrsText, WithoutTheDatabaseCodesMeanNothing) {
    const std::string wkt = wkt1_of_crs("EPSG:25832");
    const WithoutDatabase hidden;
    EXPECT_EQ(wkt1_of_crs("EPSG:25832"), "");
    EXPECT_FALSE(describe_crs("EPSG:25832"));
    EXPECT_EQ(crs_name("EPSG:25832"), "EPSG:25832");
    EXPECT_TRUE(same_crs("EPSG:25832", "EPSG:25832"));
    const auto described = describe_crs(wkt);  // WKT says all by itself
    ASSERT_TRUE(described);
    EXPECT_EQ(described->name, "ETRS89 / UTM zone 32N");
    EXPECT_EQ(described->unit, "metre");
}

TEST(CrsText, NamesAreShort) {
    EXPECT_EQ(crs_name("EPSG:32632"), "EPSG:32632 WGS 84 / UTM zone 32N");
    EXPECT_EQ(crs_name(wkt1_of_crs("EPSG:32632")), "EPSG:32632 WGS 84 / UTM zone 32N");
    EXPECT_EQ(crs_name("mine"), "mine");
    EXPECT_EQ(crs_name(std::string(100, 'x')), std::string(60, 'x') + "...");
}

}  // namespace
}  // namespace strata
