// AprilTag grids in pictures that others took: real Kalibr sheets, with their border of two cells.
#include <algorithm>
#include <fstream>
#include <iostream>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heba/config/yaml_reader.h"
#include "targets/image.h"
#include "targets/target.h"
#include "tests/support/data_sets.h"

namespace heba {
namespace {

std::unique_ptr<Target> Make(const std::string& yaml) {
  MapReader reader(ParseYaml(yaml, "target"));
  return CreateTarget(reader);
}

TEST(AprilTagGridTest, PointsAreKalibrs) {
  const auto target = Make("{target_type: aprilgrid, tagRows: 2, tagCols: 3, tagSize: 0.08, tagSpacing: 0.25}");
  ASSERT_EQ(target->type(), "apriltag_grid");
  ASSERT_EQ(target->points().size(), 24U);
  // Corner 2 (top right) of tag 4 (second row, second column): (0.1 + 0.08, 0.1 + 0.08).
  const TargetPoint& point = target->points()[18];
  EXPECT_EQ(point.id, 18);
  EXPECT_NEAR(point.in_target.x(), 0.18, 1e-12);
  EXPECT_NEAR(point.in_target.y(), 0.18, 1e-12);
}

// The ids that an independent detector reads, picture by picture. At least 95 % of them are found; every id found
// beside them is one of the board's and lies on it, or the detector would have dropped it.
TEST(AprilTagGridTest, ReadsRecordedKalibrSheets) {
  const std::filesystem::path folder = DataDir() / "detect_kalibr_aprilgrid";
  HEBA_SKIP_WITHOUT(folder);
  const auto target = Make(
      "{type: apriltag_grid, family: tag36h11, rows: 6, columns: 6, tag_size: 88 mm, tag_spacing: 0.3, border_bits: "
      "2}");
  std::ifstream stream(folder / "dataset.json");
  const nlohmann::json data = nlohmann::json::parse(stream);
  int listed = 0;
  int found = 0;
  int additional = 0;
  for (const nlohmann::json& entry : data["images"]) {
    const std::string name = entry["image"];
    const std::set<int> ids = entry["ids"].get<std::set<int>>();
    // Boards of other sizes, two of them, and a sheet with the ordinary border.
    if (name == "rs_iphone.png" || name == "rs_two_boards.png" || name == "py_t36h11_1bit_margin.png") continue;
    const Detection detection = target->Detect(ReadGreyImage(folder / "images" / name));
    std::set<int> seen;
    for (const int id : detection.ids) EXPECT_TRUE(seen.insert(id).second) << name << ": point " << id << " twice";
    std::set<int> tags;
    for (const int id : seen) tags.insert(id / 4);
    std::vector<int> missing;
    std::set_difference(ids.begin(), ids.end(), tags.begin(), tags.end(), std::back_inserter(missing));
    listed += static_cast<int>(ids.size());
    found += static_cast<int>(ids.size() - missing.size());
    additional += static_cast<int>(tags.size() - (ids.size() - missing.size()));
    std::cout << name << ": " << ids.size() - missing.size() << " of " << ids.size() << " listed tags, "
              << tags.size() - (ids.size() - missing.size()) << " more\n";
  }
  std::cout << "all: " << found << " of " << listed << " listed tags, " << additional << " more\n";
  EXPECT_GE(found, 0.95 * listed);
}

}  // namespace
}  // namespace heba
