#include "heba/evaluation/judgement.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string_view>
#include <utility>

#include "heba/base/units.h"
#include "heba/evaluation/limits.h"

namespace heba {
namespace {

// The codes as which errors of the model show; the one that says most comes first.
constexpr std::array<std::string_view, 6> kSymptoms = {
    FindingCode("unmodelled_error"),    FindingCode("hold_out"),
    FindingCode("captures_scatter"),    FindingCode("closed_form_better"),
    FindingCode("influential_capture"), FindingCode("pixel_noise")};
// The codes that a cause explains besides.
constexpr std::array<std::string_view, 3> kConsequences = {FindingCode("captures_left_out"), FindingCode("uncertainty"),
                                                           FindingCode("required")};

size_t RankOf(const Finding& finding) {
  return static_cast<size_t>(std::find(kSymptoms.begin(), kSymptoms.end(), finding.code) - kSymptoms.begin());
}

// Returns whether a finding shows that something is wrong, without its cause.
bool IsSymptom(const Finding& finding) {
  return IsMisfit(finding) ||
         std::find(kConsequences.begin(), kConsequences.end(), finding.code) != kConsequences.end();
}

// Returns findings in which those that `is_part` selects are parts of the one at `lead`.
template <class IsPart>
std::vector<Finding> WithParts(std::vector<Finding> findings, size_t lead, const IsPart& is_part) {
  std::vector<Finding> parts;
  for (size_t i = 0; i < findings.size(); ++i) {
    if (i != lead && is_part(findings[i])) parts.push_back(std::exchange(findings[i], Finding()));
  }
  Finding& whole = findings[lead];
  for (Finding& part : Sorted(std::move(parts))) {
    whole.numbers.insert(whole.numbers.end(), part.numbers.begin(), part.numbers.end());
    whole.parts.push_back(std::move(part));
  }
  std::erase_if(findings, [](const Finding& finding) { return finding.code.empty(); });
  return findings;
}

// Returns the index of the finding that precedes all others by `is_before` among those that `is_candidate` selects.
template <class IsCandidate, class IsBefore>
std::optional<size_t> FirstOf(const std::vector<Finding>& findings, const IsCandidate& is_candidate,
                              const IsBefore& is_before) {
  std::optional<size_t> first;
  for (size_t i = 0; i < findings.size(); ++i) {
    if (is_candidate(findings[i]) && (!first || is_before(findings[i], findings[*first]))) first = i;
  }
  return first;
}

// Returns the grade of a share of the distance, which is not bad up to `explained_share`.
Grade GradeUnlessExplained(double share, const Limits& limits, double explained_share) {
  const Grade grade = GradeOf(share, limits);
  return share <= std::min(explained_share, kUseless) ? std::min(grade, Grade::kDoubtful) : grade;
}

}  // namespace

double RobotErrorShare(const std::optional<RobotNoise>& noise, const std::optional<RobotNoise>& smooth_noise,
                       double distance_m) {
  double square = 0;
  for (const std::optional<RobotNoise>& part : {noise, smooth_noise}) {
    if (!part) continue;
    const double share = part->translation_m / distance_m;
    square += share * share + part->rotation_rad * part->rotation_rad;
  }
  return std::sqrt(square);
}

Grade GradeOfSigma(double share_of_distance, double robot_error_share, int num_captures) {
  return GradeUnlessExplained(share_of_distance, kSigmaShare,
                              kTimesMean * robot_error_share / std::sqrt(std::max(1, num_captures)));
}

Grade GradeOfHeldOut(double share_of_distance, double deg, double robot_error_share) {
  return GradeUnlessExplained(std::max(share_of_distance, DegToRad(deg)), kHeldOutShare,
                              kTimesRobotError * robot_error_share);
}

Grade GradeOfMisfit(double chi2_per_dof, Grade of_hold_out) {
  const Grade grade = GradeOf(chi2_per_dof, kHeldOutChi2);
  return of_hold_out == Grade::kGood ? std::min(grade, Grade::kDoubtful) : grade;
}

std::optional<Finding> JudgeMoves(const std::vector<NamedMove>& moves, double distance_m) {
  constexpr double kUnlikely = 0.01;
  const auto p_value_of = [](const NamedMove& named) { return named.move.p_value; };
  const auto strongest = std::min_element(moves.begin(), moves.end(), [&](const NamedMove& a, const NamedMove& b) {
    return p_value_of(a) < p_value_of(b);
  });
  const auto num_unlikely = static_cast<double>(
      std::count_if(moves.begin(), moves.end(), [&](const NamedMove& named) { return p_value_of(named) < kUnlikely; }));
  const auto num_asked = static_cast<double>(moves.size());
  constexpr double kFew = 0.2;
  if (strongest == moves.end() || num_unlikely > std::max(1.0, kFew * num_asked)) return std::nullopt;
  const double move_m = strongest->move.tangent.head<3>().norm();
  const double move_rad = strongest->move.tangent.tail<3>().norm();
  const double p_value = std::min(1.0, num_asked * strongest->move.p_value);
  const bool matters = std::max(move_m / distance_m, move_rad) > kSigmaShare.doubtful;
  if (p_value > kUnlikely || !matters) return std::nullopt;
  return Finding{Grade::kDoubtful,
                 FindingCode("influential_capture"),
                 {{"move_mm", 1000 * move_m}, {"move_deg", RadToDeg(move_rad)}, {"chance", p_value}},
                 {{"image", strongest->capture}}};
}

bool IsMisfit(const Finding& finding) { return RankOf(finding) < kSymptoms.size(); }

std::vector<Finding> WithSymptomsGathered(std::vector<Finding> findings) {
  const std::optional<size_t> cause = FirstOf(
      findings, [](const Finding& finding) { return finding.is_cause && finding.grade != Grade::kGood; },
      [](const Finding& a, const Finding& b) { return a.grade > b.grade; });
  if (cause) {
    const Grade grade = findings[*cause].grade;
    findings = WithParts(std::move(findings), *cause, [&](const Finding& finding) {
      return !finding.is_cause && IsSymptom(finding) && finding.grade != Grade::kGood && finding.grade <= grade;
    });
  }
  const auto is_misfit = [](const Finding& finding) { return finding.grade != Grade::kGood && IsMisfit(finding); };
  const std::optional<size_t> lead = FirstOf(findings, is_misfit, [](const Finding& a, const Finding& b) {
    return a.grade != b.grade ? a.grade > b.grade : RankOf(a) < RankOf(b);
  });
  return lead ? WithParts(std::move(findings), *lead, is_misfit) : std::move(findings);
}

std::vector<Finding> Sorted(std::vector<Finding> findings) {
  std::stable_sort(findings.begin(), findings.end(), [](const Finding& a, const Finding& b) {
    return a.grade != b.grade ? a.grade > b.grade : a.is_cause && !b.is_cause;
  });
  return findings;
}

}  // namespace heba
