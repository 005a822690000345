#include "app/quantity_text.h"

#include <gtest/gtest.h>

namespace strata {
namespace {

TEST(QuantityText, CountsInThousands) {
    EXPECT_EQ(with_commas(0), "0");
    EXPECT_EQ(with_commas(999), "999");
    EXPECT_EQ(with_commas(1000), "1,000");
    EXPECT_EQ(with_commas(18446744073709551615u), "18,446,744,073,709,551,615");
}

TEST(QuantityText, SizesInTheLargestUnitOfWhichThereIsOne) {
    EXPECT_EQ(size_text(0), "0 B");
    EXPECT_EQ(size_text(1023), "1023 B");
    EXPECT_EQ(size_text(1024), "1.0 KiB");
    EXPECT_EQ(size_text((1 << 20) - 1), "1.0 MiB");  // not 1024.0 KiB
    EXPECT_EQ(size_text(uint64_t{5} << 29), "2.5 GiB");
    EXPECT_EQ(size_text(uint64_t{1} << 60), "1048576.0 TiB");
}

}  // namespace
}  // namespace strata
