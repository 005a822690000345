#include "core/simulate/survey.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <vector>

#include "core/error.h"
#include "core/simulate/scan_cloud.h"
#include "core/simulate/scan_stream.h"

namespace strata {
namespace {

std::vector<ScanPoint> scan(const SurveySettings& settings, int threads = 2) {
    const VillageScene scene(1);
    const Survey survey(scene, settings);
    std::vector<ScanPoint> all;
    stream_scan(scene, survey, threads, [&](std::span<const ScanPoint> points) { all.insert(all.end(), points.begin(), points.end()); });
    return all;
}

class Modes : public testing::TestWithParam<SurveyMode> {};
INSTANTIATE_TEST_SUITE_P(All, Modes, testing::Values(SurveyMode::airborne, SurveyMode::terrestrial, SurveyMode::both));

TEST_P(Modes, WritesExactlyTheCount) {
    for (const uint64_t count : {1u, 2u, 999u, 30'011u}) EXPECT_EQ(scan({.points = count, .mode = GetParam()}).size(), count);
}

// Without noise every point but leaves lies on the exposed surface. 1e-9: terrain to 1e-10 m of height, planes and tubes to rounding.
TEST_P(Modes, NoiseFreePointsLieOnTheSurface) {
    const VillageScene scene(1);
    SceneProbe probe(scene);
    std::map<Part, int> seen;
    const std::vector<ScanPoint> points = scan({.points = 40'000, .noise = 0.0, .mode = GetParam()});
    for (size_t i = 0; i < points.size(); i += 5) {
        if (points[i].part == Part::leaf) continue;
        ++seen[points[i].part];
        ASSERT_LT(probe.nearest_surface(points[i].position).distance, 1e-9)
            << "part " << int(points[i].part) << " at " << points[i].position.transpose();
    }
    for (const Part part : {Part::ground, Part::roof, Part::wall}) EXPECT_GT(seen[part], 20) << int(part);
}

TEST_P(Modes, TheSameForAnyNumberOfThreads) {
    const SurveySettings settings{.points = 150'000, .noise = 0.02, .seed = 9, .mode = GetParam()};
    const std::vector<ScanPoint> one = scan(settings, 1);
    for (const int threads : {2, 7}) {
        const std::vector<ScanPoint> many = scan(settings, threads);
        ASSERT_EQ(one.size(), many.size());
        for (size_t i = 0; i < one.size(); ++i) {
            ASSERT_EQ(one[i].position, many[i].position) << i;
            ASSERT_EQ(one[i].gps_time, many[i].gps_time) << i;
            ASSERT_EQ(one[i].red, many[i].red) << i;
            ASSERT_EQ(one[i].intensity, many[i].intensity) << i;
        }
    }
}

// The same pulses with and without noise meet the same surfaces, so the difference is the noise alone. Its mean is within
// 5 sigma / sqrt(n), its deviation within 5 sigma / sqrt(2 n).
TEST(Survey, NoiseHasTheDeviationThatWasAsked) {
    constexpr double kSigma = 0.03;
    const std::vector<ScanPoint> exact = scan({.points = 50'000, .noise = 0.0, .mode = SurveyMode::airborne});
    const std::vector<ScanPoint> noisy = scan({.points = 50'000, .noise = kSigma, .mode = SurveyMode::airborne});
    ASSERT_EQ(exact.size(), noisy.size());
    double sum = 0.0, sum2 = 0.0;
    for (size_t i = 0; i < exact.size(); ++i) {
        ASSERT_EQ(exact[i].gps_time, noisy[i].gps_time);
        const Vec3d difference = noisy[i].position - exact[i].position;
        const double along = std::copysign(difference.norm(), -difference.z());  // beams go down
        sum += along;
        sum2 += along * along;
    }
    const double n = double(exact.size());
    EXPECT_NEAR(sum / n, 0.0, 5.0 * kSigma / std::sqrt(n));
    EXPECT_NEAR(std::sqrt(sum2 / n), kSigma, 5.0 * kSigma / std::sqrt(2.0 * n));
}

// Nothing solid stands between a station and what it measured: samples along each beam are in the open.
TEST(Survey, NoPointBehindAWall) {
    const VillageScene scene(1);
    const SurveySettings settings{.points = 12'000, .noise = 0.0, .mode = SurveyMode::terrestrial};
    const Survey survey(scene, settings);
    SceneProbe probe(scene);
    std::map<int, Vec3d> eyes;
    for (const SurveyPart& part : survey.parts()) eyes[part.source_id] = part.station.eye;
    const std::vector<ScanPoint> points = scan(settings);
    int walls = 0;
    for (size_t i = 0; i < points.size(); i += 13) {
        const Vec3d eye = eyes.at(points[i].source_id), way = points[i].position - eye;
        walls += points[i].part == Part::wall;
        const int samples = int(way.norm() / 0.25) + 2;
        for (int k = 1; k < samples; ++k) ASSERT_FALSE(probe.buried(eye + way * (double(k) / samples), 1e-6)) << i << " at " << k << "/" << samples;
    }
    EXPECT_GT(walls, 20);
}

TEST(Survey, EchoesOfAPulseAreNumberedAndOrdered) {
    const std::vector<ScanPoint> points = scan({.points = 60'000, .noise = 0.0, .mode = SurveyMode::airborne});
    size_t several = 0;
    for (size_t i = 0; i < points.size();) {
        const size_t count = points[i].return_count;
        ASSERT_GE(count, 1u);
        if (i + count > points.size()) break;  // the last pulse may be cut
        for (size_t k = 0; k < count; ++k) {
            ASSERT_EQ(points[i + k].return_number, k + 1);
            ASSERT_EQ(points[i + k].return_count, count);
            ASSERT_EQ(points[i + k].gps_time, points[i].gps_time);
            if (k > 0) {
                ASSERT_LT(points[i + k].position.z(), points[i + k - 1].position.z());
            }
        }
        several += count > 1;
        if (i > 0) {
            ASSERT_GT(points[i].gps_time, points[i - 1].gps_time);
        }
        i += count;
    }
    EXPECT_GT(several, 300u);
}

TEST(Survey, StripsOverlapAndHaveEdges) {
    const std::vector<ScanPoint> points = scan({.points = 60'000, .noise = 0.0, .mode = SurveyMode::airborne});
    std::map<int, std::pair<double, double>> reach;  // of each strip, north
    size_t edges = 0;
    for (const ScanPoint& p : points) {
        auto [strip, fresh] = reach.try_emplace(p.source_id, p.position.y(), p.position.y());
        strip->second.first = std::min(strip->second.first, p.position.y());
        strip->second.second = std::max(strip->second.second, p.position.y());
        edges += p.line_edge;
        EXPECT_LE(std::abs(p.scan_angle * 0.006), 25.1);
    }
    ASSERT_EQ(reach.size(), 2u);
    EXPECT_GT(reach.begin()->second.second, reach.rbegin()->second.first);
    EXPECT_GT(edges, 50u);
}

// At the border of a swath the lines of one channel are two advances apart, and those of the other channel fall anywhere between.
// Wider gaps are the shadows of houses and trees, which take about one in a hundred here.
TEST(Survey, ScanLinesLeaveNoStripesOfGroundOut) {
    const VillageScene scene(1);
    const SurveySettings settings{.points = 100'000, .noise = 0.0, .mode = SurveyMode::airborne};
    const Survey survey(scene, settings);
    const AirborneStrips& strips = survey.parts()[0].strips;
    const double advance = strips.extent / double(strips.lines);
    std::map<std::pair<int, int>, std::vector<double>> tracks;  // by strip and degree of scan angle: places along the flight
    for (const ScanPoint& p : scan(settings)) {
        const int degree = int(std::lround(p.scan_angle * 0.006));
        if (p.part == Part::ground && std::abs(degree) >= 23) tracks[{p.source_id, degree}].push_back(p.position.x());
    }
    size_t gaps = 0, wide = 0;
    for (auto& [track, places] : tracks) {
        std::sort(places.begin(), places.end());
        for (size_t i = 1; i < places.size(); ++i) {
            ++gaps;
            wide += places[i] - places[i - 1] > 2.5 * advance;
        }
    }
    EXPECT_GT(gaps, 3000u);
    EXPECT_LT(double(wide), 0.02 * double(gaps));
}

// Water answers beams that fall onto it: the pond of the village is a sheet, nearly as dense as the lawn around it.
TEST(Survey, ThePondIsScanned) {
    const std::vector<ScanPoint> points = scan({.points = 200'000, .noise = 0.0, .mode = SurveyMode::airborne});
    size_t answers = 0;
    std::set<std::pair<int, int>> squares;  // of 1 m
    for (const ScanPoint& p : points) {
        if (p.part != Part::water) continue;
        ++answers;
        squares.insert({int(std::floor(p.position.x())), int(std::floor(p.position.y()))});
    }
    EXPECT_GT(squares.size(), 300u);
    EXPECT_GT(answers, 5 * squares.size());
}

TEST(Survey, ClassesOfAVillageAreThere) {
    std::set<int> classes;
    for (const ScanPoint& p : scan({.points = 200'000, .mode = SurveyMode::both})) classes.insert(p.classification);
    for (const int expected : {2, 5, 6, 9, 11, 14, 15}) EXPECT_TRUE(classes.contains(expected)) << expected;
}

TEST(ScanCloud, PositionsAreRoundedToTheNearestMillimetreInUtm) {
    ScanPoint point;
    point.position = Vec3d(-12.3456, 7.0004, 1.2346);
    PointBatch batch;
    fill_scan_batch(std::span(&point, 1), batch);
    const Vec3d world = scan_quantization().world_from_quanta({batch.x[0], batch.y[0], batch.z[0]});
    EXPECT_LE((world - scan_origin() - point.position).cwiseAbs().maxCoeff(), 0.0005 + 1e-9);
    for (const double offset : {scan_quantization().offset.x(), scan_quantization().offset.y()}) EXPECT_EQ(std::fmod(offset, 1000.0), 0.0);
}

TEST(StreamScan, AFailingSinkEndsAllThreads) {
    const VillageScene scene(1);
    const Survey survey(scene, {.points = 400'000});
    EXPECT_THROW(stream_scan(scene, survey, 3, [](std::span<const ScanPoint>) { throw Error(ErrorKind::io, "full"); }), Error);
}

}  // namespace
}  // namespace strata
