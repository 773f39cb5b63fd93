#include "heba/base/text.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <numeric>

namespace heba {
namespace {

// Returns the Levenshtein distance, where a swap of neighbouring characters counts as one edit.
int EditDistance(std::string_view a, std::string_view b) {
  std::vector<std::vector<int>> d(a.size() + 1, std::vector<int>(b.size() + 1));
  for (size_t i = 0; i <= a.size(); ++i) d[i][0] = static_cast<int>(i);
  for (size_t j = 0; j <= b.size(); ++j) d[0][j] = static_cast<int>(j);
  for (size_t i = 1; i <= a.size(); ++i) {
    for (size_t j = 1; j <= b.size(); ++j) {
      const int substitution = d[i - 1][j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, substitution});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
      }
    }
  }
  return d[a.size()][b.size()];
}

// Returns whether a byte of a UTF-8 text is not the first one of its character.
bool ContinuesCharacter(char byte) { return (static_cast<unsigned char>(byte) & 0xC0) == 0x80; }

}  // namespace

std::string Join(const std::vector<std::string>& parts, std::string_view separator) {
  std::string joined;
  for (size_t i = 0; i < parts.size(); ++i) {
    if (i > 0) joined += separator;
    joined += parts[i];
  }
  return joined;
}

std::vector<std::string> Split(std::string_view text, char separator) {
  std::vector<std::string> parts;
  size_t start = 0;
  while (true) {
    const size_t end = text.find(separator, start);
    if (end == std::string_view::npos) {
      parts.emplace_back(text.substr(start));
      return parts;
    }
    parts.emplace_back(text.substr(start, end - start));
    start = end + 1;
  }
}

std::string Trim(std::string_view text) {
  constexpr std::string_view kSpace = " \t\r\n";
  const size_t first = text.find_first_not_of(kSpace);
  if (first == std::string_view::npos) return "";
  return std::string(text.substr(first, text.find_last_not_of(kSpace) - first + 1));
}

size_t NumCharacters(std::string_view text) {
  return text.size() - static_cast<size_t>(std::count_if(text.begin(), text.end(), ContinuesCharacter));
}

std::string ShortenedAtStart(std::string_view text, size_t width) {
  constexpr std::string_view kDots = "..";
  if (NumCharacters(text) <= width) return std::string(text);
  size_t begin = text.size();
  for (size_t length = kDots.size(); length < width;) length += ContinuesCharacter(text[--begin]) ? 0 : 1;
  return std::string(kDots) + std::string(text.substr(begin));
}

std::string PadLeft(const std::string& text, size_t width) {
  const size_t length = NumCharacters(text);
  return length < width ? std::string(width - length, ' ') + text : text;
}

std::string PadRight(const std::string& text, size_t width) {
  const size_t length = NumCharacters(text);
  return length < width ? text + std::string(width - length, ' ') : text;
}

std::string Wrapped(std::string_view text, size_t width) {
  // Escape sequences ESC [ ... m have no length.
  const auto length_of = [](std::string_view word) {
    size_t length = 0;
    for (size_t i = 0; i < word.size(); ++i) {
      if (word[i] == '\x1b') {
        i = std::min(word.find('m', i), word.size());
      } else {
        ++length;
      }
    }
    return length;
  };
  std::vector<std::string> lines;
  for (const std::string& line : Split(text, '\n')) {
    if (length_of(line) <= width) {
      lines.push_back(line);
      continue;
    }
    const size_t indent = std::min(line.find_first_not_of(' '), line.size());
    std::string broken(indent, ' ');
    size_t length = indent;
    bool has_word = false;
    for (const std::string& word : Split(std::string_view(line).substr(indent), ' ')) {
      const size_t word_length = length_of(word);
      if (has_word && length + 1 + word_length > width) {
        lines.push_back(broken);
        broken = std::string(indent + 2, ' ');
        length = indent + 2;
        has_word = false;
      }
      if (has_word) broken += ' ';
      broken += word;
      length += word_length + (has_word ? 1 : 0);
      has_word = true;
    }
    lines.push_back(broken);
  }
  return Join(lines, "\n");
}

std::string Quoted(std::string_view text) {
  constexpr size_t kMaxLength = 60;
  size_t length = std::min(text.size(), kMaxLength);
  // Do not cut within a UTF-8 character.
  while (length < text.size() && length > 0 && ContinuesCharacter(text[length])) --length;
  std::string shown(text.substr(0, length));
  for (char& c : shown) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  }
  return "'" + shown + (length < text.size() ? "...'" : "'");
}

std::string EscapedForMarkup(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      case '\'':
        escaped += "&#39;";
        break;
      default:
        escaped += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
    }
  }
  return escaped;
}

bool IsUtf8(std::string_view text) {
  for (size_t i = 0; i < text.size();) {
    const auto first = static_cast<unsigned char>(text[i]);
    const size_t more = first < 0x80                    ? 0
                        : first >= 0xc2 && first < 0xe0 ? 1
                        : first >= 0xe0 && first < 0xf0 ? 2
                        : first >= 0xf0 && first < 0xf5 ? 3
                                                        : text.size();
    if (i + more >= text.size()) return false;
    for (size_t k = 1; k <= more; ++k) {
      if ((static_cast<unsigned char>(text[i + k]) & 0xc0) != 0x80) return false;
    }
    i += more + 1;
  }
  return true;
}

std::string ImageSizeText(double width_px, double height_px) {
  return Fixed(width_px, 0) + " x " + Fixed(height_px, 0) + " px";
}

