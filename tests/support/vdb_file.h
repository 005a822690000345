#pragma once

#include <cstdint>
#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include "core/math/vec.h"

namespace strata::test {

/// Grids of a .vdb file made by hand: file version 224, not compressed, one node below the root, 128^3 points from (0, 0, 0) on in leaves.
class VdbFileByHand {
public:
    struct Grid {
        std::string name, type = "float";  // or vec3s
        std::vector<float> background = {0.0f};
        std::function<std::vector<float>(int x, int y, int z)> value;
        std::function<bool(int x, int y, int z)> is_active = [](int, int, int) { return true; };
        double voxel_size = 1.0;
        std::string grid_class = "unknown";
        int leaves = 4;  // an axis, at most 16
    };

    void add(const Grid& grid) {
        text(grid.name);
        text("Tree_" + grid.type + "_5_4_3");
        text("");
        const size_t offsets = grids_.size();
        for (int i = 0; i < 3; ++i) put(int64_t{0});
        const auto set = [&](size_t place) {
            const auto at = int64_t(kHead + grids_.size());
            std::memcpy(grids_.data() + offsets + 8 * place, &at, 8);
        };
        set(0);
        put(uint32_t{0});  // not compressed
        put(uint32_t{1});
        text("class");
        text("string");
        text(grid.grid_class);
        text("UniformScaleMap");
        for (int i = 0; i < 15; ++i) put(grid.voxel_size);  // scale, and what follows from it
        set(1);
        put(int32_t{1});
        for (const float part : grid.background) put(part);
        put(uint32_t{0});
        put(uint32_t{1});
        for (int i = 0; i < 3; ++i) put(int32_t{0});
        const auto has_child = [&](int log2, int child, int slot) {
            const int x = slot >> 2 * log2, y = slot >> log2 & ((1 << log2) - 1), z = slot & ((1 << log2) - 1);
            return log2 == 5 ? slot == 0 : child == 0 && x < grid.leaves && y < grid.leaves && z < grid.leaves;
        };
        for (const int log2 : {5, 4}) {
            const int slots = 1 << 3 * log2;
            for (int byte = 0; byte < slots / 8; ++byte) {
                uint8_t bits = 0;
                for (int bit = 0; bit < 8; ++bit) bits |= uint8_t(has_child(log2, 0, 8 * byte + bit) << bit);
                put(bits);
            }
            grids_.append(size_t(slots / 8), '\0');  // no active tile
            put(int8_t{6});                          // all values are stored
            for (int slot = 0; slot < slots; ++slot)
                for (const float part : grid.background) put(part);
        }
        for (int leaf = 0; leaf < grid.leaves * grid.leaves * grid.leaves; ++leaf) put_mask(grid, leaf);
        set(1);
        for (int leaf = 0; leaf < grid.leaves * grid.leaves * grid.leaves; ++leaf) {
            put_mask(grid, leaf);
            put(int8_t{6});
            for (int i = 0; i < 512; ++i) {
                const Vec3i p = point(grid, leaf, i);
                for (const float part : grid.value(p.x(), p.y(), p.z())) put(part);
            }
        }
        set(2);
        ++count_;
    }
    std::string bytes() const {
        std::string head("\x20\x42\x44\x56\0\0\0\0", 8);
        const auto number = [&](uint32_t value) { head.append(reinterpret_cast<const char*>(&value), 4); };
        number(224);
        number(10);
        number(0);
        head += '\1' + std::string(36, '0');
        number(0);
        number(count_);
        return head + grids_;
    }

private:
    static constexpr size_t kHead = 8 + 12 + 1 + 36 + 8;

    // Leaves come in the order of the slots of their node.
    static Vec3i point(const Grid& grid, int leaf, int i) {
        const int n = grid.leaves;
        return {8 * (leaf / (n * n)) + (i >> 6), 8 * (leaf / n % n) + (i >> 3 & 7), 8 * (leaf % n) + (i & 7)};
    }
    void put_mask(const Grid& grid, int leaf) {
        for (int byte = 0; byte < 64; ++byte) {
            uint8_t bits = 0;
            for (int bit = 0; bit < 8; ++bit) {
                const Vec3i p = point(grid, leaf, 8 * byte + bit);
                bits |= uint8_t(grid.is_active(p.x(), p.y(), p.z()) << bit);
            }
            put(bits);
        }
    }
    template <typename T>
    void put(T value) {
        grids_.append(reinterpret_cast<const char*>(&value), sizeof value);
    }
    void text(const std::string& text) {
        put(uint32_t(text.size()));
        grids_ += text;
    }

    std::string grids_;
    uint32_t count_ = 0;
};

}  // namespace strata::test
