#include "render/pass/points_gl_pass.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/math/random.h"
#include "render/gl/egl_context.h"
#include "render/pass/blend_kernel.h"
#include "render/pass/points_kernel.h"
#include "render/stream/point_pool.h"

namespace strata {
namespace {

constexpr uint32_t kWidth = 200, kHeight = 100;
constexpr uint32_t kNodePoints = 2500;
constexpr uint64_t kAmple = uint64_t{1} << 30;
const Quantization kMillimeters = {.scale = Vec3d::Constant(0.001), .offset = Vec3d(500000, 5300000, 100)};  // UTM

void add_point(ResidentNode& node, const Vec3i& quanta, const PointShape& shape) {
    node.min_quanta = node.x.empty() ? quanta : Vec3i(node.min_quanta.cwiseMin(quanta));
    node.max_quanta = node.x.empty() ? quanta : Vec3i(node.max_quanta.cwiseMax(quanta));
    node.x.push_back(quanta.x());
    node.y.push_back(quanta.y());
    node.z.push_back(quanta.z());
    node.shapes.push_back(shape);
    node.colors.push_back(0x12345678u * uint32_t(node.x.size()));
    node.normals.push_back({int8_t(quanta.x() * 7), int8_t(quanta.y() * 5), node.x.size() % 3 == 0 ? int8_t(0) : int8_t(quanta.z() * 3)});
    if (node.x.size() % 5 == 0) node.normals.back() = {};
}

PointShape random_shape(Random& random) {
    if (random.uniform() < 0.3) return {.spacing = float(random.uniform(0.0, 0.1))};
    return {.spacing = float(random.uniform(0.005, 0.1)),
            .normal = {int8_t(int(random.bits() % 255) - 127), int8_t(int(random.bits() % 255) - 127), int8_t(random.bits() % 127 + 1)}};
}

// Around the eye, before and behind it, so that the picture's borders cut many splats.
std::vector<ResidentNode> random_nodes() {
    Random random(4);
    std::vector<ResidentNode> nodes(3);
    for (ResidentNode& node : nodes)
        for (uint32_t i = 0; i < kNodePoints; ++i)
            add_point(node, {int32_t(random.uniform(-3000, 3000)), int32_t(random.uniform(-500, 5000)), int32_t(random.uniform(-1500, 1500))},
                      random_shape(random));
    return nodes;
}

// Ten thousand points in one place, others of the same depth around it, and a node that repeats them.
std::vector<ResidentNode> tied_nodes() {
    Random random(5);
    ResidentNode node;
    for (int i = 0; i < 10000; ++i) add_point(node, {100, 2000, 100}, {.spacing = 0.02f});
    for (int i = 0; i < 2000; ++i) add_point(node, {int32_t(random.uniform(-900, 900)), 2000, int32_t(random.uniform(-400, 400))}, {.spacing = 0.05f});
    return {node, node};
}

Camera camera_north(Projection projection, const Vec3d& eye) {
    Camera camera;
    camera.projection = projection;
    camera.eye = eye;
    camera.view_from_world = look_along({0, 1, 0}, {0, 0, 1});
    camera.fov_rad = 2.0 * std::atan(0.5);
    camera.height = 2;
    camera.near_depth = 0.01;
    camera.far_depth = 100;
    return camera;
}

std::vector<PointNode> listed(const std::vector<ResidentNode>& nodes, uint32_t height = kHeight) {
    std::vector<PointNode> list;
    uint32_t rank = 0;
    for (const ResidentNode& node : nodes) {
        list.push_back({.points = &node, .first_rank = rank, .top_row = 0, .bottom_row = float(height)});
        rank += uint32_t(node.size());
    }
    return list;
}

std::vector<uint64_t> words_of(const WordRows& target) {
    const PixelRows& rows = target.rows;
    std::vector<uint64_t> words;
    for (uint32_t row = 0; row < rows.rows; ++row) words.insert(words.end(), target.words + size_t(row) * rows.stride, target.words + size_t(row) * rows.stride + rows.width);
    return words;
}

std::vector<uint64_t> light_of(const PixelRows& rows, const LightSum* sums) {
    std::vector<uint64_t> light;
    for (size_t row = 0; sums != nullptr && row < rows.rows; ++row)
        for (size_t column = 0; column < rows.width; ++column) {
            const LightSum& sum = sums[row * rows.stride + column];
            light.insert(light.end(), {sum.red, sum.green, sum.blue, sum.weight});
        }
    return light;
}

// One context and program for all tests: llvmpipe takes a second to compile it.
class PointsGl : public testing::Test {
protected:
    static void SetUpTestSuite() {
        try {
            context_ = new EglContext(2);
            gpu_ = new PointsGlPass(*context_);
        } catch (const Error& error) {
            problem_ = new std::string(error.what());
        }
    }
    static void TearDownTestSuite() {
        delete gpu_;
        delete context_;
        delete problem_;
    }
    void SetUp() override {
        if (problem_ != nullptr) GTEST_SKIP() << "no EGL with OpenGL 4.5 here: " << *problem_;
        gpu_->forget_nodes();
    }

