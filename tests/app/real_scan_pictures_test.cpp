// Pictures of real scans by the real program, against baselines: airborne scans of a park at a river in feet (autzen_trim), of
// a forest (4_6_crop), and of open ground seen at 4 points a square meter (sample_c); and a statue, from a COPC file.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "tests/support/baseline.h"

namespace strata {
namespace {

namespace fs = std::filesystem;

struct Picture {
    const char* name;
    const char* scan;
    std::vector<std::string> words;
};

void PrintTo(const Picture& picture, std::ostream* out) { *out << picture.name; }

class RealScanPictures : public testing::TestWithParam<Picture> {};

TEST_P(RealScanPictures, AgreeWithTheBaselines) {
    const Picture& picture = GetParam();
    const char* const data = std::getenv("STRATA_DATA");
    const fs::path scan = fs::path(data ? data : "") / picture.scan;
    if (!data || !fs::exists(scan)) GTEST_SKIP() << "STRATA_DATA names no folder with real scans";
    std::vector<std::string> words = {scan.string()};
    words.insert(words.end(), picture.words.begin(), picture.words.end());
    test::expect_baseline(picture.name, words);
}

INSTANTIATE_TEST_SUITE_P(, RealScanPictures,
                         testing::Values(Picture{"park", "las/autzen_trim.las", {}},
                                         Picture{"park_bank_samples", "las/autzen_trim.las",
                                                 {"--eye", "636620,849480,470", "--target", "636760,849240,420", "--samples", "4"}},
                                         Picture{"forest_returns", "las/4_6_crop.las", {"--color", "return", "--splat", "disc", "--edl", "1,4"}},
                                         Picture{"forest_ssao", "las/4_6_crop.las", {"--color", "elevation", "--ssao", "--edl", "0"}},
                                         Picture{"statue", "copc/lion_takanawa.copc.laz", {"--view", "front", "--splat", "gaussian"}},
                                         Picture{"ground_fill", "las/sample_c.las", {"--fill", "--splat", "square", "--point-size", "3"}}),
                         [](const testing::TestParamInfo<Picture>& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace strata
