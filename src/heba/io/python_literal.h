// Python literals as files hold them: what mrcal's .cameramodel is written in.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace heba {

struct PythonValue {
  enum class Kind { kNumber, kText, kList, kDict, kName };
  Kind kind = Kind::kName;
  double number = 0;
  std::string text;                // Of a kText, or the kName (None, True, False).
  std::vector<PythonValue> items;  // Of a kList, which may be a tuple; of a kDict the values.
  std::vector<std::string> keys;   // Of a kDict, in the order of the items.
  int line = 0;

  // The value of a kDict's key; null if there is none.
  const PythonValue* Find(std::string_view key) const;
};

// Reads one literal: numbers, strings (b'' and r'' too), lists, tuples, dicts with text keys, None, True, False;
// comments, trailing commas. Escapes in strings are kept as they stand. InputErrors start with "name:line: ".
PythonValue ParsePythonLiteral(const std::string& text, const std::filesystem::path& name);

}  // namespace heba
