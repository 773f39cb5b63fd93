// Calibrates random subsets of recorded data sets with heba's defaults, each in a process of its own, and compares what
// comes out with the whole set's result and with what OpenCV makes of the same captures.
//
//   soak --subsets 1000 --seed 1 [--spoil] [--sets ur5_chess_forty,caliban_no_curv] [--list] [--nostatistics]
//
// Every subset has 6 to --most_captures captures. Its lens is chosen from the captures or held at the whole set's, and
// so is the shape of its target. With --spoil, the poses of two captures are exchanged, a capture has the image of
// another one, or one pose is turned by 3 deg. Nothing may end with a signal or take more than two minutes of the
// processor. Exit status: 0 all limits below hold, 1 one does not, 77 the recorded data are not here.
#include <poll.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <numeric>
#include <set>

#include <gflags/gflags.h>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "heba/base/distributions.h"
#include "heba/base/error.h"
#include "heba/base/factorisation.h"
#include "heba/base/memory.h"
#include "heba/base/rng.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/image_detection.h"
#include "heba/run.h"
#include "tests/support/data_sets.h"
#include "tests/support/datasets.h"
#include "tools/config/run_config.h"
#include "tools/files/cached_detector.h"
#include "tools/run/captures.h"

DEFINE_int32(subsets, 100, "Number of subsets over all sets");
DEFINE_int32(seed, 1, "Seed of the subsets");
DEFINE_bool(spoil, false, "Spoil each subset in one way");
DEFINE_string(sets, "", "Names of the sets, separated by commas; all if empty");
DEFINE_string(only, "", "Numbers of the subsets that are run, separated by commas; all if empty");
DEFINE_bool(list, false, "Print a line for each subset");
DEFINE_int32(jobs, 2, "Number of subsets at a time");
DEFINE_int32(most_captures, 40, "The most captures of a subset");
DEFINE_string(robot_noise, "auto", "Model of the robot's noise, as refine.robot_noise: auto, white or smooth");
DEFINE_bool(statistics, true, "Compare with the whole sets; without it only aborts, hangs and refusals count");

