// The words that OpenGL leaves are those of the CPU's kernels, bit by bit. A driver that fills triangles by another rule is refused when the pass is made.
#include "render/pass/mesh_gl_pass.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/math/random.h"
#include "render/gl/egl_context.h"
#include "render/pass/mesh_pass.h"
#include "tests/support/empty_gbuffer.h"
#include "tests/support/test_meshes.h"

namespace strata {
namespace {

constexpr uint32_t kWidth = 333, kHeight = 200;

// One context and program for all tests.
class MeshGl : public testing::Test {
protected:
    static void SetUpTestSuite() {
        try {
            context_ = new EglContext(2);
        } catch (const Error& error) {
            problem_ = new std::string(error.what());
            return;
        }
        try {
            gpu_ = new MeshGlPass(*context_);
        } catch (const Error& error) {
            // Software GL is known to draw as the kernels. A shader that does not compile is a failure everywhere.
            const std::string problem = error.what();
            if (context_->is_software() || problem.find("fills triangles by another rule") == std::string::npos) throw;
            problem_ = new std::string(problem);
        }
    }
    static void TearDownTestSuite() {
        delete gpu_;
        delete context_;
        delete problem_;
    }
    void SetUp() override {
        if (problem_ != nullptr) GTEST_SKIP() << "no OpenGL 4.5 here that draws as the kernels: " << *problem_;
        ASSERT_NE(gpu_, nullptr);
        context_->make_current();
    }

    static GBuffer drawn(const MeshModel& model, const Camera& camera, MeshGlPass* gpu, uint32_t first_row = 0, uint32_t rows = kHeight) {
        GBuffer gbuffer = test::empty_gbuffer(kWidth, first_row, rows);
        MeshPass().draw(model, 1, {camera, kWidth, kHeight, Vec2f::Zero(), {}, 2, UpAxis::z, gpu}, gbuffer);
        return gbuffer;
    }

    static inline EglContext* context_ = nullptr;
    static inline MeshGlPass* gpu_ = nullptr;
    static inline std::string* problem_ = nullptr;
};

size_t different(const std::vector<uint64_t>& a, const std::vector<uint64_t>& b) {
    size_t count = 0;
    for (size_t i = 0; i < a.size(); ++i) count += a[i] != b[i];
    return count;
}

MeshModel model_of(const TriangleMesh& mesh) { return MeshModel(mesh, MeshColors(mesh, "plain", std::nullopt, {}), {}); }

Camera random_camera(Random& random, Projection projection, double distance) {
    Camera camera;
    camera.projection = projection;
    const Vec3d away = Vec3d(random.normal(), random.normal(), random.normal()).normalized();
    camera.eye = distance * away;
    camera.view_from_world = look_along(-away, Vec3d(random.normal(), random.normal(), random.normal()));
    camera.fov_rad = 0.9;
    camera.height = 4.0;
    camera.near_depth = projection == Projection::perspective ? 0.01 : 0.0;
    camera.far_depth = 100;
    return camera;
}

TEST_F(MeshGl, WordsAreThoseOfTheKernels) {
    Random random(1);
    for (int round = 0; round < 6; ++round) {
        std::vector<ProjectedVertex> places;
        std::vector<std::array<uint32_t, 3>> triangles;
        for (uint32_t i = 0; i < 1500; ++i) {
            const uint64_t grid = i % 3 == 0 ? 1 : 128, size = i % 2 == 0 ? 1500 : i % 7 == 0 ? 90000 : 9000;
            const uint64_t x = random.bits() % (kWidth * 256), y = random.bits() % (kHeight * 256);
            for (int corner = 0; corner < 3; ++corner)
                places.push_back({int32_t((x + random.bits() % size) / grid * grid) - int32_t(size / 2), int32_t((y + random.bits() % size) / grid * grid) - int32_t(size / 2),
                                  i % 5 == 0 ? 0.5f : float(random.uniform(1e-6, 1.0))});
            triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
            if (i % 10 == 0) triangles.push_back({3 * i + 1, 3 * i, 3 * i + 2});
        }
        const uint32_t first_row = round % 2 == 0 ? 0 : 61, rows = kHeight - first_row;
        std::vector<uint64_t> gl(size_t{kWidth} * rows, 7), cpu(gl.size(), 0);
        gpu_->draw({0, triangles, places}, {gl.data(), kWidth, first_row, rows});
        const MeshTarget target = {cpu.data(), kWidth, first_row, rows};
        const MeshKernels& kernels = mesh_kernels(best_simd_level());
        TriangleBlock block;
        for (block.first = 0; block.first < triangles.size(); block.first += kTriangleBlock) {
            block.count = std::min(kTriangleBlock, triangles.size() - block.first);
            kernels.sort({triangles.data(), places.data()}, target, block);
            kernels.draw_small(target, block, Sharing::alone);
            for (size_t i = 0; i < block.count; ++i) {
                if (block.kinds[i] != TriangleKind::large) continue;
                RasterTriangle t = {{}, {}, {}, block.first + uint32_t(i)};
                for (size_t corner = 0; corner < 3; ++corner) {
                    const ProjectedVertex& v = places[triangles[t.number][corner]];
                    t.x[corner] = v.x, t.y[corner] = v.y, t.key[corner] = v.key;
                }
                kernels.draw(t, target);
            }
        }
        EXPECT_EQ(different(gl, cpu), 0u) << context_->renderer();
        EXPECT_GT(std::count_if(cpu.begin(), cpu.end(), [](uint64_t word) { return word != 0; }), 20000);
    }
}

// Whole pictures, also of meshes that reach behind the eye and far beside the picture, where the CPU draws what the GPU cannot.
TEST_F(MeshGl, PicturesAreThoseOfTheCpu) {
    Random random(2);
    TriangleMesh mesh = torus_mesh(Vec3d::Zero(), 1.0, 0.4, 90);
    append(mesh, sphere_mesh(Vec3d(0.5, 0, 0), 0.6, 5));
    append(mesh, box_mesh(Vec3d(0, 0.9, 0.3), Vec3d(4.0, 0.02, 300.0)));
    const MeshModel model = model_of(mesh);
    for (int round = 0; round < 10; ++round) {
        const Camera camera = random_camera(random, round % 2 == 0 ? Projection::perspective : Projection::orthographic, round < 5 ? 3.0 : 0.7);
        const GBuffer cpu = drawn(model, camera, nullptr), gl = drawn(model, camera, gpu_);
        EXPECT_EQ(gl.ids, cpu.ids) << round;
        EXPECT_EQ(gl.depths, cpu.depths) << round;
        EXPECT_EQ(gl.colors, cpu.colors) << round;
        const GBuffer strip = drawn(model, camera, gpu_, 77, 50);
        EXPECT_TRUE(std::equal(strip.ids.begin(), strip.ids.end(), cpu.ids.begin() + 77 * kWidth)) << round;
    }
}

// Another mesh of the same size is another mesh.
TEST_F(MeshGl, MeshesAreToldApart) {
    Random random(3);
    const TriangleMesh ball = sphere_mesh(Vec3d::Zero(), 1.0, 12);
    TriangleMesh turned = ball;
    turn_inside_out(turned);
    const MeshModel first = model_of(ball), second = model_of(turned);
    const Camera camera = random_camera(random, Projection::perspective, 3.0);
    for (const MeshModel* model : {&first, &second, &first}) EXPECT_EQ(drawn(*model, camera, gpu_).ids, drawn(*model, camera, nullptr).ids);
}

}  // namespace
}  // namespace strata
