// The first points of each chunk, read without the rest of it.
#include <gtest/gtest.h>

#include <atomic>
#include <numeric>

#include "core/math/random.h"
#include "io/las/las_writer.h"
#include "io/las/laz_source.h"
#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

constexpr uint64_t kPoints = 150'000;  // three chunks

// A file in memory that counts what is read of it.
class CountedBytes : public ByteSource {
public:
    CountedBytes(std::unique_ptr<ByteSource> source, std::atomic<uint64_t>& count) : source_(std::move(source)), count_(count) {}
    const std::string& name() const override { return source_->name(); }
    uint64_t size() const override { return source_->size(); }
    void read(uint64_t offset, std::span<std::byte> out) const override {
        count_ += out.size();
        source_->read(offset, out);
    }

private:
    std::unique_ptr<ByteSource> source_;
    std::atomic<uint64_t>& count_;
};

// The first `dense` points of each chunk are noise, the others steps of a line.
std::string write_laz(const TemporaryFolder& folder, int format, uint64_t dense) {
    LasWriterSettings settings{.point_format = format, .compressed = true};
    settings.attributes = {{.name = std::string(attribute_name::kIntensity), .type = ScalarType::uint16},
                           {.name = std::string(attribute_name::kRgb), .type = ScalarType::uint16, .components = 3}};
    settings.overwrite = true;
    PointBatch batch;
    const std::vector<int> all = {0, 1};
    resize_batch(batch, kPoints, settings.attributes, all);
    Random random(9);
    for (size_t i = 0; i < kPoints; ++i) {
        const bool is_noise = i % 50'000 < dense;
        batch.x[i] = is_noise ? int32_t(random.bits()) : int32_t(i);
        batch.y[i] = is_noise ? int32_t(random.bits()) : 2 * int32_t(i);
        batch.z[i] = is_noise ? int32_t(random.bits()) : 7 + int32_t(random.bits() % 4);
        batch.column<uint16_t>(0)[i] = uint16_t(is_noise ? random.bits() : 100 + random.bits() % 8);
        for (size_t c = 0; c < 3; ++c) batch.column<uint16_t>(1)[3 * i + c] = uint16_t(is_noise ? random.bits() : 30'000 + random.bits() % 512);
    }
    const std::string path = folder.file("points.laz");
    LasWriter writer(path, settings);
    writer.write(batch);
    writer.finish(Durability::unsynced);
    return path;
}

void expect_first_points(const LazSource& source, uint64_t most) {
    std::vector<int> all(source.info().attributes.size());
    std::iota(all.begin(), all.end(), 0);
    ASSERT_EQ(source.batch_count(), 3u);
    for (uint64_t index = 0; index < 3; ++index) {
        PointBatch first, whole;
        source.read_first(index, most, all, first);
        source.read_batch(index, all, whole);
        ASSERT_EQ(first.size, most);
        for (const auto column : {&PointBatch::x, &PointBatch::y, &PointBatch::z})
            EXPECT_TRUE(std::equal((first.*column).begin(), (first.*column).end(), (whole.*column).begin()));
        for (size_t a = 0; a < all.size(); ++a)
            EXPECT_TRUE(std::equal(first.columns[a].begin(), first.columns[a].end(), whole.columns[a].begin())) << a;
    }
}

TEST(LazFirstPoints, AreTheSameHoweverTheyLieInTheChunk) {
    const TemporaryFolder folder;
    for (const int format : {2, 7})
        for (const uint64_t dense : {uint64_t{0}, uint64_t{3000}})  // noise needs far more bytes than its share
            for (const uint64_t most : {uint64_t{1}, uint64_t{900}, uint64_t{2999}, uint64_t{49'999}}) {
                SCOPED_TRACE(std::to_string(format) + ", " + std::to_string(dense) + ", " + std::to_string(most));
                expect_first_points(LazSource(open_file(write_laz(folder, format, dense))), most);
            }
}

TEST(LazFirstPoints, TakeFewBytes) {
    const TemporaryFolder folder;
    for (const int format : {2, 7}) {
        std::atomic<uint64_t> count = 0;
        auto bytes = std::make_unique<CountedBytes>(open_file(write_laz(folder, format, 0)), count);
        const uint64_t size = bytes->size();
        const LazSource source(std::move(bytes));
        count = 0;
        PointBatch batch;
        const std::vector<int> all = {0, 1, 2, 3};
        for (uint64_t index = 0; index < 3; ++index) source.read_first(index, 500, all, batch);
        EXPECT_LT(count, size / 5) << format;  // a hundredth of the points
    }
}

}  // namespace
}  // namespace strata
