#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "core/error.h"
#include "io/mesh/mesh_reader.h"

namespace strata {

/// Reads bytes as a mesh, under a cap that small files stay far below, and traps where the mesh is not what TriangleMesh promises.
inline int fuzz_mesh(TriangleMesh (*read)(const ByteSource&, const MeshReadSettings&, MeshReport&), const uint8_t* data, size_t size) {
    std::vector<std::byte> bytes(size);
    if (size > 0) std::memcpy(bytes.data(), data, size);
    try {
        MeshReport report;
        const TriangleMesh mesh = read(*memory_source("fuzz", std::move(bytes)), {.most_bytes = 64 * size + 65536, .scalars = true}, report);
        for (const Vec3d& position : mesh.positions)
            if (!position.allFinite()) __builtin_trap();
        for (const auto& triangle : mesh.triangles)
            for (const uint32_t vertex : triangle)
                if (vertex >= mesh.positions.size()) __builtin_trap();
        for (const size_t count : {mesh.normals.size(), mesh.colors.size()})
            if (count != 0 && count != mesh.positions.size()) __builtin_trap();
        for (const MeshScalars& scalars : mesh.scalars)
            if (scalars.values.size() != mesh.positions.size()) __builtin_trap();
    } catch (const Error&) {
    }
    return 0;
}

}  // namespace strata
