#include "heba/recognition.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <set>
#include <string_view>

#include <opencv2/imgproc.hpp>

#include "heba/base/error.h"
#include "heba/base/even_indices.h"
#include "heba/base/parallel.h"
#include "heba/base/text.h"

namespace heba {

#define HEBA_TARGET(type, description) std::vector<TargetSettings> ProposeTargets_##type(const cv::Mat& grey);
#include "targets/targets.def"
#undef HEBA_TARGET

namespace {

struct Proposer {
  const char* type;
  std::vector<TargetSettings> (*propose)(const cv::Mat& grey);
};
constexpr Proposer kProposers[] = {
#define HEBA_TARGET(type, description) {#type, &ProposeTargets_##type},
#include "targets/targets.def"
#undef HEBA_TARGET
};

// The types that are searched for last, in this order: the rings of coded dots take the longest among other things, and
// a ChArUco board has the corners of a chessboard, which has no codes.
constexpr std::string_view kLast[] = {"coded_board", "circle_grid", "chessboard"};

// Returns the proposers in the order in which they are asked.
std::vector<Proposer> OrderedProposers() {
  std::vector<Proposer> ordered(std::begin(kProposers), std::end(kProposers));
  const auto rank = [](const Proposer& proposer) {
    const auto place = std::find(std::begin(kLast), std::end(kLast), proposer.type);
    return place == std::end(kLast) ? -1 : place - std::begin(kLast);
  };
  std::stable_sort(ordered.begin(), ordered.end(),
                   [&](const Proposer& a, const Proposer& b) { return rank(a) < rank(b); });
  return ordered;
}

// The fewest points that determine a pose.
constexpr size_t kFewestPoints = 4;

std::string YamlOf(const TargetSettings& settings) {
  std::vector<std::string> keys;
  for (const auto& [key, value] : settings) keys.push_back(key + ": " + value);
  return "{" + Join(keys, ", ") + "}";
}

bool IsLength(const std::string& value) { return value.ends_with(" m"); }

// Returns the target of some settings; nothing if there is no such target, such as one with more tags than the family
// has.
std::optional<RecognisedTarget> TargetOf(const TargetSettings& settings) {
  RecognisedTarget recognised;
  try {
    recognised.target = ParseTarget(YamlOf(settings));
  } catch (const InputError&) {
    return std::nullopt;
  }
  const auto first_length =
      std::find_if(settings.begin(), settings.end(), [](const auto& entry) { return IsLength(entry.second); });
  if (first_length != settings.end()) recognised.size_key = first_length->first;
  recognised.settings = settings;
  return recognised;
}

// Returns an image of at most `side_px` pixels along its longer side.
cv::Mat Reduced(const cv::Mat& image, double side_px) {
  const double scale = side_px / std::max(image.cols, image.rows);
  if (scale >= 1) return image;
  cv::Mat reduced;
  cv::resize(image, reduced, {}, scale, scale, cv::INTER_AREA);
  return reduced;
}

size_t NumSeen(const RecognisedTarget& recognised, const cv::Mat& image) {
  const size_t num_points = recognised.target->Detect(image).ids.size();
  return num_points < kFewestPoints ? 0 : num_points;
}

// Returns the proposal of one type of which the most points are found in the image that it comes from, which it counts;
// of several with as many, the smallest has the fewest that are not there.
std::optional<RecognisedTarget> BestProposal(const Proposer& proposer, const cv::Mat& image) {
  std::optional<RecognisedTarget> best;
  size_t most = 0;
  for (TargetSettings& settings : proposer.propose(image)) {
    settings.insert(settings.begin(), {"type", proposer.type});
    std::optional<RecognisedTarget> proposal = TargetOf(settings);
    if (!proposal) continue;
    const size_t num_points = NumSeen(*proposal, image);
    const bool is_better = num_points > most || (num_points == most && best && num_points > 0 &&
                                                 proposal->target->points().size() < best->target->points().size());
    if (!is_better) continue;
    most = num_points;
    best = std::move(proposal);
  }
  if (most == 0) return std::nullopt;
  best->num_points = most;
  return best;
}

// Returns whether the points of a target have codes.
bool IsCoded(const RecognisedTarget& recognised) { return recognised.target->Codes().size() > 1; }

// The corners of a ChArUco board are those of a chessboard too: codes decide unless they leave out many points.
constexpr double kOfCodes = 1.1;

// Returns whether codes explain an image so well that no other target of as many points does better.
bool IsExplained(const RecognisedTarget& best) {
  return IsCoded(best) &&
         kOfCodes * static_cast<double>(best.num_points) >= static_cast<double>(best.target->points().size());
}

// Returns whether one target explains images better than another one.
bool IsBetter(const RecognisedTarget& a, const RecognisedTarget& b) {
  const auto weight = [](const RecognisedTarget& proposal) {
    return static_cast<double>(proposal.num_points) * (IsCoded(proposal) ? kOfCodes : 1);
  };
  return weight(a) != weight(b) ? weight(a) > weight(b) : a.target->points().size() < b.target->points().size();
}

// Returns whether two proposals are one target: lengths that are measured in images differ by some hundredths.
bool AreAlike(const TargetSettings& a, const TargetSettings& b) {
  constexpr double kAlike = 1.1;
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const auto& one, const auto& other) {
    // Measured are lengths and their ratios, which have a decimal point.
    const auto figure_of = [](const std::string& value) {
      double figure = 0;
      const std::string number = IsLength(value) ? value.substr(0, value.size() - 2) : value;
      const bool is_measured = number.find('.') != std::string::npos && ParseDouble(number, &figure);
      return is_measured ? std::optional(figure) : std::nullopt;
    };
    const std::optional<double> figure = figure_of(one.second);
    const std::optional<double> other_figure = figure_of(other.second);
    if (one.first != other.first || !figure || !other_figure) return one == other;
    return *figure < kAlike * *other_figure && *other_figure < kAlike * *figure;
  });
}

}  // namespace

