// Text functions for messages, tables and files.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace heba {

std::string Join(const std::vector<std::string>& parts, std::string_view separator);
std::vector<std::string> Split(std::string_view text, char separator);
std::string Trim(std::string_view text);

// Returns the number of characters of a UTF-8 text.
size_t NumCharacters(std::string_view text);
// Returns `text` if it has at most `width` characters, otherwise ".." and its last characters, `width` in all. UTF-8
// characters are not cut.
std::string ShortenedAtStart(std::string_view text, size_t width);

// Pads `text` with blanks on the left, or on the right, to `width` characters.
std::string PadLeft(const std::string& text, size_t width);
std::string PadRight(const std::string& text, size_t width);

// Breaks every line of `text` that is longer than `width` at blanks. The continuation lines are indented by two more
// characters than the line. Words longer than `width` are not broken. The colour codes of terminals count as zero
// characters.
std::string Wrapped(std::string_view text, size_t width);

// Returns text from a file or the command line in a form that is safe in a message: in quotes, on one line, truncated
// if it is long.
std::string Quoted(std::string_view text);

// Escapes text for XML or HTML, attributes included, so that no part of it is read as markup. Control characters and
// line ends become blanks, because XML allows only a few of them.
std::string EscapedForMarkup(std::string_view text);

// Returns whether the bytes are valid UTF-8.
bool IsUtf8(std::string_view text);

// Returns the size of an image in words, such as "640 x 480 px".
std::string ImageSizeText(double width_px, double height_px);
// Formats `value` with `decimals` digits after the decimal point.
std::string Fixed(double value, int decimals);
// Formats `value` with `digits` significant digits, without an exponent unless the number is very large or very small.
std::string Significant(double value, int digits);
// Formats a length in mm or an angle in deg with `digits` significant digits. A non-zero amount below 1e-6 becomes "<
// 1e-6", because it is only rounding error.
std::string ShownAmount(double amount, int digits);
// Formats a sigma of robot poses in mm or deg with two significant digits; less than 0.0001 is nothing for a robot.
std::string ShownNoise(double sigma);
// Returns the number of decimals, 0 to `most`, at which the first two significant digits of `sigma` are visible.
int DecimalsFor(double sigma, int most);
// Formats a probability with one significant digit; everything below 1e-6 becomes "< 1e-6".
std::string ShownPValue(double p_value);
// Returns the shortest text that reads back as the same double.
std::string RoundTrip(double value);

// Encodes to base64 (RFC 4648) and decodes from it. Decoding stops at the first character that is not base64.
std::string ToBase64(std::string_view bytes);
std::string FromBase64(std::string_view text);

// Parses the whole of `text` as a double, which may be infinite or NaN, independently of the locale. Returns false if
// it is not a number.
bool ParseDouble(std::string_view text, double* value);

// Returns `text` with ASCII letters in lower case.
std::string Lower(std::string_view text);

// Returns whether name `a` comes before `b` if numbers in the names are compared by value: 9.png before 10.png.
bool NaturalLess(const std::string& a, const std::string& b);

// Returns "; did you mean 'x'?" with the known name nearest to `unknown`, or an empty string if none is similar.
// The shortest name that contains `unknown` in whichever case is nearer than one with other letters.
std::string DidYouMean(std::string_view unknown, const std::vector<std::string>& known);

}  // namespace heba
