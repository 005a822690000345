#include "render/gl/program.h"

#include <epoxy/gl.h>

#include <array>
#include <string>

#include "core/error.h"
#include "render/shaders/shader_source.h"

namespace strata {
namespace {

// Some compilers put a heading before what is wrong.
std::string first_error(const std::string& log) {
    const size_t error = log.find("error");
    const size_t begin = error == std::string::npos ? 0 : log.rfind('\n', error) + 1;
    return log.substr(begin, log.find('\n', begin) - begin);
}

uint32_t compile(GLenum stage, std::string_view file) {
    const std::string source = whole_shader_source(file);
    const char* const text = source.data();
    const GLint length = GLint(source.size());
    const uint32_t shader = glCreateShader(stage);
    glShaderSource(shader, 1, &text, &length);
    glCompileShader(shader);
    GLint compiled = GL_FALSE;
    glGetShaderiv(shader, GL_COMPILE_STATUS, &compiled);
    if (compiled == GL_TRUE) return shader;
    std::string log(4096, '\0');
    GLsizei log_size = 0;
    glGetShaderInfoLog(shader, GLsizei(log.size()), &log_size, log.data());
    glDeleteShader(shader);
    log.resize(size_t(log_size));
    throw Error(ErrorKind::device, "OpenGL: " + std::string(file) + ": " + first_error(log));
}

}  // namespace

Program::Program(std::string_view vertex_file, std::string_view fragment_file) {
    const uint32_t vertex = compile(GL_VERTEX_SHADER, vertex_file);
    uint32_t fragment = 0;
    try {
        fragment = compile(GL_FRAGMENT_SHADER, fragment_file);
    } catch (...) {
        glDeleteShader(vertex);
        throw;
    }
    link(std::array{vertex, fragment}, fragment_file);
}

Program::Program(std::string_view compute_file) {
    link(std::array{compile(GL_COMPUTE_SHADER, compute_file)}, compute_file);
}

// Takes the shaders over.
void Program::link(std::span<const uint32_t> shaders, std::string_view file) {
    name_ = glCreateProgram();
    for (const uint32_t shader : shaders) glAttachShader(name_, shader);
    glLinkProgram(name_);
    for (const uint32_t shader : shaders) glDeleteShader(shader);
    GLint linked = GL_FALSE;
    glGetProgramiv(name_, GL_LINK_STATUS, &linked);
    if (linked == GL_TRUE) return;
    std::string log(4096, '\0');
    GLsizei log_size = 0;
    glGetProgramInfoLog(name_, GLsizei(log.size()), &log_size, log.data());
    glDeleteProgram(name_);
    log.resize(size_t(log_size));
    throw Error(ErrorKind::device, "OpenGL: " + std::string(file) + ": " + first_error(log));
}

Program::~Program() { glDeleteProgram(name_); }

void Program::use() const { glUseProgram(name_); }
void Program::dispatch(uint32_t columns, uint32_t rows) { glDispatchCompute(columns, rows, 1); }
void Program::finish_writes() { glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT); }
void Program::set(int location, int32_t value) const { glProgramUniform1i(name_, location, value); }
void Program::set(int location, float value) const { glProgramUniform1f(name_, location, value); }
void Program::set(int location, int32_t x, int32_t y) const { glProgramUniform2i(name_, location, x, y); }
void Program::set(int location, int32_t x, int32_t y, int32_t z) const { glProgramUniform3i(name_, location, x, y, z); }
void Program::set(int location, float x, float y) const { glProgramUniform2f(name_, location, x, y); }

}  // namespace strata
