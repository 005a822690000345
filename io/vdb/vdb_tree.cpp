#include "io/vdb/vdb_tree.h"

#include <blosc.h>
#include <zlib.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <tuple>
#include <type_traits>
#include <vector>

#include "core/error.h"

namespace strata {
namespace {

constexpr uint32_t kZip = 1, kActiveOnly = 2, kBlosc = 4;  // bits of compression
constexpr int kLeafLog2 = 3, kLowerLog2 = 4, kUpperLog2 = 5;

// IEEE 754, binary16.
float float_from_half(uint16_t half) {
    const uint32_t sign = uint32_t(half & 0x8000) << 16, exponent = half >> 10 & 31, fraction = half & 0x3FF;
    if (exponent == 0) return std::bit_cast<float>(sign | std::bit_cast<uint32_t>(std::ldexp(float(fraction), -24)));
    return std::bit_cast<float>(sign | (exponent == 31 ? 0x7F800000 : (exponent + 112) << 23) | fraction << 13);
}

// Values of a tree: float, double, three of them, or for truth a byte of 0 or 1.
template <typename T>
constexpr bool is_truth = std::is_same_v<T, uint8_t>;

template <typename Scalar>
struct Triple {
    std::array<Scalar, 3> parts;
};

template <typename T>
struct Parts {
    using Scalar = T;
    static constexpr size_t kCount = 1;
};
template <typename S>
struct Parts<Triple<S>> {
    using Scalar = S;
    static constexpr size_t kCount = 3;
};

template <typename T>
T negative(T value) {
    if constexpr (is_truth<T>) return T(value == 0);
    else if constexpr (Parts<T>::kCount == 3) return {{-value.parts[0], -value.parts[1], -value.parts[2]}};
    else return -value;
}

// What a number says of the values that are not active and so not stored.
enum class Inactive : int8_t { background, minus_background, one_value, mask_of_backgrounds, mask_of_background_and_one, mask_of_two, all_stored };

template <typename T>
class TreeReader {
public:
    TreeReader(ByteStream& stream, const VdbGrid& grid, const VdbVisitor& visitor, int component = 0)
        : stream_(stream), grid_(grid), visitor_(visitor), component_(size_t(component)) {}

    T read_background() {
        stream_.seek(grid_.tree_offset);
        if (stream_.number<int32_t>() != 1) stream_.fail_at_byte("a tree with one buffer is expected");
        return read_number();
    }
    void read() {
        background_ = read_background();
        read_root();
        for (const std::array<int32_t, 3>& leaf : leaves_) read_leaf({leaf[0], leaf[1], leaf[2]});
        if (stream_.position() != grid_.tree_end)
            stream_.fail_at_byte("the grid's end at byte " + std::to_string(grid_.tree_end) + " is expected here");
    }

private:
    using Word = uint64_t;
    template <int Log2>
    using Mask = std::array<Word, (size_t{1} << 3 * Log2) / 64>;

    template <size_t Words>
    static bool is_on(const std::array<Word, Words>& mask, size_t bit) {
        return mask[bit / 64] >> bit % 64 & 1;
    }
    template <size_t Words>
    void load(std::array<Word, Words>& mask) {
        stream_.read(std::as_writable_bytes(std::span(mask)));
    }

    T read_number() {
        if constexpr (is_truth<T>) return T(stream_.number<uint8_t>() != 0);
        else if constexpr (Parts<T>::kCount == 3) {
            T value;
            for (auto& part : value.parts) part = stream_.number<typename Parts<T>::Scalar>();
            return value;
        } else return stream_.number<T>();
    }
    double told(const T& value) const {
        if constexpr (Parts<T>::kCount == 3) return double(value.parts[component_]);
        else return double(value);
    }

    void read_root() {
        visitor_.begin(told(background_));
        const uint32_t tiles = stream_.number<uint32_t>(), children = stream_.number<uint32_t>();
        const std::array<int64_t, 3> before = {std::numeric_limits<int64_t>::min(), 0, 0};
        std::array<int64_t, 3> last = before;
        for (uint32_t i = 0; i < tiles; ++i) {
            const Vec3i origin = read_root_origin(last);
            const T value = read_number();
            const bool active = stream_.number<uint8_t>() != 0;
            visitor_.tile(origin, 12, told(value), active);
        }
        last = before;
        for (uint32_t i = 0; i < children; ++i) read_upper(read_root_origin(last));
    }
    // They ascend, as OpenVDB keeps them, so none comes twice.
    Vec3i read_root_origin(std::array<int64_t, 3>& last) {
        std::array<int64_t, 3> place;
        for (int64_t& part : place) part = stream_.number<int32_t>();
        for (const int64_t part : place)
            if ((part & 4095) != 0) stream_.fail_at_byte("a multiple of 4096 is expected, as places of nodes below the root are");
        if (place <= last) stream_.fail_at_byte("nodes below the root in ascending order are expected");
        last = place;
        return {int(place[0]), int(place[1]), int(place[2])};
    }

