#include "io/png/png_writer.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cstdlib>
#include <cstring>
#include <new>
#include <string_view>

#include "core/error.h"
#include "core/parallel.h"

static_assert(std::endian::native == std::endian::little, "rows are copied as bytes of little-endian pixels");

namespace strata {
namespace {

// Fixed, not a function of the threads: the segments show in the file's bytes.
constexpr size_t kSegmentBytes = 256 << 10;

constexpr std::array<uint8_t, 8> kSignature = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
constexpr uint8_t kColorRgb = 2, kColorRgba = 6;          // PNG (third edition) 11.2.1
constexpr uint8_t kFilterSub = 1, kFilterUp = 2;          // 9.2
constexpr uint8_t kIntentPerceptual = 0;                  // 11.3.2.5

void append_u32(std::vector<std::byte>& out, uint32_t value) {
    for (int shift = 24; shift >= 0; shift -= 8) out.push_back(std::byte(value >> shift & 0xff));
}

void append_bytes(std::vector<std::byte>& out, const void* data, size_t size) {
    const auto* first = static_cast<const std::byte*>(data);
    out.insert(out.end(), first, first + size);
}

// A chunk is length, type, data, CRC-32 of type and data. The length is filled in when the data are known.
void begin_chunk(std::vector<std::byte>& out, std::string_view type) {
    append_u32(out, 0);
    append_bytes(out, type.data(), 4);
}

void end_chunk(std::vector<std::byte>& out, size_t begin) {
    const uint32_t size = uint32_t(out.size() - begin - 8);
    for (int i = 0; i < 4; ++i) out[begin + size_t(i)] = std::byte(size >> (24 - 8 * i) & 0xff);
    append_u32(out, uint32_t(crc32(0, reinterpret_cast<const Bytef*>(out.data() + begin + 4), size + 4)));
}

template <typename Fill>
void append_chunk(std::vector<std::byte>& out, std::string_view type, const Fill& fill) {
    const size_t begin = out.size();
    begin_chunk(out, type);
    fill();
    end_chunk(out, begin);
}

void pack_row(std::span<const uint32_t> rgba, size_t channels, uint8_t* out) {
    if (channels == 4) {
        std::memcpy(out, rgba.data(), rgba.size_bytes());
        return;
    }
    for (const uint32_t pixel : rgba) {
        out[0] = uint8_t(pixel);
        out[1] = uint8_t(pixel >> 8);
        out[2] = uint8_t(pixel >> 16);
        out += 3;
    }
}

// Deflate stream that ends on a byte and at a point where nothing before is referred to: segments can be put in a row.
void append_deflated(std::vector<std::byte>& out, const std::vector<uint8_t>& raw) {
    z_stream stream{};
    if (deflateInit2(&stream, 1, Z_DEFLATED, -MAX_WBITS, 9, Z_DEFAULT_STRATEGY) != Z_OK) throw std::bad_alloc();
    const size_t begin = out.size();
    out.resize(begin + deflateBound(&stream, uLong(raw.size())) + 16);  // 16: the flush's empty block
    stream.next_in = const_cast<Bytef*>(raw.data());
    stream.avail_in = uInt(raw.size());
    stream.next_out = reinterpret_cast<Bytef*>(out.data() + begin);
    stream.avail_out = uInt(out.size() - begin);
    [[maybe_unused]] const int outcome = deflate(&stream, Z_SYNC_FLUSH);
    assert(outcome == Z_OK && stream.avail_in == 0 && stream.avail_out > 0);
    out.resize(begin + stream.total_out);
    deflateEnd(&stream);
}

}  // namespace

PngWriter::PngWriter(const std::string& path, uint32_t width, uint32_t height, const Options& options)
    : file_(path, options.overwrite),
      width_(width),
      height_(height),
      channels_(options.alpha == Alpha::kept ? 4 : 3),
      options_(options) {
    if (width == 0 || height == 0 || width > INT32_MAX || height > INT32_MAX)
        throw Error(ErrorKind::usage, path + ": a PNG of " + std::to_string(width) + " x " + std::to_string(height) + " pixels cannot be");
    segment_rows_ = uint32_t(std::clamp<size_t>(kSegmentBytes / row_bytes(), 1, height));

    std::vector<std::byte> head;
    append_bytes(head, kSignature.data(), kSignature.size());
    append_chunk(head, "IHDR", [&] {
        append_u32(head, width);
        append_u32(head, height);
        const std::array<uint8_t, 5> format = {8, channels_ == 4 ? kColorRgba : kColorRgb, 0, 0, 0};
        append_bytes(head, format.data(), format.size());
    });
    append_chunk(head, "sRGB", [&] { head.push_back(std::byte(kIntentPerceptual)); });
    if (!options_.software.empty())
        append_chunk(head, "tEXt", [&] {
            append_bytes(head, "Software", 9);  // with its 0
            append_bytes(head, options_.software.data(), options_.software.size());
        });
    const std::array<uint8_t, 2> zlib_head = {0x78, 0x01};  // RFC 1950: deflate, 32 KiB window, fastest
    append_chunk(head, "IDAT", [&] { append_bytes(head, zlib_head.data(), zlib_head.size()); });
    file_.write(head);
}

void PngWriter::write_rows(std::span<const uint32_t> rgba) {
    assert(rgba.size() % width_ == 0 && rgba.size() / width_ <= height_ - rows_come_);
    rows_come_ += uint32_t(rgba.size() / width_);
    const size_t segment_pixels = size_t(segment_rows_) * width_;
    if (!pending_.empty()) {
        const size_t taken = std::min(segment_pixels - pending_.size(), rgba.size());
        pending_.insert(pending_.end(), rgba.begin(), rgba.begin() + ptrdiff_t(taken));
        rgba = rgba.subspan(taken);
        if (pending_.size() == segment_pixels || rows_come_ == height_) {
            write_segments(pending_);
            pending_.clear();
        }
    }
    const size_t whole = rows_come_ == height_ ? rgba.size() : rgba.size() / segment_pixels * segment_pixels;
    write_segments(rgba.first(whole));
    pending_.insert(pending_.end(), rgba.begin() + ptrdiff_t(whole), rgba.end());
}

// As many segments at a time as there are threads, so that memory stays small however many rows one call brings.
void PngWriter::write_segments(std::span<const uint32_t> rgba) {
    const size_t segment_pixels = size_t(segment_rows_) * width_;
    const size_t group_segments = size_t(std::max(options_.threads, 1)) * 4;
    while (!rgba.empty()) {
        const std::span<const uint32_t> group = rgba.first(std::min(rgba.size(), group_segments * segment_pixels));
        std::vector<Segment> segments((group.size() + segment_pixels - 1) / segment_pixels);
        parallel_blocks(options_.threads, segments.size(), 1, [&](size_t begin, size_t end) {
            for (size_t i = begin; i < end; ++i) {
                const size_t first = i * segment_pixels;
                segments[i] = compress(group.subspan(first, std::min(segment_pixels, group.size() - first)));
            }
        });
        for (const Segment& segment : segments) {
            checksum_ = uint32_t(adler32_combine(checksum_, segment.checksum, z_off_t(segment.raw_bytes)));
            file_.write(segment.chunk);
        }
        rgba = rgba.subspan(group.size());
    }
}

PngWriter::Segment PngWriter::compress(std::span<const uint32_t> rgba) const {
    const size_t rows = rgba.size() / width_;
    const size_t stride = row_bytes() - 1;
    std::vector<uint8_t> raw(rows * row_bytes());
    std::vector<uint8_t> row(stride), above(stride);
    for (size_t y = 0; y < rows; ++y) {
        pack_row(rgba.subspan(y * width_, width_), channels_, row.data());
        uint8_t* out = raw.data() + y * row_bytes();
        if (y == 0) {  // the row above belongs to another segment
            *out++ = kFilterSub;
            for (size_t i = 0; i < channels_; ++i) out[i] = row[i];
            for (size_t i = channels_; i < stride; ++i) out[i] = uint8_t(row[i] - row[i - channels_]);
        } else {
            *out++ = kFilterUp;
            for (size_t i = 0; i < stride; ++i) out[i] = uint8_t(row[i] - above[i]);
        }
        std::swap(row, above);
    }
    Segment segment;
    segment.raw_bytes = raw.size();
    segment.checksum = uint32_t(adler32(adler32(0, nullptr, 0), raw.data(), uInt(raw.size())));
    append_chunk(segment.chunk, "IDAT", [&] { append_deflated(segment.chunk, raw); });
    return segment;
}

void PngWriter::finish() {
    assert(rows_come_ == height_ && pending_.empty());
    std::vector<std::byte> tail;
    append_chunk(tail, "IDAT", [&] {
        const std::array<uint8_t, 2> empty_last_block = {0x03, 0x00};  // RFC 1951: final, fixed codes, end of block
        append_bytes(tail, empty_last_block.data(), empty_last_block.size());
        append_u32(tail, checksum_);
    });
    append_chunk(tail, "IEND", [] {});
    file_.write(tail);
    file_.commit(options_.durability);
}

}  // namespace strata
