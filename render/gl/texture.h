#pragma once

#include <cstdint>
#include <utility>

namespace strata {

/// Texel formats that passes use.
enum class TexelFormat { rgba8, r8, r32f, rgba32f, rgba32ui };

/// A two-dimensional texture without mipmaps, read texel by texel. Owns its GL name; the context must be current.
class Texture {
public:
    Texture(TexelFormat format, uint32_t width, uint32_t height);
    Texture(Texture&& other) noexcept : name_(std::exchange(other.name_, 0)), format_(other.format_), width_(other.width_), height_(other.height_) {}
    Texture& operator=(Texture&& other) noexcept;
    ~Texture();

    /// Replaces the first `height` rows. texels: rows without gaps
    void upload(const void* texels, uint32_t height);
    void bind(uint32_t unit) const;

    uint32_t name() const { return name_; }
    uint32_t width() const { return width_; }
    uint32_t height() const { return height_; }

private:
    uint32_t name_ = 0;
    TexelFormat format_;
    uint32_t width_, height_;
};

/// A framebuffer that draws into one texture. Owns its GL name.
class Framebuffer {
public:
    explicit Framebuffer(const Texture& color);
    Framebuffer(const Framebuffer&) = delete;
    Framebuffer& operator=(const Framebuffer&) = delete;
    ~Framebuffer();

    /// Draws the built-in triangle that covers rows [0, rows), without vertex data, with the program in use.
    void draw_covering(uint32_t rows) const;
    /// Reads rows [first, first + rows) as RGBA bytes.
    void read(uint32_t first, uint32_t rows, uint32_t* out) const;
    /// Reads rows of four unsigned integers a texel, from a texture of rgba32ui.
    void read_integers(uint32_t first, uint32_t rows, void* out) const;

private:
    void read_as(uint32_t format, uint32_t type, uint32_t first, uint32_t rows, void* out) const;

    uint32_t name_ = 0, vertex_array_ = 0;
    uint32_t width_, height_;
};

}  // namespace strata