namespace heba {
namespace {
namespace fs = std::filesystem;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

constexpr int kSkipped = 77;
constexpr int kFewestCaptures = 6;
// A run is stopped after so much time of the processor, or of the clock: other work on the machine is no hang.
constexpr int kLimitCpuSeconds = 120;
constexpr int kLimitSeconds = 1200;

// The limits that the soak must hold.
constexpr int kEligibleCaptures = 8;    // From so many on, what OpenCV answers must be answered.
constexpr int kWellGivenCaptures = 12;  // From so many on, few results may be bad.
constexpr double kLeastAnswered = 0.99;
constexpr double kLeastAnsweredOfSet = 0.9;
constexpr double kMostBad = 0.05;
constexpr double kLeastInside = 0.98;
constexpr double kInsideLevel = 1e-4;
constexpr double kMostGoodAndOutside = 0.01;

// A recorded set with its detections.
struct RecordedSet {
  std::string name;
  Dataset data;
  RunOptions options;
  std::vector<size_t> seen;  // The captures that show the target.
};

// The parts of the model that a subset has fixed.
struct Fixed {
  bool lens = false;
  bool shape = false;
  size_t index() const { return (lens ? 1 : 0) + (shape ? 2 : 0); }
};
constexpr std::array<Fixed, 4> kFixed = {Fixed{}, {true, false}, {false, true}, {true, true}};
constexpr std::array<const char*, 4> kFixedNames = {"free", "lens held", "shape held", "both held"};

enum class Spoiling { kNone, kSwapped, kOtherImage, kTurned };
constexpr std::array<const char*, 4> kSpoilingNames = {"as recorded", "two poses exchanged", "image of another pose",
                                                       "pose turned by 3 deg"};

// The part of a result that is compared; it crosses a pipe between processes as text.
struct Answer {
  enum class End { kDone, kRefused, kInputError, kSignal, kTimeout };
  End end = End::kSignal;
  Grade grade = Grade::kBad;
  HandEye hand_eye;
  Matrix6d covariance = Matrix6d::Zero();
  double dof = 0;
  std::string text;  // The first finding's code, or the reason.
  std::string model;
  double seconds = 0;
};

struct Subset {
  size_t set = 0;
  size_t fixed = 0;
  Spoiling spoiling = Spoiling::kNone;
  Dataset data;
  int num_captures = 0;
  bool opencv_answers = false;
};

RecordedSet ReadSet(const fs::path& config_file) {
  RecordedSet set;
  set.name = config_file.stem();
  const fs::path folder = fs::canonical(DataDir() / set.name);
  // A copy of the config whose paths are relative to the data.
  std::ifstream in(config_file);
  std::string text{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  for (const std::string key : {"images: ", "poses: "}) {
    for (size_t at = text.find(key); at != std::string::npos; at = text.find(key, at + 1)) {
      text.insert(at + key.size(), folder.string() + "/");
    }
  }
  const fs::path copy = fs::temp_directory_path() / ("heba_soak_" + std::to_string(getpid()) + ".yaml");
  std::ofstream(copy) << text;
  const RunConfig config = ReadShortRunConfig(copy);
  fs::remove(copy);
  set.data = config.data;
  set.options = config.options;
  set.data.given_detections = DetectDataset(set.data, CachedDetections(set.data, config.targets_used), 2, nullptr);
  for (TargetDetection& seen : set.data.given_detections) {
    seen.detection.small_jpeg.clear();
    seen.detection.image_digest.clear();
    if (!seen.detection.detection.ids.empty()) set.seen.push_back(seen.capture);
  }
  return set;
}

Answer AnswerOf(const Dataset& data, const RunOptions& options) {
  Answer answer;
  try {
    const Outcome<RunOutput> output = Run(data, options);
    if (!output) {
      answer.end = Answer::End::kRefused;
      answer.text = output.reason();
      return answer;
    }
    answer.end = Answer::End::kDone;
    const RunResult& result = output->result;
    answer.grade = result.verdict.grade;
    if (!result.verdict.findings.empty()) {
      for (const Finding& finding : result.verdict.findings) {
        if (finding.grade == Grade::kGood) break;
        answer.text += (answer.text.empty() ? "" : "+") + finding.code;
      }
    }
    const Estimate& refined = *FindRefined(result);
    answer.hand_eye = refined.hand_eye;
    answer.covariance = PoseCovarianceOf(refined.solution->covariance, kHandEyeBlock).value_or(Matrix6d::Zero());
    answer.dof = refined.solution->covariance_dof;
    answer.model = result.model.camera + "/" + result.model.robot_noise + "/" + Join(result.model.target_shape, "-") +
                   (refined.solution->smooth_noise ? "/smooth" : "");
  } catch (const InputError& error) {
    answer.end = Answer::End::kInputError;
    answer.text = error.what();
  }
  return answer;
}

std::string Packed(const Answer& answer) {
  std::ostringstream out;
  out.precision(17);
  out << static_cast<int>(answer.end) << ' ' << static_cast<int>(answer.grade) << ' ' << answer.dof << ' ';
  for (const Rigid3d& pose : {answer.hand_eye.camera_mount_from_camera, answer.hand_eye.target_mount_from_target}) {
    out << pose.rotation.coeffs().transpose() << ' ' << pose.translation.transpose() << ' ';
  }
  for (Eigen::Index i = 0; i < 36; ++i) out << answer.covariance(i) << ' ';
  out << (answer.model.empty() ? "-" : answer.model) << ' ' << answer.text;
  return out.str();
}

Answer Unpacked(const std::string& text) {
  Answer answer;
  std::istringstream in(text);
  int end = 0;
  int grade = 0;
  std::string dof;
  const auto number = [&] {
    std::string word;
    in >> word;
    return std::strtod(word.c_str(), nullptr);
  };
  in >> end >> grade;
  answer.dof = number();
  for (Rigid3d* pose : {&answer.hand_eye.camera_mount_from_camera, &answer.hand_eye.target_mount_from_target}) {
    for (Eigen::Index i = 0; i < 4; ++i) pose->rotation.coeffs()[i] = number();
    for (Eigen::Index i = 0; i < 3; ++i) pose->translation[i] = number();
  }
  for (Eigen::Index i = 0; i < 36; ++i) answer.covariance(i) = number();
  in >> answer.model;
  std::getline(in, answer.text);
  answer.end = static_cast<Answer::End>(end);
  answer.grade = static_cast<Grade>(grade);
  return answer;
}

// A run in a process of its own.
struct Child {
  pid_t pid = 0;
  int pipe = 0;
  std::string received;
  std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now();
};

Child Start(const Dataset& data, const RunOptions& options) {
  std::array<int, 2> ends{};
  CHECK_EQ(pipe(ends.data()), 0);
  Child child;
  std::cout.flush();
  child.pid = fork();
  CHECK_GE(child.pid, 0);
  if (child.pid == 0) {
    close(ends[0]);
    const rlimit limit{kLimitCpuSeconds, kLimitCpuSeconds + 5};
    if (setrlimit(RLIMIT_CPU, &limit) != 0) _exit(3);
    if (std::freopen("/dev/null", "w", stderr) == nullptr) _exit(3);
    const std::string text = Packed(AnswerOf(data, options));
    size_t written = 0;
    while (written < text.size()) {
      const ssize_t count = write(ends[1], text.data() + written, text.size() - written);
      if (count <= 0) _exit(3);
      written += static_cast<size_t>(count);
    }
    _exit(0);
  }
  close(ends[1]);
  child.pipe = ends[0];
  return child;
}

// Reads what a child has written. Returns its answer when it has ended or has taken too long.
std::optional<Answer> Poll(Child* child) {
  std::array<char, 4096> buffer{};
  pollfd waiting{child->pipe, POLLIN, 0};
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - child->start).count();
  if (poll(&waiting, 1, 20) > 0) {
    const ssize_t count = read(child->pipe, buffer.data(), buffer.size());
    if (count > 0) {
      child->received.append(buffer.data(), static_cast<size_t>(count));
      return std::nullopt;
    }
  } else if (seconds < kLimitSeconds) {
    return std::nullopt;
  } else {
    kill(child->pid, SIGKILL);
  }
  close(child->pipe);
  int status = 0;
  waitpid(child->pid, &status, 0);
  Answer answer;
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) {
    answer = Unpacked(child->received);
  } else {
    const bool has_taken_too_long = seconds >= kLimitSeconds || (WIFSIGNALED(status) && WTERMSIG(status) == SIGXCPU);
    answer.end = has_taken_too_long ? Answer::End::kTimeout : Answer::End::kSignal;
    answer.text = "signal " + std::to_string(WIFSIGNALED(status) ? WTERMSIG(status) : 0);
  }
  answer.seconds = seconds;
  return answer;
}

// Runs all data sets, a few at a time.
std::vector<Answer> AnswersOf(const std::vector<std::pair<const Dataset*, RunOptions>>& runs,
                              const std::function<void(size_t, const Answer&)>& on_answer) {
  std::vector<Answer> answers(runs.size());
  std::map<size_t, Child> children;
  size_t next = 0;
  while (next < runs.size() || !children.empty()) {
    while (next < runs.size() && children.size() < static_cast<size_t>(FLAGS_jobs)) {
      if (runs[next].first == nullptr) {  // A set of which no subset is run.
        ++next;
        continue;
      }
      children.emplace(next, Start(*runs[next].first, runs[next].second));
      ++next;
    }
    for (auto it = children.begin(); it != children.end();) {
      std::optional<Answer> answer = Poll(&it->second);
      if (!answer) {
        ++it;
        continue;
      }
      answers[it->first] = std::move(*answer);
      on_answer(it->first, answers[it->first]);
      it = children.erase(it);
    }
  }
  return answers;
}

// Gives a data set a camera that is taken as it is given.
void Hold(const Camera& camera, Dataset* data) {
  data->has_camera = {true};
  data->rig.cameras[0].camera = camera;
  data->rig.cameras[0].free_intrinsics = {};
}

RunOptions OptionsOf(const RecordedSet& set, const Fixed& fixed) {
  RunOptions options = set.options;
  CalibrationOptions& calibration = options.calibration;
  if (fixed.shape) calibration.choose_target_shape = false;
  if (FLAGS_robot_noise == "white") calibration.smooth = SmoothPoseErrors::kNone;
  if (FLAGS_robot_noise == "smooth") {
    calibration.adjustment.robot = BundleOptions::Robot::kEstimatedNoise;
    calibration.smooth = SmoothPoseErrors::kAlways;
  }
  return options;
}

// Returns whether cv::calibrateCamera and the hand-eye method of Park and Martin give a finite pose.
bool OpenCvAnswers(const Dataset& data) {
  std::vector<std::vector<cv::Point3f>> points;
  std::vector<std::vector<cv::Point2f>> pixels;
  std::vector<cv::Mat> rotations;
  std::vector<cv::Mat> translations;
  for (size_t i = 0; i < data.captures.size(); ++i) {
    const Observations seen = ObservationsOf(*data.targets[0], data.given_detections[i].detection.detection);
    if (seen.size() < 6) continue;
    std::vector<cv::Point3f>& of_points = points.emplace_back();
    std::vector<cv::Point2f>& of_pixels = pixels.emplace_back();
    for (Eigen::Index k = 0; k < seen.size(); ++k) {
      of_points.emplace_back(static_cast<float>(seen.points_in_target(0, k)),
                             static_cast<float>(seen.points_in_target(1, k)), 0.0F);
      of_pixels.emplace_back(static_cast<float>(seen.pixels(0, k)), static_cast<float>(seen.pixels(1, k)));
    }
    const Rigid3d reported = data.captures[i].base_from_gripper[0];
    const Rigid3d mount = SetupOf(data) == Setup::kEyeInHand ? reported : Inverse(reported);
    const Eigen::Matrix3d rotation = mount.RotationMatrix();
    cv::Mat r(3, 3, CV_64F);
    cv::Mat t(3, 1, CV_64F);
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) r.at<double>(a, b) = rotation(a, b);
      t.at<double>(a) = mount.translation[a];
    }
    rotations.push_back(r);
    translations.push_back(t);
  }
  if (points.size() < 3) return false;
  try {
    cv::Mat camera;
    cv::Mat distortion;
    std::vector<cv::Mat> rvecs;
    std::vector<cv::Mat> tvecs;
    const CaptureDetection& first = data.given_detections.front().detection;
    cv::calibrateCamera(points, pixels, {first.width_px, first.height_px}, camera, distortion, rvecs, tvecs);
    cv::Mat r;
    cv::Mat t;
    cv::calibrateHandEye(rotations, translations, rvecs, tvecs, r, t, cv::CALIB_HAND_EYE_PARK);
    return cv::checkRange(r) && cv::checkRange(t) && !t.empty();
  } catch (const cv::Exception&) {
    return false;
  }
}