    void read_upper(const Vec3i& origin) {
        read_inner<kUpperLog2>(origin, kLowerLog2 + kLeafLog2, [&](const Vec3i& child) {
            read_inner<kLowerLog2>(child, kLeafLog2, [&](const Vec3i& leaf) {
                stream_.skip(64);  // its active mask, which comes again with its values
                leaves_.push_back({leaf.x(), leaf.y(), leaf.z()});
            });
        });
    }

    // A node of 2^Log2 children a side, each of 2^child_log2 points a side.
    template <int Log2, typename ReadChild>
    void read_inner(const Vec3i& origin, int child_log2, const ReadChild& read_child) {
        constexpr size_t kSlots = size_t{1} << 3 * Log2;
        const auto children = std::make_unique<Mask<Log2>>(), active = std::make_unique<Mask<Log2>>();
        load(*children);
        load(*active);
        std::vector<T>& values = Log2 == kUpperLog2 ? upper_values_ : lower_values_;
        values.resize(kSlots);
        read_values(std::span(values), *active);
        const auto place = [&](size_t slot) {
            const Vec3i in_node(int(slot >> 2 * Log2), int(slot >> Log2 & ((1 << Log2) - 1)), int(slot & ((1 << Log2) - 1)));
            return Vec3i(origin + (in_node.array() * (1 << child_log2)).matrix());
        };
        for (size_t slot = 0; slot < kSlots; ++slot)
            if (!is_on(*children, slot)) visitor_.tile(place(slot), child_log2, told(values[slot]), is_on(*active, slot));
        for (size_t slot = 0; slot < kSlots; ++slot)
            if (is_on(*children, slot)) read_child(place(slot));
    }

    void read_leaf(const Vec3i& origin) {
        Mask<kLeafLog2> active;
        load(active);
        std::array<double, 512> values;
        if constexpr (is_truth<T>) {
            stream_.skip(12);  // its origin
            Mask<kLeafLog2> bits = active;
            if (grid_.type == "bool") load(bits);
            for (size_t i = 0; i < values.size(); ++i) values[i] = is_on(bits, i);
        } else {
            std::array<T, 512> stored;
            read_values(std::span<T>(stored), active);
            for (size_t i = 0; i < values.size(); ++i) values[i] = told(stored[i]);
        }
        visitor_.leaf(origin, active, values);
    }

    // The values of a node: all, or where only active ones are stored, these with what the rest is.
    template <size_t Words>
    void read_values(std::span<T> out, const std::array<Word, Words>& active) {
        const int8_t number = stream_.number<int8_t>();
        if (number < 0 || number > int8_t(Inactive::all_stored)) stream_.fail_at_byte("a number from 0 to 6 is expected, for values that are not active");
        const Inactive inactive{number};
        T off = inactive == Inactive::background ? background_ : negative(background_), on = background_;
        const bool two = inactive == Inactive::mask_of_two;
        if (two || inactive == Inactive::one_value || inactive == Inactive::mask_of_background_and_one) off = read_number();
        if (two) on = read_number();
        std::array<Word, Words> selected{};
        if (two || inactive == Inactive::mask_of_backgrounds || inactive == Inactive::mask_of_background_and_one) load(selected);

        size_t count = out.size();
        if ((grid_.compression & kActiveOnly) != 0 && inactive != Inactive::all_stored) {
            count = 0;
            for (const Word word : active) count += size_t(std::popcount(word));
        }
        read_numbers(out.first(count));
        if (count == out.size()) return;
        // The last active value is the last that was stored.
        for (size_t i = out.size(), next = count; i-- > 0;) out[i] = is_on(active, i) ? out[--next] : is_on(selected, i) ? on : off;
    }

