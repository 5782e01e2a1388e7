#include <fmt/format.h>
#include <fmt/ranges.h>
#include <algorithm>
#include <map>

#include "results/report/verdict.h"
#include "results/tables/json_fields.h"

namespace imuscope::report {
namespace {

using tables::field;
using tables::number_at;
using tables::text_at;

using nlohmann::json;

/// Axes of one S-IMU whose models were held against each other.
struct AxisCounts {
  std::size_t n = 0;
  std::vector<std::string> differing;
  std::size_t undetermined = 0;
};

bool differs(const json& comparison) {
  const auto joint_p = number_at(field(comparison, "joint"), "p_holm");
  if (joint_p) return *joint_p < kTestLevel;
  const json& parameters = field(comparison, "parameters");
  return std::any_of(parameters.begin(), parameters.end(),
                     [](const json& parameter) { return text_at(parameter, "verdict") == "differs"; });
}

bool undetermined(const json& comparison) {
  const json& parameters = field(comparison, "parameters");
  return field(comparison, "joint").is_null() &&
         std::all_of(parameters.begin(), parameters.end(),
                     [](const json& parameter) { return text_at(parameter, "verdict") == "not determined"; });
}

/// One model after one duration, over all S-IMUs.
struct ModelScore {
  double nees_sum = 0.0;
  double surprise_sum = 0.0;
  int n = 0;
  int too_proud = 0;  ///< NEES above where a right model's lies
  [[nodiscard]] double nees() const { return nees_sum / n; }
  [[nodiscard]] double surprise() const { return surprise_sum / n; }
};

std::map<std::string, ModelScore> scores_of(const json& evaluation) {
  std::map<std::string, ModelScore> scores;
  for (const json& row : field(evaluation, "evaluations")) {
    const auto nees = number_at(row, "nees_position");
    const auto surprise = number_at(row, "surprise");
    const auto high = number_at(row, "nees_high");
    if (!nees || !surprise || !high) continue;
    ModelScore& score = scores[text_at(row, "model")];
    score.nees_sum += *nees;
    score.surprise_sum += *surprise;
    ++score.n;
    if (*nees > *high) ++score.too_proud;
  }
  return scores;
}

/// "dynamic: mean NEES 1.1; too sure of itself in 1 of 9."
std::string score_sentence(const std::string& name, const ModelScore& score) {
  return fmt::format("{}: mean NEES {:.2g}, surprise {:.3g}; too sure of itself in {} of {} cases.", name,
                     score.nees(), score.surprise(), score.too_proud, score.n);
}

}  // namespace

Verdict difference_verdict(const RunFiles& run) {
  Verdict verdict;
  std::map<std::string, AxisCounts> by_imu;
  std::size_t n = 0;
  std::size_t n_differing = 0;
  std::size_t n_undetermined = 0;
  for (const json& comparison : field(run.comparison, "comparisons")) {
    AxisCounts& counts = by_imu[text_at(comparison, "name")];
    ++counts.n;
    ++n;
    if (differs(comparison)) {
      counts.differing.push_back(axis_words(text_at(comparison, "axis")));
      ++n_differing;
    } else if (undetermined(comparison)) {
      ++counts.undetermined;
      ++n_undetermined;
    }
  }
  if (n == 0) {
    verdict.headline = "Cannot be said: no two regimes were compared in this run.";
    return verdict;
  }
  for (const auto& [name, counts] : by_imu) {
    std::string sentence =
        fmt::format("{}: {} of {} axes differ{}", name, counts.differing.size(), counts.n,
                    counts.differing.empty() ? "" : fmt::format(" ({})", fmt::join(counts.differing, ", ")));
    if (counts.undetermined > 0) sentence += fmt::format("; {} could not be tested", counts.undetermined);
    verdict.reasons.push_back(sentence + ".");
  }
  verdict.reasons.emplace_back("Tests of all parameters together, corrected for their number (Holm).");
  if (n_undetermined == n) {
    verdict.headline = "Cannot be said: none of the axes could be tested.";
  } else {
    verdict.answer = Answer::kYes;
    verdict.headline =
        n_differing == 0 ? "No difference was shown." : fmt::format("Yes, on {} of {} axes.", n_differing, n);
  }
  return verdict;
}

Verdict outage_verdict(const RunFiles& run) {
  Verdict verdict;
  const auto scores = scores_of(run.evaluation);
  if (scores.empty()) {
    verdict.headline = "Not put to the test: `imuscope evaluate` does it.";
    return verdict;
  }
  const auto best = std::min_element(scores.begin(), scores.end(), [](const auto& a, const auto& b) {
    return a.second.surprise() < b.second.surprise();
  });
  const auto worst = std::max_element(scores.begin(), scores.end(), [](const auto& a, const auto& b) {
    return a.second.surprise() < b.second.surprise();
  });
  // One nat in the mean is odds of e to one an outage; a tenth is within what the starts scatter.
  constexpr double kMatters_nat = 1.0;
  constexpr double kAlike_nat = 0.1;
  const bool matters = worst->second.surprise() - best->second.surprise() > kMatters_nat;
  std::vector<std::string> leaders;
  for (const auto& [name, score] : scores) {
    if (score.surprise() - best->second.surprise() <= kAlike_nat) leaders.push_back("“" + name + "”");
  }
  const std::string leading =
      fmt::format("the model{} {} predict{} the errors best", leaders.size() > 1 ? "s" : "",
                  fmt::join(leaders, " and "), leaders.size() > 1 ? "" : "s");
  verdict.answer = best->second.too_proud == 0 ? Answer::kYes : Answer::kPartly;
  verdict.headline = matters ? fmt::format("Yes: in GNSS outages {}, “{}” worst.", leading, worst->first)
                             : "Hardly: in GNSS outages all models predict the errors much alike.";
  for (const auto& [name, score] : scores) verdict.reasons.push_back(score_sentence(name, score));
  return verdict;
}

}  // namespace imuscope::report
