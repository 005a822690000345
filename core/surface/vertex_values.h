#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/surface/surface_sink.h"

namespace strata {

/// A quantity at places of a surface.
class ValuesAtVertices {
public:
    virtual ~ValuesAtVertices() = default;
    /// Vertices come in the order in which the surface has them.
    /// origin, positions  as in SurfacePiece
    /// out                [positions] NaN: unknown
    /// throws             Error: what prevents reading it
    virtual void look_up(const Vec3d& origin, std::span<const Vec3f> positions, std::span<float> out) = 0;
    /// After the last vertex: reads what is left, so that a file that is damaged there is found to be.
    virtual void finish() {}
};

/// Where no color is known.
inline constexpr std::array<uint8_t, 4> kNoColor = {128, 128, 128, 255};

/// Colors likewise; kNoColor: unknown.
class ColorsAtVertices {
public:
    virtual ~ColorsAtVertices() = default;
    virtual void look_up(const Vec3d& origin, std::span<const Vec3f> positions, std::span<std::array<uint8_t, 4>> out) = 0;
};

/// Gives the pieces of a surface attributes and colors by the places of their vertices, and hands them on, large ones in parts. Nothing that
/// makes a surface needs to know of them.
/// cost  beside what values are looked up in, 400 KB and 64 KB an attribute
class SurfaceWithValues : public SurfaceSink {
public:
    /// next  must outlive it
    explicit SurfaceWithValues(SurfaceSink& next) : next_(next) {}

    void add_values(std::string name, ValuesAtVertices& values) { values_.push_back({std::move(name), &values, {}}); }
    /// In place of the pieces' own.
    void set_colors(ColorsAtVertices& colors) { colors_ = &colors; }

    void add(const SurfacePiece& piece) override;
    /// After the last piece.
    void finish();

private:
    static constexpr size_t kMostVertices = size_t{1} << 14;  // of a part

    struct Attribute {
        std::string name;
        ValuesAtVertices* source;
        std::vector<float> values;
    };

    SurfaceSink& next_;
    std::vector<Attribute> values_;
    ColorsAtVertices* colors_ = nullptr;
    std::vector<std::array<uint8_t, 4>> found_;
};

}  // namespace strata
