#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "heba/base/error.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "heba/evaluation/pose_correction.h"
#include "heba/io/export_files.h"
#include "heba/io/result_file.h"
#include "python/bindings/arrays.h"
#include "python/bindings/bindings.h"
#include "python/bindings/names.h"
#include "tools/config/robot_section.h"
#include "tools/config/run_export.h"
#include "tools/pages/comparison_files.h"
#include "tools/text/console.h"
#include "tools/text/failure_text.h"
#include "tools/text/result_table.h"

namespace heba {
namespace {

// Returns the names and the texts of the files of an export.
std::vector<std::pair<std::string, std::string>> ExportOf(const std::filesystem::path& result_file,
                                                          const std::string& format_name, bool is_forced) {
  const pybind11::gil_scoped_release release;
  const ExportFormat* const format = FindEntry(ExportFormats(), format_name);
  if (format == nullptr) throw InputError("format: " + UnknownName(format_name, NamesOf(ExportFormats())));
  const RunResult result = ReadWholeResult(result_file);
  const ExportRequests requests = ExportRequestsOf(result_file.parent_path(), result, kBundleMethod);
  std::vector<std::pair<std::string, std::string>> files;
  std::string reason;
  for (const ExportedFile& file :
       FilesToExport({*format}, requests, result.verdict.grade, is_forced, "force=True exports it")) {
    if (!file.text.empty()) files.emplace_back(file.name, file.text);
    if (reason.empty()) reason = file.reason;
  }
  if (files.empty()) throw InputError("format " + format_name + ": " + reason);
  return files;
}

std::string TableOf(const std::filesystem::path& result_file) {
  const pybind11::gil_scoped_release release;
  return ResultTable(ReadRunResult(result_file), Colour::kPlain);
}

// Compares finished runs, and writes the folder of the comparison if there is one. Returns the table, and the contents
// of compare.csv and pairs.csv.
std::tuple<std::string, std::string, std::string> Compare(const std::vector<std::filesystem::path>& runs,
                                                          const std::optional<std::filesystem::path>& out) {
  const pybind11::gil_scoped_release release;
  const Comparison comparison = CompareRuns(ReadComparedRuns(runs));
  if (out) WriteComparison(comparison, *out);
  return {ComparisonTable(comparison), ComparisonRunsCsv(comparison), ComparisonPairsCsv(comparison)};
}

// Returns the true poses of an arm, n x 4 x 4, or those to command, with the joints at them (rad or m) if they are
// given. The only arm has an empty name.
std::vector<pybind11::array_t<double>> CorrectPoses(const std::filesystem::path& result_file, const std::string& arm,
                                                    const DoubleArray& base_from_gripper,
                                                    const std::vector<std::vector<double>>& joints, bool is_inverse,
                                                    bool is_forced) {
  const std::vector<Rigid3d> given = PosesFrom(base_from_gripper);
  std::vector<Rigid3d> corrected;
  {
    const pybind11::gil_scoped_release release;
    const RunResult result = ReadWholeResult(result_file);
    const size_t index = IndexOfArm("arm", arm, result.rig.robots, "the name of one");
    const RobotSummary* const robot = FindEstimatedArm(result, index);
    if (robot == nullptr) throw InputError("arm: " + WhyNotEstimated(result, index));
    if (result.verdict.grade == Grade::kBad && !is_forced) {
      throw InputError("the verdict of the run is bad, and a robot would move by these poses; force=True gives them");
    }
    const auto num_joints = static_cast<size_t>(robot->nominal.num_joints());
    if (!joints.empty() && joints.front().size() != num_joints) {
      throw InputError("joints: the arm " + robot->nominal.name + " has " + std::to_string(num_joints) +
                       " joints, not " + std::to_string(joints.front().size()));
    }
    for (size_t i = 0; i < given.size(); ++i) {
      const auto by_joints = [&] {
        const Eigen::Map<const Eigen::VectorXd> at(joints[i].data(), static_cast<Eigen::Index>(num_joints));
        return is_inverse ? CommandFor(*robot, given[i], at) : TruePose(*robot, given[i], at);
      };
      const auto by_pose = [&] { return is_inverse ? CommandFor(*robot, given[i]) : TruePose(*robot, given[i]); };
      const Outcome<Rigid3d> pose = joints.empty() ? by_pose() : by_joints();
      if (!pose) throw InputError("poses[" + std::to_string(i) + "]: " + FailureText(pose.failure()));
      corrected.push_back(*pose);
    }
  }
  std::vector<pybind11::array_t<double>> arrays;
  for (const Rigid3d& pose : corrected) arrays.push_back(ArrayOf(pose));
  return arrays;
}

}  // namespace

void BindResults(pybind11::module_& module) {
  using pybind11::arg;
  module.def("export", &ExportOf, arg("result_file"), arg("format"), arg("force"));
  module.def("table", &TableOf, arg("result_file"));
  module.def("compare", &Compare, arg("runs"), arg("out"));
  module.def("correct", &CorrectPoses, arg("result_file"), arg("arm"), arg("base_from_gripper"), arg("joints"),
             arg("is_inverse"), arg("is_forced"));
}

}  // namespace heba
