#pragma once

#include <gtest/gtest.h>

#include <string>

#include "core/error.h"
#include "io/mesh/mesh_reader.h"
#include "tests/support/las_file.h"

namespace strata::test {

using ReadMesh = TriangleMesh (*)(const ByteSource&, const MeshReadSettings&, MeshReport&);

struct MeshOf {
    TriangleMesh mesh;
    MeshReport report;
};

/// What a reader makes of bytes.
inline MeshOf mesh_of(ReadMesh read, const std::vector<std::byte>& bytes, const MeshReadSettings& settings = {.most_bytes = uint64_t{1} << 30}) {
    MeshOf result;
    result.mesh = read(*memory_source("mesh", bytes), settings, result.report);
    return result;
}
inline MeshOf mesh_of(ReadMesh read, const std::string& text, const MeshReadSettings& settings = {.most_bytes = uint64_t{1} << 30}) {
    return mesh_of(read, bytes_of(text), settings);
}

/// The message of the Error that a reader throws; empty: it throws none. A damaged file is malformed, a large one beyond a limit.
inline std::string refusal_of(ReadMesh read, const std::vector<std::byte>& bytes, const MeshReadSettings& settings = {.most_bytes = uint64_t{1} << 30},
                              ErrorKind kind = ErrorKind::malformed) {
    try {
        mesh_of(read, bytes, settings);
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, kind) << error.what();
        return error.what();
    }
    return {};
}
inline std::string refusal_of(ReadMesh read, const std::string& text) { return refusal_of(read, bytes_of(text)); }

using Triangles = std::vector<std::array<uint32_t, 3>>;

}  // namespace strata::test
