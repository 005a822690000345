#include "io/crs/reprojected_source.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "core/error.h"
#include "io/crs/crs_text.h"
#include "tests/support/memory_source.h"
#include "tests/support/points_of.h"

namespace strata {
namespace {

std::unique_ptr<MemorySource> cloud_in(const std::string& crs, const Quantization& quantization, std::vector<Vec3i> quanta) {
    auto source = std::make_unique<MemorySource>(std::move(quanta));
    source->changeable_info().crs = crs;
    source->changeable_info().quantization = quantization;
    return source;
}

// Steps of a hundred-thousandth of a meter on the ground.
Quantization degrees_at(double longitude, double latitude) { return {Vec3d(1e-10, 1e-10, 1e-5), Vec3d(longitude, latitude, 0.0)}; }

std::vector<Vec3d> places_of(const PointSource& source) {
    const PointBatch points = test::points_of(source);
    std::vector<Vec3d> places;
    for (size_t i = 0; i < points.size; ++i)
        places.push_back(source.info().quantization.world_from_quanta({points.x[i], points.y[i], points.z[i]}));
    return places;
}

// One place, transformed. The cloud's steps are 1e-5 m.
Vec3d transformed(const std::string& from, const Quantization& quantization, const std::string& to, const Vec3i& quanta = Vec3i::Zero()) {
    return places_of(*reproject_points(cloud_in(from, quantization, {quanta}), to, "cloud", 1)).at(0);
}

// A scan of 400 m, in millimeters of UTM zone 32.
std::unique_ptr<MemorySource> utm_scan(const std::string& crs = "EPSG:32632", int points = 25'000) {
    std::mt19937 random(7);
    std::vector<Vec3i> quanta;
    for (int i = 0; i < points; ++i) quanta.push_back(Vec3i(int(random() % 400'000), int(random() % 400'000), int(random() % 60'000)));
    return cloud_in(crs, {Vec3d::Constant(0.001), Vec3d(690'000.0, 5'330'000.0, 400.0)}, std::move(quanta));
}

TEST(ReprojectedSource, TheSameSystemIsTheSourceItself) {
    auto before = utm_scan();
    before->changeable_info().crs_records.resize(1);
    const PointSource* const same = before.get();
    const auto after = reproject_points(std::move(before), wkt1_of_crs("EPSG:32632"), "cloud", 2);
    EXPECT_EQ(after.get(), same);
    EXPECT_EQ(after->info().crs, "EPSG:32632");
    EXPECT_EQ(after->info().crs_records.size(), 1u);
    EXPECT_TRUE(after->info().notes.empty());
    EXPECT_EQ(reproject_points(utm_scan("+proj=utm +zone=32 +datum=WGS84", 10), "EPSG:32632", "cloud", 2)->info().crs, "EPSG:32632");
}

// The series of Helmert (1880) for the length of the meridian, in the third flattening; its fifth powers are nanometers.
double meridian_arc(double latitude) {
    constexpr double a = 6378137.0, f = 1.0 / 298.257223563, n = f / (2.0 - f);
    const double p = latitude * std::numbers::pi / 180.0;
    return a / (1.0 + n) *
           ((1.0 + n * n / 4.0 + n * n * n * n / 64.0) * p - 1.5 * (n - n * n * n / 8.0) * std::sin(2 * p) +
            15.0 / 16.0 * (n * n - n * n * n * n / 4.0) * std::sin(4 * p) - 35.0 / 48.0 * n * n * n * std::sin(6 * p) +
            315.0 / 512.0 * n * n * n * n * std::sin(8 * p));
}

TEST(ReprojectedSource, OnTheCentralMeridianOfAZone) {
    for (const double latitude : {0.0, 10.0, 48.0, 71.0, 83.0}) {
        const Vec3d place = transformed("EPSG:4326", degrees_at(9.0, latitude), "EPSG:32632", {0, 0, 123});
        EXPECT_EQ(place.x(), 500000.0) << latitude;
        EXPECT_NEAR(place.y(), 0.9996 * meridian_arc(latitude), 1e-5) << latitude;
        EXPECT_EQ(place.z(), 123 * 1e-5);
    }
}

TEST(ReprojectedSource, EarthCenteredCoordinates) {
    constexpr double a = 6378137.0, b = 6356752.314245179;
    const double h = 1e4 * 1e-5;
    const auto to_earth = [&](double longitude, double latitude, const char* from = "EPSG:4979") {
        return transformed(from, degrees_at(longitude, latitude), "EPSG:4978", {0, 0, 10'000});
    };
    EXPECT_LT((to_earth(0.0, 0.0) - Vec3d(a + h, 0.0, 0.0)).norm(), 1e-5);
    EXPECT_LT((to_earth(90.0, 0.0) - Vec3d(0.0, a + h, 0.0)).norm(), 1e-5);
    EXPECT_LT((to_earth(-180.0, 0.0) - Vec3d(-a - h, 0.0, 0.0)).norm(), 1e-5);
    EXPECT_LT((to_earth(0.0, 90.0) - Vec3d(0.0, 0.0, b + h)).norm(), 1e-5);
    EXPECT_LT((to_earth(0.0, 90.0, "EPSG:4326") - Vec3d(0.0, 0.0, b + h)).norm(), 1e-5);  // nothing said of heights
    // And back.
    const Quantization pole = {Vec3d::Constant(1e-3), Vec3d(0.0, 0.0, 6356752.314)};
    const Vec3d place = transformed("EPSG:4978", pole, "EPSG:4979", {0, 0, 5000});
    EXPECT_NEAR(place.y(), 90.0, 1e-8);
    EXPECT_NEAR(place.z(), 5.0 - 0.000245, 0.0005 + 1e-9);
}

// x is the one to the east, whatever comes first in the registry: 3035 and 4326 begin with the north.
TEST(ReprojectedSource, EastIsX) {
    EXPECT_LT((transformed("EPSG:4258", degrees_at(10.0, 52.0), "EPSG:3035") - Vec3d(4'321'000.0, 3'210'000.0, 0.0)).norm(), 1e-5);
    const Vec3d back = transformed("EPSG:3035", {Vec3d::Constant(1e-5), Vec3d(4'321'000.0, 3'210'000.0, 0.0)}, "EPSG:4258");
    EXPECT_LT((back - Vec3d(10.0, 52.0, 0.0)).norm(), 1e-9);
}

// Gauss-Krueger zone 3 and its base, the north or the latitude first, with the shift to WGS 84 in the datum; DHHN92 heights or none.
std::string old_german(const char* kind, bool heights) {
    const std::string base = "GEOGCS[\"DHDN\",DATUM[\"Deutsches_Hauptdreiecksnetz\",SPHEROID[\"Bessel 1841\",6377397.155,299.1528128],"
                             "TOWGS84[598.1,73.7,418.2,0.202,0.045,-2.455,6.7]],PRIMEM[\"Greenwich\",0],UNIT[\"degree\",0.0174532925199433]";
    std::string plane = base + ",AXIS[\"Latitude\",NORTH],AXIS[\"Longitude\",EAST]]";
    if (kind == std::string("projected"))
        plane = "PROJCS[\"DHDN / Gauss-Kruger zone 3\"," + base +
                "],PROJECTION[\"Transverse_Mercator\"],PARAMETER[\"latitude_of_origin\",0],PARAMETER[\"central_meridian\",9],"
                "PARAMETER[\"scale_factor\",1],PARAMETER[\"false_easting\",3500000],PARAMETER[\"false_northing\",0],UNIT[\"metre\",1],"
                "AXIS[\"Northing\",NORTH],AXIS[\"Easting\",EAST]]";
    if (!heights) return plane;
    return "COMPD_CS[\"with heights\"," + plane + ",VERT_CS[\"DHHN92 height\",VERT_DATUM[\"Deutsches Haupthoehennetz 1992\",2005,"
           "AUTHORITY[\"EPSG\",\"5181\"]],UNIT[\"metre\",1],AXIS[\"Up\",UP],AUTHORITY[\"EPSG\",\"5783\"]]]";
}

// Heights that stay as they are leave x and y where the system of the plane alone has them, and east remains x.
TEST(ReprojectedSource, EastIsXInACompoundSystemWithAShiftToWgs84) {
    const Quantization gauss = {Vec3d::Constant(1e-5), Vec3d(3'500'000.0, 5'400'000.0, 0.0)};
    const Quantization utm = {Vec3d::Constant(1e-5), Vec3d(500'000.0, 5'398'000.0, 0.0)};
    const Vec3i high(0, 0, 10'000'000);
    for (const char* const kind : {"projected", "geographic"}) {
        const bool projected = kind == std::string("projected");
        const std::string plane = old_german(kind, false), solid = old_german(kind, true);
        const Quantization here = projected ? gauss : degrees_at(9.0, 48.7);
        // On the central meridian of both; the datums are some hundred meters apart.
        const Vec3d expected = transformed(plane, here, "EPSG:25832", high);
        EXPECT_NEAR(expected.x(), 500'000.0, 200.0) << kind;
        EXPECT_DOUBLE_EQ(expected.z(), 100.0) << kind;
        EXPECT_LT((transformed(solid, here, "EPSG:25832", high) - expected).cwiseAbs().maxCoeff(), 2e-5) << kind;
        // Between the same heights PROJ takes a grid for the plane where it has one: half a meter away.
        EXPECT_LT((transformed(solid, here, "EPSG:25832+5783", high) - expected).cwiseAbs().maxCoeff(), 1.0) << kind;
        const Vec3d there = transformed("EPSG:25832", utm, plane, high);
        EXPECT_NEAR(there.x(), projected ? 3'500'000.0 : 9.0, projected ? 200.0 : 0.01) << kind;
        for (const char* const from : {"EPSG:25832", "EPSG:25832+5783"})
            EXPECT_LT((transformed(from, utm, solid, high) - there).cwiseAbs().maxCoeff(), projected ? 2e-5 : 2e-10) << from << " to " << kind;
    }
}

TEST(ReprojectedSource, OutAndBackIsWithinOneQuantum) {
    for (const char* const there : {"EPSG:4326", "EPSG:4978", "EPSG:32633", "EPSG:3857", "EPSG:4979"}) {
        const auto before = utm_scan();
        auto out = reproject_points(utm_scan(), there, "cloud", 2);
        EXPECT_GT((out->info().bounds.min - places_of(*before).at(0)).norm(), 1000.0) << there;  // they are somewhere else
        const auto back = reproject_points(std::move(out), "EPSG:32632", "cloud", 2);
        const std::vector<Vec3d> expected = places_of(*before), found = places_of(*back);
        ASSERT_EQ(expected.size(), found.size());
        double worst = 0.0;
        for (size_t i = 0; i < found.size(); ++i) worst = std::max(worst, (expected[i] - found[i]).cwiseAbs().maxCoeff());
        EXPECT_LT(worst, 0.001 + 1e-6) << there;
    }
}

TEST(ReprojectedSource, StepsAreAsFineAsBefore) {
    const auto degrees = reproject_points(utm_scan(), "EPSG:4326", "cloud", 1);
    EXPECT_EQ(degrees->info().quantization.scale, Vec3d(1e-8, 1e-8, 0.001));
    EXPECT_EQ(degrees->info().quantization.offset, Vec3d(12.0, 48.0, 400.0));
    EXPECT_EQ(degrees->info().crs, "EPSG:4326");
    const auto earth = reproject_points(utm_scan(), "EPSG:4978", "cloud", 1);
    EXPECT_EQ(earth->info().quantization.scale, Vec3d::Constant(0.001));
    for (int axis = 0; axis < 3; ++axis) EXPECT_EQ(std::fmod(earth->info().quantization.offset[axis], 1000.0), 0.0);
    EXPECT_EQ(earth->info().worst_rounding, 0.0005);
    for (const PointSource* const source : {degrees.get(), earth.get()}) {
        Box3d bounds;
        for (const Vec3d& place : places_of(*source)) bounds.extend(place);
        EXPECT_EQ(source->info().bounds.min, bounds.min);
        EXPECT_EQ(source->info().bounds.max, bounds.max);
    }
}

// The definition of the zone in feet differs from that in meters by the foot alone: 3937 of them are 1200 m.
TEST(ReprojectedSource, FeetBecomeMeters) {
    const Quantization feet = {Vec3d::Constant(0.01), Vec3d(6'000'000.0, 2'000'000.0, 0.0)};
    const auto plane = reproject_points(cloud_in("EPSG:2225", feet, {Vec3i(100, 200, 300)}), "EPSG:26941", "cloud", 1);
    const Vec3d place = places_of(*plane).at(0);
    EXPECT_NEAR(place.x(), 6'000'001.0 * 1200.0 / 3937.0, 0.0005 + 1e-4);  // the registry rounds the false easting to 0.1 mm
    EXPECT_NEAR(place.y(), 2'000'002.0 * 1200.0 / 3937.0, 0.0005 + 1e-4);
    EXPECT_EQ(place.z(), 3.0);
    EXPECT_EQ(plane->info().quantization.scale, Vec3d(0.001, 0.001, 0.01));
    ASSERT_EQ(plane->info().notes.size(), 1u);
    EXPECT_NE(plane->info().notes[0].find("heights stay the numbers"), std::string::npos);
    const auto solid = reproject_points(cloud_in("EPSG:2225+6360", feet, {Vec3i(100, 200, 300)}), "EPSG:26941+5703", "cloud", 1);
    EXPECT_NEAR(places_of(*solid).at(0).z(), 3.0 * 1200.0 / 3937.0, 0.0005 + 1e-9);
}

TEST(ReprojectedSource, AWiderScaleIsSaid) {
    const auto world = reproject_points(cloud_in("EPSG:4979", {Vec3d(1e-7, 1e-7, 1e-3), Vec3d::Zero()}, {Vec3i(0, 0, 0), Vec3i(1'800'000'000, 0, 0)}),
                                        "EPSG:4978", "cloud", 1);
    EXPECT_EQ(world->info().quantization.scale, Vec3d(0.01, 0.001, 0.001));
    ASSERT_EQ(world->info().notes.size(), 1u);
    EXPECT_EQ(world->info().notes[0], "the x scale is widened to 0.01 to hold all points");
    EXPECT_EQ(places_of(*world).at(0).x(), 6378137.0);
}

TEST(ReprojectedSource, ThreadsDoNotShow) {
    const auto one = reproject_points(utm_scan(), "EPSG:4978", "cloud", 1), four = reproject_points(utm_scan(), "EPSG:4978", "cloud", 4);
    EXPECT_TRUE(one->info().quantization == four->info().quantization);
    const PointBatch a = test::points_of(*one), b = test::points_of(*four);
    EXPECT_EQ(a.x, b.x);
    EXPECT_EQ(a.y, b.y);
    EXPECT_EQ(a.z, b.z);
    EXPECT_EQ(a.columns, b.columns);
}

std::string refusal(std::unique_ptr<PointSource> source, const std::string& to, ErrorKind kind) {
    try {
        (void)reproject_points(std::move(source), to, "scan.las", 2);
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, kind) << error.what();
        return error.what();
    }
    return "accepted";
}

TEST(ReprojectedSource, APointWithoutAPlaceIsNamed) {
    std::vector<Vec3i> quanta(25'000, Vec3i(9, 48, 0));
    quanta[12'344] = Vec3i(9, 95, 7);
    quanta[23'000] = Vec3i(9, 96, 7);
    const std::string message = refusal(cloud_in("EPSG:4326", {Vec3d::Ones(), Vec3d::Zero()}, quanta), "EPSG:32632", ErrorKind::limit);
    EXPECT_TRUE(message.starts_with("scan.las: point 12345, at 9, 95, 7, has no place in WGS 84 / UTM zone 32N: ")) << message;
}

TEST(ReprojectedSource, WhatHasNoWayIsRefused) {
    const Quantization q;
    EXPECT_EQ(refusal(cloud_in("", q, {}), "EPSG:4326", ErrorKind::unsupported),
              "scan.las: the file does not say its coordinate reference system; say it, as in --in-crs EPSG:25832");
    EXPECT_TRUE(refusal(cloud_in("mine", q, {}), "EPSG:4326", ErrorKind::usage).starts_with("scan.las: 'mine' is no coordinate reference system that PROJ knows"));
    EXPECT_TRUE(refusal(cloud_in("EPSG:4326", q, {}), "EPSG:99999", ErrorKind::usage).starts_with("scan.las: 'EPSG:99999' is no"));
    EXPECT_TRUE(refusal(cloud_in("LOCAL_CS[\"here\",UNIT[\"metre\",1]]", q, {}), "EPSG:4326", ErrorKind::unsupported).starts_with("scan.las: PROJ knows no way from here to"));
    // Heights of a datum that nobody has related to anything.
    const std::string utm = wkt1_of_crs("EPSG:32632");
    const std::string own = "COMPD_CS[\"own\"," + utm + ",VERT_CS[\"mine\",VERT_DATUM[\"mine\",2005],UNIT[\"metre\",1],AXIS[\"Up\",UP]]]";
    const std::string message = refusal(utm_scan(own, 10), "EPSG:4978", ErrorKind::unsupported);
    EXPECT_TRUE(message.starts_with("scan.las: PROJ lacks the grid that brings heights from ")) << message;
    EXPECT_EQ(refusal(utm_scan(own, 10), "EPSG:32633", ErrorKind::unsupported), "accepted");  // heights are no business of 32633
}

TEST(ReprojectedSource, WhatIsRoughIsSaid) {
    const auto unknown = reproject_points(utm_scan("+proj=utm +zone=32 +ellps=bessel", 10), "EPSG:4326", "cloud", 1);
    ASSERT_EQ(unknown->info().notes.size(), 1u);
    EXPECT_NE(unknown->info().notes[0].find("is not known: they are taken for one"), std::string::npos) << unknown->info().notes[0];
    const auto heights = reproject_points(utm_scan("EPSG:32632", 10), "EPSG:4978", "cloud", 1);
    ASSERT_EQ(heights->info().notes.size(), 1u);
    EXPECT_EQ(heights->info().notes[0], "WGS 84 / UTM zone 32N says nothing of heights: they are taken for meters above the ellipsoid, unless --in-crs says more");
}

TEST(ReprojectedSource, NoPointsHaveNoBounds) {
    const auto none = reproject_points(cloud_in("EPSG:32632", {}, {}), "EPSG:4326", "cloud", 2);
    EXPECT_TRUE(none->info().bounds.empty());
    EXPECT_EQ(none->info().quantization.scale.x(), 1e-8);
}

TEST(ReprojectedSource, AProjStringIsKeptAsWkt) {
    const auto there = reproject_points(utm_scan("EPSG:32632", 10), "+proj=utm +zone=33 +datum=WGS84", "cloud", 1);
    EXPECT_TRUE(there->info().crs.starts_with("PROJCS[")) << there->info().crs;
    EXPECT_TRUE(same_crs(there->info().crs, "EPSG:32633"));
}

TEST(ReprojectedSource, ASystemMayBeSaidByTheCaller) {
    const auto said = with_crs(cloud_in("", {}, {Vec3i(1, 2, 3)}), "EPSG:25832");
    EXPECT_EQ(said->info().crs, "EPSG:25832");
    EXPECT_TRUE(said->info().notes.empty());
    EXPECT_EQ(test::points_of(*said).y, std::vector<int32_t>{2});
    const auto overridden = with_crs(cloud_in("EPSG:25833", {}, {}), "EPSG:25832");
    EXPECT_EQ(overridden->info().crs, "EPSG:25832");
    EXPECT_EQ(overridden->info().notes, std::vector<std::string>{"its coordinate reference system, EPSG:25833 ETRS89 / UTM zone 33N, is taken for EPSG:25832 "
                                                                 "ETRS89 / UTM zone 32N"});
}

}  // namespace
}  // namespace strata
