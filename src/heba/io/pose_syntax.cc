#include "heba/io/pose_syntax.h"

#include <algorithm>
#include <cctype>
#include <optional>

#include "heba/base/text.h"

namespace heba {
namespace {

struct PoseSyntax {
  std::string_view pose_format;
  std::string_view marker;
  std::vector<std::string> parts;
};

const std::vector<PoseSyntax>& PoseSyntaxes() {
  static const std::vector<PoseSyntax> syntaxes = {
#define HEBA_POSE_SYNTAX(name, description, pose_format, marker, syntax) \
  {pose_format, marker, Split(Lower(syntax), ' ')},
#include "heba/io/pose_syntaxes.def"
#undef HEBA_POSE_SYNTAX
  };
  return syntaxes;
}

bool IsBlank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }
bool IsOfWord(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_'; }

// The end of a match, and the numbers in it. `end` is nothing if the text does not match.
struct Match {
  std::optional<size_t> end;
  std::vector<double> numbers;
  bool lacks_number = false;  // Whether it ended before another number than the first.
};

// Matches a syntax at a place of a text in lower case.
Match MatchAt(std::string_view text, size_t at, const PoseSyntax& syntax) {
  Match match;
  for (const std::string& part : syntax.parts) {
    while (at < text.size() && IsBlank(text[at])) ++at;
    if (part == "%" || part == "#") {
      size_t end = at;
      constexpr std::string_view kDigits = "0123456789";
      const std::string_view allowed = part == "#" ? kDigits : std::string_view("+-.0123456789e");
      while (end < text.size() && allowed.find(text[end]) != std::string_view::npos) ++end;
      double number = 0;
      if (!ParseDouble(text.substr(at, end - at), &number)) {
        match.lacks_number = !match.numbers.empty();
        return match;
      }
      if (part == "%") match.numbers.push_back(number);
      at = end;
    } else {
      if (!text.substr(at).starts_with(part)) return match;
      at += part.size();
    }
  }
  match.end = at;
  return match;
}

WrittenPoses PosesIn(std::string_view text, const PoseSyntax& syntax) {
  WrittenPoses found;
  found.pose_format = syntax.pose_format;
  if (text.find(Lower(syntax.marker)) == std::string_view::npos) return found;
  const std::string& first = syntax.parts.front();
  size_t counted = 0;
  int line = 1;
  for (size_t at = text.find(first); at != std::string_view::npos; at = text.find(first, at)) {
    line += static_cast<int>(std::count(text.begin() + static_cast<std::ptrdiff_t>(counted),
                                        text.begin() + static_cast<std::ptrdiff_t>(at), '\n'));
    counted = at;
    const bool is_within_word = at > 0 && IsOfWord(first[0]) && IsOfWord(text[at - 1]);
    const Match match = is_within_word ? Match{} : MatchAt(text, at, syntax);
    if (match.end) {
      found.rows.push_back(match.numbers);
      found.lines.push_back(line);
      at = *match.end;
    } else {
      if (match.lacks_number && found.broken_line == 0) found.broken_line = line;
      ++at;
    }
  }
  return found;
}

}  // namespace

WrittenPoses FindWrittenPoses(std::string_view text) {
  const std::string lower = Lower(text);
  WrittenPoses most;
  for (const PoseSyntax& syntax : PoseSyntaxes()) {
    WrittenPoses found = PosesIn(lower, syntax);
    if (found.rows.size() > most.rows.size()) most = std::move(found);
  }
  return most;
}

}  // namespace heba