    void read_numbers(std::span<T> out) {
        if (grid_.is_half && !is_truth<T>) {
            if (out.empty()) return;  // then nothing is stored, not even a length
            using Scalar = typename Parts<T>::Scalar;
            const size_t count = out.size() * Parts<T>::kCount;
            bytes_.resize(count * 2);
            read_bytes(bytes_);
            auto* const parts = reinterpret_cast<std::byte*>(out.data());
            for (size_t i = 0; i < count; ++i) {
                uint16_t half;
                std::memcpy(&half, bytes_.data() + 2 * i, sizeof half);
                const auto part = Scalar(float_from_half(half));
                std::memcpy(parts + i * sizeof part, &part, sizeof part);
            }
            return;
        }
        bytes_.resize(out.size() * sizeof(T));
        read_bytes(bytes_);
        if constexpr (is_truth<T>)
            for (size_t i = 0; i < out.size(); ++i) out[i] = T(bytes_[i] != std::byte{0});
        else if (!out.empty())
            std::memcpy(out.data(), bytes_.data(), bytes_.size());
    }

    void read_bytes(std::span<std::byte> out) {
        if ((grid_.compression & (kZip | kBlosc)) == 0) {
            stream_.read(out);
            return;
        }
        // A length, or where compression gained nothing, minus that.
        const int64_t length = stream_.number<int64_t>();
        if (length <= 0) {
            if (uint64_t(-(length + 1)) + 1 != out.size() && !(length == 0 && out.empty()))
                stream_.fail_at_byte(std::to_string(out.size()) + " bytes are expected, the length is " + std::to_string(length));
            stream_.read(out);
            return;
        }
        if (uint64_t(length) > out.size() + BLOSC_MAX_OVERHEAD)
            stream_.fail_at_byte("a compressed length of at most " + std::to_string(out.size()) + " bytes is expected, it is " + std::to_string(length));
        packed_.resize(size_t(length));
        stream_.read(packed_);
        if (!((grid_.compression & kBlosc) != 0 ? unpack_blosc(out) : unpack_zip(out)))
            stream_.fail_at_byte(std::to_string(length) + " bytes before here do not decompress to " + std::to_string(out.size()));
    }
    bool unpack_zip(std::span<std::byte> out) {
        uLongf size = out.size();
        return uncompress(reinterpret_cast<Bytef*>(out.data()), &size, reinterpret_cast<const Bytef*>(packed_.data()), packed_.size()) == Z_OK &&
               size == out.size();
    }
    bool unpack_blosc(std::span<std::byte> out) {
        size_t size = 0;
        if (blosc_cbuffer_validate(packed_.data(), packed_.size(), &size) != 0 || size != out.size()) return false;
        return blosc_decompress_ctx(packed_.data(), out.data(), out.size(), 1) == int(out.size());
    }

    ByteStream& stream_;
    const VdbGrid& grid_;
    const VdbVisitor& visitor_;
    size_t component_;
    T background_{};
    std::vector<std::array<int32_t, 3>> leaves_;
    std::vector<T> upper_values_, lower_values_;
    std::vector<std::byte> bytes_, packed_;
};

}  // namespace

bool is_readable(const VdbGrid& grid) {
    return grid.is_common && grid.tree_offset != 0 && (grid.type == "float" || grid.type == "double" || grid.type == "bool" || grid.type == "mask");
}

bool is_vector(const VdbGrid& grid) { return grid.is_common && grid.tree_offset != 0 && (grid.type == "vec3s" || grid.type == "vec3d"); }

double read_vdb_background(ByteStream& stream, const VdbGrid& grid) {
    const VdbVisitor none;
    if (grid.type == "float") return double(TreeReader<float>(stream, grid, none).read_background());
    if (grid.type == "double") return TreeReader<double>(stream, grid, none).read_background();
    return double(TreeReader<uint8_t>(stream, grid, none).read_background());
}

void read_vdb_tree(ByteStream& stream, const VdbGrid& grid, const VdbVisitor& visitor, std::optional<int> component) {
    if (grid.is_common && grid.tree_offset == 0)
        throw Error(ErrorKind::unsupported, stream.name() + ": grid " + grid.name + ": its tree stands behind a transform that is not read");
    if (component && is_vector(grid)) {
        if (grid.type == "vec3s") return TreeReader<Triple<float>>(stream, grid, visitor, *component).read();
        return TreeReader<Triple<double>>(stream, grid, visitor, *component).read();
    }
    if (!is_readable(grid))
        throw Error(ErrorKind::unsupported, stream.name() + ": grid " + grid.name + ": values of float, double, bool or mask are expected, they are " + grid.type);
    if (grid.type == "float")
        TreeReader<float>(stream, grid, visitor).read();
    else if (grid.type == "double")
        TreeReader<double>(stream, grid, visitor).read();
    else
        TreeReader<uint8_t>(stream, grid, visitor).read();
}

}  // namespace strata
