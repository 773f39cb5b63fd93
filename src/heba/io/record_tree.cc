#include "heba/io/record_tree.h"

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <zlib.h>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/config/yaml_reader.h"
#include "heba/io/file_storage.h"
#include "heba/io/json_reader.h"
#include "heba/io/npy_file.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

constexpr size_t kMostBytes = size_t{64} << 20;
constexpr int kDeepest = 64;

// Throws InputError if brackets of a JSON text are nested more deeply than any record: a tree is walked by recursion.
void CheckDepth(std::string_view text, const fs::path& file) {
  int depth = 0;
  bool is_in_string = false;
  for (size_t i = 0; i < text.size(); ++i) {
    if (is_in_string) {
      if (text[i] == '\\') {
        ++i;
        continue;
      }
      if (text[i] == '"') is_in_string = false;
      continue;
    }
    is_in_string = text[i] == '"';
    if (text[i] == '[' || text[i] == '{') ++depth;
    if (text[i] == ']' || text[i] == '}') --depth;
    if (depth > kDeepest)
      throw InputError(file.string() + ": is nested more than " + std::to_string(kDeepest) + " deep");
  }
}

// Returns a text as a number if it is one, otherwise as it is.
RecordTree Scalar(const std::string& text) {
  double number = 0;
  if (ParseDouble(text, &number)) return number;
  return text;
}

// Returns the elements of an array, by rows.
RecordTree NestedArray(std::span<const size_t> shape, std::span<const double> numbers) {
  if (shape.empty()) return numbers.front();
  RecordTree list = RecordTree::array();
  const size_t stride = numbers.size() / shape.front();
  for (size_t i = 0; i < shape.front(); ++i) {
    list.push_back(NestedArray(shape.subspan(1), numbers.subspan(i * stride, stride)));
  }
  return list;
}

RecordTree TreeOfArray(const NumberArray& array) { return NestedArray(array.shape, array.numbers); }

// Returns the tree with every matrix of FileStorage, {rows, cols, dt, data}, as the list of its rows.
RecordTree WithUnfoldedMatrices(RecordTree tree) {
  if (!tree.is_structured()) return tree;
  for (RecordTree& value : tree) value = WithUnfoldedMatrices(std::move(value));
  const bool is_matrix = tree.is_object() && tree.contains("rows") && tree.contains("cols") && tree.contains("data") &&
                         tree["rows"].is_number() && tree["cols"].is_number() && tree["data"].is_array();
  if (!is_matrix) return tree;
  const RecordTree data = tree["data"];
  const double num_columns = tree["cols"].get<double>();
  if (!(num_columns >= 1) || tree["rows"].get<double>() * num_columns != static_cast<double>(data.size())) return tree;
  RecordTree matrix = RecordTree::array();
  for (size_t i = 0; i < data.size(); ++i) {
    if (i % static_cast<size_t>(num_columns) == 0) matrix.push_back(RecordTree::array());
    matrix.back().push_back(data[i]);
  }
  return matrix;
}

RecordTree TreeOfYaml(const YAML::Node& node, int depth) {
  if (depth > kDeepest) return nullptr;
  if (node.IsScalar()) return Scalar(node.Scalar());
  if (node.IsSequence()) {
    RecordTree list = RecordTree::array();
    for (const YAML::Node& item : node) list.push_back(TreeOfYaml(item, depth + 1));
    return list;
  }
  if (!node.IsMap()) return nullptr;
  RecordTree object = RecordTree::object();
  for (const auto& entry : node) {
    if (entry.first.IsScalar()) object[entry.first.Scalar()] = TreeOfYaml(entry.second, depth + 1);
  }
  return object;
}

// Returns the documents of a text, which lines of three hyphens separate; a recorder may also end the text with one.
std::vector<std::string> DocumentsOf(const std::string& text) {
  std::vector<std::string> documents = {""};
  for (const std::string& line : Split(text, '\n')) {
    if (Trim(line) == "---") {
      documents.emplace_back();
    } else {
      documents.back() += line + "\n";
    }
  }
  std::erase_if(documents, [](const std::string& document) { return Trim(document).empty(); });
  return documents;
}

RecordTree ReadYaml(const std::string& text, const fs::path& file) {
  if (IsFileStorage(text)) return TreeOfYaml(ParseFileStorage(text, file).node(), 0);
  const std::vector<std::string> documents = DocumentsOf(text);
  if (documents.size() == 1) return TreeOfYaml(ParseYaml(documents.front(), file).node(), 0);
  RecordTree list = RecordTree::array();
  for (const std::string& document : documents) list.push_back(TreeOfYaml(ParseYaml(document, file).node(), 0));
  return list;
}

