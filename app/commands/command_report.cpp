#include "app/commands/command_report.h"

#include <cstdio>
#include <nlohmann/json.hpp>

#include "app/printable_text.h"

namespace strata {

void print_notes(std::span<const std::string> notes) {
    for (const std::string& note : notes) std::fprintf(stderr, "note: %s\n", printable(note).c_str());
}

void print_json(const nlohmann::ordered_json& report) {
    std::printf("%s\n", report.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace).c_str());
}

}  // namespace strata
