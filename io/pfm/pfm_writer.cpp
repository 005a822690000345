#include "io/pfm/pfm_writer.h"

#include <bit>
#include <cassert>
#include <vector>

static_assert(std::endian::native == std::endian::little, "floats are written as they lie in memory");

namespace strata {

PfmWriter::PfmWriter(const std::string& path, uint32_t width, uint32_t height, bool overwrite)
    : file_(path, overwrite), width_(width), height_(height) {
    const std::string head = "Pf\n" + std::to_string(width) + " " + std::to_string(height) + "\n-1.0\n";
    head_bytes_ = head.size();
    file_.write(std::as_bytes(std::span(head)));
    file_.truncate(head_bytes_ + uint64_t{width} * height * sizeof(float));
}

void PfmWriter::write_rows(uint32_t first_row, std::span<const float> values) {
    assert(values.size() % width_ == 0 && values.size() / width_ <= height_ - first_row);
    const uint32_t rows = uint32_t(values.size() / width_);
    std::vector<float> upside_down;
    upside_down.reserve(values.size());
    for (uint32_t row = rows; row-- > 0;) {
        const std::span<const float> source = values.subspan(size_t(row) * width_, width_);
        upside_down.insert(upside_down.end(), source.begin(), source.end());
    }
    const uint64_t row_from_bottom = height_ - first_row - rows;
    file_.write_at(head_bytes_ + row_from_bottom * width_ * sizeof(float), std::as_bytes(std::span(upside_down)));
}

void PfmWriter::finish() { file_.commit(Durability::unsynced); }

}  // namespace strata