void Shuffle(Rng& random, std::vector<size_t>* values) {
  for (size_t i = values->size(); i > 1; --i) {
    std::swap((*values)[i - 1], (*values)[static_cast<size_t>(random.Index(static_cast<int>(i)))]);
  }
}

void Spoil(const RecordedSet& set, const std::vector<size_t>& captures, Spoiling spoiling, Rng& random, Dataset* data) {
  std::vector<size_t> order(captures.size());
  std::iota(order.begin(), order.end(), size_t{0});
  Shuffle(random, &order);
  if (spoiling == Spoiling::kSwapped) {
    std::swap(data->captures[order[0]].base_from_gripper, data->captures[order[1]].base_from_gripper);
  } else if (spoiling == Spoiling::kOtherImage) {
    // The image of a capture that is not part of the subset, if there is one.
    std::vector<size_t> others;
    for (const size_t i : set.seen) {
      if (std::find(captures.begin(), captures.end(), i) == captures.end()) others.push_back(i);
    }
    Shuffle(random, &others);
    data->given_detections[order[0]].detection = others.empty() ? data->given_detections[order[1]].detection
                                                                : set.data.given_detections[others.front()].detection;
  } else if (spoiling == Spoiling::kTurned) {
    const Eigen::Vector3d axis = random.NormalVector3().normalized();
    Rigid3d& pose = data->captures[order[0]].base_from_gripper[0];
    pose = pose * Rigid3d(ExpRotation(DegToRad(3.0) * axis), Eigen::Vector3d::Zero());
  }
}

