#include "io/world_file.h"

#include <charconv>
#include <filesystem>
#include <span>

#include "io/output_file.h"

namespace strata {

std::string world_file_text(const PictureGeoreference& g) {
    std::string text;
    for (const double value : {g.right_step.x(), g.right_step.y(), g.down_step.x(), g.down_step.y(), g.first_center.x(), g.first_center.y()}) {
        char digits[400];  // fixed notation of any double: not every GIS reads exponents
        const auto [end, error] = std::to_chars(digits, digits + sizeof(digits), value + 0.0, std::chars_format::fixed);  // + 0: no "-0"
        text.append(digits, end).push_back('\n');
    }
    return text;
}

std::string world_file_path(const std::string& png_path) {
    return std::filesystem::path(png_path).replace_extension(".pgw").string();
}

void write_world_file(const std::string& path, const PictureGeoreference& georeference, bool overwrite) {
    const std::string text = world_file_text(georeference);
    OutputFile file(path, overwrite);
    file.write(std::as_bytes(std::span(text)));
    file.commit(Durability::unsynced);
}

}  // namespace strata
