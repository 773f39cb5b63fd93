// A trajectory in the format of TUM's RGB-D benchmark: lines of time x y z qx qy qz qw (m, Hamilton), here the
// gripper's pose in the base. The images of a folder `images` or `rgb` beside the file are used, in order, if there is
// one per line.
#include "heba/base/files.h"
#include "heba/io/import.h"
#include "heba/io/import_text.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

constexpr size_t kNumbers = 8;

bool Matches(const fs::path& source) { return NumbersInFirstLine(source) == kNumbers; }

ImportedSet Read(const fs::path& source) {
  ImportedSet set;
  set.files.push_back(source);
  const std::vector<TextLine> lines = LinesOf(ReadTextFile(source));
  const fs::path folder = source.parent_path();
  const auto [images, remarks] = ImagesForPoses({folder / "images", folder / "rgb"}, lines.size());
  set.remarks = remarks;
  for (size_t i = 0; i < lines.size(); ++i) {
    const std::string where = source.string() + ":" + std::to_string(lines[i].number);
    const std::vector<double> numbers = NumbersOfLine(lines[i].text, source, lines[i].number);
    if (numbers.size() != kNumbers) throw InputError(where + ": 8 numbers are needed: time, x, y, z, qx, qy, qz, qw");
    ImportedCapture capture = CaptureOf(images.empty() ? fs::path() : images[i], i);
    capture.base_from_gripper = PoseOf("ros", std::span(numbers).subspan(1), where);
    set.captures.push_back(std::move(capture));
  }
  return set;
}

}  // namespace

ImportReader ImportReader_tum() { return {Matches, Read}; }

}  // namespace heba
