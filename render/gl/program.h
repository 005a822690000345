#pragma once

#include <cstdint>
#include <span>
#include <string_view>

namespace strata {

/// A linked program of a vertex and a fragment shader, or of a compute shader. Owns its GL name; the context must be current.
class Program {
public:
    /// stem's names: files of render/shaders, such as "cover.vert" and "edl.frag"
    /// throws  Error{device} with the compiler's first line about an error
    Program(std::string_view vertex_file, std::string_view fragment_file);
    explicit Program(std::string_view compute_file);
    Program(const Program&) = delete;
    Program& operator=(const Program&) = delete;
    ~Program();

    void use() const;
    /// Runs the compute shader in use. columns, rows: work groups, at most 65535
    static void dispatch(uint32_t columns, uint32_t rows);
    /// What was dispatched before has written its buffers when anything that follows reads them.
    static void finish_writes();
    /// By explicit location.
    void set(int location, int32_t value) const;
    void set(int location, float value) const;
    void set(int location, int32_t x, int32_t y) const;
    void set(int location, int32_t x, int32_t y, int32_t z) const;
    void set(int location, float x, float y) const;

private:
    void link(std::span<const uint32_t> shaders, std::string_view file);

    uint32_t name_ = 0;
};

}  // namespace strata
