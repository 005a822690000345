#pragma once

#include <charconv>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <system_error>

namespace strata {

/// The words of one line of text, one after the other, whatever the locale. Blanks are space, tab, CR, VT and FF.
class TextWords {
public:
    explicit TextWords(std::string_view line) : at_(line.data()), end_(line.data() + line.size()) {}

    static bool is_blank(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

    /// Steps over blanks; false: the line has no more words.
    bool more() {
        while (at_ < end_ && is_blank(*at_)) ++at_;
        return at_ < end_;
    }
    bool at_word_end() const { return at_ == end_ || is_blank(*at_); }
    char peek() const { return at_ < end_ ? *at_ : '\0'; }
    void skip(size_t count) { at_ += count; }

    /// The next word; empty: none.
    std::string_view word() {
        if (!more()) return {};
        const char* const begin = at_;
        while (!at_word_end()) ++at_;
        return {begin, size_t(at_ - begin)};
    }

    /// Reads the word as a number: false where it is none. NaN and infinity are numbers here, in the ways that programs write
    /// them; what is too large for a double is infinite, what is too small is 0.
    bool number(double& value) {
        if (!more()) return false;
        skip_plus();
        const char* const begin = at_;
        const auto [stop, problem] = std::from_chars(at_, end_, value);
        if (problem == std::errc::invalid_argument) return false;
        at_ = stop;
        if (problem == std::errc::result_out_of_range) value = beyond_range({begin, size_t(stop - begin)});
        if (peek() == '#') {  // 1.#QNAN, -1.#IND00, 1.#INF of old Windows libraries
            value = std::numeric_limits<double>::quiet_NaN();
            while (!at_word_end()) ++at_;
        }
        return at_word_end();
    }

    /// Reads digits with a sign or none, not the word's end. false: there are none, or more than 64 bits hold
    bool integer(int64_t& value) {
        if (at_ == end_) return false;
        skip_plus();
        const auto [stop, problem] = std::from_chars(at_, end_, value);
        at_ = stop;
        return problem == std::errc();
    }

private:
    void skip_plus() {
        if (*at_ == '+' && at_ + 1 < end_ && at_[1] != '-') ++at_;
    }

    static double beyond_range(std::string_view text) {
        const bool negative = text.starts_with('-');
        if (negative) text.remove_prefix(1);
        const size_t exponent = text.find_first_of("eE");
        const bool small = exponent == std::string_view::npos ? text.starts_with('0') || text.starts_with('.')
                                                              : text.substr(exponent + 1).starts_with('-');
        const double value = small ? 0.0 : std::numeric_limits<double>::infinity();
        return negative ? -value : value;
    }

    const char* at_;
    const char* end_;
};

/// Without the blanks at both ends.
inline std::string_view trimmed(std::string_view text) {
    while (!text.empty() && TextWords::is_blank(text.front())) text.remove_prefix(1);
    while (!text.empty() && TextWords::is_blank(text.back())) text.remove_suffix(1);
    return text;
}

/// Letters of ASCII only, whatever the locale.
inline std::string lower_case(std::string_view text) {
    std::string lower(text);
    for (char& c : lower)
        if (c >= 'A' && c <= 'Z') c = char(c + ('a' - 'A'));
    return lower;
}

}  // namespace strata
