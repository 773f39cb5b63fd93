// mrcal's corners.vnl: one line `filename x y level` (or weight) per corner of the chessboard, row by row; `-` stands
// for a corner, or a whole image, that was not detected. Pixel (0, 0) is the centre of the first pixel. The file
// contains no robot poses.
#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/io/import.h"
#include "heba/io/import_text.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

bool Matches(const fs::path& source) { return BeginningOf(source).find("# filename x y") != std::string::npos; }

ImportedSet Read(const fs::path& source) {
  ImportedSet set;
  set.files.push_back(source);
  std::map<std::string, size_t> place;
  std::map<std::string, int> num_lines;
  for (const TextLine& line : LinesOf(ReadTextFile(source))) {
    const size_t name_end = line.text.find_first_of(" \t");
    const std::string where = source.string() + ":" + std::to_string(line.number);
    if (name_end == std::string::npos) throw InputError(where + ": filename, x and y are needed");
    const fs::path file = line.text.substr(0, name_end);
    const std::string name = file.filename().string();
    const auto [found, is_new] = place.emplace(name, set.captures.size());
    if (is_new) {
      ImportedCapture capture;
      capture.name = name;
      capture.image = file.is_absolute() ? file : source.parent_path() / file;
      if (!fs::exists(capture.image)) capture.image.clear();
      set.captures.push_back(std::move(capture));
    }
    const int id = num_lines[name]++;
    std::string rest = Trim(line.text.substr(name_end));
    if (rest.starts_with('-') && (rest.size() == 1 || rest[1] == ' ' || rest[1] == '\t')) continue;
    // The level `-` marks a corner that was not detected, regardless of its coordinates.
    const bool is_missing = rest.ends_with(" -") || rest.ends_with("\t-");
    if (is_missing) continue;
    const std::vector<double> numbers = NumbersOfLine(rest, source, line.number);
    if (numbers.size() < 2) throw InputError(where + ": filename, x and y are needed");
    ImportedCapture& capture = set.captures[found->second];
    capture.ids.push_back(id);
    capture.pixels.emplace_back(numbers[0], numbers[1]);
  }
  set.remarks.emplace_back("the file has no robot poses: give them (captures.poses)");
  return set;
}

}  // namespace

ImportReader ImportReader_mrcal_corners() { return {Matches, Read}; }

}  // namespace heba
