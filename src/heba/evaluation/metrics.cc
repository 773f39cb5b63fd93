#include "heba/evaluation/metrics.h"

#include <cmath>

#include "heba/base/median.h"
#include "heba/base/units.h"
#include "heba/data/prediction.h"

namespace heba {

std::optional<double> SquaredErrors::RmsPx() const {
  if (num_points == 0) return std::nullopt;
  return std::sqrt(sum_px2 / num_points);
}

std::optional<Points2> Residuals(const Camera& camera, const Rigid3d& camera_from_target,
                                 const Observations& observations) {
  Points2 pixels;
  if (!Predict(camera.Model(), camera.params.data(), camera_from_target, observations, &pixels, nullptr)) {
    return std::nullopt;
  }
  pixels -= observations.pixels;
  return pixels;
}

std::optional<SquaredErrors> ViewErrors(const Camera& camera, const Rigid3d& camera_from_target,
                                        const Observations& observations) {
  const std::optional<Points2> residuals = Residuals(camera, camera_from_target, observations);
  if (!residuals) return std::nullopt;
  return SquaredErrors{residuals->squaredNorm(), observations.size()};
}

std::optional<SquaredErrors> ReprojectionErrors(const HandEye& hand_eye, const Camera& camera,
                                                const std::vector<View>& views) {
  SquaredErrors total;
  for (const View& view : views) {
    const std::optional<SquaredErrors> errors =
        ViewErrors(camera, CameraFromTarget(hand_eye, view.camera_mount_from_target_mount), view.observations);
    if (!errors) return std::nullopt;
    total.Add(*errors);
  }
  return total;
}

std::optional<double> AxxbMeanMm(const std::vector<PosePair>& pairs, const Rigid3d& camera_mount_from_camera) {
  if (pairs.size() < 2) return std::nullopt;
  const auto in_mm = [](const Rigid3d& pose) { return Rigid3d(pose.rotation, 1000.0 * pose.translation).Matrix(); };
  const Eigen::Matrix4d x = in_mm(camera_mount_from_camera);
  double sum = 0;
  for (size_t i = 0; i + 1 < pairs.size(); ++i) {
    const Rigid3d a = pairs[i + 1].camera_mount_from_target_mount * Inverse(pairs[i].camera_mount_from_target_mount);
    const Rigid3d b = pairs[i + 1].camera_from_target * Inverse(pairs[i].camera_from_target);
    sum += (in_mm(a) * x - x * in_mm(b)).norm();
  }
  return sum / static_cast<double>(pairs.size() - 1);
}

double WorkingDistance(const std::vector<Rigid3d>& camera_from_target) {
  std::vector<double> distances_m;
  for (const Rigid3d& pose : camera_from_target) distances_m.push_back(pose.translation.norm());
  return distances_m.empty() ? 0 : Median(distances_m);
}

std::optional<BoardScatter> ComputeBoardScatter(const std::vector<PosePair>& pairs, const HandEye& hand_eye) {
  if (pairs.empty()) return std::nullopt;
  std::vector<Rigid3d> boards;
  for (const PosePair& pair : pairs) {
    boards.push_back(Inverse(pair.camera_mount_from_target_mount) * hand_eye.camera_mount_from_camera *
                     pair.camera_from_target);
  }
  const Rigid3d mean = MeanPose(boards);
  double translation_sum = 0;
  double rotation_sum = 0;
  for (const Rigid3d& board : boards) {
    translation_sum += std::pow(DistanceM(board, mean), 2);
    rotation_sum += std::pow(AngleRad(board, mean), 2);
  }
  const double n = static_cast<double>(boards.size());
  return BoardScatter{1000.0 * std::sqrt(translation_sum / n), RadToDeg(std::sqrt(rotation_sum / n))};
}

TruthErrors CompareWithTruth(const HandEye& hand_eye, const Camera& camera, const Truth& truth,
                             const std::vector<Rigid3d>& symmetries) {
  TruthErrors errors;
  errors.hand_eye_mm = 1000.0 * DistanceM(hand_eye.camera_mount_from_camera, truth.camera_mount_from_camera);
  errors.hand_eye_deg = RadToDeg(AngleRad(hand_eye.camera_mount_from_camera, truth.camera_mount_from_camera));
  if (truth.target_mount_from_target) {
    for (const Rigid3d& symmetry : symmetries) {
      const Rigid3d board = hand_eye.target_mount_from_target * symmetry;
      const double angle_deg = RadToDeg(AngleRad(board, *truth.target_mount_from_target));
      if (errors.board_deg && *errors.board_deg <= angle_deg) continue;
      errors.board_deg = angle_deg;
      errors.board_mm = 1000.0 * DistanceM(board, *truth.target_mount_from_target);
    }
  }
  if (truth.camera && !camera.params.empty()) {
    const double fx_error = camera.params[0] - truth.camera->params[0];
    const double fy_error = camera.params[1] - truth.camera->params[1];
    errors.focal_px = std::sqrt(0.5 * (fx_error * fx_error + fy_error * fy_error));
  }
  return errors;
}

}  // namespace heba
