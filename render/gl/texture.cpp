#include "render/gl/texture.h"

#include <epoxy/gl.h>

#include <string>

#include "core/error.h"

namespace strata {
namespace {

struct TexelLayout {
    GLenum internal, format, type;
};

TexelLayout layout_of(TexelFormat format) {
    switch (format) {
        case TexelFormat::rgba8: return {GL_RGBA8, GL_RGBA, GL_UNSIGNED_BYTE};
        case TexelFormat::r8: return {GL_R8, GL_RED, GL_UNSIGNED_BYTE};
        case TexelFormat::r32f: return {GL_R32F, GL_RED, GL_FLOAT};
        case TexelFormat::rgba32f: return {GL_RGBA32F, GL_RGBA, GL_FLOAT};
        case TexelFormat::rgba32ui: return {GL_RGBA32UI, GL_RGBA_INTEGER, GL_UNSIGNED_INT};
    }
    return {};
}

}  // namespace

Texture::Texture(TexelFormat format, uint32_t width, uint32_t height) : format_(format), width_(width), height_(height) {
    glCreateTextures(GL_TEXTURE_2D, 1, &name_);
    glTextureStorage2D(name_, 1, layout_of(format).internal, GLsizei(width), GLsizei(height));
    glTextureParameteri(name_, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    glTextureParameteri(name_, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    if (glGetError() != GL_NO_ERROR) {
        glDeleteTextures(1, &name_);
        throw Error(ErrorKind::device, "OpenGL: no texture of " + std::to_string(width) + " x " + std::to_string(height) + " pixels");
    }
}

Texture& Texture::operator=(Texture&& other) noexcept {
    std::swap(name_, other.name_);
    std::swap(format_, other.format_);
    std::swap(width_, other.width_);
    std::swap(height_, other.height_);
    return *this;
}

Texture::~Texture() {
    if (name_ != 0) glDeleteTextures(1, &name_);
}

void Texture::upload(const void* texels, uint32_t height) {
    const TexelLayout layout = layout_of(format_);
    glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
    glTextureSubImage2D(name_, 0, 0, 0, GLsizei(width_), GLsizei(height), layout.format, layout.type, texels);
}

void Texture::bind(uint32_t unit) const { glBindTextureUnit(unit, name_); }

Framebuffer::Framebuffer(const Texture& color) : width_(color.width()), height_(color.height()) {
    glCreateFramebuffers(1, &name_);
    glNamedFramebufferTexture(name_, GL_COLOR_ATTACHMENT0, color.name(), 0);
    glCreateVertexArrays(1, &vertex_array_);
    if (glCheckNamedFramebufferStatus(name_, GL_DRAW_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE) {
        glDeleteFramebuffers(1, &name_);
        glDeleteVertexArrays(1, &vertex_array_);
        throw Error(ErrorKind::device, "OpenGL: the framebuffer of " + std::to_string(width_) + " x " +
                                           std::to_string(height_) + " pixels is not complete");
    }
}

Framebuffer::~Framebuffer() {
    glDeleteFramebuffers(1, &name_);
    glDeleteVertexArrays(1, &vertex_array_);
}

void Framebuffer::draw_covering(uint32_t rows) const {
    glBindFramebuffer(GL_DRAW_FRAMEBUFFER, name_);
    glViewport(0, 0, GLsizei(width_), GLsizei(rows));
    glBindVertexArray(vertex_array_);
    glDrawArrays(GL_TRIANGLES, 0, 3);
}

void Framebuffer::read(uint32_t first, uint32_t rows, uint32_t* out) const { read_as(GL_RGBA, GL_UNSIGNED_BYTE, first, rows, out); }

void Framebuffer::read_integers(uint32_t first, uint32_t rows, void* out) const {
    read_as(GL_RGBA_INTEGER, GL_UNSIGNED_INT, first, rows, out);
}

void Framebuffer::read_as(uint32_t format, uint32_t type, uint32_t first, uint32_t rows, void* out) const {
    glBindFramebuffer(GL_READ_FRAMEBUFFER, name_);
    glReadPixels(0, GLint(first), GLsizei(width_), GLsizei(rows), format, type, out);
    if (glGetError() != GL_NO_ERROR) throw Error(ErrorKind::device, "OpenGL: reading the picture back failed");
}

}  // namespace strata
