#include "core/cloud/salvaged_source.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "core/error.h"
#include "tests/support/points_of.h"

namespace strata {
namespace {

// Batches of 1, 2, 3, ... points, some of which cannot be read.
class DamagedSource : public PointSource {
public:
    /// fault  of every damaged batch; empty: each has its own
    DamagedSource(uint64_t batches, std::vector<uint64_t> damaged, ErrorKind kind, std::string fault = {})
        : batches_(batches), damaged_(std::move(damaged)), kind_(kind), fault_(std::move(fault)) {
        info_.points = batches * (batches + 1) / 2;
        info_.attributes = {{.name = "batch", .type = ScalarType::uint8}};
    }

    const CloudInfo& info() const override { return info_; }
    uint64_t batch_count() const override { return batches_; }
    void read_batch(uint64_t index, std::span<const int> wanted, PointBatch& out) const override {
        // Damage may lie in an attribute alone.
        if (!wanted.empty() && std::find(damaged_.begin(), damaged_.end(), index) != damaged_.end()) throw Error(kind_, fault_.empty() ? "batch " + std::to_string(index) : fault_);
        resize_batch(out, size_t(index + 1), info_.attributes, wanted);
        for (const int a : wanted) std::fill(out.columns[size_t(a)].begin(), out.columns[size_t(a)].end(), std::byte(index));
    }

private:
    CloudInfo info_;
    uint64_t batches_;
    std::vector<uint64_t> damaged_;
    ErrorKind kind_;
    std::string fault_;
};

TEST(SalvagedSource, DamageCostsItsBatchAlone) {
    for (const ErrorKind kind : {ErrorKind::malformed, ErrorKind::io}) {
        const SalvagedSource source(std::make_unique<DamagedSource>(6, std::vector<uint64_t>{0, 3}, kind), 30, 3);
        EXPECT_EQ(source.info().points, 2u + 3 + 5 + 6);
        EXPECT_EQ(source.lost_points(), 1u + 4 + 9);  // 21 are in the source
        EXPECT_EQ(source.info().notes, (std::vector<std::string>{"left out: batch 0", "left out: batch 3"}));
        std::vector<double> expected;
        for (const int batch : {1, 2, 4, 5}) expected.insert(expected.end(), size_t(batch) + 1, batch);
        EXPECT_EQ(test::values_of(source, test::points_of(source), "batch"), expected);
        PointBatch positions;
        source.read_batch(2, {}, positions);  // what can be read without the damaged attribute stays out as well
        EXPECT_EQ(positions.size, 5u);
    }
}

TEST(SalvagedSource, ManyNotesAreCounted) {
    std::vector<uint64_t> damaged(15);
    for (size_t i = 0; i < damaged.size(); ++i) damaged[i] = i;
    const SalvagedSource source(std::make_unique<DamagedSource>(20, damaged, ErrorKind::malformed), 210, 1);
    ASSERT_EQ(source.info().notes.size(), 11u);
    for (int i = 0; i < 10; ++i) EXPECT_EQ(source.info().notes[size_t(i)], "left out: batch " + std::to_string(i));
    EXPECT_EQ(source.info().notes.back(), "15 parts are left out in all");
}

// What lies behind the end of a file that is cut short fails for one reason.
TEST(SalvagedSource, OneReasonIsSaidOnce) {
    const SalvagedSource source(std::make_unique<DamagedSource>(20, std::vector<uint64_t>{7, 9, 11}, ErrorKind::malformed, "cut short"), 210, 3);
    EXPECT_EQ(source.info().notes, (std::vector<std::string>{"left out: cut short", "3 parts are left out in all"}));
}

TEST(SalvagedSource, NothingSoundIsAnError) {
    try {
        const SalvagedSource source(std::make_unique<DamagedSource>(2, std::vector<uint64_t>{0, 1}, ErrorKind::malformed), 3, 1);
        FAIL();
    } catch (const Error& error) {
        EXPECT_STREQ(error.what(), "batch 0; nothing else can be read, either");
    }
}

TEST(SalvagedSource, OtherFailuresAreNoDamage) {
    EXPECT_THROW(SalvagedSource(std::make_unique<DamagedSource>(2, std::vector<uint64_t>{1}, ErrorKind::limit), 3, 1), Error);
}

}  // namespace
}  // namespace strata