std::vector<RecognisedTarget> RecogniseTargets(const std::vector<cv::Mat>& images, int num_threads) {
  // Proposals come from a few images, in which a target is as well seen at a moderate size.
  constexpr size_t kMostProposing = 3;
  constexpr double kProposingSidePx = 1920;
  const std::vector<size_t> chosen = EvenIndices(images.size(), kMostProposing);
  std::vector<cv::Mat> proposing;
  for (const size_t i : chosen) proposing.push_back(Reduced(images[i], kProposingSidePx));
  // One type after the other, each in the images that no code explains.
  std::vector<std::optional<RecognisedTarget>> best_of(proposing.size());
  for (const Proposer& proposer : OrderedProposers()) {
    ParallelFor(static_cast<int>(proposing.size()), num_threads, [&](int task) {
      const auto i = static_cast<size_t>(task);
      std::optional<RecognisedTarget>& best = best_of[i];
      if (best && IsExplained(*best)) return;
      std::optional<RecognisedTarget> proposal = BestProposal(proposer, proposing[i]);
      if (proposal && (!best || IsBetter(*proposal, *best))) best = std::move(proposal);
    });
  }
  // Only the best proposal of each image is tried in all images: the others are parts of it, or accidents.
  struct Seen {
    size_t proposal = 0;
    size_t image = 0;
    size_t num_points = 0;
  };
  std::vector<RecognisedTarget> proposals;
  std::vector<Seen> known;  // In images that were not reduced, with the lengths that were measured there.
  for (size_t i = 0; i < best_of.size(); ++i) {
    std::optional<RecognisedTarget>& best = best_of[i];
    if (!best) continue;
    auto same = std::find_if(proposals.begin(), proposals.end(),
                             [&](const RecognisedTarget& other) { return AreAlike(other.settings, best->settings); });
    if (proposing[i].size() == images[chosen[i]].size()) {
      known.push_back({static_cast<size_t>(same - proposals.begin()), chosen[i], best->num_points});
    }
    if (same != proposals.end()) continue;
    best->num_points = 0;
    proposals.push_back(std::move(*best));
  }
  std::vector<std::optional<size_t>> num_seen(proposals.size() * images.size());
  for (const Seen& seen : known) num_seen[seen.proposal * images.size() + seen.image] = seen.num_points;
  ParallelFor(static_cast<int>(num_seen.size()), num_threads, [&](int task) {
    const auto k = static_cast<size_t>(task);
    if (!num_seen[k]) num_seen[k] = NumSeen(proposals[k / images.size()], images[k % images.size()]);
  });
  for (size_t k = 0; k < num_seen.size(); ++k) {
    RecognisedTarget& proposal = proposals[k / images.size()];
    proposal.num_points += *num_seen[k];
    proposal.num_images += *num_seen[k] > 0 ? 1 : 0;
  }
  std::erase_if(proposals, [](const RecognisedTarget& proposal) { return proposal.num_images == 0; });
  std::stable_sort(proposals.begin(), proposals.end(), &IsBetter);
  std::vector<RecognisedTarget> best;
  std::set<std::string_view> types;
  for (RecognisedTarget& proposal : proposals) {
    if (!types.insert(proposal.target->type()).second) continue;
    // A type that is seen in no more images, and with fewer points, is a part of the first one.
    if (!best.empty() && proposal.num_images <= best.front().num_images) continue;
    best.push_back(std::move(proposal));
  }
  return best;
}

std::string RecognisedTargetText(const RecognisedTarget& recognised, double size_m) {
  TargetSettings settings = recognised.settings;
  for (auto& [key, value] : settings) {
    if (!IsLength(value)) continue;
    double ratio = 0;
    ParseDouble(value.substr(0, value.size() - 2), &ratio);
    constexpr double kMicrometres = 1e6;
    constexpr double kPerMillimetre = 1e3;
    value = size_m > 0     ? RoundTrip(std::round(kMicrometres * size_m * ratio) / kPerMillimetre) + " mm"
            : ratio == 1.0 ? std::string("SIZE")
                           : Significant(ratio, 3) + " * SIZE";
  }
  return YamlOf(settings);
}

}  // namespace heba