Subset Draw(const std::vector<RecordedSet>& sets, size_t which, Rng& random) {
  Subset subset;
  subset.set = which;
  const RecordedSet& set = sets[which];
  const int most = std::min(FLAGS_most_captures, static_cast<int>(set.seen.size()));
  const int least = std::min(kFewestCaptures, most);
  subset.num_captures = least + random.Index(most - least + 1);
  std::vector<size_t> captures = set.seen;
  Shuffle(random, &captures);
  captures.resize(static_cast<size_t>(subset.num_captures));
  std::sort(captures.begin(), captures.end());
  subset.fixed = static_cast<size_t>(random.Index(static_cast<int>(kFixed.size())));
  subset.data = PartOf(set.data, captures);
  if (FLAGS_spoil) {
    subset.spoiling = static_cast<Spoiling>(1 + random.Index(3));
    Spoil(set, captures, subset.spoiling, random, &subset.data);
  }
  return subset;
}

// Returns the probability of so large a difference between the poses of a part and of the whole, if both are right.
double PValueOfDifference(const Answer& part, const Answer& whole, double share) {
  const Tangent6 difference =
      LocalCoordinates(whole.hand_eye.camera_mount_from_camera, part.hand_eye.camera_mount_from_camera);
  const auto root = Cholesky(part.covariance);
  if (!root) return 0;
  // The part's errors are those of the whole and others that are independent of them: the covariance of the difference
  // is the difference of the covariances, at least that of equally informative captures.
  const Matrix6d whitened = root->SolveLower(root->SolveLower(part.covariance - whole.covariance).transpose());
  const SymmetricEigen<6> eigen = EigenOfSymmetric(0.5 * (whitened + whitened.transpose()));
  const Eigen::Matrix<double, 6, 1> coordinates = eigen.vectors.transpose() * root->SolveLower(difference);
  double chi2 = 0;
  for (Eigen::Index i = 0; i < 6; ++i) {
    chi2 += coordinates[i] * coordinates[i] / std::max(eigen.values[i], std::max(1e-3, 1 - share));
  }
  return FisherTail(chi2 / 6, 6, part.dof);
}

