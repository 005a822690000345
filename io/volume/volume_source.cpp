#include "io/volume/volume_source.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <type_traits>
#include <utility>

#include "core/error.h"

namespace strata {
namespace {

constexpr size_t kBuffer = 64 * 1024;
constexpr uint64_t kLargestHeader = 4096;  // that is taken for one without being told, where it is a quarter of the samples or more

template <typename Act>
void with_type(SampleType type, const Act& act) {
    switch (type) {
        case SampleType::int8: return act(int8_t{});
        case SampleType::uint8: return act(uint8_t{});
        case SampleType::int16: return act(int16_t{});
        case SampleType::uint16: return act(uint16_t{});
        case SampleType::int32: return act(int32_t{});
        case SampleType::uint32: return act(uint32_t{});
        case SampleType::int64: return act(int64_t{});
        case SampleType::uint64: return act(uint64_t{});
        case SampleType::float32: return act(float{});
        case SampleType::float64: return act(double{});
    }
}

template <typename T>
T sample_at(const std::byte* bytes, size_t i) {
    T value;
    std::memcpy(&value, bytes + i * sizeof(T), sizeof(T));
    return value;
}

// A difference as a float that is 0 only where the difference is, and finite.
float rounded(double difference) {
    constexpr double kMost = std::numeric_limits<float>::max();
    constexpr float kLeast = std::numeric_limits<float>::denorm_min();
    const float value = float(difference > kMost ? kMost : difference < -kMost ? -kMost : difference);
    return value == 0.0f && difference != 0.0 ? (difference < 0.0 ? -kLeast : kLeast) : value;
}

template <typename T>
void subtract(const std::byte* bytes, double reference, std::span<float> out) {
    if constexpr (std::is_integral_v<T> && sizeof(T) == 8) {  // more bits than a double has
        for (size_t i = 0; i < out.size(); ++i) out[i] = rounded(double(static_cast<long double>(sample_at<T>(bytes, i)) - static_cast<long double>(reference)));
    } else {
        for (size_t i = 0; i < out.size(); ++i) out[i] = rounded(double(sample_at<T>(bytes, i)) - reference);
    }
}

template <size_t Bytes>
void swap_each(std::span<std::byte> bytes) {
    for (size_t at = 0; at < bytes.size(); at += Bytes) std::reverse(bytes.data() + at, bytes.data() + at + Bytes);
}

void swap_samples(std::span<std::byte> bytes, size_t size) {
    if (size == 2) swap_each<2>(bytes);
    else if (size == 4) swap_each<4>(bytes);
    else if (size == 8) swap_each<8>(bytes);
}

template <typename T>
void extend(const std::byte* bytes, size_t count, VolumeRange& range) {
    double least = std::numeric_limits<double>::infinity(), greatest = -least;
    uint64_t nan = 0;
    for (size_t i = 0; i < count; ++i) {
        const double value = double(sample_at<T>(bytes, i));
        nan += value != value;
        least = value < least ? value : least;
        greatest = value > greatest ? value : greatest;
    }
    range.nan += nan;
    if (nan == count) return;
    range.min = range.values == 0 ? least : std::min(range.min, least);
    range.max = range.values == 0 ? greatest : std::max(range.max, greatest);
    range.values += count - nan;
}

VolumeHeader read_header(ByteStream& stream) {
    std::array<char, 512> bytes;
    const size_t size = size_t(std::min<uint64_t>(bytes.size(), stream.size()));
    stream.read(std::as_writable_bytes(std::span(bytes).first(size)));
    stream.seek(0);
    const std::string_view head(bytes.data(), size);
    if (looks_like_nrrd(head)) return read_nrrd_header(stream);
    if (looks_like_vtk(head)) return read_vtk_header(stream);
    return read_metaimage_header(stream);
}

}  // namespace

VolumeSource::VolumeSource(std::unique_ptr<ByteSource> samples, VolumeHeader header)
    : bytes_(std::move(samples)), header_(std::move(header)), samples_(open_samples(*bytes_, header_)), buffer_(kBuffer) {
    const uint64_t behind = samples_->bytes_behind();
    if (behind > 0 && !header_.more_follows) header_.notes.push_back(bytes_->name() + ": " + std::to_string(behind) + " bytes behind the last sample are left out; are size and type right?");
}

void VolumeSource::restart() {
    if (next_ == 0) return;
    samples_ = open_samples(*bytes_, header_);
    next_ = 0;
}

void VolumeSource::read_block(std::span<std::byte> out) {
    samples_->read(out);
    if (header_.is_big_endian && header_.encoding != VolumeEncoding::text) swap_samples(out, size_of(header_.type));
}

template <typename Take>
void VolumeSource::each_block(uint64_t samples, const Take& take) {
    const size_t size = size_of(header_.type);
    while (samples > 0) {
        const size_t count = size_t(std::min<uint64_t>(samples, buffer_.size() / size));
        read_block(std::span(buffer_).first(count * size));
        take(buffer_.data(), count);
        samples -= count;
    }
}

void VolumeSource::read(uint32_t count, double reference, std::span<float> out) {
    assert(count <= header_.size[2] - next_ && out.size() == uint64_t{count} * header_.size[0] * header_.size[1]);
    size_t done = 0;
    with_type(header_.type, [&]<typename T>(T) {
        each_block(out.size(), [&](const std::byte* bytes, size_t block) {
            subtract<T>(bytes, reference, out.subspan(done, block));
            done += block;
        });
    });
    next_ += count;
    if (next_ == header_.size[2]) samples_->finish();
}

VolumeRange VolumeSource::measure() {
    restart();
    next_ = header_.size[2];  // whatever happens, the next one to read begins again
    VolumeRange range;
    with_type(header_.type, [&]<typename T>(T) {
        each_block(header_.samples(), [&](const std::byte* bytes, size_t block) { extend<T>(bytes, block, range); });
    });
    samples_->finish();
    restart();
    return range;
}

std::unique_ptr<VolumeSource> open_volume(std::unique_ptr<ByteSource> source, const OpenBeside& open_beside) {
    ByteStream stream(*source);
    VolumeHeader header = read_header(stream);
    if (header.data_file.empty()) return std::make_unique<VolumeSource>(std::move(source), std::move(header));
    try {
        std::unique_ptr<ByteSource> samples = open_beside(header.data_file);
        return std::make_unique<VolumeSource>(std::move(samples), std::move(header));
    } catch (const Error& error) {
        throw error.within(source->name());
    }
}

std::unique_ptr<VolumeSource> open_volume(const std::string& path) {
    return open_volume(open_file(path), [&](const std::string& name) { return open_file((std::filesystem::path(path).parent_path() / name).string()); });
}

std::unique_ptr<VolumeSource> open_raw_volume(std::unique_ptr<ByteSource> source, const RawVolumeLayout& layout) {
    VolumeHeader header;
    header.format = "raw samples";
    header.type = layout.type;
    header.is_big_endian = layout.is_big_endian;
    header.is_at_end = !layout.offset;
    header.offset = layout.offset.value_or(0);
    set_size(header, {layout.size[0], layout.size[1], layout.size[2]}, source->name());
    header.placement.origin = layout.origin;
    header.placement.axes = layout.spacing.asDiagonal();
    check_placement(header.placement, header.size, source->name());
    if (header.is_at_end && source->size() > header.sample_bytes()) {
        const uint64_t before = source->size() - header.sample_bytes();
        if (before > kLargestHeader && before >= header.sample_bytes() / 4)
            throw Error(ErrorKind::malformed, source->name() + ": " + std::to_string(before) + " bytes more than samples of that size and type: too many for a header, unless its bytes are given");
        header.notes.push_back("the first " + std::to_string(before) + " bytes are taken for a header");
    }
    return std::make_unique<VolumeSource>(std::move(source), std::move(header));
}

}  // namespace strata