std::string Fixed(double value, int decimals) {
  char buffer[512];
  std::snprintf(buffer, sizeof(buffer), "%.*f", decimals, value);
  // A value that is rounded to zero has no sign.
  const bool is_zero = std::string_view(buffer).find_first_not_of("-0.") == std::string_view::npos;
  return is_zero && buffer[0] == '-' ? buffer + 1 : buffer;
}

std::string Significant(double value, int digits) {
  if (!std::isfinite(value)) return std::isnan(value) ? "nan" : (value > 0 ? "inf" : "-inf");
  if (value == 0) return "0";
  const int exponent = static_cast<int>(std::floor(std::log10(std::abs(value))));
  if (exponent >= digits + 3 || exponent < -6) {
    char buffer[64];
    std::snprintf(buffer, sizeof(buffer), "%.*e", digits - 1, value);
    return buffer;
  }
  return Fixed(value, std::max(0, digits - 1 - exponent));
}

std::string ShownAmount(double amount, int digits) {
  constexpr double kLeast = 1e-6;
  return std::abs(amount) < kLeast && amount != 0 ? "< 1e-6" : Significant(amount, digits);
}

std::string ShownNoise(double sigma) {
  constexpr double kLeast = 1e-4;
  return sigma < kLeast && sigma > 0 ? "< 0.0001" : Significant(sigma, 2);
}

int DecimalsFor(double sigma, int most) {
  if (!(sigma > 0)) return most;
  return std::clamp(1 - static_cast<int>(std::floor(std::log10(sigma))), 0, most);
}

std::string ShownPValue(double p_value) { return p_value < 1e-6 ? "< 1e-6" : Significant(p_value, 1); }

std::string RoundTrip(double value) {
  char buffer[64];
  const auto [end, error] = std::to_chars(buffer, buffer + sizeof(buffer), value);
  return error == std::errc() ? std::string(buffer, end) : std::string("nan");
}

namespace {
constexpr std::string_view kBase64 = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
}  // namespace

std::string ToBase64(std::string_view bytes) {
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (size_t i = 0; i < bytes.size(); i += 3) {
    uint32_t group = 0;
    for (size_t k = 0; k < 3; ++k) {
      group = (group << 8) | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0U);
    }
    for (size_t k = 0; k < 4; ++k) text += i + k <= bytes.size() ? kBase64[(group >> (18 - 6 * k)) & 63U] : '=';
  }
  return text;
}

std::string FromBase64(std::string_view text) {
  std::string bytes;
  uint32_t group = 0;
  int num_bits = 0;
  for (const char c : text) {
    const size_t value = kBase64.find(c);
    if (value == std::string_view::npos) break;
    group = (group << 6) | static_cast<uint32_t>(value);
    num_bits += 6;
    if (num_bits < 8) continue;
    num_bits -= 8;
    bytes += static_cast<char>((group >> num_bits) & 255U);
  }
  return bytes;
}

bool ParseDouble(std::string_view text, double* value) {
  if (text.starts_with("+-")) return false;
  if (text.starts_with('+')) text.remove_prefix(1);
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *value);
  return error == std::errc() && end == text.data() + text.size();
}

std::string Lower(std::string_view text) {
  std::string lower(text);
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return lower;
}

std::string DidYouMean(std::string_view unknown, const std::vector<std::string>& known) {
  // Names that long are not typing errors, and the distance takes time and memory proportional to the product of the
  // lengths.
  constexpr size_t kMaxLength = 64;
  if (unknown.size() > kMaxLength) return "";
  // Two short names that share no character are not similar, although few characters differ.
  const int length = static_cast<int>(unknown.size());
  int best_distance = std::min(std::max(2, length / 3) + 1, length);
  const std::string* best = nullptr;
  for (const std::string& name : known) {
    const int distance = EditDistance(unknown, name);
    if (distance < best_distance) {
      best_distance = distance;
      best = &name;
    }
  }
  // A part of a name is nearer than any name that was mistyped.
  const std::string unknown_lower = Lower(unknown);
  const std::string* shortest = nullptr;
  for (const std::string& name : known) {
    const bool is_part = unknown.size() >= 3 && Lower(name).find(unknown_lower) != std::string::npos;
    if (is_part && (shortest == nullptr || name.size() < shortest->size())) shortest = &name;
  }
  if (shortest != nullptr) best = shortest;
  return best == nullptr ? "" : "; did you mean '" + *best + "'?";
}

bool NaturalLess(const std::string& a, const std::string& b) {
  size_t i = 0;
  size_t j = 0;
  const auto is_digit = [](char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; };
  while (i < a.size() && j < b.size()) {
    if (is_digit(a[i]) && is_digit(b[j])) {
      size_t i_end = i;
      size_t j_end = j;
      while (i_end < a.size() && is_digit(a[i_end])) ++i_end;
      while (j_end < b.size() && is_digit(b[j_end])) ++j_end;
      while (i + 1 < i_end && a[i] == '0') ++i;
      while (j + 1 < j_end && b[j] == '0') ++j;
      if (i_end - i != j_end - j) return i_end - i < j_end - j;
      const int order = a.compare(i, i_end - i, b, j, j_end - j);
      if (order != 0) return order < 0;
      i = i_end;
      j = j_end;
    } else {
      if (a[i] != b[j]) return a[i] < b[j];
      ++i;
      ++j;
    }
  }
  if (i < a.size() || j < b.size()) return i == a.size();
  return a < b;
}

}  // namespace heba
