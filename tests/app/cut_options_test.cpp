#include "app/cut_options.h"

#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "core/error.h"

namespace strata {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::string message_of(const std::function<void()>& action) {
    try {
        action();
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, ErrorKind::usage);
        return error.what();
    }
    return "no error";
}

TEST(CutOptions, BoxesAreSixNumbersEach) {
    const std::vector<ClipBox> boxes = parse_clip_boxes("--clip", "1,2,3,4,5,6;,,470.5,,,470.5", ClipBox::Action::remove);
    ASSERT_EQ(boxes.size(), 2u);
    EXPECT_EQ(boxes[0], (ClipBox{{.min = {1, 2, 3}, .max = {4, 5, 6}}, ClipBox::Action::remove}));
    EXPECT_EQ(boxes[1].box.min, Vec3d(-kInfinity, -kInfinity, 470.5));
    EXPECT_EQ(boxes[1].box.max, Vec3d(kInfinity, kInfinity, 470.5));
}

TEST(CutOptions, WrongBoxesSayWhatIsWrong) {
    const auto message = [](const std::string& text) {
        return message_of([&] { parse_clip_boxes("--clip", text, ClipBox::Action::keep); });
    };
    EXPECT_EQ(message("1,2,3,4,1.5,6"), "--clip: the box's least y, 2, is above its most, 1.5");
    EXPECT_EQ(message("1,2,3,4,5"), "--clip: expected xmin,ymin,zmin,xmax,ymax,zmax, got '1,2,3,4,5'");
    EXPECT_EQ(message("1,2,3,4,5,nan"), "--clip: expected a number, got 'nan'");
    EXPECT_EQ(message("1,2,3,4,5,inf"), "--clip: expected a number, got 'inf'");
    EXPECT_EQ(message("1,2,3,4,5,6m"), "--clip: expected a number, got '6m'");
    EXPECT_NE(message("1,2,3,4,5,6;"), "no error");
}

TEST(CutOptions, FiltersAreListsAndRanges) {
    const std::vector<FilterTerm> terms = parse_filter("--filter", "class=2,6:7;scan angle=-10:;rgb[1]=:5");
    ASSERT_EQ(terms.size(), 3u);
    EXPECT_EQ(terms[0].name, "class");
    ASSERT_EQ(terms[0].ranges.size(), 2u);
    EXPECT_EQ(terms[0].ranges[0].min, 2);
    EXPECT_EQ(terms[0].ranges[0].max, 2);
    EXPECT_EQ(terms[0].ranges[1].min, 6);
    EXPECT_EQ(terms[0].ranges[1].max, 7);
    EXPECT_EQ(terms[1].name, "scan angle");
    EXPECT_EQ(terms[1].ranges[0].min, -10);
    EXPECT_EQ(terms[1].ranges[0].max, kInfinity);
    EXPECT_EQ(terms[2].ranges[0].min, -kInfinity);
}

TEST(CutOptions, WrongFiltersSayWhatIsWrong) {
    const auto message = [](const std::string& text) { return message_of([&] { parse_filter("--filter", text); }); };
    EXPECT_EQ(message("class=6:2"), "--filter class: expected a range from low to high, got '6:2'");
    EXPECT_EQ(message("class=2,"), "--filter class: expected a number, got ''");
    EXPECT_EQ(message("class=nan"), "--filter class: expected a number, got 'nan'");
    for (const char* text : {"class", "=2", "class=2;", "", "class=1:2:3"}) EXPECT_NE(message(text), "no error") << text;
}

}  // namespace
}  // namespace strata
