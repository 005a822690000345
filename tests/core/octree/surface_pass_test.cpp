#include "core/octree/surface_pass.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <mutex>

#include "core/error.h"
#include "core/math/random.h"
#include "core/octree/octree_builder.h"
#include "tests/support/memory_source.h"
#include "tests/support/store_in_memory.h"

namespace strata {
namespace {

using Values = std::vector<std::array<uint32_t, 4>>;  // [point] the bits of normal and density

struct Pass {
    Values values;
    size_t chunks = 0;
    AttributeRanges ranges{{}};
};

constexpr SurfaceSettings kBoth = {.neighbors = 16, .normals = true, .density = true, .viewpoint = {}};

// The pass over chunks of at most `max_chunk_points`.
Pass run_pass(const std::vector<Vec3i>& points, uint64_t max_chunk_points, const SurfaceSettings& settings = kBoth, int threads = 1,
              ScratchStore* scratch = nullptr) {
    const Quantization quantization{Vec3d(0.001, 0.001, 0.0005), Vec3d::Zero()};
    QuantaBounds bounds;
    for (const Vec3i& p : points) {
        bounds.min = bounds.min.cwiseMin(p);
        bounds.max = bounds.max.cwiseMax(p);
    }
    const OctreeFrame frame = make_octree_frame(quantization, bounds.min, bounds.max);
    const auto stored = [&](const Vec3i& p) { return Vec3i(frame.stored(0, p.x()), frame.stored(1, p.y()), frame.stored(2, p.z())); };
    const auto cells = [&](const Vec3i& p) { return std::array{frame.cell(0, p.x()), frame.cell(1, p.y()), frame.cell(2, p.z())}; };
    Partition partition(points.size(), max_chunk_points);
    do {
        for (const Vec3i& p : points) {
            const auto [x, y, z] = cells(stored(p));
            partition.count(x, y, z, 1);
        }
    } while (!partition.refine());

    std::vector<Attribute> attributes = {{.name = "index", .type = ScalarType::uint32}};
    for (const Attribute& attribute : surface_attributes(settings)) attributes.push_back(attribute);
    const RecordLayout layout(attributes);
    ChunkStore store(partition, layout.size, scratch);
    std::vector<std::byte> record(layout.size);
    for (uint32_t i = 0; i < points.size(); ++i) {
        const Vec3i p = stored(points[i]);
        const auto [x, y, z] = cells(p);
        std::memcpy(record.data(), p.data(), 12);
        std::memcpy(record.data() + 12, &i, 4);
        store.add(partition.chunk_of(x, y, z), record);
    }
    Pass pass;
    pass.chunks = partition.chunks().size();
    uint64_t reported = 0;
    std::mutex mutex;
    pass.ranges = estimate_surfaces(partition, frame, {frame.scale, quantization.world_from_quanta(bounds.min)}, layout, settings, threads,
                                    store, [&](uint64_t n) {
                                        const std::lock_guard lock(mutex);
                                        reported += n;
                                    });
    EXPECT_EQ(reported, points.size());
    pass.values.resize(points.size());
    for (uint32_t chunk = 0; chunk < pass.chunks; ++chunk)
        store.visit(chunk, [&](std::span<const std::byte> records) {
            for (size_t at = 0; at < records.size(); at += layout.size) {
                uint32_t i;
                std::memcpy(&i, records.data() + at + 12, 4);
                std::memcpy(pass.values[i].data(), records.data() + at + 16, layout.size - 16);
            }
        });
    return pass;
}

// All points in one tree, at their own coordinates.
Values in_one_tree(const std::vector<Vec3i>& points, uint32_t k, const std::optional<Vec3d>& viewpoint = {}) {
    std::vector<TreePoint> numbered;
    for (const Vec3i& p : points) numbered.push_back({p, uint32_t(numbered.size())});
    const Quantization quantization{Vec3d(0.001, 0.001, 0.0005), Vec3d::Zero()};
    const NeighborTree tree(std::move(numbered), quantization.scale);
    Values values(points.size());
    for_each_neighborhood(tree, k, 1, [&](const TreePoint& point, const Neighborhood& neighbors) {
        const SurfaceEstimate e = estimate_surface(neighbors, quantization, viewpoint);
        values[point.index] = {std::bit_cast<uint32_t>(e.normal.x()), std::bit_cast<uint32_t>(e.normal.y()),
                               std::bit_cast<uint32_t>(e.normal.z()), std::bit_cast<uint32_t>(e.density)};
    });
    return values;
}

std::vector<Vec3i> cloud_in_box(size_t n, uint64_t seed, const Vec3d& low, const Vec3d& high) {
    Random random(seed);
    std::vector<Vec3i> points(n);
    for (Vec3i& p : points)
        for (int axis = 0; axis < 3; ++axis) p[axis] = int32_t(random.uniform(low[axis], high[axis]));
    return points;
}

void expect_as_in_one_tree(const std::vector<Vec3i>& points, std::initializer_list<uint64_t> chunk_sizes, size_t least_chunks) {
    const Values expected = in_one_tree(points, 16);
    size_t most = 0;
    for (const uint64_t size : chunk_sizes) {
        const Pass pass = run_pass(points, size);
        most = std::max(most, pass.chunks);
        size_t wrong = 0;
        for (size_t i = 0; i < points.size(); ++i) wrong += pass.values[i] != expected[i];
        EXPECT_EQ(wrong, 0u) << "chunks of " << size << ", " << pass.chunks;
    }
    EXPECT_GE(most, least_chunks);
}

TEST(SurfacePass, ChunksDoNotShow) {
    constexpr size_t kPoints = 2000;
    expect_as_in_one_tree(cloud_in_box(3000, 1, {0, 0, 0}, {30'000, 30'000, 200}), {10'000, 900, 60}, 60);  // a surface
    expect_as_in_one_tree(cloud_in_box(kPoints, 2, {0, 0, 0}, {30'000, 30'000, 30'000}), {400, 30}, 60);
    expect_as_in_one_tree(cloud_in_box(kPoints, 3, {0, 0, 0}, {90'000, 4, 4}), {400, 10}, 100);  // a line
    expect_as_in_one_tree(cloud_in_box(kPoints, 4, {0, 0, 0}, {25, 25, 25}), {400, 30}, 60);     // ties everywhere
    expect_as_in_one_tree(cloud_in_box(10, 5, {0, 0, 0}, {900, 900, 900}), {1000, 3}, 2);        // fewer than the neighbors
    expect_as_in_one_tree({{7, -7, 7}}, {10}, 1);
}

// A surface along the border of two cubes: every point has its neighbors in both.
TEST(SurfacePass, ASurfaceOnABorder) {
    std::vector<Vec3i> points = cloud_in_box(2000, 6, {0, 0, 19'990}, {40'000, 40'000, 20'010});
    points.push_back({0, 0, 0});
    points.push_back({39'999, 39'999, 40'000});
    expect_as_in_one_tree(points, {1500, 150}, 20);
}

// Dense and sparse side by side, strays that find their neighbors many chunks away, chunks with a point or two, many
// points at one place.
TEST(SurfacePass, ChunksOfAllSizes) {
    std::vector<Vec3i> points = cloud_in_box(1000, 7, {-1'000'000, 0, 0}, {1'000'000, 1'000'000, 300'000});
    const auto add = [&](const std::vector<Vec3i>& more) { points.insert(points.end(), more.begin(), more.end()); };
    add(cloud_in_box(1000, 8, {5'000, 70'000, 20'000}, {9'000, 73'000, 20'500}));
    add(cloud_in_box(60, 9, {-1e9, -1e9, -9e8}, {1e9, 1e9, 9e8}));
    add(std::vector<Vec3i>(400, Vec3i(-77'777, 1'000, 50)));
    expect_as_in_one_tree(points, {100'000, 500, 30}, 100);
}

TEST(SurfacePass, ThreadsAndStoresDoNotShow) {
    const std::vector<Vec3i> points = cloud_in_box(6'000, 10, {0, 0, 0}, {3'000, 3'000, 30});
    const Pass expected = run_pass(points, 1000);
    for (const int threads : {2, 7}) {
        test::StoreInMemory scratch;
        const Pass in_memory = run_pass(points, 1000, kBoth, threads), on_scratch = run_pass(points, 1000, kBoth, threads, &scratch);
        EXPECT_EQ(in_memory.values, expected.values);
        EXPECT_EQ(on_scratch.values, expected.values);
        EXPECT_EQ(on_scratch.ranges.min, expected.ranges.min);
    }
    EXPECT_EQ(run_pass(points, 50'000, kBoth, 7).values, expected.values);  // one chunk, shared by all
}

TEST(SurfacePass, SettingsDecideWhatIsStored) {
    const std::vector<Vec3i> points = cloud_in_box(2000, 11, {0, 0, 0}, {2'000, 2'000, 20});
    const auto names = [](const SurfaceSettings& settings) {
        std::string list;
        for (const Attribute& attribute : surface_attributes(settings)) list += attribute.name + " " + std::string(scalar_name(attribute.type)) + ";";
        return list;
    };
    EXPECT_EQ(names(kBoth), "NormalX float;NormalY float;NormalZ float;density float;");
    const SurfaceSettings density = {.neighbors = 5, .normals = false, .density = true, .viewpoint = {}};
    EXPECT_EQ(names(density), "density float;");
    const Values only_density = run_pass(points, 300, density).values, five = in_one_tree(points, 5);
    for (size_t i = 0; i < points.size(); ++i) EXPECT_EQ(only_density[i][0], five[i][3]);
    const Vec3d below(1.0, 1.0, -5.0);
    EXPECT_EQ(run_pass(points, 300, {.neighbors = 9, .density = true, .viewpoint = below}).values, in_one_tree(points, 9, below));
}

TEST(SurfacePass, RangesAreThoseOfTheValues) {
    const Pass pass = run_pass(cloud_in_box(3000, 12, {0, 0, 0}, {3'000, 3'000, 900}), 300);
    for (size_t a = 0; a < 4; ++a) {
        float low = 1e30f, high = -1e30f;
        for (const auto& bits : pass.values) {
            low = std::min(low, std::bit_cast<float>(bits[a]));
            high = std::max(high, std::bit_cast<float>(bits[a]));
        }
        EXPECT_EQ(pass.ranges.min[a], std::vector<double>{low});
        EXPECT_EQ(pass.ranges.max[a], std::vector<double>{high});
    }
}

class NoSink : public NodeSink {
public:
    void begin(const BuiltCloud&) override { ADD_FAILURE(); }
    void encode(std::span<const std::byte>, uint32_t, std::vector<std::byte>&) const override {}
    void append(std::span<const BuiltNode>, std::span<const std::byte>) override {}
    void finish() override {}
};

TEST(SurfacePass, AnAttributeThatIsThereIsNotReplaced) {
    MemorySource source({{0, 0, 0}, {1, 1, 1}});
    source.changeable_info().attributes[0].name = "NormalY";
    NoSink sink;
    BuildSettings settings;
    settings.surface = kBoth;
    try {
        build_octree(source, settings, nullptr, sink);
        ADD_FAILURE();
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, ErrorKind::usage);
        EXPECT_EQ(std::string(error.what()), "the points have an attribute NormalY already");
    }
}

}  // namespace
}  // namespace strata
