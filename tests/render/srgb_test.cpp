#include "render/srgb.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace strata {
namespace {

TEST(Srgb, EveryCodeComesBack) {
    for (int code = 0; code < 256; ++code) {
        EXPECT_EQ(srgb8_from_linear(linear_from_srgb8()[size_t(code)]), code);
        EXPECT_NEAR(srgb_from_linear(linear_from_srgb(code / 255.0)), code / 255.0, 1e-7);  // the standard's own seam
    }
}

TEST(Srgb, TheTableRoundsAsTheFormulaDoes) {
    // The sweep has 2^20 values; where the formula is within 1e-4 code of a half, float and double may round apart.
    for (int i = 0; i <= 1 << 20; ++i) {
        const float linear = float(i) * 0x1p-20f;
        const double exact = 255.0 * srgb_from_linear(linear);
        if (std::abs(exact - std::floor(exact) - 0.5) < 1e-4) continue;
        ASSERT_EQ(srgb8_from_linear(linear), std::lround(exact)) << linear;
    }
}

TEST(Srgb, OutOfRangeIsClamped) {
    EXPECT_EQ(srgb8_from_linear(-1.0f), 0);
    EXPECT_EQ(srgb8_from_linear(std::numeric_limits<float>::quiet_NaN()), 0);
    EXPECT_EQ(srgb8_from_linear(1.0f), 255);
    EXPECT_EQ(srgb8_from_linear(std::numeric_limits<float>::infinity()), 255);
}

TEST(Oklab, WhiteIsLightnessOneWithoutHueAndAllColorsComeBack) {
    const Vec3d white = oklab_from_linear(Vec3d::Ones());
    EXPECT_NEAR(white.x(), 1.0, 1e-6);
    EXPECT_NEAR(white.tail<2>().norm(), 0.0, 1e-6);
    for (int i = 0; i < 125; ++i) {
        const Vec3d rgb = Vec3d(i % 5, i / 5 % 5, i / 25) / 4.0;
        EXPECT_LT((linear_from_oklab(oklab_from_linear(rgb)) - rgb).norm(), 1e-6);  // digits of the published matrices
    }
}

}  // namespace
}  // namespace strata
