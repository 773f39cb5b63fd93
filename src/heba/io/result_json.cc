#include "heba/io/result_json.h"

#include <algorithm>
#include <limits>

#include "heba/base/units.h"
#include "heba/geometry/pose_block.h"

namespace heba {
namespace {

// Returns one sigma of a parameter, or null if it was held.
Json SigmaJson(const Covariance& covariance, const std::string& name) {
  const std::optional<double> sigma = SigmaOf(covariance, name);
  return sigma ? Finite(*sigma) : Json(nullptr);
}

// Throws InputError if the matrix is not a covariance.
void CheckCovariance(const JsonReader& reader, const Covariance& covariance) {
  const Eigen::MatrixXd& matrix = covariance.matrix;
  constexpr double kMost = 1e15;
  constexpr double kRounding = 1e-6;
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    if (!(matrix(i, i) >= 0 && matrix(i, i) <= kMost)) {
      reader.Fail("a variance is negative or above 1e15: " + covariance.layout.Name(i));
    }
  }
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    for (Eigen::Index j = 0; j < i; ++j) {
      const double most = std::sqrt(matrix(i, i)) * std::sqrt(matrix(j, j));
      if (std::abs(matrix(i, j) - matrix(j, i)) <= kRounding * most &&
          std::abs(matrix(i, j)) <= (1 + kRounding) * most) {
        continue;
      }
      reader.Fail("the matrix is not a covariance: see " + covariance.layout.Name(i) + " and " +
                  covariance.layout.Name(j));
    }
  }
}

Grade ReadGrade(const JsonReader& reader) { return ReadEnum<Grade>(reader, "grade", kGradeNames); }

}  // namespace

Json PoseJson(const Rigid3d& pose, std::string_view parent, std::string_view child) {
  // q and -q are the same rotation; w is kept non-negative, so that files can be compared.
  const double sign = pose.rotation.w() < 0 ? -1.0 : 1.0;
  Json json;
  json["parent"] = parent;
  json["child"] = child;
  json["translation_m"] = {pose.translation.x(), pose.translation.y(), pose.translation.z()};
  json["quaternion_xyzw"] = {sign * pose.rotation.x(), sign * pose.rotation.y(), sign * pose.rotation.z(),
                             sign * pose.rotation.w()};
  return json;
}

Json PoseJson(const Rigid3d& pose, std::string_view parent, std::string_view child, const Covariance* covariance,
              const std::string& block) {
  Json json = PoseJson(pose, parent, child);
  json["std_translation_m"] = nullptr;
  json["std_rotation_rad"] = nullptr;
  for (size_t i = 0; covariance != nullptr && i < kTangentNames.size(); ++i) {
    json[i < 3 ? "std_translation_m" : "std_rotation_rad"].push_back(
        SigmaJson(*covariance, block + "." + std::string(kTangentNames[i])));
  }
  return json;
}

Json CameraJson(const Camera& camera) {
  Json json;
  json["model"] = camera.model;
  json["image_size"] = {camera.width_px, camera.height_px};
  json["fx"] = camera.params[0];
  json["fy"] = camera.params[1];
  json["cx"] = camera.params[2];
  json["cy"] = camera.params[3];
  json["distortion"] = std::vector<double>(camera.params.begin() + 4, camera.params.end());
  return json;
}

Json CameraJson(const Camera& camera, const Covariance* covariance, const std::string& block) {
  Json json = CameraJson(camera);
  json["std"] = nullptr;
  if (covariance == nullptr) return json;
  const std::vector<std::string>& names = camera.Model().param_names();
  Json sigmas;
  for (size_t i = 0; i < 4; ++i) sigmas[names[i]] = SigmaJson(*covariance, block + "." + names[i]);
  sigmas["distortion"] = Json::array();
  for (size_t i = 4; i < names.size(); ++i) {
    sigmas["distortion"].push_back(SigmaJson(*covariance, block + "." + names[i]));
  }
  json["std"] = std::move(sigmas);
  return json;
}

Json PointOffsetsJson(const std::vector<PointOffsets>& offsets, size_t target) {
  Json json = Json::array();
  if (target >= offsets.size()) return json;
  for (const auto& [id, offset_m] : offsets[target]) {
    json.push_back(Json{{"id", id}, {"offset_m", {offset_m.x(), offset_m.y(), offset_m.z()}}});
  }
  return json;
}

Json ShapeJson(const TargetShape& shape, const Covariance& covariance, const std::string& block) {
  Json json;
  Json sigmas;
  bool is_free = false;
  for (size_t i = 0; i < shape.params.size(); ++i) {
    const std::string name(kTargetShapeParamNames[i]);
    json[name] = shape.params[i];
    sigmas[name] = SigmaJson(covariance, block + "." + name);
    is_free = is_free || !sigmas[name].is_null();
  }
  json["std"] = sigmas;
  return is_free ? json : Json(nullptr);
}

