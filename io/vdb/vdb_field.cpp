#include "io/vdb/vdb_field.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <tuple>

#include "core/error.h"
#include "io/vdb/vdb_tree.h"
#include "io/vdb/vdb_voxels.h"

namespace strata {
namespace {

constexpr std::array<int, 3> kTileLog2 = {3, 7, 12};
constexpr size_t kPageBricks = 512;
constexpr uint64_t kBrickBytes = kFieldBrickSamples * sizeof(float);

auto key_of(const Vec3i& origin) { return std::tuple(origin.z(), origin.y(), origin.x()); }

template <typename Entry>
bool comes_before(const Entry& a, const Entry& b) {
    return key_of(a.origin) < key_of(b.origin);
}

template <typename Entry>
const Entry* find(const std::vector<Entry>& sorted, const Vec3i& origin) {
    const auto found = std::lower_bound(sorted.begin(), sorted.end(), origin, [](const Entry& entry, const Vec3i& wanted) { return key_of(entry.origin) < key_of(wanted); });
    return found != sorted.end() && found->origin == origin ? &*found : nullptr;
}

// Not a number is one value.
bool is_same(float a, float b) { return a == b || (std::isnan(a) && std::isnan(b)); }

}  // namespace

VdbField::VdbField(const ByteSource& source, const VdbFieldSettings& settings) : memory_bytes_(settings.memory_bytes), memory_parts_(settings.memory_parts), scratch_(settings.scratch) {
    ByteStream stream(source);
    grid_ = choose_vdb_grid(read_vdb_header(stream), settings.grid, source.name());
    place_ = source.name() + ": grid " + grid_.name;
    if (!grid_.voxel_size || !grid_.voxel_size->allFinite() || grid_.voxel_size->cwiseAbs().minCoeff() == 0.0)
        throw Error(ErrorKind::unsupported, place_ + ": a transform that is a scale and a shift is expected, it is " + grid_.map);
    placement_.origin = grid_.place_of_0;
    placement_.axes = grid_.voxel_size->asDiagonal();

    if (settings.component && !is_vector(grid_)) throw Error(ErrorKind::unsupported, place_ + ": values of vec3s or vec3d are expected, they are " + grid_.type);

    constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
    VdbVisitor visitor;
    visitor.begin = [&](double background) { see(background_ = float(settings.only_active ? kUnknown : background)); };
    visitor.tile = [&](const Vec3i& origin, int log2_side, double value, bool active) {
        if (settings.only_active && !active) value = kUnknown;
        if (!is_same(float(value), background_)) add_tile(origin, log2_side, float(value));
    };
    visitor.leaf = [&](const Vec3i& origin, std::span<const uint64_t, 8> active, std::span<const double, 512> values) {
        if (!settings.only_active) return add_leaf(origin, values);
        std::array<double, 512> known;
        for (size_t i = 0; i < known.size(); ++i) known[i] = active[i / 64] >> i % 64 & 1 ? values[i] : kUnknown;
        add_leaf(origin, known);
    };
    read_vdb_tree(stream, grid_, visitor, settings.component);

    std::sort(bricks_.begin(), bricks_.end(), comes_before<Brick>);
    for (std::vector<Region>& tiles : tiles_) std::sort(tiles.begin(), tiles.end(), comes_before<Region>);
    add_rims();
    for (const Brick& brick : bricks_) {
        least_index_ = least_index_.cwiseMin(brick.origin);
        greatest_index_ = greatest_index_.cwiseMax((brick.origin.array() + (kFieldBrickSide - 1)).matrix());
    }
    if (bricks_.empty()) return;
    for (const Vec3i& corner : {least_index_, greatest_index_}) bounds_.extend(placement_.world_from_index(corner.cast<double>()));
}

void VdbField::see(float value) {
    if (value < least_) least_ = value;
    if (value > greatest_) greatest_ = value;
}

void VdbField::check_memory() const {
    uint64_t bytes = bricks_.capacity() * sizeof(Brick) + pages_.size() * kPageBricks * kBrickBytes;
    for (const std::vector<Region>& tiles : tiles_) bytes += tiles.capacity() * sizeof(Region);
    if (bytes > memory_bytes_)
        throw Error(ErrorKind::limit, place_ + ": its values need more than " + std::to_string(bytes * memory_parts_) + " bytes of memory, " + std::to_string(memory_bytes_ * memory_parts_) + " are allowed");
}

void VdbField::add_tile(const Vec3i& origin, int log2_side, float value) {
    see(value);
    const auto size = size_t(std::find(kTileLog2.begin(), kTileLog2.end(), log2_side) - kTileLog2.begin());
    tiles_[size].push_back({origin, value});
    if (tiles_[size].size() % 1024 == 0) check_memory();
}

void VdbField::add_leaf(const Vec3i& origin, std::span<const double, 512> values) {
    std::array<float, kFieldBrickSamples> turned;  // x runs fastest here, slowest there
    for (size_t i = 0; i < turned.size(); ++i) {
        turned[i] = float(values[(i & 7) << 6 | (i >> 3 & 7) << 3 | i >> 6]);
        see(turned[i]);
    }
    const size_t page = size_t(slots_ / kPageBricks);
    // Half of what is allowed is for values, where others have a place to go.
    const bool fits = scratch_ == nullptr || (pages_.size() > page || (page == pages_.size() && (page + 1) * kPageBricks * kBrickBytes <= memory_bytes_ / 2));
    if (fits) {
        if (page == pages_.size()) pages_.push_back(std::make_unique<float[]>(kPageBricks * kFieldBrickSamples));
        std::memcpy(pages_[page].get() + slots_ % kPageBricks * kFieldBrickSamples, turned.data(), kBrickBytes);
    } else {
        scratch_->write(slots_ * kBrickBytes, std::as_bytes(std::span(turned)));
    }
    bricks_.push_back({.origin = origin, .value = 0.0f, .slot = slots_++});
    if (bricks_.size() % 1024 == 1) check_memory();
}

// Bricks of tiles next to what has another value and is no brick itself.
void VdbField::add_rims() {
    const size_t leaves = bricks_.size();
    for (size_t size = 0; size < tiles_.size(); ++size)
        for (const Region& tile : tiles_[size]) add_rim(tile, kTileLog2[size]);
    std::sort(bricks_.begin() + ptrdiff_t(leaves), bricks_.end(), comes_before<Brick>);
    std::inplace_merge(bricks_.begin(), bricks_.begin() + ptrdiff_t(leaves), bricks_.end(), comes_before<Brick>);
}

void VdbField::add_rim(const Region& tile, int log2_side) {
    const int side = 1 << (log2_side - 3);
    for (int k = 0; k < side; ++k)
        for (int j = 0; j < side; ++j) {
            const bool inner_row = k > 0 && k + 1 < side && j > 0 && j + 1 < side;
            for (int i = 0; i < side; i += inner_row ? side - 1 : 1) {
                const Vec3i origin = tile.origin + 8 * Vec3i(i, j, k);
                if (!touches_other(origin, tile.value)) continue;
                bricks_.push_back({.origin = origin, .value = tile.value, .slot = kNoSlot});
                if (bricks_.size() % 1024 == 1) check_memory();
            }
        }
}

// Whether one of the 26 bricks around is no leaf and has another value. Leaves come first in bricks_, as long as rims are added.
bool VdbField::touches_other(const Vec3i& brick, float value) const {
    const auto leaves = std::lower_bound(bricks_.begin(), bricks_.end(), true, [](const Brick& b, bool) { return b.slot != kNoSlot; });
    for (int k = -1; k <= 1; ++k)
        for (int j = -1; j <= 1; ++j)
            for (int i = -1; i <= 1; ++i) {
                const std::array<int64_t, 3> at = {int64_t{brick.x()} + 8 * i, int64_t{brick.y()} + 8 * j, int64_t{brick.z()} + 8 * k};
                if (std::any_of(at.begin(), at.end(), [](int64_t part) { return part != int32_t(part); })) {
                    if (!is_same(value, background_)) return true;  // beyond what can be said
                    continue;
                }
                const std::array<int32_t, 3> corner = {int32_t(at[0]), int32_t(at[1]), int32_t(at[2])};
                if (is_same(absent_value(corner), value)) continue;
                const Vec3i origin(corner[0], corner[1], corner[2]);
                const auto found = std::lower_bound(bricks_.begin(), leaves, origin, [](const Brick& b, const Vec3i& wanted) { return key_of(b.origin) < key_of(wanted); });
                if (found == leaves || found->origin != origin) return true;
            }
    return false;
}

float VdbField::absent_value(const std::array<int32_t, 3>& corner) const {
    for (size_t size = 0; size < tiles_.size(); ++size) {
        if (tiles_[size].empty()) continue;
        const int32_t mask = ~((1 << kTileLog2[size]) - 1);
        if (const Region* const tile = find(tiles_[size], {corner[0] & mask, corner[1] & mask, corner[2] & mask})) return tile->value;
    }
    return background_;
}

void VdbField::read_values(const Brick& brick, std::span<float> out) const {
    const size_t page = size_t(brick.slot / kPageBricks);
    if (brick.slot == kNoSlot) std::fill(out.begin(), out.end(), brick.value);
    else if (page < pages_.size()) std::memcpy(out.data(), pages_[page].get() + brick.slot % kPageBricks * kFieldBrickSamples, kBrickBytes);
    else scratch_->read(brick.slot * kBrickBytes, std::as_writable_bytes(out));
}

float VdbField::value_at(const Vec3i& index) {
    const auto corner = [](int part) { return part & ~(kFieldBrickSide - 1); };
    const Vec3i origin(corner(index.x()), corner(index.y()), corner(index.z())), place = index - origin;
    if (last_ >= bricks_.size() || bricks_[last_].origin != origin) {
        const Brick* const found = find(bricks_, origin);
        if (!found) return absent_value({origin.x(), origin.y(), origin.z()});
        last_ = size_t(found - bricks_.data());
    }
    const Brick& brick = bricks_[last_];
    const size_t number = size_t(place.z() << 6 | place.y() << 3 | place.x()), page = size_t(brick.slot / kPageBricks);
    if (brick.slot == kNoSlot) return brick.value;
    if (page < pages_.size()) return pages_[page][brick.slot % kPageBricks * kFieldBrickSamples + number];
    if (cached_ != last_) {
        cache_.resize(kFieldBrickSamples);
        read_values(brick, cache_);
        cached_ = last_;
    }
    return cache_[number];
}

bool VdbField::next_layer(FieldBrickLayer& out) {
    out.corners.clear();
    if (next_ == bricks_.size()) return false;
    out.k = bricks_[next_].origin.z();
    size_t end = next_;
    while (end < bricks_.size() && bricks_[end].origin.z() == out.k) ++end;
    if ((end - next_) * kBrickBytes > memory_bytes_)
        throw Error(ErrorKind::limit, place_ + ": a layer of it needs " + std::to_string((end - next_) * kBrickBytes * memory_parts_) + " bytes of memory, " + std::to_string(memory_bytes_ * memory_parts_) + " are allowed");
    out.values.resize((end - next_) * kFieldBrickSamples);
    for (size_t i = 0; next_ < end; ++next_, ++i) {
        out.corners.push_back({bricks_[next_].origin.x(), bricks_[next_].origin.y()});
        read_values(bricks_[next_], std::span(out.values).subspan(i * kFieldBrickSamples, kFieldBrickSamples));
    }
    return true;
}

std::unique_ptr<VdbField> open_vdb_field(const std::string& path, const VdbFieldSettings& settings) { return std::make_unique<VdbField>(*open_file(path), settings); }

}  // namespace strata
