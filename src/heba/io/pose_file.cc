#include "heba/io/pose_file.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "heba/base/files.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"

namespace heba {
namespace {

constexpr int kMaxRows = 1000000;

// A line of the file, with its position for error messages.
struct Line {
  std::string_view text;
  int number = 0;
  const std::filesystem::path* file = nullptr;

  [[noreturn]] void Fail(const std::string& fault) const {
    throw InputError(file->string() + ":" + std::to_string(number) + ": " + fault);
  }
  [[noreturn]] void FailColumn(const std::string& column, const std::string& fault) const {
    Fail("column '" + column + "': " + fault);
  }
};

// Iterates over the lines that are neither blank nor comments.
class LineReader {
 public:
  LineReader(std::string_view text, const std::filesystem::path& file) : rest_(text), file_(file) {
    constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
    if (rest_.starts_with(kByteOrderMark)) rest_.remove_prefix(kByteOrderMark.size());
  }

  std::optional<Line> Next() {
    while (!rest_.empty()) {
      const size_t end = std::min(rest_.find('\n'), rest_.size());
      std::string_view text = rest_.substr(0, end);
      rest_.remove_prefix(std::min(end + 1, rest_.size()));
      ++number_;
      const size_t first = text.find_first_not_of(" \t\r");
      if (first == std::string_view::npos || text[first] == '#') continue;
      if (text.ends_with('\r')) text.remove_suffix(1);
      return Line{text, number_, &file_};
    }
    return std::nullopt;
  }