Json NoiseJson(const std::optional<RobotNoise>& noise, const std::string& prefix) {
  return Json{{prefix + "mm", noise ? Json(1000 * noise->translation_m) : Json(nullptr)},
              {prefix + "deg", noise ? Json(RadToDeg(noise->rotation_rad)) : Json(nullptr)}};
}

Json TangentJson(const std::optional<Tangent6>& tangent) {
  if (!tangent) return nullptr;
  const Eigen::Vector3d t = 1000 * tangent->head<3>();
  const Eigen::Vector3d r = tangent->tail<3>();
  return Json{{"translation_mm", {t.x(), t.y(), t.z()}},
              {"rotation_deg", {RadToDeg(r.x()), RadToDeg(r.y()), RadToDeg(r.z())}}};
}

Json MoveJson(const std::optional<CaptureMove>& move) {
  if (!move) return nullptr;
  Json json = TangentJson(move->tangent);
  json["chance"] = Finite(move->p_value);
  return json;
}

Json MatrixJson(const Eigen::MatrixXd& matrix) {
  Json rows = Json::array();
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    Json row = Json::array();
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) row.push_back(Finite(matrix(i, j)));
    rows.push_back(std::move(row));
  }
  return rows;
}

Json CovarianceJson(const Covariance& covariance, const UnknownBlock& left_out) {
  Json order = Json::array();
  std::vector<Eigen::Index> written;
  for (Eigen::Index i = 0; i < covariance.layout.size(); ++i) {
    if (i >= left_out.first && i < left_out.end()) continue;
    order.push_back(covariance.layout.Name(i));
    written.push_back(i);
  }
  return Json{{"order", std::move(order)}, {"matrix", MatrixJson(covariance.matrix(written, written))}};
}

Json VerdictJson(const Verdict& verdict) {
  Json findings = Json::array();
  for (const Finding& finding : verdict.findings) {
    Json numbers = Json::object();
    for (const auto& [name, value] : finding.numbers) numbers[name] = Finite(value);
    Json names = Json::object();
    for (const auto& [name, value] : finding.names) {
      if (!names.contains(name)) names[name] = value;
    }
    findings.push_back(Json{{"code", finding.code},
                            {"grade", GradeName(finding.grade)},
                            {"numbers", numbers},
                            {"names", names},
                            {"text", finding.text},
                            {"action", finding.action}});
  }
  return Json{{"grade", GradeName(verdict.grade)}, {"findings", findings}};
}

Json TimingJson(const Timing& timing) {
  return Json{
      {"detect", timing.detect_s}, {"seed", timing.seed_s}, {"refine", timing.refine_s}, {"total", timing.total_s}};
}

