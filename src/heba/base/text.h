// Small text helpers for messages and tables.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace heba {

std::string Join(const std::vector<std::string>& parts, std::string_view separator);
std::vector<std::string> Split(std::string_view text, char separator);
std::string Trim(std::string_view text);

// With blanks on the left, or on the right, up to `width`.
std::string PadLeft(const std::string& text, size_t width);
std::string PadRight(const std::string& text, size_t width);

// `text` with every line that is longer than `width` broken at blanks, what follows indented two further than the line;
// words that are longer stay whole. A terminal's colour codes have no length.
std::string Wrapped(std::string_view text, size_t width);

// Text from a file or the command line as a message can show it: in quotes, on one line, cut off where it is long.
std::string Quoted(std::string_view text);

// Text as it can stand in XML or HTML, within attributes too: nothing of it is markup. Control characters, line ends
// among them, become blanks: XML has few of them.
std::string EscapedForMarkup(std::string_view text);

// Whether the bytes are UTF-8.
bool IsUtf8(std::string_view text);

// `value` with `decimals` digits after the point.
std::string Fixed(double value, int decimals);
// `value` with `digits` significant digits, without an exponent where that is readable.
std::string Significant(double value, int digits);
// A length in mm or an angle in deg, with so many significant digits; "< 1e-6" for less, which is rounding and says
// nothing of the world.
std::string ShownAmount(double amount, int digits);
// How many digits behind the point `sigma` deserves, so that its first two digits are seen; 0 to `most`.
int DecimalsFor(double sigma, int most);
// A chance as people read it: one digit, and "< 1e-6" for all that is less.
std::string ShownChance(double chance);
// The shortest text that reads back as the same double.
std::string RoundTrip(double value);

// RFC 4648's base64, and back; decoding stops at the first character that is none of it.
std::string ToBase64(std::string_view bytes);
std::string FromBase64(std::string_view text);

// The whole of `text` as a finite or non-finite double, independent of the locale; false if it is not a number.
bool ParseDouble(std::string_view text, double* value);

// Whether name `a` comes before `b`, with numbers in them by value: 9.png before 10.png.
bool NaturalLess(const std::string& a, const std::string& b);

// "; did you mean 'x'?" for the known name nearest to `unknown`, or an empty string if none is near.
std::string DidYouMean(std::string_view unknown, const std::vector<std::string>& known);

}  // namespace heba
