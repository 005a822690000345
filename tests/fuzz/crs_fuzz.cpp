// Any bytes are GeoTIFF keys or the text of a coordinate reference system: they are understood, left out, or refused with an Error.
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <vector>

#include "core/error.h"
#include "io/crs/crs_text.h"
#include "io/crs/geotiff_crs.h"

// The first byte says which: 0, and two 16-bit sizes of the directory and of the numbers before these and the texts; else a text.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    using namespace strata;
    const std::span<const std::byte> bytes(reinterpret_cast<const std::byte*>(data), size);
    try {
        if (size > 0 && data[0] != 0) {
            const std::string text(reinterpret_cast<const char*>(data) + 1, size - 1);
            (void)describe_crs(text);
            (void)crs_name(text);
            (void)same_crs(wkt1_of_crs(text), "EPSG:4326");
            return 0;
        }
        ByteReader reader(bytes, "fuzz");
        reader.skip(1);
        const uint16_t directory_bytes = reader.read<uint16_t>(), number_bytes = reader.read<uint16_t>();
        const std::span<const std::byte> directory = reader.take(directory_bytes), numbers = reader.take(number_bytes);
        std::vector<std::string> notes;
        (void)crs_of_geotiff_keys(ByteReader(directory, "fuzz"), numbers, reader.take(reader.left()), notes);
    } catch (const Error&) {
    }
    return 0;
}
