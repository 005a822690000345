#include "render/colormap.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "core/error.h"
#include "render/srgb.h"

namespace strata {
namespace {

Vec3d oklab_of(Rgba8 color) {
    const auto& linear = linear_from_srgb8();
    return oklab_from_linear(Vec3d(linear[red_of(color)], linear[green_of(color)], linear[blue_of(color)]));
}

// Rounding to 8 bits moves a color by at most half a code an axis: measured over the sRGB cube, up to 0.003 in OKLab for
// colors of lightness above 0.25, and more near black, where a code is a large step.
constexpr double kRounding = 0.004;
constexpr size_t kSteps = 32;

class EveryColormap : public testing::TestWithParam<ColormapName> {};

INSTANTIATE_TEST_SUITE_P(Names, EveryColormap, testing::ValuesIn(all_colormaps().begin(), all_colormaps().end()),
                         [](const auto& test) { return std::string(test.param.name); });

// Equal differences of the value look equally large: of 32 steps, none differs from the mean by more than 12 %.
TEST_P(EveryColormap, StepsAreEqual) {
    const Colormap map(GetParam().name);
    std::vector<double> lengths;
    for (size_t i = 0; i < kSteps; ++i) {
        // Along the curve, in small chords, not across it.
        double length = 0;
        constexpr size_t kChords = 4;
        for (size_t k = 0; k < kChords; ++k)
            length += (oklab_of(map.color(double(i * kChords + k + 1) / (kSteps * kChords))) -
                       oklab_of(map.color(double(i * kChords + k) / (kSteps * kChords)))).norm();
        lengths.push_back(length);
    }
    double mean = 0;
    for (const double length : lengths) mean += length / kSteps;
    for (size_t i = 0; i < kSteps; ++i) {
        if (oklab_of(map.color(double(i) / kSteps)).x() < 0.25) continue;  // rounding rules there
        EXPECT_NEAR(lengths[i], mean, 0.12 * mean) << "step " << i;
    }
}

TEST_P(EveryColormap, LightnessFollowsTheKind) {
    const Colormap map(GetParam().name);
    std::vector<double> lightness;
    for (const Rgba8 color : map.colors()) lightness.push_back(oklab_of(color).x());
    const auto rises = [](auto first, auto last) {
        for (auto next = first; next != last; ++next) {
            if (*next < *first - kRounding) return false;
            first = *next > *first ? next : first;
        }
        return true;
    };
    switch (GetParam().kind) {
        case ColormapKind::sequential:
            EXPECT_TRUE(rises(lightness.begin(), lightness.end()));
            EXPECT_GT(lightness.back() - lightness.front(), 0.6);
            break;
        case ColormapKind::diverging: {
            const auto middle = std::max_element(lightness.begin(), lightness.end());
            EXPECT_NEAR(double(middle - lightness.begin()), Colormap::kColors / 2.0, 0.03 * Colormap::kColors);
            EXPECT_TRUE(rises(lightness.begin(), middle));
            EXPECT_TRUE(rises(lightness.rbegin(), std::make_reverse_iterator(middle)));
            EXPECT_NEAR(lightness.front(), lightness.back(), 0.02);  // neither side looks heavier
            break;
        }
        case ColormapKind::rainbow: EXPECT_GT(*std::min_element(lightness.begin(), lightness.end()), 0.35); break;
    }
}

TEST(Colormap, ValuesOutsideAreClamped) {
    const Colormap map("fjord");
    EXPECT_EQ(map.color(-5.0), map.colors().front());
    EXPECT_EQ(map.color(7.0), map.colors().back());
}

TEST(Colormap, UnknownNamesListTheKnown) {
    try {
        Colormap("jet");
        ADD_FAILURE();
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, ErrorKind::usage);
        for (const ColormapName& known : all_colormaps())
            EXPECT_NE(std::string(error.what()).find(known.name), std::string::npos);
    }
}

TEST(ClassificationColors, NamedClassesCanBeToldApart) {
    const auto& colors = classification_colors();
    for (int a = 0; a < 23; ++a)
        for (int b = 0; b < a; ++b) {
            if (classification_name(uint8_t(a)).empty() || classification_name(uint8_t(b)).empty()) continue;
            EXPECT_GT((oklab_of(colors[size_t(a)]) - oklab_of(colors[size_t(b)])).norm(), 0.045) << a << " and " << b;
        }
    EXPECT_EQ(classification_name(2), "ground");
    EXPECT_EQ(classification_name(9), "water");
    EXPECT_EQ(classification_name(200), "");
}

TEST(CategoryColors, NeighborsAreFarApart) {
    for (uint64_t number = 0; number < 255; ++number)
        for (uint64_t next = number + 1; next < std::min<uint64_t>(number + 5, 256); ++next)
            EXPECT_GT((oklab_of(category_color(number)) - oklab_of(category_color(next))).norm(), 0.1) << number;
}

}  // namespace
}  // namespace strata