// Returns the largest ratio of the sigmas of a part to those of the whole, times the root of its share.
double SigmaRatio(const Answer& part, const Answer& whole, double share) {
  double largest = 0;
  for (const Eigen::Index first : {0, 3}) {
    const double of_part = std::sqrt(part.covariance.block<3, 3>(first, first).trace());
    const double of_whole = std::sqrt(whole.covariance.block<3, 3>(first, first).trace());
    largest = std::max(largest, of_part / of_whole * std::sqrt(share));
  }
  return largest;
}

// The counts of one set, or of all.
struct Counts {
  int subsets = 0;
  int crashes = 0;
  int eligible = 0;
  int answered = 0;
  int well_given = 0;
  int bad = 0;
  int good = 0;
  int compared = 0;
  int inside = 0;
  int wide = 0;
  int spoiled = 0;
  int good_and_outside = 0;
  double seconds = 0;

  void Add(const Counts& other) {
    subsets += other.subsets;
    crashes += other.crashes;
    eligible += other.eligible;
    answered += other.answered;
    well_given += other.well_given;
    bad += other.bad;
    good += other.good;
    compared += other.compared;
    inside += other.inside;
    wide += other.wide;
    spoiled += other.spoiled;
    good_and_outside += other.good_and_outside;
    seconds += other.seconds;
  }
};

void PrintRow(const std::string& name, const Counts& c) {
  std::printf("%-36s %7d %7d %5d/%-5d %4d/%-4d %5d %5d/%-5d %5d %5d/%-5d %6.1f\n", name.c_str(), c.subsets, c.crashes,
              c.answered, c.eligible, c.bad, c.well_given, c.good, c.inside, c.compared, c.wide, c.good_and_outside,
              c.spoiled, c.subsets > 0 ? c.seconds / c.subsets : 0);
}

bool Hold(const Counts& c, double least_answered) {
  const auto share = [](int part, int of) { return of == 0 ? 1.0 : static_cast<double>(part) / of; };
  return c.crashes == 0 && share(c.answered, c.eligible) >= least_answered;
}

