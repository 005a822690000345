#pragma once

// Potree 2.0 data sets assembled by hand: what the reader is tested with, and the writer's independent twin.
// Nothing here is shared with io/potree: two mistakes must agree before a test is fooled.

#include <brotli/encode.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/octree/layered_cloud.h"
#include "io/potree/potree_cloud.h"

namespace strata::test {

/// A point with the attributes "intensity", "rgb" and "gps-time", in this order behind the position.
struct PotreePoint {
    std::array<int32_t, 3> quanta{};
    uint16_t intensity = 0;
    std::array<uint16_t, 3> rgb{};
    double gps_time = 0.0;
};

struct PotreeFiles {
    std::string metadata;
    std::vector<std::byte> hierarchy, octree;
};

struct PotreeSet {
    std::map<std::string, std::vector<PotreePoint>> nodes;  // by name: "r", "r0", "r07", ...; parents must be there too
    bool brotli = false;
    double scale = 0.001;
    std::array<double, 3> corner = {0.0, 0.0, 0.0};  // least corner of the cube, and the offset of the quanta
    double side = 128.0;
    double spacing = 1.0;
    int step = 4;  // levels below the root of a chunk
};

namespace potree_detail {

template <typename T>
void put(std::vector<std::byte>& out, T value) {
    const auto* bytes = reinterpret_cast<const std::byte*>(&value);
    out.insert(out.end(), bytes, bytes + sizeof value);
}

/// Bit by bit, so that it shares no trick with a fast one: bit b of x, y, z goes to 3 b, 3 b + 1, 3 b + 2.
inline uint64_t interleave(uint32_t x, uint32_t y, uint32_t z, int bits) {
    uint64_t code = 0;
    for (int bit = 0; bit < bits; ++bit)
        code |= uint64_t(x >> bit & 1) << (3 * bit) | uint64_t(y >> bit & 1) << (3 * bit + 1) |
                uint64_t(z >> bit & 1) << (3 * bit + 2);
    return code;
}

inline std::vector<std::byte> packed_records(const std::vector<PotreePoint>& points) {
    std::vector<std::byte> out;
    for (const PotreePoint& point : points) {
        for (const int32_t q : point.quanta) put(out, q);
        put(out, point.intensity);
        for (const uint16_t c : point.rgb) put(out, c);
        put(out, point.gps_time);
    }
    return out;
}

inline std::vector<std::byte> compressed(const std::vector<std::byte>& raw) {
    std::vector<std::byte> out(BrotliEncoderMaxCompressedSize(raw.size()) + 16);
    size_t size = out.size();
    BrotliEncoderCompress(5, BROTLI_DEFAULT_WINDOW, BROTLI_MODE_GENERIC, raw.size(),
                          reinterpret_cast<const uint8_t*>(raw.data()), &size, reinterpret_cast<uint8_t*>(out.data()));
    out.resize(size);
    return out;
}

inline std::vector<std::byte> brotli_columns(const std::vector<PotreePoint>& points) {
    std::vector<std::byte> raw;
    for (const PotreePoint& point : points) {
        const uint32_t q[3] = {uint32_t(point.quanta[0]), uint32_t(point.quanta[1]), uint32_t(point.quanta[2])};
        put(raw, interleave(q[0] >> 16, q[1] >> 16, q[2] >> 16, 16));
        put(raw, interleave(q[0] & 0xffff, q[1] & 0xffff, q[2] & 0xffff, 16));
    }
    for (const PotreePoint& point : points) put(raw, point.intensity);
    for (const PotreePoint& point : points) put(raw, interleave(point.rgb[0], point.rgb[1], point.rgb[2], 16));
    for (const PotreePoint& point : points) put(raw, point.gps_time);
    return compressed(raw);
}

inline void put_record(std::vector<std::byte>& out, int type, int mask, uint32_t points, uint64_t offset, uint64_t size) {
    put(out, uint8_t(type));
    put(out, uint8_t(mask));
    put(out, points);
    put(out, offset);
    put(out, size);
}

struct Placed {
    uint32_t points = 0;
    uint64_t offset = 0, size = 0;
    int mask = 0;
};

/// The chunk of `root`, then those of the proxies that it names; each chunk's place is found before it is filled.
inline void put_chunk(const std::map<std::string, Placed>& nodes, const std::string& root, size_t step,
                      std::vector<std::byte>& out) {
    std::vector<std::string> order = {root};
    for (size_t i = 0; i < order.size(); ++i) {
        if (order[i].size() - root.size() == step) continue;
        for (char digit = '0'; digit < '8'; ++digit)
            if (nodes.at(order[i]).mask >> (digit - '0') & 1) order.push_back(order[i] + digit);
    }
    const size_t begin = out.size();
    out.resize(begin + 22 * order.size());
    for (size_t i = 0; i < order.size(); ++i) {
        const Placed& node = nodes.at(order[i]);
        std::vector<std::byte> record;
        if (i > 0 && order[i].size() - root.size() == step && node.mask != 0) {
            const size_t chunk = out.size();
            put_chunk(nodes, order[i], step, out);
            // The chunk's own size: 22 bytes a node down to its step.
            size_t count = 0;
            for (const auto& [name, ignored] : nodes)
                count += name.starts_with(order[i]) && name.size() - order[i].size() <= step;
            put_record(record, 2, node.mask, node.points, chunk, 22 * count);
        } else {
            put_record(record, node.mask != 0 ? 0 : 1, node.mask, node.points, node.offset, node.size);
        }
        std::copy(record.begin(), record.end(), out.begin() + std::ptrdiff_t(begin + 22 * i));
    }
}

inline std::string attribute_json(const char* name, const char* type, int count, int bytes, const std::string& more) {
    return std::string("{\"name\": \"") + name + "\", \"description\": \"\", \"size\": " + std::to_string(count * bytes) +
           ", \"numElements\": " + std::to_string(count) + ", \"elementSize\": " + std::to_string(bytes) +
           ", \"type\": \"" + type + "\"" + more + "}";
}

inline std::string triple(double x, double y, double z) {
    char text[128];
    std::snprintf(text, sizeof text, "[%.17g, %.17g, %.17g]", x, y, z);
    return text;
}

}  // namespace potree_detail

inline PotreeFiles make_potree(const PotreeSet& set) {
    using namespace potree_detail;
    PotreeFiles files;
    std::map<std::string, Placed> placed;
    uint64_t points = 0;
    for (const auto& [name, node_points] : set.nodes) {
        Placed node;
        node.points = uint32_t(node_points.size());
        node.offset = files.octree.size();
        if (!node_points.empty()) {
            const auto bytes = set.brotli ? brotli_columns(node_points) : packed_records(node_points);
            files.octree.insert(files.octree.end(), bytes.begin(), bytes.end());
        }
        node.size = files.octree.size() - node.offset;
        for (char digit = '0'; digit < '8'; ++digit)
            if (set.nodes.contains(name + digit)) node.mask |= 1 << (digit - '0');
        points += node.points;
        placed[name] = node;
    }
    put_chunk(placed, "r", size_t(set.step), files.hierarchy);
    size_t first = 0;
    for (const auto& [name, ignored] : placed) first += name.size() <= size_t(set.step) + 1;

    const auto& c = set.corner;
    const std::string low = triple(c[0], c[1], c[2]), high = triple(c[0] + set.side, c[1] + set.side, c[2] + set.side);
    char spacing[32];
    std::snprintf(spacing, sizeof spacing, "%.17g", set.spacing);
    files.metadata =
        "{\"version\": \"2.0\", \"name\": \"hand-made\", \"description\": \"\", \"points\": " + std::to_string(points) +
        ", \"projection\": \"EPSG:25832\", \"hierarchy\": {\"firstChunkSize\": " + std::to_string(22 * first) +
        ", \"stepSize\": " + std::to_string(set.step) + ", \"depth\": 0}, \"offset\": " + low +
        ", \"scale\": " + triple(set.scale, set.scale, set.scale) + ", \"spacing\": " + spacing +
        ", \"boundingBox\": {\"min\": " + low + ", \"max\": " + high + "}, \"encoding\": \"" +
        (set.brotli ? "BROTLI" : "DEFAULT") + "\", \"attributes\": [" +
        attribute_json("position", "int32", 3, 4, ", \"min\": " + low + ", \"max\": " + high) + ", " +
        attribute_json("intensity", "uint16", 1, 2, ", \"min\": [0], \"max\": [65535], \"scale\": [1], \"offset\": [0]") +
        ", " + attribute_json("rgb", "uint16", 3, 2, "") + ", " + attribute_json("gps-time", "double", 1, 8, "") + "]}";
    return files;
}

inline std::unique_ptr<LayeredCloud> open_potree_files(const PotreeFiles& files) {
    const auto* first = reinterpret_cast<const std::byte*>(files.metadata.data());
    std::vector<std::byte> text(first, first + files.metadata.size());
    return open_potree(memory_source("set/metadata.json", std::move(text)),
                       memory_source("set/hierarchy.bin", files.hierarchy), memory_source("set/octree.bin", files.octree));
}

/// Writes the three files into a folder that exists.
inline void write_potree_files(const PotreeFiles& files, const std::string& folder) {
    const auto write = [&](const char* name, const void* bytes, size_t size) {
        std::ofstream(folder + "/" + name, std::ios::binary).write(static_cast<const char*>(bytes), std::streamsize(size));
    };
    write("octree.bin", files.octree.data(), files.octree.size());
    write("hierarchy.bin", files.hierarchy.data(), files.hierarchy.size());
    write("metadata.json", files.metadata.data(), files.metadata.size());
}

}  // namespace strata::test