    struct Drawn {
        std::vector<uint64_t> cpu, gpu, cpu_light, gpu_light;  // words, and sums of Gaussian splats

        size_t covered() const { return cpu.size() - size_t(std::count(cpu.begin(), cpu.end(), uint64_t{0})); }
    };
    static Drawn draw(const std::vector<ResidentNode>& nodes, const PointProjection& projection, const SplatStyle& style,
                      uint64_t cap_bytes = kAmple, uint32_t width = kWidth, uint32_t first_row = 0, uint32_t rows = kHeight) {
        const std::vector<PointNode> list = listed(nodes, first_row + rows);
        PointsPass pass;
        pass.clear(width, first_row, rows, 2);
        pass.draw(list, projection, style, 2);
        const WordRows target = pass.resize(width, first_row, rows);
        LightSum* const light = style.shape == SplatShape::gaussian ? pass.resize_sums() : nullptr;
        Drawn drawn = {.cpu = words_of(target), .cpu_light = light_of(target.rows, light)};
        gpu_->draw(target, light, list, projection, style, cap_bytes);
        drawn.gpu = words_of(target);
        drawn.gpu_light = light_of(target.rows, light);
        return drawn;
    }
    // Software GL divides and takes roots as IEEE 754 has it: every bit agrees. GPUs may be off by an ulp or two there, which takes
    // a splat over a pixel's edge or turns the order of two depths now and then.
    static void expect_equal(const Drawn& drawn) {
        if (context_->is_software()) {
            EXPECT_TRUE(drawn.cpu == drawn.gpu);
            EXPECT_TRUE(drawn.cpu_light == drawn.gpu_light);
            return;
        }
        size_t others = 0;  // that show another point
        for (size_t i = 0; i < drawn.cpu.size(); ++i) others += uint32_t(drawn.cpu[i]) != uint32_t(drawn.gpu[i]);
        EXPECT_LE(others, drawn.covered() / 200);
    }