int Soak() {
  std::vector<RecordedSet> sets;
  std::set<std::string> wanted;
  for (const std::string& name : Split(FLAGS_sets, ',')) {
    if (!name.empty()) wanted.insert(name);
  }
  std::vector<fs::path> configs;
  for (const fs::directory_entry& entry : fs::directory_iterator(fs::path(HEBA_SOURCE_DIR) / "tests/soak/sets")) {
    const std::string name = entry.path().stem();
    if ((wanted.empty() || wanted.contains(name)) && fs::exists(DataDir() / name)) configs.push_back(entry.path());
  }
  std::sort(configs.begin(), configs.end());
  if (configs.empty()) {
    std::cout << "skipped: no recorded data in " << DataDir() << " (set HEBA_DATA_DIR to use it)\n";
    return kSkipped;
  }
  for (const fs::path& config : configs) sets.push_back(ReadSet(config));

  std::vector<size_t> chosen(static_cast<size_t>(FLAGS_subsets));
  std::iota(chosen.begin(), chosen.end(), size_t{0});
  if (!FLAGS_only.empty()) {
    chosen.clear();
    for (const std::string& number : Split(FLAGS_only, ',')) chosen.push_back(std::stoul(number));
  }
  // Subsets take turns among the sets.
  std::vector<bool> is_needed(sets.size(), false);
  for (const size_t i : chosen) is_needed[i % sets.size()] = true;

  // The whole sets. The lens that parts hold is the one that the whole set determines.
  std::vector<std::pair<const Dataset*, RunOptions>> whole_runs;
  std::vector<Dataset> held(sets.size());
  for (size_t s = 0; s < sets.size(); ++s) {
    held[s] = sets[s].data;
    if (!FLAGS_statistics) continue;
    if (!is_needed[s]) {
      whole_runs.resize(whole_runs.size() + kFixed.size());
      continue;
    }
    const Outcome<RunOutput> output = Run(sets[s].data, sets[s].options);
    if (output) {
      Camera& camera = sets[s].data.rig.cameras[0].camera;
      sets[s].data.has_camera = {false};
      camera = {camera.model, 0, 0, {}};
      Hold(FindRefined(output->result)->camera, &held[s]);
      std::printf("%-36s %s, %s\n", sets[s].name.c_str(), std::string(GradeName(output->result.verdict.grade)).c_str(),
                  output->result.model.camera.c_str());
    } else {
      std::printf("%-36s %s\n", sets[s].name.c_str(), output.reason().c_str());
    }
    for (size_t f = 0; f < kFixed.size(); ++f) {
      const bool is_held = kFixed[f].lens && held[s].has_camera[0];
      whole_runs.emplace_back(is_held ? &held[s] : &sets[s].data, OptionsOf(sets[s], kFixed[f]));
    }
  }
  const std::vector<Answer> whole = AnswersOf(whole_runs, [](size_t, const Answer&) {});

  Rng random(static_cast<uint64_t>(FLAGS_seed));
  std::vector<Subset> subsets;
  for (int i = 0; i < FLAGS_subsets; ++i) {
    subsets.push_back(Draw(sets, static_cast<size_t>(i) % sets.size(), random));
    Subset& subset = subsets.back();
    subset.opencv_answers = subset.spoiling == Spoiling::kNone && OpenCvAnswers(subset.data);
    if (!kFixed[subset.fixed].lens) continue;
    const Dataset& of_set = held[subset.set];
    if (of_set.has_camera[0]) {
      Hold(of_set.rig.cameras[0].camera, &subset.data);
    } else {
      subset.fixed = kFixed[subset.fixed].shape ? 2 : 0;
    }
  }
  std::vector<std::pair<const Dataset*, RunOptions>> runs;
  for (const size_t i : chosen) {
    runs.emplace_back(&subsets.at(i).data, OptionsOf(sets[subsets[i].set], kFixed[subsets[i].fixed]));
  }
  const Answer unknown;
  std::vector<Counts> of_set(sets.size());
  AnswersOf(runs, [&](size_t k, const Answer& answer) {
    const size_t i = chosen[k];
    const Subset& subset = subsets[i];
    const Answer& all = whole.empty() ? unknown : whole[subset.set * kFixed.size() + subset.fixed];
    Counts& counts = of_set[subset.set];
    ++counts.subsets;
    counts.seconds += answer.seconds;
    const bool is_done = answer.end == Answer::End::kDone;
    const bool is_crash = answer.end == Answer::End::kSignal || answer.end == Answer::End::kTimeout;
    counts.crashes += is_crash ? 1 : 0;
    const bool is_eligible = subset.opencv_answers && subset.num_captures >= kEligibleCaptures;
    counts.eligible += is_eligible ? 1 : 0;
    counts.answered += is_eligible && is_done ? 1 : 0;
    const bool is_well_given = is_eligible && subset.num_captures >= kWellGivenCaptures;
    counts.well_given += is_well_given ? 1 : 0;
    counts.bad += is_well_given && is_done && answer.grade == Grade::kBad ? 1 : 0;
    counts.good += is_done && answer.grade == Grade::kGood ? 1 : 0;
    double p = 1;
    double ratio = 1;
    if (is_done && all.end == Answer::End::kDone) {
      const double share = static_cast<double>(subset.num_captures) / static_cast<double>(sets[subset.set].seen.size());
      p = PValueOfDifference(answer, all, share);
      ratio = SigmaRatio(answer, all, share);
      if (subset.spoiling != Spoiling::kNone) {
        ++counts.spoiled;
        counts.good_and_outside += answer.grade == Grade::kGood && p < kInsideLevel ? 1 : 0;
      } else if (is_well_given) {
        ++counts.compared;
        counts.inside += p >= kInsideLevel ? 1 : 0;
        counts.wide += ratio > 2 ? 1 : 0;
      }
    }
    if (!FLAGS_list) return;
    constexpr std::array<const char*, 5> kEnds = {"done", "REFUSED", "INPUT", "SIGNAL", "TIMEOUT"};
    const Rigid3d difference =
        Inverse(all.hand_eye.camera_mount_from_camera) * answer.hand_eye.camera_mount_from_camera;
    std::printf(
        "%4zu %-32s %2d %-10s %-21s %-7s %-8s p %.1e ratio %4.2f off %.2f mm %.3f deg sigma %.2f mm %.3f deg"
        " %4.1f s %s %s\n",
        i, sets[subset.set].name.c_str(), subset.num_captures, kFixedNames[subset.fixed],
        kSpoilingNames[static_cast<size_t>(subset.spoiling)], kEnds[static_cast<size_t>(answer.end)],
        is_done ? std::string(GradeName(answer.grade)).c_str() : "-", p, ratio,
        is_done ? 1000 * difference.translation.norm() : 0.0,
        is_done ? RadToDeg(RotationAngle(difference.rotation)) : 0.0,
        1000 * std::sqrt(answer.covariance.block<3, 3>(0, 0).trace()),
        RadToDeg(std::sqrt(answer.covariance.block<3, 3>(3, 3).trace())), answer.seconds, answer.model.c_str(),
        answer.text.c_str());
    std::fflush(stdout);
  });

  std::printf("%-36s %7s %7s %11s %9s %5s %11s %5s %11s %6s\n", "set", "subsets", "crashes", "answered", "bad", "good",
              "inside", "wide", "good,out", "s");
  Counts all;
  bool holds = true;
  for (size_t s = 0; s < sets.size(); ++s) {
    PrintRow(sets[s].name, of_set[s]);
    all.Add(of_set[s]);
    holds = holds && Hold(of_set[s], kLeastAnsweredOfSet);
  }
  PrintRow("all", all);
  holds = holds && Hold(all, kLeastAnswered);
  holds = holds &&
          (!FLAGS_statistics || (all.bad <= kMostBad * all.well_given && all.inside >= kLeastInside * all.compared &&
                                 all.good_and_outside <= kMostGoodAndOutside * all.spoiled));
  std::printf("%s\n", holds ? "all limits hold" : "a limit does not hold");
  return holds ? 0 : 1;
}

}  // namespace
}  // namespace heba

int main(int argc, char** argv) {
  heba::KeepFreedMemory();
  google::InitGoogleLogging(argv[0]);
  gflags::ParseCommandLineFlags(&argc, &argv, true);
  return heba::Soak();
}