RecordTree ReadJsonLines(const std::string& text, const fs::path& file) {
  RecordTree list = RecordTree::array();
  int number = 0;
  for (const std::string& line : Split(text, '\n')) {
    ++number;
    if (Trim(line).empty()) continue;
    RecordTree value = RecordTree::parse(line, nullptr, false);
    if (value.is_discarded()) throw InputError(file.string() + ":" + std::to_string(number) + ": not valid JSON");
    list.push_back(std::move(value));
  }
  return list;
}

uint64_t LittleEndian(const std::string& bytes, size_t at, size_t size) {
  uint64_t number = 0;
  for (size_t i = size; i-- > 0;) number = 256 * number + static_cast<unsigned char>(bytes[at + i]);
  return number;
}

// Returns the bytes of a deflated stream (RFC 1951) of which `size` are expected; none if it has another size.
std::string Inflated(std::string deflated, size_t size) {
  z_stream stream{};
  constexpr int kWithoutHeader = -MAX_WBITS;
  if (inflateInit2(&stream, kWithoutHeader) != Z_OK) return "";
  std::string bytes(size + 1, '\0');  // One more byte shows whether there are more.
  stream.next_in = reinterpret_cast<Bytef*>(deflated.data());
  stream.avail_in = static_cast<uInt>(deflated.size());
  stream.next_out = reinterpret_cast<Bytef*>(bytes.data());
  stream.avail_out = static_cast<uInt>(bytes.size());
  const int end = inflate(&stream, Z_FINISH);
  bytes.resize(end == Z_STREAM_END && stream.total_out == size ? size : 0);
  inflateEnd(&stream);
  return bytes;
}

// Reads the arrays of a .npz, which is a ZIP archive, deflated if it was written by savez_compressed.
RecordTree ReadNpz(const std::string& bytes, const fs::path& file) {
  const auto fail = [&](const std::string& fault) { throw InputError(file.string() + ": " + fault); };
  // ZIP, APPNOTE 6.3: the local header of a file.
  constexpr std::string_view kLocalHeader = "PK\x03\x04";
  constexpr size_t kHeaderSize = 30;
  constexpr uint64_t kInExtraField = 0xffffffff;
  RecordTree object = RecordTree::object();
  size_t at = 0;
  while (bytes.compare(at, kLocalHeader.size(), kLocalHeader) == 0 && at + kHeaderSize <= bytes.size()) {
    constexpr uint64_t kStored = 0;
    constexpr uint64_t kDeflated = 8;
    const uint64_t method = LittleEndian(bytes, at + 8, 2);
    if (method != kStored && method != kDeflated) fail("is compressed in a way that NumPy does not use");
    uint64_t size = LittleEndian(bytes, at + 18, 4);
    uint64_t full_size = LittleEndian(bytes, at + 22, 4);
    const size_t name_size = LittleEndian(bytes, at + 26, 2);
    const size_t extra_size = LittleEndian(bytes, at + 28, 2);
    const size_t data_at = at + kHeaderSize + name_size + extra_size;
    if (data_at > bytes.size()) fail("is truncated");
    // With 64-bit sizes, the extra field begins with its id and its length, then the full and the compressed size.
    constexpr size_t kSize64At = 12;
    if (size == kInExtraField && extra_size >= kSize64At + 8) {
      full_size = LittleEndian(bytes, at + kHeaderSize + name_size + kSize64At - 8, 8);
      size = LittleEndian(bytes, at + kHeaderSize + name_size + kSize64At, 8);
    }
    if (size > bytes.size() - data_at) fail("is truncated");
    std::string name = bytes.substr(at + kHeaderSize, name_size);
    if (name.ends_with(".npy")) name.resize(name.size() - 4);
    std::string content = bytes.substr(data_at, size);
    if (method == kDeflated) {
      if (full_size > kMostBytes) fail("has an array of more than 64 MB");
      content = Inflated(std::move(content), full_size);
    }
    const auto crc = crc32(0, reinterpret_cast<const Bytef*>(content.data()), static_cast<uInt>(content.size()));
    if (crc != LittleEndian(bytes, at + 14, 4))
      fail("is spoiled: the checksum of the array " + Quoted(name) + " differs");
    try {
      object[name] = TreeOfArray(ParseNpy(content, file));
    } catch (const InputError&) {
      object[name] = nullptr;  // An array of texts or of objects.
    }
    at = data_at + size;
  }
  if (object.empty()) fail("is not a NumPy archive (.npz)");
  return object;
}