    static inline EglContext* context_ = nullptr;
    static inline PointsGlPass* gpu_ = nullptr;
    static inline std::string* problem_ = nullptr;
};

// Every shape and projection, and sizes from one pixel to many.
TEST_F(PointsGl, DrawsTheWordsOfTheCpu) {
    const std::vector<ResidentNode> nodes = random_nodes();
    for (const Projection projection : {Projection::perspective, Projection::orthographic})
        for (const SplatShape shape : {SplatShape::square, SplatShape::disc, SplatShape::paraboloid, SplatShape::gaussian, SplatShape::surfel})
            for (const float fixed_px : {0.0f, 1.0f, 2.6f, 17.0f}) {
                SCOPED_TRACE(testing::Message() << "projection " << int(projection) << ", shape " << int(shape) << ", " << fixed_px << " px");
                Camera camera = camera_north(projection, kMillimeters.offset + Vec3d(0.0004, -0.00031, 0.01237));
                camera.view_from_world = look_along({0.1, 1, -0.05}, {0.2, 0, 1});  // no row has zeros
                const Drawn drawn = draw(nodes, {camera, kMillimeters, kWidth, kHeight}, {.shape = shape, .fixed_px = fixed_px});
                EXPECT_GT(drawn.covered(), 1000u);
                expect_equal(drawn);
            }
}

TEST_F(PointsGl, TiesGoToTheLowerRank) {
    const std::vector<ResidentNode> nodes = tied_nodes();
    for (const Projection projection : {Projection::perspective, Projection::orthographic})
        for (const auto& [shape, fixed_px] : {std::pair(SplatShape::square, 1.0f), {SplatShape::square, 0.0f}, {SplatShape::disc, 3.0f}, {SplatShape::paraboloid, 0.0f}, {SplatShape::gaussian, 2.0f}}) {
            SCOPED_TRACE(testing::Message() << "projection " << int(projection) << ", shape " << int(shape) << ", " << fixed_px << " px");
            const Camera camera = camera_north(projection, kMillimeters.offset);
            const Drawn drawn = draw(nodes, {camera, kMillimeters, kWidth, kHeight}, {.shape = shape, .fixed_px = fixed_px});
            EXPECT_GT(drawn.covered(), 1000u);
            expect_equal(drawn);
            for (const uint64_t word : drawn.gpu)
                if (word != 0) EXPECT_LT(~uint32_t(word), nodes[0].size());  // never of the node that repeats
        }
}

// Parts of a picture, of an odd size and of rows that start below the top, through a center that is off by a part of a pixel.
TEST_F(PointsGl, DrawsPartsOfPictures) {
    const std::vector<ResidentNode> nodes = random_nodes();
    PointProjection projection(camera_north(Projection::perspective, kMillimeters.offset), kMillimeters, 133, 91);
    projection.center_x -= 0.3125f;
    projection.center_y += 0.4375f;
    for (const auto& [first_row, rows] : {std::pair(0u, 1u), {17u, 30u}, {90u, 1u}})
        for (const SplatShape shape : {SplatShape::paraboloid, SplatShape::gaussian, SplatShape::surfel}) {
            const Drawn drawn = draw(nodes, projection, {.shape = shape}, kAmple, 133, first_row, rows);
            EXPECT_GT(drawn.covered(), 30u);
            expect_equal(drawn);
        }
}

// More words than are drawn at a time.
TEST_F(PointsGl, DrawsLargePicturesInBands) {
    std::vector<ResidentNode> nodes(1);
    Random random(7);
    for (int i = 0; i < 1000; ++i)
        add_point(nodes[0], {int32_t(random.uniform(-50000, 50000)), 2000, int32_t(random.uniform(-1000, 1000))}, {});
    const PointProjection projection(camera_north(Projection::perspective, kMillimeters.offset), kMillimeters, 16384, 300);
    for (const auto& [shape, rows] : {std::pair(SplatShape::disc, 300u), {SplatShape::gaussian, 100u}}) {
        const Drawn drawn = draw(nodes, projection, {.shape = shape, .fixed_px = 9}, kAmple, 16384, 100, rows);
        EXPECT_GT(drawn.covered(), 10000u);
        expect_equal(drawn);
    }
}

// Differences of quanta beyond 32 bits: a far eye, and an eye at the other end of the quanta's range. Among them are some that lie
// halfway between two floats.
TEST_F(PointsGl, DrawsFarFromTheEye) {
    Random random(6);
    const Quantization fine = {.scale = Vec3d::Constant(0x1p-20), .offset = Vec3d::Zero()};
    std::vector<ResidentNode> nodes(1);
    for (int i = 0; i < 5000; ++i)
        add_point(nodes[0], {int32_t(random.uniform(-1, 1) * 0x1p29), int32_t(random.uniform(-1, 1) * 0x1p29) | 1, int32_t(random.uniform(-1, 1) * 0x1p29)},
                  random_shape(random));
    Camera camera = camera_north(Projection::perspective, {0, -16384, 4096});  // 2^34 quanta away
    camera.view_from_world = look_along(-camera.eye, {0, 0, 1});
    camera.fov_rad = 0.05;
    for (const float fixed_px : {0.0f, 1.0f, 4.0f}) {
        const Drawn drawn = draw(nodes, {camera, fine, kWidth, kHeight}, {.fixed_px = fixed_px});
        EXPECT_GT(drawn.covered(), 1000u);
        expect_equal(drawn);
    }

    ResidentNode ends;
    for (int i = 0; i < 3000; ++i)
        add_point(ends, {int32_t(random.uniform(-0.9, 0.9) * 0x1p30), std::numeric_limits<int32_t>::max() - int32_t(random.bits() % 1000000), int32_t(random.uniform(-0.9, 0.9) * 0x1p30)},
                  random_shape(random));
    add_point(ends, {0, std::numeric_limits<int32_t>::min(), 0}, {.spacing = 1});
    for (const double eye : {-2048.0, -1000.0, 0.0, -8.0e12, 8.0e12}) {  // quanta: -2^31 and beyond
        Camera from = camera_north(Projection::orthographic, {0, eye, 0});
        from.height = 1200;
        from.near_depth = -1e13;
        from.far_depth = 1e13;
        expect_equal(draw({ends}, {from, fine, kWidth, kHeight}, {.fixed_px = 3}));
    }
}

// Where the GPU has no room for all, points are brought in turns, and for both of the ways through them.
TEST_F(PointsGl, AByteCapDoesNotShow) {
    std::vector<ResidentNode> nodes = random_nodes();
    for (size_t i = 0; i < nodes.size(); i += 2) nodes[i].serial = i + 1;
    const PointProjection projection(camera_north(Projection::perspective, kMillimeters.offset), kMillimeters, kWidth, kHeight);
    for (const uint64_t chunks : {1, 2, 5}) expect_equal(draw(nodes, projection, {}, chunks * PointPool::kChunkBytes));
    expect_equal(draw(nodes, projection, {.shape = SplatShape::gaussian}, 0));
}

TEST_F(PointsGl, AStillPictureUploadsNothing) {
    std::vector<ResidentNode> nodes = random_nodes();
    const PointProjection projection(camera_north(Projection::perspective, kMillimeters.offset), kMillimeters, kWidth, kHeight);
    const auto uploaded = [&](const SplatStyle& style) {
        const uint64_t before = gpu_->uploaded_bytes();
        expect_equal(draw(nodes, projection, style));
        return gpu_->uploaded_bytes() - before;
    };
    const uint64_t points = 3 * kNodePoints;
    for (size_t i = 0; i < nodes.size(); ++i) nodes[i].serial = i + 1;
    EXPECT_EQ(uploaded({.fixed_px = 2}), points * 12);
    EXPECT_EQ(uploaded({.fixed_px = 3}), 0u);
    EXPECT_EQ(uploaded({}), points * 8);
    EXPECT_EQ(uploaded({}), 0u);
    // Shapes that change are brought, and only they.
    for (PointShape& shape : nodes[1].shapes) shape.spacing *= 2;
    ++nodes[1].shapes_version;
    EXPECT_EQ(uploaded({}), kNodePoints * 8);
    // So are colors, and normals.
    EXPECT_EQ(uploaded({.shape = SplatShape::gaussian}), points * 4);
    EXPECT_EQ(uploaded({.shape = SplatShape::surfel}), points * 3);
    EXPECT_EQ(uploaded({.shape = SplatShape::gaussian}), 0u);
    // Another read of a node, and nodes that are made for one frame.
    nodes[0].serial = 9;
    EXPECT_EQ(uploaded({.fixed_px = 2}), kNodePoints * 12);
    nodes[2].serial = 0;
    EXPECT_EQ(uploaded({.fixed_px = 2}), kNodePoints * 12);
    EXPECT_EQ(uploaded({.fixed_px = 2}), kNodePoints * 12);
    gpu_->forget_nodes();
    EXPECT_EQ(uploaded({.fixed_px = 2}), points * 12);
}

// With room for two chunks, the one that was held last but one goes.
TEST_F(PointsGl, ThePoolForgetsTheLeastRecentlyHeld) {
    std::vector<ResidentNode> nodes(3);
    for (size_t i = 0; i < nodes.size(); ++i) {
        add_point(nodes[i], {1, 2, 3}, {});
        nodes[i].serial = i + 1;
    }
    PointPool pool(*context_);
    PointPool::Place place;
    const auto brings = [&](const ResidentNode& node) {
        const uint64_t before = pool.uploaded_bytes();
        pool.release(2 * PointPool::kChunkBytes);
        EXPECT_TRUE(pool.hold(node, 0, {}, place));
        return pool.uploaded_bytes() != before;
    };
    EXPECT_TRUE(brings(nodes[0]));
    EXPECT_TRUE(brings(nodes[1]));
    EXPECT_FALSE(brings(nodes[0]));
    EXPECT_TRUE(brings(nodes[2]));
    EXPECT_FALSE(brings(nodes[0]));
    EXPECT_TRUE(brings(nodes[1]));
    // What is held stays, though there is no room for more.
    pool.release(2 * PointPool::kChunkBytes);
    EXPECT_TRUE(pool.hold(nodes[0], 0, {}, place));
    EXPECT_TRUE(pool.hold(nodes[1], 0, {}, place));
    EXPECT_FALSE(pool.hold(nodes[2], 0, {}, place));
}

}  // namespace
}  // namespace strata
