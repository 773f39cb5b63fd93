// Python literals, the format of mrcal's .cameramodel files and of the headers of NumPy arrays.
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
  std::string text;                // Content of a kText, or the name of a kName (None, True, False).
  std::vector<PythonValue> items;  // Items of a kList, which may be a tuple; values of a kDict.
  std::vector<std::string> keys;   // Keys of a kDict, in the order of the items.
  int line = 0;

  // Returns the value of a key of a kDict; null if there is none.
  const PythonValue* Find(std::string_view key) const;
};

// Parses one literal: numbers, strings (b'' and r'' too), lists, tuples, dicts with text keys, None, True, False.
// Comments and trailing commas are accepted. Escape sequences in strings are not interpreted. InputErrors start with
// "name:line: ".
PythonValue ParsePythonLiteral(const std::string& text, const std::filesystem::path& name);

}  // namespace heba
