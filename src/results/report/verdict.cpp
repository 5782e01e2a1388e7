#include "results/report/verdict.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/calibration_levels.h"
#include "base/digits.h"
#include "base/manoeuvres.h"
#include "base/units.h"
#include "results/report/mounting.h"
#include "results/report/people.h"
#include "results/tables/json_fields.h"

namespace imuscope::report {
namespace {

using tables::field;
using tables::number_at;
using tables::numbers_at;
using tables::text_at;

/// An error beyond this many sd is not chance.
constexpr double kSdMax = 4.0;
/// Fewer seconds of a regime than this leave its slow processes unseen.
constexpr double kRegimeShort_s = 60.0;
/// More names than this are counted instead.
constexpr std::size_t kNamesMax = 6;

using Three = std::array<double, 3>;

std::optional<double> largest(const std::optional<Three>& values) {
  return values ? std::optional(*std::max_element(values->begin(), values->end())) : std::nullopt;
}

/// Largest sd of each kind; empty where calibration.json does not say.
struct Accuracy {
  std::optional<double> boresight_deg;
  std::optional<double> lever_arm_mm;
  std::optional<double> time_offset_ms;
};

Accuracy accuracy_of(const SImuFiles& study) {
  Accuracy accuracy;
  accuracy.boresight_deg = largest(numbers_at<3>(study.calibration, "boresight_sd_deg"));
  accuracy.lever_arm_mm = largest(numbers_at<3>(study.calibration, "r_bs_b_sd_m"));
  if (accuracy.lever_arm_mm) *accuracy.lever_arm_mm *= kMmPerM;
  accuracy.time_offset_ms = number_at(study.calibration, "t_d_sd_s");
  if (accuracy.time_offset_ms) *accuracy.time_offset_ms *= kMsPerS;
  return accuracy;
}

std::string direction_words(const std::string& direction) {
  if (direction.rfind("psi_", 0) == 0) return "boresight about " + direction.substr(4);
  if (direction.rfind("r_", 0) == 0) return "lever arm along " + direction.substr(2);
  return direction == "t_d" ? "time offset" : direction;
}

/// Names of what the run says it has not observed.
std::vector<std::string> not_observed(const SImuFiles& study) {
  std::vector<std::string> names;
  for (const auto& [name, observed] : field(study.calibration, "observable").items()) {
    if (observed == nlohmann::json(false)) names.push_back(name);
  }
  return names;
}

std::vector<std::string> words_of(const std::vector<std::string>& directions) {
  std::vector<std::string> words;
  for (const std::string& direction : directions) words.push_back(direction_words(direction));
  return words;
}

/// One kind of sd beside what makes a mounting usable (base/calibration_levels.h).
struct SdBesideLimit {
  const char* what;
  std::optional<double> sd;
  double usable;
  const char* unit;
};

constexpr double kUsableBoresightSd_deg = kUsableBoresightSd_rad * kDegPerRad;
constexpr double kUsableLeverArmSd_mm = kUsableLeverArmSd_m * kMmPerM;
constexpr double kUsableTimeOffsetSd_ms = kUsableTimeOffsetSd_s * kMsPerS;

std::array<SdBesideLimit, 3> sds_beside_limits(const SImuFiles& study) {
  const Accuracy accuracy = accuracy_of(study);
  return {SdBesideLimit{"boresight", accuracy.boresight_deg, kUsableBoresightSd_deg, "deg"},
          SdBesideLimit{"lever arm", accuracy.lever_arm_mm, kUsableLeverArmSd_mm, "mm"},
          SdBesideLimit{"time offset", accuracy.time_offset_ms, kUsableTimeOffsetSd_ms, "ms"}};
}

Usability usability(const SImuFiles& study) {
  constexpr double kUnknownSd = std::numeric_limits<double>::quiet_NaN();
  const Accuracy accuracy = accuracy_of(study);
  const auto by_sd = usability_of(accuracy.boresight_deg.value_or(kUnknownSd) * kRadPerDeg,
                                  accuracy.lever_arm_mm.value_or(kUnknownSd) / kMmPerM,
                                  accuracy.time_offset_ms.value_or(kUnknownSd) / kMsPerS);
  if (by_sd == Usability::kUsable && !not_observed(study).empty()) return Usability::kWithLimits;
  return by_sd;
}

/// Largest error against truth.json in units of its sd; empty where either is not known.
std::optional<double> worst_error_sd(const SImuFiles& study) {
  std::optional<double> worst;
  const auto take = [&](double error, double sd) {
    if (sd > 0.0) worst = std::max(worst.value_or(0.0), std::abs(error) / sd);
  };
  const auto found_C = numbers_at<9>(study.calibration, "C_b_s");
  const auto true_C = numbers_at<9>(study.truth, "C_b_s");
  const auto sd_deg = numbers_at<3>(study.calibration, "boresight_sd_deg");
  if (found_C && true_C && sd_deg) {
    const Angles error_deg = boresight_deg(*true_C, *found_C);
    for (std::size_t i = 0; i < error_deg.size(); ++i) take(error_deg[i], (*sd_deg)[i]);
  }
  const auto found_r = numbers_at<3>(study.calibration, "r_bs_b_m");
  const auto true_r = numbers_at<3>(study.truth, "r_bs_b_m");
  const auto sd_m = numbers_at<3>(study.calibration, "r_bs_b_sd_m");
  if (found_r && true_r && sd_m) {
    for (std::size_t i = 0; i < found_r->size(); ++i) take((*found_r)[i] - (*true_r)[i], (*sd_m)[i]);
  }
  return worst;
}

std::string accuracy_sentence(const SImuFiles& study) {
  std::vector<std::string> parts;
  for (const SdBesideLimit& part : sds_beside_limits(study)) {
    if (!part.sd) {
      parts.push_back(fmt::format("{} unknown", part.what));
    } else {
      parts.push_back(fmt::format(
          "{} {} {}{}", part.what, digits_beside(*part.sd, part.usable), part.unit,
          *part.sd <= part.usable ? "" : fmt::format(" (wanted: {:g} {})", part.usable, part.unit)));
    }
  }
  std::string sentence = fmt::format("{}: {}; largest sd of {}.", study.name,
                                     imuscope::words_of(usability(study)), fmt::join(parts, ", "));
  const auto missing = words_of(not_observed(study));
  if (!missing.empty())
    sentence += fmt::format(" Not observable in this drive: {}.", fmt::join(missing, ", "));
  if (const auto worst = worst_error_sd(study)) {
    sentence += fmt::format(" Against the truth, boresight and lever arm err by at most {:.1f} sd{}.", *worst,
                            *worst > kSdMax ? ", more than their sd allows" : "");
  }
  return sentence;
}

std::size_t count_rejected(const std::vector<Fit>& fits, double level) {
  return static_cast<std::size_t>(std::count_if(
      fits.begin(), fits.end(), [&](const Fit& fit) { return fit.j_p_value && *fit.j_p_value < level; }));
}

std::string fit_name(const Fit& fit) {
  return fmt::format("{} {} ({})", fit.imu, axis_words(fit.axis), fit.regime.empty() ? "all" : fit.regime);
}

std::string fit_names(const std::vector<const Fit*>& fits) {
  std::vector<std::string> names;
  for (const Fit* fit : fits) {
    if (names.size() == kNamesMax)
      return fmt::format("{} and {} more", fmt::join(names, ", "), fits.size() - kNamesMax);
    names.push_back(fit_name(*fit));
  }
  return fmt::format("{}", fmt::join(names, ", "));
}

/// The fits to judge. A model over all regimes together is judged only where no regime has one of its own: it
/// mixes what the regimes' models keep apart.
std::vector<Fit> judged(const std::vector<Fit>& fits) {
  const auto is_whole = [](const Fit& fit) { return fit.regime == "all" || fit.regime.empty(); };
  std::vector<Fit> chosen;
  for (const Fit& fit : fits) {
    const bool replaced = is_whole(fit) && std::any_of(fits.begin(), fits.end(), [&](const Fit& other) {
                            return !is_whole(other) && other.imu == fit.imu && other.axis == fit.axis;
                          });
    if (!replaced) chosen.push_back(fit);
  }
  return chosen;
}

template <typename Condition>
std::vector<const Fit*> those(const std::vector<Fit>& fits, Condition condition) {
  std::vector<const Fit*> chosen;
  for (const Fit& fit : fits) {
    if (condition(fit)) chosen.push_back(&fit);
  }
  return chosen;
}

/// What to drive so that these directions can be seen.
void manoeuvres(const RunFiles& run, std::vector<std::string>& steps) {
  bool turns = false;
  bool brakes = false;
  bool rough = false;
  for (const SImuFiles& study : run.studies) {
    const auto missing = not_observed(study);
    const auto misses = [&](std::string_view name) {
      return std::find(missing.begin(), missing.end(), name) != missing.end();
    };
    const auto parts = sds_beside_limits(study);
    const auto short_of = [&](std::size_t i) { return parts[i].sd && *parts[i].sd > parts[i].usable; };
    turns = turns || misses("psi_x") || misses("psi_y") || misses("r_x") || misses("r_y") || misses("t_d") ||
            short_of(0) || short_of(1) || short_of(2);
    brakes = brakes || misses("psi_z") || short_of(0);
    rough = rough || misses("r_z") || short_of(1);
  }
  const auto advise = [&](const char* what, const char* manoeuvre) {
    steps.push_back(fmt::format("To show {}: {}.", what, manoeuvre));
  };
  if (turns)
    advise("the boresight about the level axes, the level lever arm and the time offset", kTurnBothWays);
  if (brakes) advise("the boresight about the vertical axis", kBrakeFirmly);
  if (rough) advise("the vertical lever arm", kRoughRoad);
}

void device_steps(const RunFiles& run, std::vector<std::string>& steps) {
  for (const auto& device : field(run.run, "devices")) {
    const double samples_lost = number_at(device, "samples_lost").value_or(0.0);
    const double bad_checksums = number_at(device, "bad_checksums").value_or(0.0);
    if (samples_lost + bad_checksums == 0.0) continue;
    std::vector<std::string> what;
    if (samples_lost > 0.0) what.push_back(fmt::format("{:.0f} samples lost", samples_lost));
    if (bad_checksums > 0.0)
      what.push_back(fmt::format("{:.0f} frames with a wrong checksum", bad_checksums));
    steps.push_back(fmt::format("See to device {}: {} (cable, baud rate, reception, load of the computer).",
                                text_at(device, "name"), fmt::join(what, ", ")));
  }
}

void model_steps(const RunFiles& run, const std::vector<Fit>& fits, std::vector<std::string>& steps) {
  const double level = fits.empty() ? kTestLevel : kTestLevel / static_cast<double>(fits.size());
  if (count_rejected(fits, level) > 0) {
    steps.emplace_back(
        "Try another composition of the noise model for the signals that the test rejects; Figure 4 shows "
        "at which scales the fitted line leaves the intervals.");
  }
  const auto vague = those(fits, [](const Fit& fit) { return !fit.identifiable; });
  const auto records = records_needed(fits);
  steps.insert(steps.end(), records.begin(), records.end());
  if (!vague.empty() && records.empty()) {
    steps.push_back(
        fmt::format("Use a simpler model where parameters cannot be told apart ({}); each fit names it.",
                    fit_names(vague)));
  }
  for (const char* regime : {"static", "dynamic"}) {
    const auto seconds = number_at(field(run.run, "regimes"), fmt::format("{}_s", regime).c_str());
    if (seconds && *seconds < kRegimeShort_s) {
      steps.push_back(fmt::format("Record more of the {} regime: this run has {} of it.", regime,
                                  duration_words(*seconds)));
    }
  }
}

/// Nothing is usable that was made of data or a configuration that are wrong.
void judge_by_findings(const RunFiles& run, Verdict& verdict) {
  const auto wrong = findings_of(run, "wrong");
  if (!wrong.empty()) {
    verdict.answer = Answer::kNo;
    verdict.headline = "Not usable: something is wrong with the data or the configuration, as said above.";
  } else if (verdict.answer == Answer::kYes && !findings_of(run, "limits").empty()) {
    verdict.answer = Answer::kPartly;
    verdict.headline = "Usable with limits: what the data lack is said above.";
  }
}

std::string counted(std::size_t n, const char* thing) {
  return fmt::format("{} {}{}", n, thing, n == 1 ? "" : "s");
}

}  // namespace

std::vector<std::string> findings_of(const RunFiles& run, std::string_view harm) {
  std::vector<std::string> sentences;
  for (const auto& finding : field(run.run, "findings")) {
    if (text_at(finding, "harm") == harm) sentences.push_back(text_at(finding, "text"));
  }
  return sentences;
}

const char* css_class_of(Answer answer) {
  switch (answer) {
    case Answer::kYes:
      return "yes";
    case Answer::kPartly:
      return "partly";
    case Answer::kNo:
      return "no";
    case Answer::kOpen:
      break;
  }
  return "unknown";
}

Verdict data_verdict(const RunFiles& run) {
  Verdict verdict;
  const std::size_t wrong = findings_of(run, "wrong").size();
  const std::size_t limits = findings_of(run, "limits").size();
  verdict.reasons = sentences_of(run, "warnings");
  const std::size_t warnings = verdict.reasons.size();
  verdict.answer = wrong > 0 ? Answer::kNo : limits > 0 || warnings > 0 ? Answer::kPartly : Answer::kYes;
  if (wrong > 0) {
    verdict.headline =
        fmt::format("No: {} wrong.", wrong == 1 ? "1 thing is" : fmt::format("{} things are", wrong));
  } else if (limits > 0) {
    verdict.headline = fmt::format("Yes, with {}.", counted(limits, "limit"));
  } else if (warnings > 0) {
    verdict.headline = fmt::format("Yes, but the run gave {}.", counted(warnings, "warning"));
  } else {
    verdict.headline = "Yes: nothing wrong was found.";
  }
  return verdict;
}

Verdict calibration_verdict(const RunFiles& run) {
  Verdict verdict;
  if (run.studies.empty()) {
    verdict.headline = "Cannot be said: the run has no S-IMU.";
    return verdict;
  }
  std::size_t usable = 0;
  std::size_t not_usable = 0;
  for (const SImuFiles& study : run.studies) {
    const Usability of_study = usability(study);
    if (of_study == Usability::kUsable) ++usable;
    if (of_study == Usability::kNotUsable) ++not_usable;
    verdict.reasons.push_back(accuracy_sentence(study));
  }
  const std::size_t n = run.studies.size();
  if (usable == n) {
    verdict.answer = Answer::kYes;
    verdict.headline = n == 1 ? "Usable." : fmt::format("Usable, all {} S-IMUs.", n);
  } else if (not_usable == n) {
    verdict.answer = Answer::kNo;
    verdict.headline = "Not usable: its directions are known no better than a protractor tells them.";
  } else {
    verdict.answer = Answer::kPartly;
    verdict.headline =
        n == 1 ? "Usable with limits: what is less certain than wanted stands below."
               : fmt::format("Usable with limits: {} of {} S-IMUs are usable, {} with limits, {} not.",
                             usable, n, n - usable - not_usable, not_usable);
  }
  const bool overconfident = std::any_of(run.studies.begin(), run.studies.end(), [](const SImuFiles& study) {
    return worst_error_sd(study).value_or(0.0) > kSdMax;
  });
  if (overconfident && verdict.answer == Answer::kYes) {
    verdict.answer = Answer::kPartly;
    verdict.headline =
        "Usable with limits: precise, but not as accurate as it says, as an error exceeds its sd.";
  }
  if (field(field(run.run, "gnss"), "contradicts_motion") == nlohmann::json(true)) {
    verdict.answer = Answer::kNo;
    verdict.headline = "Not usable: the receiver's positions contradict the motion.";
    verdict.reasons.push_back(
        "The warnings of the run say what to check: whose clock the receiver's times are of, "
        "its antenna's lever arm, its sd.");
  }
  judge_by_findings(run, verdict);
  return verdict;
}

Verdict model_verdict(const std::vector<Fit>& all_fits) {
  const std::vector<Fit> fits = judged(all_fits);
  Verdict verdict;
  if (fits.empty()) {
    verdict.headline = "Cannot be said: this run has no noise model.";
    return verdict;
  }
  verdict.reasons = what_is_known(fits);
  const auto tested = those(fits, [](const Fit& fit) { return fit.j_p_value.has_value(); });
  const auto vague = those(fits, [](const Fit& fit) { return !fit.identifiable; });
  const double corrected = kTestLevel / static_cast<double>(std::max<std::size_t>(tested.size(), 1));
  const auto rejected =
      those(fits, [&](const Fit& fit) { return fit.j_p_value && *fit.j_p_value < corrected; });
  if (tested.empty()) {
    verdict.headline = fmt::format("Cannot be said: none of the {} models could be tested.", fits.size());
  } else if (rejected.empty()) {
    verdict.answer = vague.empty() ? Answer::kYes : Answer::kPartly;
    verdict.headline = vague.empty() ? "Yes: not contradicted by the data."
                                     : "Not contradicted, but not every parameter can be told.";
  } else {
    verdict.answer = rejected.size() == tested.size() ? Answer::kNo : Answer::kPartly;
    verdict.headline =
        verdict.answer == Answer::kNo
            ? fmt::format("No: none of the {} models explains its wavelet variance.", tested.size())
            : fmt::format("Not everywhere: {} of {} models do not explain their wavelet variance.",
                          rejected.size(), tested.size());
  }
  if (!tested.empty()) {
    verdict.reasons.push_back(
        fmt::format("The J-test at {:.0f} % rejects {} of {} models ({:.1f} expected by chance if all were "
                    "right), {} when corrected for that many tests{}.",
                    100.0 * kTestLevel, count_rejected(fits, kTestLevel), tested.size(),
                    kTestLevel * static_cast<double>(tested.size()), rejected.size(),
                    rejected.empty() ? "" : ": " + fit_names(rejected)));
  }
  if (tested.size() < fits.size()) {
    verdict.reasons.push_back(
        fmt::format("{} models have too few levels to be tested.", fits.size() - tested.size()));
  }
  if (!vague.empty()) {
    verdict.reasons.push_back(
        vague.size() == fits.size()
            ? fmt::format("A parameter or more cannot be told in each of the {} models.", fits.size())
            : fmt::format("A parameter or more cannot be told in {} of {} models: {}.", vague.size(),
                          fits.size(), fit_names(vague)));
  }
  return verdict;
}

std::vector<std::string> next_steps(const RunFiles& run, const std::vector<Fit>& all_fits) {
  const std::vector<Fit> fits = judged(all_fits);
  std::vector<std::string> steps;
  manoeuvres(run, steps);
  device_steps(run, steps);
  if (fits.empty()) {
    steps.emplace_back("Fit noise models to the error signals: this run folder has none.");
  } else {
    model_steps(run, fits, steps);
  }
  if (const std::size_t n = sentences_of(run, "warnings").size(); n > 0) {
    steps.push_back(fmt::format("Read the warnings of the run ({}) under “Warnings”.", n));
  }
  if (steps.empty()) {
    steps.emplace_back(
        "Nothing has to be repeated. The mounting is in calibration.json and the noise models are in "
        "models.json of this run, ready for a filter.");
  }
  return steps;
}

}  // namespace imuscope::report
