// Checks whether the images show the target that the config names: compares how much of it is detected with how much
// is detected of targets that it is often confused with.
#include <algorithm>

#include "heba/base/even_indices.h"
#include "heba/base/median.h"
#include "heba/base/parallel.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/config/yaml_reader.h"
#include "heba/recognition.h"
#include "heba/target.h"
#include "targets/images/image.h"
#include "targets/render/target_text.h"
#include "tools/doctor/examination.h"
#include "tools/doctor/symptom.h"

namespace heba {
namespace {

struct OtherTarget {
  TargetSettings settings;
  std::shared_ptr<const Target> target;
  std::string used;  // The settings as used, as YAML.
  size_t num_points = 0;
};

// Returns the config's target with other settings; nothing if they are invalid.
std::optional<OtherTarget> WithSettings(const RunConfig& config, const TargetSettings& settings) {
  try {
    YAML::Node node = YAML::Load(config.targets_used.front());
    for (const auto& [key, value] : settings) node[key] = value;
    MapReader reader(ConfigValue(node, config.file, "target"));
    OtherTarget other;
    other.settings = settings;
    other.target = CreateTarget(reader);
    other.used = YAML::Dump(reader.used());
    return other;
  } catch (const InputError&) {
    return std::nullopt;
  }
}

std::string TargetSettingsText(const TargetSettings& settings) {
  std::vector<ConfigSetting> in_target;
  for (const auto& [key, value] : settings) in_target.push_back({key, value});
  return SettingsText(in_target);
}

// Returns the settings that make the config name the other target: its keys that differ, or the whole target if the
// config itself does not hold the keys.
std::vector<ConfigSetting> InConfig(const RunConfig& config, const OtherTarget& other) {
  if (!config.has_target_keys.front()) return {{"target", TargetConfigLine(YAML::Load(other.used))}};
  std::vector<ConfigSetting> in_config;
  for (const auto& [key, value] : other.settings) in_config.push_back({"target." + key, value});
  return in_config;
}

// Returns the data set with `num_images` evenly spaced captures only.
RunConfig Sample(const RunConfig& config, size_t num_images) {
  RunConfig sample = config;
  sample.data.captures.clear();
  for (const size_t i : EvenIndices(config.data.captures.size(), num_images)) {
    sample.data.captures.push_back(config.data.captures[i]);
  }
  return sample;
}

size_t NumPoints(const std::vector<TargetDetection>& detections) {
  size_t num_points = 0;
  for (const TargetDetection& seen : detections) num_points += seen.detection.detection.ids.size();
  return num_points;
}

bool HasAnyCode(const Target& target, const std::vector<std::string>& codes) {
  const std::vector<std::string> own = target.Codes();
  return std::any_of(own.begin(), own.end(), [&](const std::string& code) {
    return std::find(codes.begin(), codes.end(), code) != codes.end();
  });
}

// Returns the targets that this one may have been confused with, those that more of the images indicate first, without
// those that have one of `other_codes`.
std::vector<OtherTarget> OtherTargets(const RunConfig& config, const std::vector<std::string>& other_codes) {
  std::vector<std::pair<int, TargetSettings>> counted;
  for (const Recording& capture : config.data.captures) {
    for (const TargetSettings& settings :
         config.data.targets.front()->LikelyMisconfigurations(ReadGreyImage(capture.images.front()))) {
      const auto known =
          std::find_if(counted.begin(), counted.end(), [&](const auto& entry) { return entry.second == settings; });
      if (known == counted.end()) {
        counted.emplace_back(1, settings);
      } else {
        ++known->first;
      }
    }
  }
  std::stable_sort(counted.begin(), counted.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<OtherTarget> others;
  for (const auto& [count, settings] : counted) {
    std::optional<OtherTarget> other = WithSettings(config, settings);
    if (other && !HasAnyCode(*other->target, other_codes)) others.push_back(std::move(*other));
  }
  return others;
}

// Returns whether another target explains the sample's images decidedly better: with more points, or with hardly any
// that are missing.
bool IsDecidedlyBetter(const RunConfig& sample, const OtherTarget& other, size_t num_now) {
  constexpr double kDecidedly = 1.15;
  const auto num_points = static_cast<double>(other.num_points);
  const auto now = static_cast<double>(num_now);
  if (num_points > kDecidedly * now + kMinPosePoints) return true;
  constexpr double kHardlyAny = 0.02;
  constexpr double kMany = 0.08;
  const auto num_images = static_cast<double>(sample.data.captures.size());
  const double missing = 1 - num_points / (num_images * static_cast<double>(other.target->points().size()));
  const double missing_now = 1 - now / (num_images * static_cast<double>(sample.data.targets.front()->points().size()));
  return num_points > now && missing < kHardlyAny && missing_now > kMany;
}

// Returns, among the targets that this one may be confused with, the one with the most points in the sample's images;
// nothing if these are not decidedly more than `num_now` points.
std::optional<OtherTarget> FindOther(const RunConfig& sample, const std::vector<std::string>& other_codes,
                                     size_t num_now, int num_threads) {
  std::vector<OtherTarget> others = OtherTargets(sample, other_codes);
  for (size_t i = 0; i < sample.data.captures.size() && !others.empty(); ++i) {
    ParallelFor(static_cast<int>(others.size()), num_threads, [&](int k) {
      OtherTarget& other = others[static_cast<size_t>(k)];
      other.num_points += DetectCapture(*other.target, sample.data.captures[i].images.front()).detection.ids.size();
    });
    // Most candidates do not fit: once one is detected, those that are not are dropped.
    std::vector<OtherTarget> seen;
    for (const OtherTarget& other : others) {
      if (other.num_points > 0) seen.push_back(other);
    }
    if (!seen.empty()) others = std::move(seen);
  }
  // The images show the target of which fewer points are missing if several have about as many points.
  const auto score = [&](const OtherTarget& other) {
    constexpr double kOfMissing = 0.1;
    const auto num_points = static_cast<double>(other.num_points);
    const double num_all = static_cast<double>(sample.data.captures.size() * other.target->points().size());
    return num_points - kOfMissing * (num_all - num_points);
  };
  const auto best = std::max_element(others.begin(), others.end(),
                                     [&](const OtherTarget& a, const OtherTarget& b) { return score(a) < score(b); });
  if (best == others.end() || !IsDecidedlyBetter(sample, *best, num_now)) return std::nullopt;
  return *best;
}

// Returns the target that the sample's images show, if it is none of those that this one is often confused with.
// Images do not tell its size, which is taken to be that of the config's target.
std::optional<OtherTarget> Recognise(const RunConfig& sample, const std::vector<std::string>& other_codes,
                                     size_t num_now, int num_threads) {
  std::vector<cv::Mat> images;
  for (const Recording& capture : sample.data.captures) images.push_back(ReadGreyImage(capture.images.front()));
  const YAML::Node now = YAML::Load(sample.targets_used.front());
  double size_m = 0;
  for (const char* const key : {"square", "spacing", "tag_size"}) {
    if (!now[key]) continue;
    const ParsedQuantity length = ParseQuantity(now[key].Scalar(), Quantity::kLength);
    if (length.fault.empty()) size_m = length.value;
  }
  for (const RecognisedTarget& recognised : RecogniseTargets(images, num_threads)) {
    // The corners of a ChArUco board whose markers cannot be read are those of a chessboard.
    const Target& now_target = *sample.data.targets.front();
    const bool is_without_codes = now_target.Codes().size() > 1 && recognised.target->Codes().size() == 1 &&
                                  now_target.points().size() == recognised.target->points().size();
    if (is_without_codes) continue;
    const YAML::Node node = YAML::Load(RecognisedTargetText(recognised, size_m > 0 ? size_m : 1));
    MapReader reader(ConfigValue(node, sample.file, "target"));
    OtherTarget other;
    other.target = CreateTarget(reader);
    if (HasAnyCode(*other.target, other_codes)) continue;
    other.used = YAML::Dump(reader.used());
    other.num_points = recognised.num_points;
    // A target of the config's type is named by the keys that differ.
    const bool is_alike = now["type"].Scalar() == recognised.target->type();
    for (const auto& entry : node) {
      const std::string key = entry.first.Scalar();
      const bool is_size = key == recognised.size_key;
      if (is_alike && (is_size || (now[key] && now[key].Scalar() == entry.second.Scalar()))) continue;
      other.settings.emplace_back(key, entry.second.Scalar());
    }
    if (!other.settings.empty() && IsDecidedlyBetter(sample, other, num_now)) return other;
  }
  return std::nullopt;
}

// Returns the median share of the target's points over the images that show it.
double MiddleShare(const RunConfig& config, const std::vector<TargetDetection>& detections) {
  std::vector<double> shares;
  for (const TargetDetection& seen : detections) {
    const size_t num_points = seen.detection.detection.ids.size();
    if (num_points < kMinPosePoints) continue;
    shares.push_back(static_cast<double>(num_points) /
                     static_cast<double>(config.data.targets.front()->points().size()));
  }
  return shares.empty() ? 0 : Median(shares);
}

constexpr double kMostImages = 0.7;
constexpr double kLeastShare = 0.6;

// Returns whether the images show enough of the target for it to be the right one.
bool IsSeenWell(const RunConfig& config, const std::vector<TargetDetection>& detections) {
  // A smaller share is a reason to search, not a fault: the target may well be half outside the image.
  constexpr double kMostOfIt = 0.9;
  return static_cast<double>(NumSeen(detections)) >= kMostImages * static_cast<double>(detections.size()) &&
         MiddleShare(config, detections) >= kMostOfIt;
}

std::string SeenText(const RunConfig& config, const std::vector<TargetDetection>& detections) {
  const size_t num_seen = NumSeen(detections);
  return "in " + std::to_string(num_seen) + " of " + std::to_string(detections.size()) + " images" +
         (num_seen == 0
              ? ""
              : " (" + Fixed(100 * MiddleShare(config, detections), 0) + " % of its points in the median image)");
}

// Another target than the config's, with its detections in all images.
struct TargetInImages {
  OtherTarget target;
  std::vector<TargetDetection> detections;
};

RunConfig WithTarget(RunConfig config, const OtherTarget& other) {
  config.data.targets = {other.target};
  config.targets_used = {other.used};
  return config;
}

// Returns the target that the images show instead of the config's; nothing if `sample`, a part of them, does not tell
// it.
std::optional<TargetInImages> FindShownTarget(const Examination& examination, const RunConfig& sample) {
  const std::vector<std::string>& other_codes = examination.rig.other_codes;
  // Both targets are compared in the same images: the few may not show the target at all.
  const size_t num_now = NumPoints(Detections(sample, examination.num_threads, Verbosity::kQuiet));
  std::optional<OtherTarget> other = FindOther(sample, other_codes, num_now, examination.num_threads);
  if (!other) other = Recognise(sample, other_codes, num_now, examination.num_threads);
  if (!other) return std::nullopt;
  const RunConfig config = WithTarget(examination.config, *other);
  std::vector<TargetDetection> detections = Detections(config, examination.num_threads, examination.verbosity);
  // A target of which most is not there is another one again.
  if (MiddleShare(config, detections) < kLeastShare) return std::nullopt;
  return TargetInImages{std::move(*other), std::move(detections)};
}

// Reports that the images show another target. `config` and `detections` are those with it; `seen` says how well that
// of the config is detected.
Symptom OtherTargetSymptom(const RunConfig& config, const std::vector<TargetDetection>& detections,
                           const OtherTarget& other, const std::string& seen) {
  const std::string settings = TargetSettingsText(other.settings);
  return {Severity::kWrong, "target",
          "the images show another target than the config names: that one is detected " + seen + "; with " + settings +
              " it is detected " + SeenText(config, detections),
          "set in the target: " + settings, InConfig(config, other)};
}

// Returns why the first of the images without a pose has none, in parentheses; empty if no reason is known.
std::string ReasonText(const RunConfig& config, const std::vector<TargetDetection>& detections) {
  for (const TargetDetection& seen : detections) {
    const Detection& detection = seen.detection.detection;
    if (detection.ids.size() >= kMinPosePoints || detection.reason.empty()) continue;
    return " (" + config.data.captures[seen.capture].name + ": " + detection.reason + ")";
  }
  return "";
}

// Reports that the config's target, which is the right one as far as is known, is detected in too few images. `seen`
// says how well it is detected.
std::vector<Symptom> SeldomSeen(const RunConfig& config, const std::vector<TargetDetection>& detections,
                                const std::string& seen) {
  const std::string why = ReasonText(config, detections);
  const size_t num_seen = NumSeen(detections);
  const double share = static_cast<double>(num_seen) / static_cast<double>(detections.size());
  constexpr double kHardly = 0.3;
  if (share < kHardly || num_seen < 3) {
    return {{Severity::kWrong, "target_not_seen", "the target is detected " + seen + why,
             std::string(num_seen == 0 ? "look at the images" : "look at the images that 'heba detect' writes") +
                 ": the target must be complete, sharp and lit, and of the type that the config names"}};
  }
  if (share >= kMostImages) return {};
  return {{Severity::kRemark, "target_often_missed", "the target is detected only " + seen + why,
           "look at the images without points that 'heba detect' writes: are they sharp and lit, and is the target in "
           "view?"}};
}

}  // namespace

Checked Check_target(const Examination& examination) {
  const RunConfig& config = examination.config;
  const auto detect_all = [&] { return Detections(config, examination.num_threads, examination.verbosity); };
  if (!config.data.given_detections.empty()) {
    return {.detections = detect_all()};
  }
  // A few images come first, because searching all of them for the wrong target may take long.
  constexpr size_t kFew = 2;
  constexpr size_t kSome = 4;
  constexpr size_t kMore = 12;  // One of several targets may be in few of the images.
  const RunConfig sample = Sample(config, examination.rig.other_codes.empty() ? kSome : kMore);
  const std::vector<TargetDetection> few = Detections(Sample(config, kFew), examination.num_threads, Verbosity::kQuiet);
  const bool is_in_none = NumSeen(few) == 0;
  std::string seen = SeenText(config, few) + " that were searched";
  const bool may_be_another = !examination.rig.is_target_known;
  std::optional<TargetInImages> shown;
  std::vector<TargetDetection> detections;
  if (is_in_none && may_be_another) shown = FindShownTarget(examination, sample);
  if (!shown) {
    detections = detect_all();
    if (IsSeenWell(config, detections)) return {.detections = std::move(detections)};
    seen = SeenText(config, detections);
    if (!is_in_none && may_be_another) shown = FindShownTarget(examination, sample);
  }
  if (!shown) return {.symptoms = SeldomSeen(config, detections, seen), .detections = detections};
  RunConfig other = WithTarget(config, shown->target);
  const Symptom symptom = OtherTargetSymptom(other, shown->detections, shown->target, seen);
  return {.symptoms = {symptom}, .config = std::move(other), .detections = std::move(shown->detections)};
}

}  // namespace heba
