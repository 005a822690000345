#include "io/text_words.h"

#include <gtest/gtest.h>

#include <bit>
#include <charconv>
#include <cmath>
#include <optional>
#include <random>

namespace strata {
namespace {

std::optional<double> number_of(std::string_view text) {
    double value = 0.0;
    TextWords words(text);
    if (!words.number(value)) return std::nullopt;
    return value;
}

TEST(TextWords, NumbersAreWhatProgramsWrite) {
    EXPECT_EQ(number_of("1"), 1.0);
    EXPECT_EQ(number_of(" +1.5e3\r"), 1500.0);
    EXPECT_EQ(number_of("-.5"), -0.5);
    EXPECT_EQ(number_of("5."), 5.0);
    EXPECT_EQ(number_of("1E-2"), 0.01);
    EXPECT_EQ(number_of("1e400"), std::numeric_limits<double>::infinity());
    EXPECT_EQ(number_of("-1e400"), -std::numeric_limits<double>::infinity());
    EXPECT_EQ(number_of("1e-400"), 0.0);
    EXPECT_EQ(number_of("inf"), std::numeric_limits<double>::infinity());
    for (const char* const nan : {"nan", "NaN", "-nan", "1.#QNAN", "-1.#IND00", "1.#INF"}) {
        ASSERT_TRUE(number_of(nan)) << nan;
        EXPECT_TRUE(std::isnan(*number_of(nan))) << nan;
    }
    for (const char* const none : {"", " ", "x", "1,5", "1.5x", "--1", "+-1", "0x10", "+", "1/2"}) EXPECT_FALSE(number_of(none)) << none;
}

// What std::to_chars writes of any float comes back bit by bit.
TEST(TextWords, FloatsRoundTrip) {
    std::mt19937 random(7);
    for (int i = 0; i < 100'000; ++i) {
        const float value = std::bit_cast<float>(uint32_t(random()));
        if (!std::isfinite(value)) continue;
        char text[64];
        const char* const end = std::to_chars(text, text + sizeof text, value).ptr;
        const auto read = number_of({text, size_t(end - text)});
        ASSERT_TRUE(read);
        ASSERT_EQ(std::bit_cast<uint32_t>(float(*read)), std::bit_cast<uint32_t>(value)) << text;
    }
}

TEST(TextWords, WordsAreBetweenBlanks) {
    TextWords words("  a\tbc \v d\r");
    EXPECT_EQ(words.word(), "a");
    EXPECT_EQ(words.word(), "bc");
    EXPECT_EQ(words.word(), "d");
    EXPECT_EQ(words.word(), "");
    EXPECT_FALSE(words.more());
}

}  // namespace
}  // namespace strata
