#include "io/world_file.h"

#include <gtest/gtest.h>

#include <charconv>
#include <sstream>
#include <vector>

namespace strata {
namespace {

TEST(WorldFile, LinesAreInTheOrderThatGisProgramsRead) {
    const PictureGeoreference g{.right_step = {0.25, 0}, .down_step = {-0.0, -0.25}, .first_center = {691000.125, 5334999.875}};
    EXPECT_EQ(world_file_text(g), "0.25\n0\n0\n-0.25\n691000.125\n5334999.875\n");
}

TEST(WorldFile, NumbersComeBackToTheLastBitWithoutExponents) {
    const PictureGeoreference g{.right_step = {0.1, 1e-9}, .down_step = {1.0 / 3.0, -1e-300}, .first_center = {691000.1, -5.3e15}};
    const std::string text = world_file_text(g);
    EXPECT_EQ(text.find('e'), std::string::npos);
    std::istringstream lines(text);
    std::vector<double> values;
    for (std::string line; std::getline(lines, line);) {
        double value = 0;
        std::from_chars(line.data(), line.data() + line.size(), value);
        values.push_back(value);
    }
    EXPECT_EQ(values, (std::vector<double>{0.1, 1e-9, 1.0 / 3.0, -1e-300, 691000.1, -5.3e15}));
}

TEST(WorldFile, TakesThePicturesNameWithItsOwnEnding) {
    EXPECT_EQ(world_file_path("a.b/top.view.png"), "a.b/top.view.pgw");
    EXPECT_EQ(world_file_path("a.b/top"), "a.b/top.pgw");
}

}  // namespace
}  // namespace strata
