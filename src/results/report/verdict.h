#pragma once

/// What the numbers mean, in words: the head of the report.

#include <string>
#include <string_view>
#include <vector>

#include "results/report/fits.h"
#include "results/report/run_files.h"

namespace imuscope::report {

enum class Answer { kYes, kPartly, kNo, kOpen };

/// The answer to one question, and the sentences that justify it.
struct Verdict {
  Answer answer = Answer::kOpen;
  std::string headline;
  std::vector<std::string> reasons;
};

/// Level of the tests.
inline constexpr double kTestLevel = 0.05;

/// The class that kit.css colours it by: "yes", "partly", "no", "unknown".
const char* css_class_of(Answer answer);

/// Is something wrong with data or configuration, by what the look at the data found?
Verdict data_verdict(const RunFiles& run);
Verdict calibration_verdict(const RunFiles& run);
Verdict model_verdict(const std::vector<Fit>& fits);
/// Which parts of the models the data determine, and how well.
std::vector<std::string> what_is_known(const std::vector<Fit>& fits);
/// How long a record the slow processes would need that this one does not determine; empty where it does.
std::vector<std::string> records_needed(const std::vector<Fit>& fits);
/// Do the models of rest and motion differ? By comparison.json; kOpen where it is absent or empty.
Verdict difference_verdict(const RunFiles& run);
/// Does it matter which model a filter holds? By evaluation.json; kOpen where it is absent.
Verdict outage_verdict(const RunFiles& run);
/// What to do next; never empty.
std::vector<std::string> next_steps(const RunFiles& run, const std::vector<Fit>& fits);

/// What the look at the data found, of one degree of harm: "wrong", "limits".
std::vector<std::string> findings_of(const RunFiles& run, std::string_view harm);

}  // namespace imuscope::report
