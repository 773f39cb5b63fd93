#include "heba/io/python_literal.h"

#include <cctype>

#include "heba/base/error.h"
#include "heba/base/text.h"

namespace heba {
namespace {

class Parser {
 public:
  Parser(const std::string& text, const std::filesystem::path& name) : text_(text), name_(name) {}

  PythonValue ParseAll() {
    PythonValue value = ParseValue(0);
    SkipSpace();
    if (at_ < text_.size()) Fail("unexpected text after the closing bracket");
    return value;
  }

 private:
  [[noreturn]] void Fail(const std::string& fault) const {
    throw InputError(name_.string() + ":" + std::to_string(line_) + ": " + fault);
  }

  char Peek() const { return at_ < text_.size() ? text_[at_] : '\0'; }
  void Step() {
    if (text_[at_] == '\n') ++line_;
    ++at_;
  }
  void SkipSpace() {
    while (at_ < text_.size()) {
      if (Peek() == '#') {
        while (at_ < text_.size() && Peek() != '\n') Step();
      } else if (std::isspace(static_cast<unsigned char>(Peek())) != 0) {
        Step();
      } else {
        return;
      }
    }
  }
  bool Accept(char c) {
    SkipSpace();
    if (Peek() != c) return false;
    Step();
    return true;
  }

  PythonValue ParseValue(int depth) {
    constexpr int kMaxDepth = 32;
    if (depth > kMaxDepth) Fail("nested deeper than 32 levels");
    SkipSpace();
    const int line = line_;
    PythonValue value = ParseUnlocated(depth);
    value.line = line;
    return value;
  }

  // Returns the value that begins here, without its line.
  PythonValue ParseUnlocated(int depth) {
    const char c = Peek();
    if (c == '{') return ParseDict(depth);
    if (c == '[' || c == '(') return ParseList(depth);
    return IsStringStart() ? ParseText() : ParseWord();
  }

  PythonValue ParseText() {
    PythonValue value;
    value.kind = PythonValue::Kind::kText;
    // Adjacent strings are concatenated.
    while (IsStringStart()) {
      value.text += ParseString();
      SkipSpace();
    }
    return value;
  }

  bool IsStringStart() const {
    size_t at = at_;
    while (at < text_.size() && at < at_ + 2 && std::string_view("bBrRuU").find(text_[at]) != std::string_view::npos)
      ++at;
    return at < text_.size() && (text_[at] == '\'' || text_[at] == '"');
  }

  std::string ParseString() {
    while (Peek() != '\'' && Peek() != '"') Step();
    const char quote = Peek();
    const bool triple = text_.compare(at_, 3, std::string(3, quote)) == 0;
    const std::string closing(triple ? 3 : 1, quote);
    for (size_t i = 0; i < closing.size(); ++i) Step();
    const size_t start = at_;
    while (at_ < text_.size() && text_.compare(at_, closing.size(), closing) != 0) {
      if (Peek() == '\n' && !triple) Fail("a quote is not closed");
      if (Peek() == '\\' && at_ + 1 < text_.size()) Step();
      Step();
    }
    if (at_ >= text_.size()) Fail("a quote is not closed");
    std::string content = text_.substr(start, at_ - start);
    at_ += closing.size();
    return content;
  }

  PythonValue ParseList(int depth) {
    PythonValue value;
    value.kind = PythonValue::Kind::kList;
    const char closing = Peek() == '[' ? ']' : ')';
    Step();
    while (!Accept(closing)) {
      value.items.push_back(ParseValue(depth + 1));
      if (!Accept(',')) {
        SkipSpace();
        if (Peek() != closing) Fail(std::string("',' or '") + closing + "' is needed");
      }
    }
    return value;
  }

  PythonValue ParseDict(int depth) {
    PythonValue value;
    value.kind = PythonValue::Kind::kDict;
    Step();
    while (!Accept('}')) {
      const PythonValue key = ParseValue(depth + 1);
      if (key.kind != PythonValue::Kind::kText) Fail("a key in quotes is needed");
      constexpr size_t kMaxEntries = 1000;
      if (value.keys.size() == kMaxEntries) Fail("more than 1000 keys");
      if (value.Find(key.text) != nullptr) Fail(Quoted(key.text) + " occurs twice");
      if (!Accept(':')) Fail("':' is needed after a key");
      value.items.push_back(ParseValue(depth + 1));
      value.keys.push_back(key.text);
      if (!Accept(',')) {
        SkipSpace();
        if (Peek() != '}') Fail("',' or '}' is needed");
      }
    }
    return value;
  }

  PythonValue ParseWord() {
    const size_t start = at_;
    while (at_ < text_.size() && (std::isalnum(static_cast<unsigned char>(Peek())) != 0 ||
                                  std::string_view("+-._").find(Peek()) != std::string_view::npos)) {
      Step();
    }
    PythonValue value;
    value.text = text_.substr(start, at_ - start);
    if (value.text.empty()) Fail(at_ < text_.size() ? "a value is needed" : "the file ends too early");
    value.kind = PythonValue::Kind::kNumber;
    if (ParseDouble(value.text, &value.number)) return value;
    value.kind = PythonValue::Kind::kName;
    if (value.text != "None" && value.text != "True" && value.text != "False") {
      Fail(Quoted(value.text) + " is not a value");
    }
    return value;
  }

  const std::string& text_;
  const std::filesystem::path& name_;
  size_t at_ = 0;
  int line_ = 1;
};

}  // namespace

const PythonValue* PythonValue::Find(std::string_view key) const {
  for (size_t i = 0; i < keys.size(); ++i) {
    if (keys[i] == key) return &items[i];
  }
  return nullptr;
}

PythonValue ParsePythonLiteral(const std::string& text, const std::filesystem::path& name) {
  return Parser(text, name).ParseAll();
}

}  // namespace heba