 private:
  std::string_view rest_;
  const std::filesystem::path& file_;
  int number_ = 0;
};

// Returns the fields of a line without surrounding blanks. A field in double quotes may contain separators; "" in it
// stands for a quote.
std::vector<std::string> Fields(const Line& line, char separator) {
  std::vector<std::string> fields;
  const std::string_view text = line.text;
  const auto is_blank = [](char c) { return c == ' ' || c == '\t'; };
  size_t i = 0;
  if (separator == ' ') {
    // Several blanks in a row are one separator.
    while (i < text.size()) {
      while (i < text.size() && is_blank(text[i])) ++i;
      const size_t end = std::min(text.find_first_of(" \t", i), text.size());
      if (end > i) fields.emplace_back(text.substr(i, end - i));
      i = end;
    }
    return fields;
  }
  while (true) {
    while (i < text.size() && text[i] != separator && is_blank(text[i])) ++i;
    if (i < text.size() && text[i] == '"') {
      std::string field;
      bool closed = false;
      for (++i; i < text.size() && !closed; ++i) {
        if (text[i] != '"') {
          field += text[i];
        } else if (i + 1 < text.size() && text[i + 1] == '"') {
          field += text[i++];
        } else {
          closed = true;
        }
      }
      const std::string name = "field " + std::to_string(fields.size() + 1);
      if (!closed) line.Fail(name + ": the quote is not closed");
      const size_t end = std::min(text.find(separator, i), text.size());
      if (!Trim(text.substr(i, end - i)).empty()) {
        line.Fail(name + ": " + Quoted(Trim(text.substr(i, end - i))) + " follows the closing quote");
      }
      fields.push_back(Trim(field));
      i = end;
    } else {
      const size_t end = std::min(text.find(separator, i), text.size());
      fields.push_back(Trim(text.substr(i, end - i)));
      i = end;
    }
    if (i >= text.size()) return fields;
    ++i;
  }
}

// Returns the most frequent separator of the first line. The result is a blank if the line contains no separator, or if
// tabs occur among blanks and separate too few fields.
char FindSeparator(const Line& first, size_t num_numbers) {
  const std::string_view text = first.text;
  char best = ',';
  for (const char separator : {';', '\t'}) {
    if (std::count(text.begin(), text.end(), separator) > std::count(text.begin(), text.end(), best)) best = separator;
  }
  // Numbers with decimal commas may stand between blanks.
  const std::vector<std::string> words = Fields(first, ' ');
  const bool are_decimals =
      best == ',' && words.size() >= 3 &&
      std::all_of(words.begin(), words.end(), [](const std::string& word) { return WithDecimalPoint(word) != word; });
  if (are_decimals) return ' ';
  const bool has_any = text.find(best) != std::string_view::npos;
  if (!has_any || (best == '\t' && Fields(first, best).size() < num_numbers)) return ' ';
  return best;
}

bool HasHeader(const std::vector<std::string>& first) {
  const auto is_number = [](const std::string& name) {
    double number = 0;
    return ParseDouble(name, &number);
  };
  constexpr int kNumbersOfAPlace = 3;
  return std::count_if(first.begin(), first.end(), is_number) < kNumbersOfAPlace;
}

// Returns a hint that names the formats of the table with exactly these columns; empty if there are none.
std::string OtherFormat(const std::vector<std::string>& names) {
  std::vector<std::string> sorted;
  for (const std::string& name : names) {
    if (name != kImageColumn && name != kRoleColumn && name != kTimeColumn) sorted.push_back(name);
  }
  std::sort(sorted.begin(), sorted.end());
  std::vector<std::string> fitting;
  for (const PoseFormat& format : PoseFormats()) {
    std::vector<std::string> columns = format.columns;
    std::sort(columns.begin(), columns.end());
    if (columns == sorted) fitting.push_back(format.name);
  }
  return fitting.empty() ? "" : "; the columns here are those of pose format " + Join(fitting, " or ");
}

// The positions of the required columns.
struct Header {
  std::vector<std::string> names;
  std::vector<size_t> numbers;  // Positions of the format's columns, in the format's order.
  std::vector<size_t> extras;   // Positions of the columns beside the pose; empty if there are none.
  std::vector<size_t> images;   // Positions of the cameras' images; empty if there are none.
  std::optional<size_t> image;
  std::optional<size_t> role;
  std::optional<size_t> time;
};

// Returns the columns of a file without a header, which `names` lists.
Header HeaderOf(const PoseFormat& format, const std::vector<std::string>& names) {
  Header header;
  header.names = names;
  const auto place_of = [&](std::string_view name) -> std::optional<size_t> {
    const auto found = std::find(header.names.begin(), header.names.end(), name);
    if (found == header.names.end()) return std::nullopt;
    return static_cast<size_t>(found - header.names.begin());
  };
  for (const std::string& column : format.columns) header.numbers.push_back(*place_of(column));
  header.image = place_of(kImageColumn);
  header.role = place_of(kRoleColumn);
  header.time = place_of(kTimeColumn);
  return header;
}

// Returns the positions of all extra columns, or none if the header names none of them.
std::vector<size_t> ExtraPlaces(const Line& line, const std::map<std::string, size_t>& places,
                                const std::vector<std::string>& extra_columns) {
  std::vector<size_t> found;
  std::string missing;
  for (const std::string& column : extra_columns) {
    const auto place = places.find(column);
    if (place != places.end()) {
      found.push_back(place->second);
    } else if (missing.empty()) {
      missing = column;
    }
  }
  if (!found.empty() && !missing.empty()) {
    line.Fail("column '" + missing + "' is missing; needed are all of " + Join(extra_columns, ", ") + ", or none");
  }
  return found;
}

// Returns the columns of a header. The names of captures may be called so in place of the images'.
std::vector<std::string> NamesOfColumns(std::vector<std::string> names) {
  const bool has_images = std::find(names.begin(), names.end(), kImageColumn) != names.end();
  // A column that occurs twice is named as the file has it.
  const bool is_once = std::count(names.begin(), names.end(), "capture") == 1;
  if (!has_images && is_once)
    std::replace(names.begin(), names.end(), std::string("capture"), std::string(kImageColumn));
  return names;
}

// Returns whether a name continues the numbers of the last of these columns, as j7 does after j1 to j6.
bool ContinuesNumbers(const std::string& name, const std::vector<std::string>& columns) {
  const auto stem_of = [](const std::string& column) {
    return column.substr(0, column.find_last_not_of("0123456789") + 1);
  };
  const std::string stem = stem_of(name);
  const std::string& last = columns.back();
  return stem == stem_of(last) && stem.size() < name.size() && stem.size() < last.size() &&
         std::make_pair(name.size(), name) > std::make_pair(last.size(), last);
}

Header ReadHeader(const Line& line, char separator, const PoseFormat& format,
                  const std::vector<std::string>& extra_columns, const std::vector<std::string>& cameras) {
  Header header;
  header.names = NamesOfColumns(Fields(line, separator));
  std::vector<std::string> known = format.columns;
  known.insert(known.end(), {std::string(kImageColumn), std::string(kRoleColumn)});
  // A format that skips columns may mean this one.
  const auto lists = [&](std::string_view name) {
    return std::find(format.file_columns.begin(), format.file_columns.end(), name) != format.file_columns.end();
  };
  if (lists(kTimeColumn) || !lists(kNoColumn)) known.emplace_back(kTimeColumn);
  known.insert(known.end(), extra_columns.begin(), extra_columns.end());
  std::vector<std::string> image_columns;
  for (const std::string& camera : cameras) image_columns.push_back(std::string(kImageColumn) + "." + camera);
  known.insert(known.end(), image_columns.begin(), image_columns.end());
  std::map<std::string, size_t> places;
  for (size_t i = 0; i < header.names.size(); ++i) {
    const std::string& name = header.names[i];
    if (name.empty()) line.Fail("column " + std::to_string(i + 1) + " has no name");
    if (std::find(known.begin(), known.end(), name) == known.end()) {
      const std::vector<std::string>& own = format.file_columns;
      if (own.size() == header.names.size() && own[i] == kImageColumn) {
        header.image = i;
        continue;
      }
      if (std::find(own.begin(), own.end(), kNoColumn) != own.end()) continue;
      if (ContinuesNumbers(name, format.columns)) {
        line.Fail("column " + Quoted(name) + " is one too many; needed: " + Join(format.columns, ", "));
      }
      const std::string other = OtherFormat(header.names);
      line.Fail("unknown column " + Quoted(name) + (other.empty() ? DidYouMean(name, known) : other) +
                "; needed: " + Join(format.columns, ", ") + "; possible: " +
                Join(std::vector<std::string>(known.begin() + static_cast<std::ptrdiff_t>(format.columns.size()),
                                              known.end()),
                     ", "));
    }
    if (!places.emplace(name, i).second) line.Fail("column " + Quoted(name) + " occurs twice");
  }
  for (const std::string& column : format.columns) {
    const auto place = places.find(column);
    if (place == places.end()) {
      line.Fail("column '" + column + "' is missing; needed: " + Join(format.columns, ", ") +
                OtherFormat(header.names));
    }
    header.numbers.push_back(place->second);
  }
  header.extras = ExtraPlaces(line, places, extra_columns);
  header.images = ExtraPlaces(line, places, image_columns);
  if (const auto place = places.find("image"); place != places.end()) header.image = place->second;
  if (const auto place = places.find("role"); place != places.end()) header.role = place->second;
  if (const auto place = places.find("time"); place != places.end()) header.time = place->second;
  return header;
}

// Reads a number with a decimal point, or with a decimal comma where the fields are not separated by commas.
double ReadNumber(const Line& line, const std::string& column, const std::string& field) {
  if (field.empty()) line.FailColumn(column, "a number is missing");
  double number = 0;
  if (!ParseDouble(WithDecimalPoint(field), &number)) line.FailColumn(column, Quoted(field) + " is not a number");
  if (!std::isfinite(number)) line.FailColumn(column, Quoted(field) + " is not finite");
  return number;
}

// Returns what a line with another number of fields than columns lacks.
std::string WrongNumberOfFields(const std::vector<std::string>& fields, const Header& header, bool has_header) {
  const auto is_digits = [](const std::string& field) {
    return !field.empty() && field.find_first_not_of("+-0123456789") == std::string::npos;
  };
  const auto num_digits = static_cast<size_t>(std::count_if(fields.begin(), fields.end(), is_digits));
  const size_t num_numbers = header.numbers.size() + header.extras.size();
  const std::string columns =
      (has_header ? "the header names " : "pose_format has ") + std::to_string(header.names.size()) + " columns";
  if (fields.size() > header.names.size() && num_digits > num_numbers) {
    return "the numbers have decimal commas, and commas separate the columns too (" + std::to_string(fields.size()) +
           " fields, but " + columns + "); write decimal points, or separate the columns by semicolons";
  }
  return std::to_string(fields.size()) + " fields, but " + columns;
}

// Returns a field for writing, in quotes if necessary.
std::string Field(const std::string& text) {
  if (text.find_first_of(",;\t\"# ") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

}  // namespace

double SecondsOf(double time) {
  // Seconds have such values after the year 5138 only.
  constexpr double kTooLarge = 1e11;
  for (int i = 0; i < 3 && std::abs(time) >= kTooLarge; ++i) time /= 1000;
  return time;
}

std::string WithDecimalPoint(std::string text) {
  const size_t comma = text.find(',');
  if (comma == std::string::npos || text.find('.') != std::string::npos) return text;
  std::string with_point = text;
  with_point[comma] = '.';
  double number = 0;
  return ParseDouble(with_point, &number) ? with_point : text;
}

std::string WithoutBrackets(std::string_view line) {
  std::string bare = Trim(line.substr(0, line.find('#')));
  constexpr std::string_view kBrackets = "[](){}";
  if (bare.starts_with("p[")) bare[0] = ' ';
  const size_t first = bare.find_first_not_of(' ');
  // Brackets at other positions belong to an image name, such as img (1).png.
  const bool has_brackets = first != std::string::npos && kBrackets.find(bare[first]) != std::string_view::npos;
  if (has_brackets) {
    std::replace_if(
        bare.begin(), bare.end(), [&](char c) { return kBrackets.find(c) != std::string_view::npos; }, ' ');
  }
  // Separators without a field end lines of some programs.
  bare.resize(bare.find_last_not_of(" \t\r,;") + 1);
  return Trim(bare);
}

std::vector<PoseRow> ParsePoses(const std::string& text, const std::filesystem::path& name, const PoseFormat& format,
                                const std::vector<std::string>& extra_columns,
                                const std::vector<std::string>& cameras) {
  if (text.find('\0') != std::string::npos) {
    throw InputError(name.string() + ": is not a text file in UTF-8; save it as CSV in UTF-8");
  }
  LineReader lines(text, name);
  std::optional<Line> first = lines.Next();
  while (first && WithoutBrackets(first->text).empty()) first = lines.Next();
  if (!first) throw InputError(name.string() + ": is empty; a header line and one line per capture are needed");
  std::string bare = WithoutBrackets(first->text);
  const Line bare_first{bare, first->number, &name};
  const char bare_separator = FindSeparator(bare_first, format.columns.size());
  const std::vector<std::string> bare_fields = Fields(bare_first, bare_separator);
  const bool has_header = HasHeader(bare_fields);
  // Joints have one order; the order of a pose's columns is the user's to say.
  const bool is_of_joints =
      format.file_columns.empty() && !format.robot.empty() && bare_fields.size() == format.columns.size();
  const std::vector<std::string>& bare_columns = is_of_joints ? format.columns : format.file_columns;
  if (!has_header && bare_columns.empty()) {
    first->Fail("the first line must name the columns: image, " + Join(format.columns, ", ") +
                "; for a file without such a line name them in the config (pose_format: {columns: [...], ...})");
  }
  const char separator = has_header ? FindSeparator(*first, format.columns.size()) : bare_separator;
  const Header header =
      has_header ? ReadHeader(*first, separator, format, extra_columns, cameras) : HeaderOf(format, bare_columns);

  std::vector<PoseRow> rows;
  std::map<std::string, int> line_of_image;
  std::vector<double> numbers(format.columns.size());
  const std::vector<std::string> roles(kCaptureRoleNames.begin() + 1, kCaptureRoleNames.end());
  for (std::optional<Line> line = has_header ? lines.Next() : first; line; line = lines.Next()) {
    if (!has_header) {
      bare = WithoutBrackets(line->text);
      if (bare.empty()) continue;
      line->text = bare;
    }
    if (rows.size() == kMaxRows) line->Fail("more than " + std::to_string(kMaxRows) + " captures");
    const std::vector<std::string> fields = Fields(*line, separator);
    if (fields.size() != header.names.size()) {
      line->Fail(WrongNumberOfFields(fields, header, has_header));
    }
    PoseRow row;
    row.line = line->number;
    if (header.image) {
      row.image = fields[*header.image];
      if (row.image.empty()) line->FailColumn("image", "the file name is missing");
      const auto [earlier, is_new] = line_of_image.emplace(row.image, row.line);
      if (!is_new) {
        line->FailColumn("image", Quoted(row.image) + " already occurs in line " + std::to_string(earlier->second));
      }
    }
    if (header.role) {
      const std::string& role_name = fields[*header.role];
      const std::optional<CaptureRole> role = FindCaptureRole(role_name);
      if (!role) {
        line->FailColumn("role", UnknownName(role_name, roles));
      }
      row.role = *role;
    }
    if (header.time) row.time_s = SecondsOf(ReadNumber(*line, "time", fields[*header.time]));
    for (size_t i = 0; i < numbers.size(); ++i) {
      numbers[i] = ReadNumber(*line, format.columns[i], fields[header.numbers[i]]);
    }
    const Outcome<Rigid3d> pose = PoseFromNumbers(format, numbers);
    if (!pose) line->Fail(pose.reason());
    row.pose = *pose;
    row.numbers = numbers;
    for (size_t i = 0; i < header.extras.size(); ++i) {
      row.extras.push_back(ReadNumber(*line, extra_columns[i], fields[header.extras[i]]));
    }
    for (const size_t place : header.images) row.images.push_back(fields[place]);
    rows.push_back(std::move(row));
  }
  if (rows.empty()) throw InputError(name.string() + ": has a header but no captures");
  return rows;
}

std::vector<PoseRow> ReadPoseFile(const std::filesystem::path& path, const PoseFormat& format,
                                  const std::vector<std::string>& extra_columns,
                                  const std::vector<std::string>& cameras) {
  return ParsePoses(ReadTextFile(path), path, format, extra_columns, cameras);
}

std::string PoseFileText(const std::vector<PoseRow>& rows, const PoseFormat& format,
                         const std::vector<std::string>& extra_columns, const std::vector<std::string>& cameras) {
  const bool with_images = std::any_of(rows.begin(), rows.end(), [](const PoseRow& row) { return !row.image.empty(); });
  const bool with_roles =
      std::any_of(rows.begin(), rows.end(), [](const PoseRow& row) { return row.role != CaptureRole::kNone; });
  const bool with_times =
      !rows.empty() && std::all_of(rows.begin(), rows.end(), [](const PoseRow& row) { return row.time_s.has_value(); });
  std::vector<std::string> names;
  if (with_images) names.emplace_back("image");
  if (with_roles) names.emplace_back("role");
  if (with_times) names.emplace_back(kTimeColumn);
  for (const std::string& camera : cameras) names.push_back(Field("image." + camera));
  for (const std::string& column : format.columns) names.push_back(Field(column));
  names.insert(names.end(), extra_columns.begin(), extra_columns.end());
  std::string text = Join(names, ",") + "\n";
  for (const PoseRow& row : rows) {
    std::vector<std::string> fields;
    if (with_images) fields.push_back(Field(row.image));
    if (with_roles) fields.emplace_back(RoleName(row.role));
    if (with_times) fields.push_back(RoundTrip(*row.time_s));
    CHECK(cameras.empty() || row.images.size() == cameras.size());
    for (size_t c = 0; c < cameras.size(); ++c) fields.push_back(Field(row.images[c]));
    for (const double number : NumbersFromPose(format, row.pose)) fields.push_back(RoundTrip(number));
    CHECK_EQ(row.extras.size(), extra_columns.size());
    for (const double number : row.extras) fields.push_back(RoundTrip(number));
    text += Join(fields, ",") + "\n";
  }
  return text;
}

}  // namespace heba
