// The reference of the keys of all files that people write: for `heba help`, and as a page of the manual.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace heba {

// A key of a file, as keys.def states it.
struct KeyEntry {
  std::string_view document;  // The name of a KeyDocument.
  std::string key;            // With its mappings: refine.loss, evaluate.require[].within.
  std::string value;          // The values that can be written.
  std::string fallback;       // Begins with `required` or `optional`, or is the default.
  std::string meaning;
  bool is_described = false;  // Whether the default is in words instead of a value that can be written.

  // Returns whether an absent key has a value.
  bool HasDefault() const { return !fallback.starts_with("required") && !fallback.starts_with("optional"); }
};

// A kind of file.
struct KeyDocument {
  std::string_view name;
  std::string_view title;
  std::string (*introduction)();
};

const std::vector<KeyDocument>& KeyDocuments();
// Returns the keys of all documents, in the order of keys.def.
const std::vector<KeyEntry>& KeyEntries();

// Returns the keys of a document for a terminal; only the keys within `key`, or that key, unless it is empty. Throws
// InputError if the document has no such key.
std::string KeysAsText(const KeyDocument& document, std::string_view key);

// Returns a page in Markdown with the keys of all documents.
std::string KeysAsMarkdown();

}  // namespace heba
