#pragma once

#include <zlib.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "core/error.h"
#include "io/volume/volume_source.h"
#include "tests/support/las_file.h"

namespace strata::test {

/// Numbers as the bytes of a file.
template <typename T>
std::string packed(const std::vector<T>& values, bool big_endian = false) {
    std::string bytes(values.size() * sizeof(T), '\0');
    std::memcpy(bytes.data(), values.data(), bytes.size());
    if (big_endian)
        for (size_t at = 0; at < bytes.size(); at += sizeof(T)) std::reverse(bytes.begin() + ptrdiff_t(at), bytes.begin() + ptrdiff_t(at + sizeof(T)));
    return bytes;
}

/// window_bits  15: zlib, 31: gzip
inline std::string deflated(const std::string& bytes, int window_bits) {
    z_stream stream{};
    deflateInit2(&stream, 9, Z_DEFLATED, window_bits, 8, Z_DEFAULT_STRATEGY);
    std::string out(deflateBound(&stream, uLong(bytes.size())) + 64, '\0');
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
    stream.avail_in = uInt(bytes.size());
    stream.next_out = reinterpret_cast<Bytef*>(out.data());
    stream.avail_out = uInt(out.size());
    deflate(&stream, Z_FINISH);
    out.resize(stream.total_out);
    deflateEnd(&stream);
    return out;
}

/// A file beside a header.
struct Beside {
    std::string name, bytes;
};

inline std::unique_ptr<VolumeSource> volume_of(const std::string& bytes, const Beside& beside = {}) {
    return open_volume(memory_source("volume", bytes_of(bytes)), [&](const std::string& name) {
        if (name != beside.name) throw Error(ErrorKind::not_found, name + ": no such file");
        return memory_source(name, bytes_of(beside.bytes));
    });
}

inline std::vector<float> values_of(VolumeSource& volume, double reference = 0.0) {
    volume.restart();
    const std::array<uint32_t, 3> size = volume.size();
    std::vector<float> values(size_t(volume.header().samples()));
    // By one slice, then by all that are left.
    const size_t slice = size_t{size[0]} * size[1];
    volume.read(1, reference, std::span(values).first(slice));
    if (size[2] > 1) volume.read(size[2] - 1, reference, std::span(values).subspan(slice));
    return values;
}

/// Opens and reads all. The message of the Error that it throws; empty: none.
inline std::string volume_refusal(const std::string& bytes, const Beside& beside = {}) {
    try {
        values_of(*volume_of(bytes, beside));
    } catch (const Error& error) {
        return error.what();
    }
    return {};
}

}  // namespace strata::test
