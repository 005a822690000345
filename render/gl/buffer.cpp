#include "render/gl/buffer.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <string>

#include "core/error.h"

namespace strata {

Buffer::Buffer(uint64_t size_bytes) : size_bytes_(size_bytes) {
    glCreateBuffers(1, &name_);
    glNamedBufferStorage(name_, GLsizeiptr(size_bytes), nullptr, GL_DYNAMIC_STORAGE_BIT);
    if (glGetError() != GL_NO_ERROR) {
        glDeleteBuffers(1, &name_);
        throw Error(ErrorKind::device, "OpenGL: no buffer of " + std::to_string(size_bytes) + " bytes");
    }
}

Buffer& Buffer::operator=(Buffer&& other) noexcept {
    std::swap(name_, other.name_);
    std::swap(size_bytes_, other.size_bytes_);
    return *this;
}

Buffer::~Buffer() {
    if (name_ != 0) glDeleteBuffers(1, &name_);
}

uint64_t Buffer::most_storage_bytes() {
    GLint64 bytes = 0;
    glGetInteger64v(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &bytes);
    return uint64_t(std::max<GLint64>(bytes, 0));
}

void Buffer::write(uint64_t offset, const void* bytes, uint64_t count) {
    glNamedBufferSubData(name_, GLintptr(offset), GLsizeiptr(count), bytes);
}

void Buffer::read(uint64_t offset, void* bytes, uint64_t count) const {
    glGetNamedBufferSubData(name_, GLintptr(offset), GLsizeiptr(count), bytes);
    if (glGetError() != GL_NO_ERROR) throw Error(ErrorKind::device, "OpenGL: reading a buffer back failed");
}

void Buffer::clear(uint64_t count) {
    glClearNamedBufferSubData(name_, GL_R32UI, 0, GLsizeiptr(count), GL_RED_INTEGER, GL_UNSIGNED_INT, nullptr);
}

void Buffer::bind_storage(uint32_t binding) const { glBindBufferBase(GL_SHADER_STORAGE_BUFFER, binding, name_); }
void Buffer::bind_uniforms(uint32_t binding) const { glBindBufferBase(GL_UNIFORM_BUFFER, binding, name_); }

}  // namespace strata
