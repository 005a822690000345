// What no test can make a scan for; convert_test.cpp looks at whole files.
#include "io/copc/copc_writer.h"

#include <gtest/gtest.h>

#include "core/error.h"
#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

// A page's counts are of 32 bits with a sign, and a negative one means something else.
TEST(CopcWriter, NodesBeyondWhatPagesHoldAreRefused) {
    const TemporaryFolder folder;
    constexpr uint64_t kMost = (uint64_t{1} << 31) - 1;
    const auto reason = [&](uint32_t points, uint64_t byte_size) {
        const std::unique_ptr<NodeWriter> writer = make_copc_writer(folder.file("set.copc.laz"), {.durability = Durability::unsynced});
        writer->begin({});
        const BuiltNode node{.points = points, .byte_size = byte_size};
        try {
            writer->append({&node, 1}, {});
        } catch (const Error& error) {
            EXPECT_EQ(error.kind, ErrorKind::limit);
            return std::string(error.what());
        }
        return std::string();
    };
    EXPECT_EQ(reason(uint32_t(kMost), kMost), "");
    EXPECT_NE(reason(uint32_t(kMost + 1), 1).find("a node of 2147483648 points; COPC's pages hold 2^31 - 1"), std::string::npos);
    EXPECT_NE(reason(1, kMost + 1).find("a node of 2147483648 bytes; COPC's pages hold 2^31 - 1"), std::string::npos);
}

}  // namespace
}  // namespace strata