std::string FileText(const Json& json) { return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n"; }

Rigid3d ReadPoseJson(const JsonReader& reader, std::string_view parent, std::string_view child) {
  if (reader.Get("parent").Text() != parent || reader.Get("child").Text() != child) {
    reader.Fail("is the pose of '" + reader.Get("child").Text() + "' in '" + reader.Get("parent").Text() +
                "'; that of '" + std::string(child) + "' in '" + std::string(parent) + "' is needed for this setup");
  }
  const std::vector<double> t = reader.Get("translation_m").Numbers(3);
  const std::vector<double> q = reader.Get("quaternion_xyzw").Numbers(4);
  const Eigen::Quaterniond rotation(q[3], q[0], q[1], q[2]);
  if (std::abs(rotation.norm() - 1) > 1e-3) reader.Fail("the quaternion's length is not 1");
  return {rotation, Eigen::Vector3d(t[0], t[1], t[2])};
}

Camera ReadCameraJson(const JsonReader& reader) {
  Camera camera;
  camera.model = reader.Get("model").Text();
  const std::vector<JsonReader> size = reader.Get("image_size").List();
  if (size.size() != 2) reader.Get("image_size").Fail("two whole numbers are needed: [width, height]");
  constexpr int kMaxSize = 100000;
  camera.width_px = size[0].Int(0, kMaxSize);
  camera.height_px = size[1].Int(0, kMaxSize);
  for (const char* key : {"fx", "fy", "cx", "cy"}) camera.params.push_back(reader.Get(key).Number());
  for (const double k : reader.Get("distortion").Numbers()) camera.params.push_back(k);
  const std::string faults = CheckCamera(camera);
  if (!faults.empty()) reader.Fail(faults);
  return camera;
}

PointOffsets ReadPointOffsetsJson(const JsonReader& reader) {
  constexpr int kMostId = 1000000000;
  constexpr size_t kDimensions = 3;
  PointOffsets offsets;
  for (const JsonReader& entry : reader.List()) {
    const JsonReader value = entry.Get("offset_m");
    const std::vector<double> offset_m = value.Numbers();
    if (offset_m.size() != kDimensions) value.Fail("three numbers are needed");
    offsets[entry.Get("id").Int(0, kMostId)] = {offset_m[0], offset_m[1], offset_m[2]};
  }
  return offsets;
}

TargetShape ReadShapeJson(const JsonReader& reader) {
  TargetShape shape;
  for (size_t i = 0; i < shape.params.size(); ++i) {
    // Results that were written before a parameter existed lack it.
    const std::string name(kTargetShapeParamNames[i]);
    if (reader.Has(name.c_str())) shape.params[i] = reader.Get(name.c_str()).Number();
  }
  return shape;
}

std::optional<double> ReadOptional(const JsonReader& reader, const char* key) {
  if (!reader.Has(key)) return std::nullopt;
  return reader.Get(key).Number();
}

double ReadFinite(const JsonReader& reader, const char* key, double otherwise) {
  return ReadOptional(reader, key).value_or(otherwise);
}

double ReadMagnitude(const JsonReader& reader, const char* key) {
  const double value = reader.Get(key).Number();
  constexpr double kMost = 1e15;
  if (!(value >= 0 && value <= kMost)) reader.Get(key).Fail("must be from 0 to 1e15");
  return value;
}

std::optional<double> ReadOptionalMagnitude(const JsonReader& reader, const char* key) {
  if (!reader.Has(key)) return std::nullopt;
  return ReadMagnitude(reader, key);
}

std::optional<RobotNoise> ReadNoise(const JsonReader& reader, const std::string& prefix) {
  const std::string mm = prefix + "mm";
  const std::string deg = prefix + "deg";
  if (!reader.Has(mm.c_str())) return std::nullopt;
  return RobotNoise{ReadMagnitude(reader, mm.c_str()) / 1000, DegToRad(ReadMagnitude(reader, deg.c_str())), 0};
}

std::optional<Tangent6> ReadTangent(const JsonReader& reader, const char* key) {
  if (!reader.Has(key)) return std::nullopt;
  const std::vector<double> t = reader.Get(key).Get("translation_mm").Numbers(3);
  const std::vector<double> r = reader.Get(key).Get("rotation_deg").Numbers(3);
  Tangent6 tangent;
  tangent << t[0] / 1000, t[1] / 1000, t[2] / 1000, DegToRad(r[0]), DegToRad(r[1]), DegToRad(r[2]);
  return tangent;
}

std::optional<CaptureMove> ReadMove(const JsonReader& reader) {
  const std::optional<Tangent6> move = ReadTangent(reader, "move_without");
  if (!move) return std::nullopt;
  return CaptureMove{*move, ReadFinite(reader.Get("move_without"), "chance", 1)};
}

std::vector<std::string> ReadOrder(const JsonReader& covariance) {
  std::vector<std::string> names;
  for (const JsonReader& name : covariance.Get("order").List()) names.push_back(name.Text());
  return names;
}

Eigen::MatrixXd ReadMatrix(const JsonReader& reader, const char* key, Eigen::Index size, const char* fault) {
  const std::vector<JsonReader> rows = reader.Get(key).List();
  if (static_cast<Eigen::Index>(rows.size()) != size) reader.Fail(fault);
  Eigen::MatrixXd matrix(size, size);
  for (Eigen::Index i = 0; i < size; ++i) {
    const std::vector<double> row = rows[static_cast<size_t>(i)].Numbers(static_cast<size_t>(size));
    matrix.row(i) = Eigen::Map<const Eigen::RowVectorXd>(row.data(), size);
  }
  return matrix;
}

Covariance ReadCovarianceMatrix(const JsonReader& reader, const UnknownLayout& layout) {
  Covariance covariance{layout,
                        ReadMatrix(reader, "matrix", layout.size(), "the matrix does not have one row per name")};
  CheckCovariance(reader, covariance);
  return covariance;
}

void CheckOrder(const JsonReader& order, const std::vector<std::string>& names, const UnknownLayout& layout) {
  const std::vector<std::string> expected = layout.Names();
  if (names == expected) return;
  const auto [name, other] = std::mismatch(names.begin(), names.end(), expected.begin(), expected.end());
  order.Fail(other == expected.end()
                 ? "'" + *name + "' is not a parameter, or occurs twice"
                 : "the names must contain " + *other + " once" + (name == names.end() ? "" : ", before " + *name));
}

Verdict ReadVerdict(const JsonReader& reader) {
  Verdict verdict;
  verdict.grade = ReadGrade(reader.Get("grade"));
  for (const JsonReader& entry : reader.Get("findings").List()) {
    Finding finding{ReadGrade(entry.Get("grade")), entry.Get("code").Text()};
    finding.text = entry.Get("text").Text();
    finding.action = entry.Get("action").Text();
    for (const auto& [name, value] : entry.Get("numbers").Members()) {
      finding.numbers.emplace_back(name, value ? value->Number() : std::numeric_limits<double>::infinity());
    }
    // Results of earlier versions have none.
    if (entry.Has("names")) {
      for (const auto& [name, value] : entry.Get("names").Members()) {
        if (value) finding.names.emplace_back(name, value->Text());
      }
    }
    verdict.findings.push_back(std::move(finding));
  }
  return verdict;
}

Timing ReadTiming(const JsonReader& reader) {
  return {ReadMagnitude(reader, "detect"), ReadMagnitude(reader, "seed"), ReadMagnitude(reader, "refine"),
          ReadMagnitude(reader, "total")};
}

}  // namespace heba
