// An export states its data and its format.
#pragma once

#include <optional>
#include <string>

#include "heba/evaluation/evaluation.h"

namespace heba {

// The frames between which an exported pose is given.
enum class ExportFrame {
  kBase,     // The robot's base, as the robot reports its poses.
  kGripper,  // The flange or tool, as the robot reports it.
  kOptical,  // The camera's optical frame: x right, y down, z forward.
  kBody,     // The camera's body frame: x forward, y left, z up, with the origin of the optical frame.
  kLink,     // A frame of the camera whose pose was given by the user.
};

// The data to export, with the names that they have in the other software.
struct ExportRequest {
  std::string name;    // Name of the run.
  std::string part;    // Name of the camera or of the arm in the run; empty if it has none.
  std::string method;  // Method of the estimate.
  Setup setup = Setup::kEyeToHand;
  Rigid3d parent_from_child;
  ExportFrame parent = ExportFrame::kBase;
  ExportFrame child = ExportFrame::kOptical;
  std::string parent_frame;  // Name of the parent frame.
  // Name of the child frame.
  std::string child_frame;
  // Covariance of the pose (one sigma), by the tangent in the child's frame (m, rad); nothing if it is unknown.
  std::optional<Eigen::Matrix<double, 6, 6>> covariance;
  // True if the poses are those of a Universal Robots controller, in the controller's own base frame.
  bool is_ur_controller = false;
  Camera camera;
  std::optional<Arm> arm;  // With its estimated errors; nothing if they were not estimated.
  // If its joints yield, the errors of the geometry that stands for it in formats without compliances.
  std::optional<RigidEquivalent> rigid;
  std::optional<Arm> rigid_arm;   // The arm with them.
  std::string why_no_arm;         // The reason why they were not, in words; empty if it is not known.
  std::optional<Grade> grade;     // The grade of the run's verdict; nothing if it is not known.
  std::string length_unit = "m";  // For the format `matrix`: m or mm.
};

struct ExportFormat {
  std::string name;
  std::string description;
  std::string file_name;  // Usual name of such a file.
};

}  // namespace heba
