#include "render/pass/mesh_gl_pass.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <bit>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/math/random.h"
#include "render/gl/buffer.h"
#include "render/gl/egl_context.h"
#include "render/gl/program.h"

namespace strata {
namespace {

constexpr uint64_t kMostPixels = 4 << 20;     // drawn at a time
constexpr uint64_t kMostTriangles = 1 << 24;  // of one call
constexpr int32_t kMostViewport = 1 << 14;    // its coordinates stay exact

int32_t largest_viewport() {
    GLint sides[2] = {0, 0};
    glGetIntegerv(GL_MAX_VIEWPORT_DIMS, sides);
    return std::min(int32_t(std::bit_floor(uint32_t(std::max(std::min(sides[0], sides[1]), 1)))), kMostViewport);
}

// A framebuffer of words and depths.
class WordTarget {
public:
    WordTarget(uint32_t width, uint32_t rows) : width_(width), rows_(rows) {
        glCreateTextures(GL_TEXTURE_2D, 1, &words_);
        glTextureStorage2D(words_, 1, GL_RG32UI, GLsizei(width), GLsizei(rows));
        glCreateTextures(GL_TEXTURE_2D, 1, &depths_);
        glTextureStorage2D(depths_, 1, GL_DEPTH_COMPONENT32F, GLsizei(width), GLsizei(rows));
        glCreateFramebuffers(1, &framebuffer_);
        glNamedFramebufferTexture(framebuffer_, GL_COLOR_ATTACHMENT0, words_, 0);
        glNamedFramebufferTexture(framebuffer_, GL_DEPTH_ATTACHMENT, depths_, 0);
        glCreateVertexArrays(1, &vertex_array_);
        if (glGetError() == GL_NO_ERROR && glCheckNamedFramebufferStatus(framebuffer_, GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE) return;
        release();
        throw Error(ErrorKind::device, "OpenGL: no framebuffer of " + std::to_string(width) + " x " + std::to_string(rows) + " words");
    }
    WordTarget(const WordTarget&) = delete;
    WordTarget& operator=(const WordTarget&) = delete;
    ~WordTarget() { release(); }

    bool fits(uint32_t width, uint32_t rows) const { return width_ == width && rows_ >= rows; }
    void begin() const {
        glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_);
        glBindVertexArray(vertex_array_);
        const GLuint none[4] = {0, 0, 0, 0};
        const GLfloat farthest = 0.0f;
        glClearNamedFramebufferuiv(framebuffer_, GL_COLOR, 0, none);
        glClearNamedFramebufferfv(framebuffer_, GL_DEPTH, 0, &farthest);
    }
    void read(uint32_t rows, uint64_t* words) const {
        static_assert(std::endian::native == std::endian::little);
        glReadPixels(0, 0, GLsizei(width_), GLsizei(rows), GL_RG_INTEGER, GL_UNSIGNED_INT, words);
        if (glGetError() != GL_NO_ERROR) throw Error(ErrorKind::device, "OpenGL: drawing triangles failed");
    }

private:
    void release() {
        glDeleteFramebuffers(1, &framebuffer_);
        glDeleteVertexArrays(1, &vertex_array_);
        glDeleteTextures(1, &words_);
        glDeleteTextures(1, &depths_);
    }

    uint32_t width_, rows_;
    GLuint words_ = 0, depths_ = 0, framebuffer_ = 0, vertex_array_ = 0;
};

// What drawing changes of the context's state, and then takes back.
class DrawingState {
public:
    explicit DrawingState(GLenum origin) {
        glEnable(GL_DEPTH_TEST);
        glDepthFunc(GL_GREATER);
        glClipControl(origin, GL_ZERO_TO_ONE);
    }
    DrawingState(const DrawingState&) = delete;
    DrawingState& operator=(const DrawingState&) = delete;
    ~DrawingState() {
        glClipControl(GL_LOWER_LEFT, GL_NEGATIVE_ONE_TO_ONE);
        glDepthFunc(GL_LESS);
        glDisable(GL_DEPTH_TEST);
    }
};

void make_room(std::optional<Buffer>& buffer, uint64_t bytes) {
    if (buffer && buffer->size_bytes() >= bytes) return;
    buffer.reset();  // its memory first
    buffer.emplace(bytes);
}

}  // namespace

struct MeshGlPass::Resources {
    void draw(const Mesh& mesh, const MeshTarget& target);
    bool draws_as_kernels();
    // Around whole pixels, so that coordinates stay exact.
    Reach reach_for(const MeshTarget& picture) const {
        return {int32_t(picture.width / 2) * kSubpixels, int32_t(picture.first_row + picture.rows / 2) * kSubpixels, viewport * kSubpixels / 2};
    }