// A parser of XML without namespaces, entities beyond the five of XML, and document types.
class XmlReader {
 public:
  XmlReader(std::string_view text, const fs::path& file) : text_(text), file_(file) {}

  RecordTree Read() {
    RecordTree root = RecordTree::object();
    while (SkipToElement()) root = WithElement(std::move(root), 0);
    return WithoutSingles(std::move(root));
  }

 private:
  [[noreturn]] void Fail(const std::string& fault) const {
    const auto line =
        1 + std::count(text_.begin(), text_.begin() + static_cast<std::ptrdiff_t>(std::min(at_, text_.size())), '\n');
    throw InputError(file_.string() + ":" + std::to_string(line) + ": not valid XML (" + fault + ")");
  }
  void SkipBlanks() {
    while (at_ < text_.size() && std::isspace(static_cast<unsigned char>(text_[at_])) != 0) ++at_;
  }
  void SkipPast(std::string_view end) {
    const size_t found = text_.find(end, at_);
    if (found == std::string_view::npos) Fail(std::string(end) + " is missing");
    at_ = found + end.size();
  }
  // Moves to the next start or end of an element. Returns false at the end of the text.
  bool SkipToElement() {
    while (true) {
      at_ = std::min(text_.find('<', at_), text_.size());
      if (at_ == text_.size()) return false;
      if (text_.substr(at_).starts_with("<!--")) {
        SkipPast("-->");
      } else if (text_.substr(at_).starts_with("<?") || text_.substr(at_).starts_with("<!")) {
        SkipPast(">");
      } else {
        return true;
      }
    }
  }
  std::string Name() {
    const size_t first = at_;
    while (at_ < text_.size() && std::string_view(" \t\r\n=/>").find(text_[at_]) == std::string_view::npos) ++at_;
    if (at_ == first) Fail("a name is needed");
    return std::string(text_.substr(first, at_ - first));
  }
  static RecordTree Content(const std::string& text) {
    RecordTree list = RecordTree::array();
    std::string spaced = text;
    std::replace_if(
        spaced.begin(), spaced.end(), [](char c) { return c == '\n' || c == '\t' || c == '\r' || c == ','; }, ' ');
    for (const std::string& field : Split(spaced, ' ')) {
      if (field.empty()) continue;
      RecordTree value = Scalar(field);
      if (!value.is_number()) return text;
      list.push_back(std::move(value));
    }
    if (list.empty()) return nullptr;
    return list.size() == 1 ? list.front() : list;
  }
  // Returns an object with one more value in the list of this name.
  static RecordTree WithMember(RecordTree object, const std::string& name, RecordTree value) {
    if (!object.contains(name)) {
      object[name] = RecordTree::array({std::move(value)});
    } else {
      object[name].push_back(std::move(value));
    }
    return object;
  }
  // Returns an object with the members of lists of one in place of those lists.
  static RecordTree WithoutSingles(RecordTree object) {
    for (RecordTree& values : object) {
      if (values.size() != 1) continue;
      RecordTree only = values.front();
      values = std::move(only);
    }
    return object;
  }
  // Reads the element that begins here, and returns `parent` with it.
  RecordTree WithElement(RecordTree parent, int depth) {
    if (depth > kDeepest) Fail("the elements are nested too deeply");
    ++at_;
    const std::string name = Name();
    RecordTree members = RecordTree::object();
    for (SkipBlanks(); at_ < text_.size() && text_[at_] != '>' && text_[at_] != '/'; SkipBlanks()) {
      const std::string attribute = Name();
      SkipBlanks();
      if (at_ >= text_.size() || text_[at_] != '=') Fail("= is missing");
      ++at_;
      SkipBlanks();
      if (at_ >= text_.size() || (text_[at_] != '"' && text_[at_] != '\'')) Fail("a quote is missing");
      const std::string quote(1, text_[at_++]);
      const size_t first = at_;
      SkipPast(quote);
      members = WithMember(std::move(members), attribute, Content(std::string(text_.substr(first, at_ - 1 - first))));
    }
    const bool is_empty = at_ < text_.size() && text_[at_] == '/';
    SkipPast(">");
    std::string content;
    bool has_elements = false;
    while (!is_empty) {
      const size_t first = at_;
      if (!SkipToElement()) Fail(name + " is not closed");
      content += text_.substr(first, at_ - first);
      if (text_.substr(at_).starts_with("</")) {
        SkipPast(">");
        break;
      }
      members = WithElement(std::move(members), depth + 1);
      has_elements = true;
    }
    const bool is_text = !has_elements && !Trim(content).empty();
    return WithMember(std::move(parent), name, is_text ? Content(content) : WithoutSingles(std::move(members)));
  }

