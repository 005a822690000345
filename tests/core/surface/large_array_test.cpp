#include "core/surface/large_array.h"

#include <gtest/gtest.h>

#include <cstdint>

namespace strata {
namespace {

// Over the sizes at which memory is had another way.
TEST(LargeArray, KeepsWhatItHoldsAsItGrows) {
    LargeArray<uint32_t> array;
    size_t filled = 0;
    for (const size_t size : {size_t{1}, size_t{1000}, size_t{500000}, size_t{524288}, size_t{524289}, size_t{3000000}, size_t{3000001},
                              size_t{9000000}, size_t{10}, size_t{9000000}}) {
        array.resize(size);
        ASSERT_EQ(array.size(), size);
        for (; filled < size; ++filled) array[filled] = uint32_t(filled) * 2654435761u;
        for (size_t i = 0; i < size; ++i) ASSERT_EQ(array[i], uint32_t(i) * 2654435761u);
    }
    const uint32_t* const place = array.data();
    LargeArray<uint32_t> other = std::move(array);
    EXPECT_EQ(other.data(), place);
    EXPECT_TRUE(array.empty());  // NOLINT: moved from, and empty
    array = std::move(other);
    EXPECT_EQ(array.data(), place);
    array = LargeArray<uint32_t>(5);
    EXPECT_EQ(array.size(), 5u);
    EXPECT_TRUE(LargeArray<uint32_t>(0).empty());
}

}  // namespace
}  // namespace strata
