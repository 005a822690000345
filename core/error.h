#pragma once

#include <stdexcept>
#include <string>
#include <string_view>

namespace strata {

/// What went wrong, as far as a caller can act on it; app/main.cpp maps each to an exit code.
enum class ErrorKind { usage, not_found, malformed, unsupported, io, limit, device };

/// The one exception strata throws. Places read from the outside in: "scan.las: header: 375 bytes needed, 37 left".
struct Error : std::runtime_error {
    Error(ErrorKind error_kind, const std::string& message) : std::runtime_error(message), kind(error_kind) {}
    Error within(std::string_view place) const { return {kind, std::string(place) + ": " + what()}; }

    ErrorKind kind;
};

}  // namespace strata
