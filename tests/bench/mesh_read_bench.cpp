// Meshes from files that every run makes: a grid of squares as OBJ, STL and PLY, in the page cache.
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include "io/mesh/mesh_reader.h"

namespace strata {
namespace {

constexpr int kSide = 500;  // squares

float height(int x, int y) { return 0.01f * float((x * 37 + y * 61) % 1000); }

std::string obj_text() {
    std::string text;
    char line[96];
    for (int y = 0; y <= kSide; ++y)
        for (int x = 0; x <= kSide; ++x) text.append(line, size_t(std::snprintf(line, sizeof line, "v %.6f %.6f %.6f\n", 0.1 * x, 0.1 * y, double(height(x, y)))));
    for (int y = 0; y < kSide; ++y)
        for (int x = 0; x < kSide; ++x) {
            const int a = y * (kSide + 1) + x + 1, b = a + kSide + 1;
            text.append(line, size_t(std::snprintf(line, sizeof line, "f %d %d %d\nf %d %d %d\n", a, a + 1, b + 1, a, b + 1, b)));
        }
    return text;
}

template <typename T>
void put(std::string& bytes, T value) {
    bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

std::string stl_bytes() {
    std::string bytes(80, '\0');
    put(bytes, uint32_t(2 * kSide * kSide));
    const auto corner = [&](int x, int y) {
        put(bytes, 0.1f * float(x));
        put(bytes, 0.1f * float(y));
        put(bytes, height(x, y));
    };
    for (int y = 0; y < kSide; ++y)
        for (int x = 0; x < kSide; ++x)
            for (const int upper : {0, 1}) {
                bytes.append(12, '\0');
                corner(x, y);
                corner(x + 1, y + upper);
                corner(x + 1 - upper, y + 1);
                bytes.append(2, '\0');
            }
    return bytes;
}

std::string ply_bytes() {
    const std::string vertices = std::to_string((kSide + 1) * (kSide + 1)), faces = std::to_string(2 * kSide * kSide);
    std::string bytes = "ply\nformat binary_little_endian 1.0\nelement vertex " + vertices + "\nproperty float x\nproperty float y\nproperty float z\nelement face " +
                        faces + "\nproperty list uchar int vertex_indices\nend_header\n";
    for (int y = 0; y <= kSide; ++y)
        for (int x = 0; x <= kSide; ++x) {
            put(bytes, 0.1f * float(x));
            put(bytes, 0.1f * float(y));
            put(bytes, height(x, y));
        }
    for (int y = 0; y < kSide; ++y)
        for (int x = 0; x < kSide; ++x)
            for (const int upper : {0, 1}) {
                const int a = y * (kSide + 1) + x;
                put(bytes, uint8_t{3});
                put(bytes, a);
                put(bytes, a + 1 + upper * (kSide + 1));
                put(bytes, a + kSide + 2 - upper);
            }
    return bytes;
}

void read_mesh_file(benchmark::State& state, const char* ending, std::string (*make)()) {
    const std::string bytes = make(), path = (std::filesystem::temp_directory_path() / ("strata-bench-" + std::to_string(::getpid()) + ending)).string();
    std::ofstream(path, std::ios::binary).write(bytes.data(), std::streamsize(bytes.size()));
    for (auto _ : state) {
        const TriangleMesh mesh = read_mesh(path);
        if (mesh.positions.size() != size_t(kSide + 1) * (kSide + 1) || mesh.triangles.size() != size_t(2) * kSide * kSide) state.SkipWithError("wrong counts");
    }
    state.SetBytesProcessed(int64_t(bytes.size()) * int64_t(state.iterations()));
    std::filesystem::remove(path);
}

BENCHMARK_CAPTURE(read_mesh_file, obj, ".obj", obj_text)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(read_mesh_file, stl, ".stl", stl_bytes)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(read_mesh_file, ply, ".ply", ply_bytes)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace strata