  std::string_view text_;
  const fs::path& file_;
  size_t at_ = 0;
};

// Returns the outermost lists in brackets of a text, with their numbers; numbers outside brackets are ignored. Returns
// nothing if a bracket is not closed.
std::optional<RecordTree> BracketedLists(const std::string& text) {
  RecordTree all = RecordTree::array();
  std::vector<RecordTree> open;
  size_t at = 0;
  while (at < text.size()) {
    const char c = text[at];
    if (c == '[') {
      if (open.size() > kDeepest) return std::nullopt;
      open.push_back(RecordTree::array());
      ++at;
    } else if (c == ']') {
      if (open.empty()) return std::nullopt;
      RecordTree closed = std::move(open.back());
      open.pop_back();
      (open.empty() ? all : open.back()).push_back(std::move(closed));
      ++at;
    } else if (std::string_view(" \t\r\n,;()").find(c) != std::string_view::npos) {
      ++at;
    } else {
      const size_t end = std::min(text.find_first_of(" \t\r\n,;()[]", at), text.size());
      RecordTree value = Scalar(text.substr(at, end - at));
      if (!open.empty() && value.is_number()) open.back().push_back(std::move(value));
      at = end;
    }
  }
  if (!open.empty() || all.empty()) return std::nullopt;
  return all.size() == 1 ? RecordTree(all.front()) : all;
}

// Returns the 4 x 4 matrices of a text whose lines with numbers have four of them each; nothing if it is no such text.
std::optional<RecordTree> MatrixBlocks(const std::string& text) {
  constexpr size_t kSize = 4;
  RecordTree matrices = RecordTree::array();
  RecordTree rows = RecordTree::array();
  for (std::string line : Split(text, '\n')) {
    std::replace_if(
        line.begin(), line.end(), [](char c) { return c == ',' || c == '\t' || c == '\r' || c == ';'; }, ' ');
    RecordTree row = RecordTree::array();
    bool has_words = false;
    for (const std::string& field : Split(line, ' ')) {
      if (field.empty()) continue;
      RecordTree value = Scalar(field);
      has_words = has_words || !value.is_number();
      row.push_back(std::move(value));
    }
    if (row.empty() || has_words || (row.size() == 1 && rows.empty())) continue;
    if (row.size() != kSize) return std::nullopt;
    rows.push_back(std::move(row));
    if (rows.size() < kSize) continue;
    matrices.push_back(std::move(rows));
    rows = RecordTree::array();
  }
  if (matrices.empty() || !rows.empty()) return std::nullopt;
  return matrices.size() == 1 ? RecordTree(matrices.front()) : matrices;
}

// Reads a file in the form that its suffix names; nothing if the text has no such values.
std::optional<RecordTree> ReadBySuffix(const fs::path& file) {
  const std::string suffix = Lower(file.extension().string());
  if (suffix == ".npy") return TreeOfArray(ReadNpyFile(file));
  const std::string text = ReadTextFile(file, kMostBytes);
  if (suffix == ".json" || suffix == ".jsonl") CheckDepth(text, file);
  if (suffix == ".json") return ReadJsonFile(file, kMostBytes);
  if (suffix == ".jsonl") return ReadJsonLines(text, file);
  if (suffix == ".npz") return ReadNpz(text, file);
  if (suffix == ".yaml" || suffix == ".yml") return ReadYaml(text, file);
  if (suffix == ".xml") return XmlReader(text, file).Read();
  if (text.find('\0') != std::string::npos) return std::nullopt;
  if (std::optional<RecordTree> lists = BracketedLists(text)) return lists;
  return MatrixBlocks(text);
}

}  // namespace

std::optional<RecordTree> ReadRecordTree(const fs::path& file) {
  std::optional<RecordTree> tree = ReadBySuffix(file);
  if (tree) *tree = WithUnfoldedMatrices(std::move(*tree));
  return tree;
}

}  // namespace heba
