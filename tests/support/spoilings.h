// Typical mistakes in data sets, each with the findings that the doctor must report for it.
#pragma once

#include <algorithm>
#include <filesystem>
#include <functional>
#include <future>
#include <iostream>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "heba/base/text.h"
#include "heba/config/yaml_reader.h"
#include "heba/data/setup.h"
#include "heba/io/pose_file.h"
#include "tests/pipeline/cli.h"

namespace heba {

// A good data set: its config and the parts that the spoilings change.
struct GoodSet {
  std::string name;
  std::filesystem::path config;
  std::filesystem::path poses;   // Pose file in format ros.
  std::filesystem::path images;  // Folder of images.
  std::filesystem::path camera;
  std::string target_type;
  std::string length_key;  // Key of the target's length; scaling it alone scales the target.
  double length_mm = 0;
  int rows = 0;
  int columns = 0;
  Setup setup = Setup::kEyeToHand;
};

struct Spoiled {
  std::vector<std::string> settings;  // Arguments of --set.
  std::vector<std::string> codes;     // The finding is right if the first code is one of these.
};

struct Spoiling {
  std::string name;
  // Returns nothing if the spoiling does not apply. `folder` is for new files.
  std::function<std::optional<Spoiled>(const GoodSet& good, const std::filesystem::path& folder)> apply;
};

inline PoseFormat FormOfRotation(const std::string& rotation, const std::string& angle, const std::string& unit) {
  const bool has_four = rotation.starts_with("quaternion");
  const std::vector<std::string> columns = has_four ? std::vector<std::string>{"x", "y", "z", "q0", "q1", "q2", "q3"}
                                                    : std::vector<std::string>{"x", "y", "z", "a", "b", "c"};
  return {"", columns, unit, rotation, has_four ? "" : angle};
}

inline std::string FormatSetting(const PoseFormat& format) {
  return "captures.pose_format={columns: [" + Join(format.columns, ", ") +
         "], translation: " + format.translation_unit + ", rotation: " + format.rotation +
         (format.angle_unit.empty() ? "" : ", angle: " + format.angle_unit) + "}";
}

// Changes the poses by `change`, writes them in one format and declares them as another.
inline Spoiling Poses(const std::string& name, const PoseFormat& written, const PoseFormat& declared,
                      const std::vector<std::string>& codes,
                      const std::function<void(std::vector<PoseRow>*)>& change = {}) {
  return {name, [=](const GoodSet& good, const std::filesystem::path& folder) -> std::optional<Spoiled> {
            std::vector<PoseRow> rows = ReadPoseFile(good.poses, *FindPoseFormat("ros"));
            if (change) change(&rows);
            for (PoseRow& row : rows) row.role = CaptureRole::kNone;
            WriteAll(folder / "poses.csv", PoseFileText(rows, written));
            return Spoiled{{"captures.poses=" + (folder / "poses.csv").string(), FormatSetting(declared)}, codes};
          }};
}

// Writes the target of the set with other settings to a file of its own, and returns the setting that selects it.
inline std::string TargetSetting(const GoodSet& good, const std::filesystem::path& folder,
                                 const std::vector<std::pair<std::string, std::string>>& changes) {
  const YAML::Node config = YAML::LoadFile(good.config.string());
  YAML::Node target = config["target"].IsMap()
                          ? YAML::Clone(config["target"])
                          : YAML::LoadFile((good.config.parent_path() / config["target"].as<std::string>()).string());
  for (const auto& [key, value] : changes) target[key] = value;
  WriteAll(folder / "target.yaml", YAML::Dump(target));
  return "target=" + (folder / "target.yaml").string();
}

inline std::vector<Spoiling> AllSpoilings(bool all_orders) {
  const PoseFormat plain = FormOfRotation("quaternion_xyzw", "", "m");
  const auto euler = [](const std::string& order, const std::string& angle = "deg", const std::string& unit = "mm") {
    return FormOfRotation(order, angle, unit);
  };
  std::vector<Spoiling> spoilings;
  // Euler angle orders.
  const std::vector<std::string> some = {"euler_xyz", "extrinsic_zyx", "euler_zyz", "extrinsic_yxz", "euler_xzy"};
  for (const std::string& rotation : PoseRotationNames()) {
    const bool is_order = rotation.starts_with("euler_") || rotation.starts_with("extrinsic_");
    if (!is_order || rotation == "euler_zyx") continue;
    if (!all_orders && std::find(some.begin(), some.end(), rotation) == some.end()) continue;
    spoilings.push_back(
        Poses("euler_zyx_read_as_" + rotation, euler("euler_zyx"), euler(rotation), {"rotation_format"}));
  }
  spoilings.push_back(Poses("rpy_read_as_rotation_vector", euler("extrinsic_xyz", "rad", "m"),
                            euler("rotation_vector", "rad", "m"), {"rotation_format"}));
  spoilings.push_back(Poses("rotation_vector_read_as_rpy", euler("rotation_vector", "rad", "m"),
                            euler("extrinsic_xyz", "rad", "m"), {"rotation_format"}));
  spoilings.push_back(Poses("rad_read_as_deg", euler("euler_zyx", "rad"), euler("euler_zyx", "deg"), {"angle_unit"}));
  spoilings.push_back(Poses("deg_read_as_rad", euler("euler_zyx", "deg"), euler("euler_zyx", "rad"), {"angle_unit"}));
  spoilings.push_back(
      Poses("mm_read_as_m", euler("euler_zyx", "deg", "mm"), euler("euler_zyx", "deg", "m"), {"pose_units"}));
  spoilings.push_back(
      Poses("m_read_as_mm", euler("euler_zyx", "deg", "m"), euler("euler_zyx", "deg", "mm"), {"pose_units"}));
  spoilings.push_back(
      Poses("inches_read_as_cm", euler("euler_zyx", "deg", "in"), euler("euler_zyx", "deg", "cm"), {"pose_units"}));
  spoilings.push_back(
      Poses("wxyz_read_as_xyzw", FormOfRotation("quaternion_wxyz", "", "m"), plain, {"rotation_format"}));
  spoilings.push_back(
      Poses("xyzw_read_as_wxyz", plain, FormOfRotation("quaternion_wxyz", "", "m"), {"rotation_format"}));
  spoilings.push_back(
      Poses("order_and_unit", euler("euler_zyx", "deg", "mm"), euler("euler_xyz", "deg", "m"), {"rotation_format"}));
  spoilings.push_back(Poses("inverse_poses", plain, plain, {"pose_direction"}, [](std::vector<PoseRow>* rows) {
    for (PoseRow& row : *rows) row.pose = Inverse(row.pose);
  }));
  spoilings.push_back(Poses("transposed_rotations", plain, plain, {"rotation_inverse"}, [](std::vector<PoseRow>* rows) {
    for (PoseRow& row : *rows) row.pose.rotation = row.pose.rotation.conjugate();
  }));
  spoilings.push_back({"wrong_set_up", [](const GoodSet& good, const std::filesystem::path&) -> std::optional<Spoiled> {
                         const Setup other = good.setup == Setup::kEyeToHand ? Setup::kEyeInHand : Setup::kEyeToHand;
                         return Spoiled{{"setup=" + std::string(SetupName(other))}, {"pose_direction"}};
                       }});
  // Order of the rows.
  const auto rotate_rows = [](std::ptrdiff_t by) {
    return [by](std::vector<PoseRow>* rows) {
      std::vector<Rigid3d> poses;
      for (const PoseRow& row : *rows) poses.push_back(row.pose);
      const auto num = static_cast<std::ptrdiff_t>(poses.size());
      for (std::ptrdiff_t i = 0; i < num; ++i) {
        (*rows)[static_cast<size_t>(i)].pose = poses[static_cast<size_t>((i + by + num) % num)];
      }
    };
  };
  spoilings.push_back(Poses("one_row_late", plain, plain, {"pairing"}, rotate_rows(-1)));
  spoilings.push_back(Poses("one_row_early", plain, plain, {"pairing"}, rotate_rows(1)));
  spoilings.push_back(Poses("two_rows_late", plain, plain, {"pairing"}, rotate_rows(-2)));
  spoilings.push_back(Poses("reverse_order", plain, plain, {"pairing"}, [](std::vector<PoseRow>* rows) {
    for (size_t i = 0; i < rows->size() / 2; ++i) std::swap((*rows)[i].pose, (*rows)[rows->size() - 1 - i].pose);
  }));
  spoilings.push_back(Poses("two_swapped", plain, plain, {"swapped"}, [](std::vector<PoseRow>* rows) {
    std::swap((*rows)[4].pose, (*rows)[rows->size() / 2 + 2].pose);
  }));
  spoilings.push_back(Poses("pose_of_another", plain, plain, {"same_pose"},
                            [](std::vector<PoseRow>* rows) { (*rows)[2].pose = (*rows)[rows->size() / 2].pose; }));
  // Target.
  for (const double factor : {1.1, 0.9}) {
    spoilings.push_back(
        {factor > 1 ? "target_10_percent_larger" : "target_10_percent_smaller",
         [factor](const GoodSet& good, const std::filesystem::path& folder) -> std::optional<Spoiled> {
           return Spoiled{
               {TargetSetting(good, folder, {{good.length_key, RoundTrip(factor * good.length_mm) + " mm"}})},
               {"target_scale"}};
         }});
  }
  spoilings.push_back({"rows_and_columns_swapped",
                       [](const GoodSet& good, const std::filesystem::path& folder) -> std::optional<Spoiled> {
                         // A chessboard with rows and columns swapped is the same board on its side.
                         if (good.rows == good.columns || good.target_type == "chessboard") return std::nullopt;
                         return Spoiled{{TargetSetting(good, folder,
                                                       {{"rows", std::to_string(good.columns)},
                                                        {"columns", std::to_string(good.rows)}})},
                                        {"target"}};
                       }});
  spoilings.push_back(
      {"wrong_family", [](const GoodSet& good, const std::filesystem::path& folder) -> std::optional<Spoiled> {
         const std::map<std::string, std::vector<std::pair<std::string, std::string>>> wrong = {
             {"apriltag_grid", {{"family", "tag25h9"}}},
             {"charuco", {{"dictionary", "DICT_7X7_250"}}},
             {"coded_board", {{"bits", "14"}}}};
         const auto found = wrong.find(good.target_type);
         if (found == wrong.end()) return std::nullopt;
         return Spoiled{{TargetSetting(good, folder, found->second)}, {"target"}};
       }});
  for (const int first : {1, 24}) {
    spoilings.push_back(
        {"numbers_from_" + std::to_string(first),
         [first](const GoodSet& good, const std::filesystem::path& folder) -> std::optional<Spoiled> {
           const std::map<std::string, std::string> keys = {
               {"apriltag_grid", "first_id"}, {"charuco", "first_marker"}, {"coded_board", "first_id"}};
           const auto key = keys.find(good.target_type);
           if (key == keys.end()) return std::nullopt;
           return Spoiled{{TargetSetting(good, folder, {{key->second, std::to_string(first)}})}, {"target"}};
         }});
  }
  spoilings.push_back(
      {"one_column_too_many", [](const GoodSet& good, const std::filesystem::path& folder) -> std::optional<Spoiled> {
         return Spoiled{{TargetSetting(good, folder, {{"columns", std::to_string(good.columns + 1)}})}, {"target"}};
       }});
  spoilings.push_back(
      {"one_row_too_few", [](const GoodSet& good, const std::filesystem::path& folder) -> std::optional<Spoiled> {
         // If points have ids, the remaining points are still correct.
         if (good.target_type != "chessboard" && good.target_type != "circle_grid") return std::nullopt;
         return Spoiled{{TargetSetting(good, folder, {{"rows", std::to_string(good.rows - 1)}})}, {"target"}};
       }});
  // Camera.
  spoilings.push_back(
      {"half_resolution_intrinsics",
       [](const GoodSet& good, const std::filesystem::path& folder) -> std::optional<Spoiled> {
         if (!std::filesystem::exists(good.camera)) return std::nullopt;
         YAML::Node camera = YAML::Clone(ReadYamlFile(good.camera).node());
         for (const char* key : {"fx", "fy", "cx", "cy"}) camera[key] = RoundTrip(0.5 * camera[key].as<double>());
         WriteAll(folder / "camera.yaml", YAML::Dump(camera));
         return Spoiled{{"camera.intrinsics=" + (folder / "camera.yaml").string()}, {"camera_scale", "camera"}};
       }});
  spoilings.push_back({"intrinsics_of_half_size",
                       [](const GoodSet& good, const std::filesystem::path& folder) -> std::optional<Spoiled> {
                         if (!std::filesystem::exists(good.camera)) return std::nullopt;
                         YAML::Node camera = YAML::Clone(ReadYamlFile(good.camera).node());
                         for (const char* key : {"fx", "fy", "cx", "cy"})
                           camera[key] = RoundTrip(0.5 * camera[key].as<double>());
                         const std::vector<int> size = camera["image_size"].as<std::vector<int>>();
                         camera["image_size"][0] = size[0] / 2;
                         camera["image_size"][1] = size[1] / 2;
                         WriteAll(folder / "camera.yaml", YAML::Dump(camera));
                         return Spoiled{{"camera.intrinsics=" + (folder / "camera.yaml").string()}, {"camera_size"}};
                       }});
  spoilings.push_back(
      {"cropped_images", [](const GoodSet& good, const std::filesystem::path& folder) -> std::optional<Spoiled> {
         if (!std::filesystem::exists(good.camera)) return std::nullopt;
         std::filesystem::create_directories(folder / "images");
         for (const auto& entry : std::filesystem::directory_iterator(good.images)) {
           const cv::Mat image = cv::imread(entry.path().string(), cv::IMREAD_GRAYSCALE);
           if (image.empty()) continue;
           const cv::Rect window(image.cols / 32, image.rows / 24, image.cols - image.cols / 16,
                                 image.rows - image.rows / 24);
           cv::imwrite((folder / "images" / entry.path().filename()).string(),
                       image(window & cv::Rect(0, 0, image.cols, image.rows)));
         }
         return Spoiled{{"captures.images=" + (folder / "images").string()}, {"camera_size"}};
       }});
  spoilings.push_back(
      {"image_twice", [](const GoodSet& good, const std::filesystem::path& folder) -> std::optional<Spoiled> {
         std::filesystem::create_directories(folder / "images");
         std::vector<std::filesystem::path> files;
         for (const auto& entry : std::filesystem::directory_iterator(good.images)) files.push_back(entry.path());
         std::sort(files.begin(), files.end());
         for (size_t i = 0; i < files.size(); ++i) {
           std::filesystem::copy_file(files[i == 3 ? 1 : i], folder / "images" / files[i].filename());
         }
         return Spoiled{{"captures.images=" + (folder / "images").string()}, {"same_picture"}};
       }});
  return spoilings;
}

// Returns the code of the first finding that is wrong; empty if there is none.
inline std::string FirstWrongCode(const std::string& out) {
  const std::string mark = "wrong [";
  const size_t at = out.find(mark);
  if (at == std::string::npos) return "";
  return out.substr(at + mark.size(), out.find(']', at) - at - mark.size());
}

struct SpoilingScore {
  int num_right = 0;
  int num_all = 0;
};

// Returns the stride for ScoreDoctor. Each set is spoiled in every `stride`-th way, starting at different ones, so
// that all spoilings are covered; HEBA_ALL_SPOILINGS in the environment selects all ways, which takes half an hour
// for the recorded sets.
inline size_t Stride(size_t stride) { return std::getenv("HEBA_ALL_SPOILINGS") != nullptr ? 1 : stride; }

// Applies every `stride`-th spoiling from `first` on to the set and prints a table of the doctor's findings. `work`
// holds new files and detections.
inline SpoilingScore ScoreDoctor(const GoodSet& good, const std::filesystem::path& work, bool all_orders, size_t first,
                                 size_t stride) {
  std::filesystem::create_directories(work / "cache");
  const std::string environment = "HEBA_CACHE=" + ShellQuoted((work / "cache").string());
  const CommandResult unspoiled = RunHeba({"doctor", good.config.string(), "--quiet"}, environment);
  EXPECT_EQ(unspoiled.status, 0) << unspoiled.err;
  EXPECT_EQ(FirstWrongCode(unspoiled.out), "") << good.name << " as it is:\n" << unspoiled.out;
  std::vector<Spoiling> spoilings;
  const std::vector<Spoiling> all = AllSpoilings(all_orders);
  for (size_t i = first % stride; i < all.size(); i += stride) spoilings.push_back(all[i]);
  const auto ask = [&](const Spoiling& spoiling) -> std::optional<std::pair<bool, std::string>> {
    const std::filesystem::path folder = work / spoiling.name;
    std::filesystem::remove_all(folder);
    std::filesystem::create_directories(folder);
    const std::optional<Spoiled> spoiled = spoiling.apply(good, folder);
    if (!spoiled) return std::nullopt;
    std::vector<std::string> arguments = {"doctor", good.config.string(), "--quiet", "--jobs", "1"};
    for (const std::string& setting : spoiled->settings) {
      arguments.push_back("--set");
      arguments.push_back(setting);
    }
    const CommandResult result = RunHeba(arguments, environment);
    const std::string code = FirstWrongCode(result.out);
    const bool is_right = std::find(spoiled->codes.begin(), spoiled->codes.end(), code) != spoiled->codes.end();
    std::filesystem::remove_all(folder);
    return std::pair(is_right, (is_right ? "  right  " : "  WRONG  ") + good.name + "  " + spoiling.name + ": " +
                                   (code.empty() ? "nothing" : code) +
                                   (is_right ? "" : "\n" + result.err + result.out));
  };
  SpoilingScore score;
  for (size_t i = 0; i < spoilings.size(); i += 2) {
    std::vector<std::future<std::optional<std::pair<bool, std::string>>>> answers;
    for (size_t k = i; k < std::min(i + 2, spoilings.size()); ++k) {
      answers.push_back(std::async(std::launch::async, ask, spoilings[k]));
    }
    for (auto& answer : answers) {
      const std::optional<std::pair<bool, std::string>> found = answer.get();
      if (!found) continue;
      ++score.num_all;
      score.num_right += found->first ? 1 : 0;
      std::cout << found->second << std::endl;
    }
  }
  return score;
}

}  // namespace heba
