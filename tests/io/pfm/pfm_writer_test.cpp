#include "io/pfm/pfm_writer.h"

#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <iterator>
#include <limits>
#include <vector>

#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

TEST(PfmWriter, BottomRowComesFirstWhateverTheOrderOfCalls) {
    const TemporaryFolder folder;
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    const std::vector<float> top_rows = {1, 2, 3, 4}, bottom_row = {5, kInfinity};  // 2 wide, 3 high
    PfmWriter writer(folder.file("depth.pfm"), 2, 3, false);
    writer.write_rows(2, bottom_row);
    writer.write_rows(0, top_rows);
    writer.finish();

    std::ifstream file(folder.file("depth.pfm"), std::ios::binary);
    const std::string bytes(std::istreambuf_iterator<char>(file), {});
    const std::string head = "Pf\n2 3\n-1.0\n";
    ASSERT_EQ(bytes.size(), head.size() + 6 * sizeof(float));
    EXPECT_EQ(bytes.substr(0, head.size()), head);
    float values[6];
    std::memcpy(values, bytes.data() + head.size(), sizeof(values));
    const float expected[6] = {5, kInfinity, 3, 4, 1, 2};
    for (int i = 0; i < 6; ++i) EXPECT_EQ(values[i], expected[i]) << i;
}

}  // namespace
}  // namespace strata