    Program program{"mesh.vert", "mesh.frag"};
    int32_t viewport = largest_viewport();
    uint64_t most_bytes = Buffer::most_storage_bytes();
    GLenum origin = GL_LOWER_LEFT;  // where a window's rows begin, which decides whose the pixels on level edges are
    std::optional<Buffer> vertices, corners;
    uint64_t corners_of = 0;  // serial
    std::optional<WordTarget> target;
};

MeshGlPass::MeshGlPass(const EglContext&) : resources_(std::make_unique<Resources>()) {
    for (const GLenum origin : {GL_LOWER_LEFT, GL_UPPER_LEFT}) {
        resources_->origin = origin;
        if (resources_->draws_as_kernels()) return;
    }
    throw Error(ErrorKind::device, "OpenGL: the driver fills triangles by another rule");
}
MeshGlPass::~MeshGlPass() = default;

bool MeshGlPass::takes(uint64_t vertices, uint64_t triangles) const {
    return vertices * sizeof(ProjectedVertex) <= resources_->most_bytes && triangles * sizeof(std::array<uint32_t, 3>) <= resources_->most_bytes && triangles < (uint64_t{1} << 31);
}

MeshGlPass::Reach MeshGlPass::reach(const MeshTarget& target) const {
    return resources_->reach_for(target);
}

void MeshGlPass::draw(const Mesh& mesh, const MeshTarget& target) { resources_->draw(mesh, target); }

void MeshGlPass::Resources::draw(const Mesh& mesh, const MeshTarget& picture) {
    make_room(vertices, std::max<uint64_t>(mesh.vertices.size_bytes(), 4));
    vertices->write(0, mesh.vertices.data(), mesh.vertices.size_bytes());
    if (mesh.serial == 0 || mesh.serial != corners_of) {
        corners_of = 0;
        make_room(corners, std::max<uint64_t>(mesh.triangles.size_bytes(), 4));
        corners->write(0, mesh.triangles.data(), mesh.triangles.size_bytes());
        corners_of = mesh.serial;
    }
    const uint32_t most_rows = uint32_t(std::clamp<uint64_t>(kMostPixels / picture.width, 1, picture.rows));
    if (!target || !target->fits(picture.width, most_rows)) {
        target.reset();
        target.emplace(picture.width, most_rows);
    }
    const Reach reach = reach_for(picture);
    const DrawingState state(origin);
    program.use();
    vertices->bind_storage(0);
    corners->bind_storage(1);
    for (uint32_t row = 0; row < picture.rows; row += most_rows) {
        const uint32_t rows = std::min(most_rows, picture.rows - row);
        const int32_t first_row = int32_t(picture.first_row + row);
        target->begin();
        glViewport((reach.middle_x - reach.size) / kSubpixels, (reach.middle_y - reach.size) / kSubpixels - first_row, viewport, viewport);
        program.set(0, reach.middle_x, reach.middle_y);
        program.set(1, reach.size);
        program.set(2, 1.0f / float(reach.size));
        program.set(3, first_row);
        program.set(5, origin == GL_LOWER_LEFT ? 1.0f : -1.0f);
        for (uint64_t first = 0; first < mesh.triangles.size(); first += kMostTriangles) {
            program.set(4, int32_t(first));
            glDrawArrays(GL_TRIANGLES, GLint(3 * first), GLsizei(3 * std::min<uint64_t>(kMostTriangles, mesh.triangles.size() - first)));
        }
        target->read(rows, picture.words + size_t(row) * picture.width);
    }
}

// Triangles of all sizes whose edges and corners often lie on centers of pixels.
bool MeshGlPass::Resources::draws_as_kernels() {
    constexpr uint32_t kSide = 64;
    Random random(1);
    std::vector<ProjectedVertex> places;
    std::vector<std::array<uint32_t, 3>> triangles;
    for (uint32_t i = 0; i < 300; ++i) {
        const uint64_t grid = i % 3 == 0 ? 1 : kSubpixels / 2, size = i % 2 == 0 ? 2000 : kSide * kSubpixels;
        const uint64_t x = random.bits() % (kSide * kSubpixels), y = random.bits() % (kSide * kSubpixels);
        for (int corner = 0; corner < 3; ++corner)
            places.push_back({int32_t((x + random.bits() % size) / grid * grid) - 1000, int32_t((y + random.bits() % size) / grid * grid) - 1000, float(random.uniform(0.1, 1.0))});
        triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    std::vector<uint64_t> drawn(kSide * kSide, 0), expected(kSide * kSide, 0);
    draw({0, triangles, places}, {drawn.data(), kSide, 0, kSide});
    const MeshTarget cpu = {expected.data(), kSide, 0, kSide};
    const MeshKernels& kernels = mesh_kernels(SimdLevel::baseline);
    TriangleBlock block;
    for (block.first = 0; block.first < triangles.size(); block.first += kTriangleBlock) {
        block.count = std::min(kTriangleBlock, triangles.size() - block.first);
        kernels.sort({triangles.data(), places.data()}, cpu, block);
        kernels.draw_small(cpu, block, Sharing::alone);
        for (size_t i = 0; i < block.count; ++i) {
            if (block.kinds[i] != TriangleKind::large) continue;
            const size_t v = 3 * (block.first + i);
            kernels.draw({{places[v].x, places[v + 1].x, places[v + 2].x}, {places[v].y, places[v + 1].y, places[v + 2].y}, {places[v].key, places[v + 1].key, places[v + 2].key}, block.first + uint32_t(i)}, cpu);
        }
    }
    return drawn == expected;
}

}  // namespace strata
