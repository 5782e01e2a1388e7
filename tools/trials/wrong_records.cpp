/// What the batch estimate makes of records that are wrong: mirrored axes, units mistaken, another body, a
/// clock that jumps, a drive that shows too little. It may refuse, or widen; what it may not do is to publish
/// a mounting that is wrong and a small sd beside it. Pairs of the harsh world, each mistake on each of them.

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <Eigen/Core>
#include <algorithm>
#include <functional>
#include <string>
#include <vector>

#include "base/units.h"
#include "estimation/batch/batch_mounting.h"
#include "estimation/navigation/so3.h"
#include "tools/trials/all_threads.h"
#include "tools/trials/batch_pairs.h"

namespace {

using namespace imuscope;
using batch::ImuRecord;
using Eigen::Matrix3f;
using Eigen::Vector3f;

struct Options {
  std::size_t seeds = 4;
  std::size_t threads = 1;
  std::uint64_t first = 1;
  double duration_s = 600.0;
  int reference_class = 1;
  std::string only;
  bool each = false;
};

/// The records that the estimate is given.
struct Pair {
  ImuRecord reference;
  ImuRecord study;
};

/// @param other  the S-IMU of another drive
using Mistake = std::function<void(Pair&, const ImuRecord& other)>;

struct Case {
  std::string name;
  Mistake make;
};

void each(ImuRecord& record, const std::function<void(Vector3f& omega_radps, Vector3f& f_mps2)>& change) {
  for (std::size_t i = 0; i < record.size(); ++i) change(record.omega_radps[i], record.f_mps2[i]);
}

/// Both triads of the S-IMU through a matrix that need not be a rotation.
Mistake study_through(const Matrix3f& gyro, const Matrix3f& accel) {
  return [gyro, accel](Pair& pair, const ImuRecord&) {
    each(pair.study, [&](Vector3f& omega, Vector3f& f) {
      omega = (gyro * omega).eval();
      f = (accel * f).eval();
    });
  };
}

void keep_between(ImuRecord& record, double from_s, double to_s) {
  ImuRecord kept;
  for (std::size_t i = 0; i < record.size(); ++i)
    if (record.time_s[i] >= from_s && record.time_s[i] < to_s)
      kept.add(record.time_s[i], record.omega_radps[i], record.f_mps2[i]);
  record = std::move(kept);
}

Mistake part_of_the_drive(double from_s, double to_s) {
  return [from_s, to_s](Pair& pair, const ImuRecord&) {
    keep_between(pair.reference, from_s, to_s);
    keep_between(pair.study, from_s, to_s);
  };
}

/// Keeps the stretches, of ten seconds and more, in which the vehicle hardly turns; between them samples are
/// missing.
void straight_road_only(Pair& pair, const ImuRecord&) {
  constexpr float kStraight_radps = 0.03F;
  constexpr std::size_t kPiece = 100;
  constexpr std::size_t kPieces = 10;
  Pair kept;
  std::size_t straight = 0;
  const auto keep = [&](std::size_t first, std::size_t end) {
    if (straight < kPieces) return;
    for (std::size_t i = first - straight * kPiece; i < std::min(end, first); ++i) {
      kept.reference.add(pair.reference.time_s[i], pair.reference.omega_radps[i], pair.reference.f_mps2[i]);
      kept.study.add(pair.study.time_s[i], pair.study.omega_radps[i], pair.study.f_mps2[i]);
    }
  };
  const std::size_t n = pair.study.size();
  for (std::size_t first = 0; first + kPiece <= n; first += kPiece) {
    Vector3f mean = Vector3f::Zero();
    for (std::size_t i = first; i < first + kPiece; ++i) mean += pair.reference.omega_radps[i];
    if (mean.norm() < kStraight_radps * static_cast<float>(kPiece)) {
      ++straight;
      continue;
    }
    keep(first, n);
    straight = 0;
  }
  keep(n - n % kPiece, n);
  pair = std::move(kept);
}

/// From the middle on, the S-IMU's clock is off by so much.
Mistake clock_jump(double by_s) {
  return [by_s](Pair& pair, const ImuRecord&) {
    const double middle_s = 0.5 * pair.study.time_s.back();
    ImuRecord jumped;
    for (std::size_t i = 0; i < pair.study.size(); ++i) {
      const double time_s = pair.study.time_s[i] + (pair.study.time_s[i] > middle_s ? by_s : 0.0);
      if (jumped.size() > 0 && time_s <= jumped.time_s.back()) continue;
      jumped.add(time_s, pair.study.omega_radps[i], pair.study.f_mps2[i]);
    }
    pair.study = std::move(jumped);
  };
}

/// From the middle on, the S-IMU sits elsewhere.
void moved(Pair& pair, const ImuRecord&) {
  const Matrix3f turn = exp_so3(Eigen::Vector3d(0.0, 0.05, 0.0)).cast<float>();
  for (std::size_t i = pair.study.size() / 2; i < pair.study.size(); ++i) {
    pair.study.omega_radps[i] = (turn * pair.study.omega_radps[i]).eval();
    pair.study.f_mps2[i] = (turn * pair.study.f_mps2[i]).eval();
  }
}

void frozen_axis(Pair& pair, const ImuRecord&) {
  const float stuck = pair.study.omega_radps.front().y();
  each(pair.study, [stuck](Vector3f& omega, Vector3f&) { omega.y() = stuck; });
}

constexpr float kRange_radps = 0.1F;
constexpr float kRange_mps2 = 10.5F;
/// A range too small for the drive: everything beyond is cut off.
void saturated(Pair& pair, const ImuRecord&) {
  each(pair.study, [](Vector3f& omega, Vector3f& f) {
    omega = omega.cwiseMax(-kRange_radps).cwiseMin(kRange_radps);
    f = f.cwiseMax(-kRange_mps2).cwiseMin(kRange_mps2);
  });
}

constexpr auto kDeg = static_cast<float>(kDegPerRad);
constexpr auto kGravity = static_cast<float>(kMps2PerG);

std::vector<Case> cases() {
  const Matrix3f same = Matrix3f::Identity();
  const Matrix3f mirrored = Vector3f(1.0F, -1.0F, 1.0F).asDiagonal();
  const Matrix3f upside_down = -same;
  Matrix3f swapped;
  swapped << 0, 1, 0, 1, 0, 0, 0, 0, 1;
  Matrix3f turned;
  turned << 0, 1, 0, -1, 0, 0, 0, 0, 1;
  return {
      {"nothing wrong", [](Pair&, const ImuRecord&) {}},
      {"one axis mirrored in both triads", study_through(mirrored, mirrored)},
      {"one gyro axis mirrored", study_through(mirrored, same)},
      {"one accelerometer axis mirrored", study_through(same, mirrored)},
      {"x and y gyros swapped", study_through(swapped, same)},
      {"x and y accelerometers swapped", study_through(same, swapped)},
      {"accelerometers turned by 90 deg", study_through(same, turned)},
      {"accelerometers upside down", study_through(same, upside_down)},
      {"study in deg/s read as rad/s", study_through(kDeg * same, same)},
      {"study in rad/s read as deg/s", study_through(same / kDeg, same)},
      {"study in g read as m/s2", study_through(same, same / kGravity)},
      {"gyros and accelerometers exchanged",
       [](Pair& pair, const ImuRecord&) { pair.study.omega_radps.swap(pair.study.f_mps2); }},
      {"reference in deg/s read as rad/s",
       [](Pair& pair, const ImuRecord&) {
         each(pair.reference, [](Vector3f& omega, Vector3f&) { omega *= kDeg; });
       }},
      {"reference in g read as m/s2",
       [](Pair& pair, const ImuRecord&) {
         each(pair.reference, [](Vector3f&, Vector3f& f) { f /= kGravity; });
       }},
      {"reference's accelerometers upside down",
       [](Pair& pair, const ImuRecord&) { each(pair.reference, [](Vector3f&, Vector3f& f) { f = -f; }); }},
      {"a copy of the reference", [](Pair& pair, const ImuRecord&) { pair.study = pair.reference; }},
      {"on another body", [](Pair& pair, const ImuRecord& other) { pair.study = other; }},
      {"clock jumps by 0.05 s", clock_jump(0.05)},
      {"clock jumps by 2 s", clock_jump(2.0)},
      {"moved by 3 deg in mid-drive", moved},
      {"one gyro stuck", frozen_axis},
      {"saturated", saturated},
      {"no rest at the start", part_of_the_drive(100.0, 1e9)},
      {"thirty seconds of drive", part_of_the_drive(100.0, 130.0)},
      {"rest alone", part_of_the_drive(0.0, 55.0)},
      {"straight road alone", straight_road_only},
  };
}

struct Totals {
  int refused = 0;
  int found = 0;
  int sure_and_wrong = 0;
  double worst_nees = 0.0;
  double worst_psi_rad = 0.0;
  double worst_r_m = 0.0;
  std::string sentence;

  void add(const Totals& t) {
    refused += t.refused, found += t.found, sure_and_wrong += t.sure_and_wrong;
    worst_nees = std::max(worst_nees, t.worst_nees);
    worst_psi_rad = std::max(worst_psi_rad, t.worst_psi_rad);
    worst_r_m = std::max(worst_r_m, t.worst_r_m);
    if (sentence.empty()) sentence = t.sentence;
  }
};

/// 0.999 quantile of chi-squared with six degrees of freedom: one right mounting in a thousand is beyond.
constexpr double kSurelyWrong = 22.46;

/// One mounting, its error beside its sd.
void print_each(const std::string& name, const batch::BatchMounting& found,
                const batch::ParameterVector& error, double nees) {
  fmt::print("{}: NEES6 {:.1f}, change {:.1f}, inconsistency {:.2f}, {}{}\n", name, nees,
             found.change.statistic, found.inconsistency, found.settled ? "settled" : "not settled",
             found.one_chip ? ", one chip" : "");
  const auto sd = [&](Eigen::Index i) { return std::sqrt(found.covariance(i, i)); };
  for (Eigen::Index i = 0; i < 3; ++i) {
    fmt::print("    psi {:8.1f} ({:.1f}) mdeg, r {:8.1f} ({:.1f}) mm\n", 1e3 * kDegPerRad * error[i],
               1e3 * kDegPerRad * sd(i), kMmPerM * error[3 + i], kMmPerM * sd(3 + i));
  }
}

void account(const Result<batch::BatchMounting>& found, const batch_pairs::TrueSensor& truth,
             const std::string& each, Totals& totals) {
  if (!found) {
    ++totals.refused;
    totals.sentence = found.error().text();
    return;
  }
  const auto error = batch_pairs::error_of(*found, truth);
  const double nees = batch_pairs::nees6(*found, error);
  if (!each.empty()) print_each(each, *found, error, nees);
  ++totals.found;
  totals.sure_and_wrong += nees > kSurelyWrong ? 1 : 0;
  totals.worst_nees = std::max(totals.worst_nees, nees);
  totals.worst_psi_rad = std::max(totals.worst_psi_rad, error.segment<3>(batch::kPsi).norm());
  totals.worst_r_m = std::max(totals.worst_r_m, error.segment<3>(batch::kLeverArm).norm());
}

std::vector<Totals> run(const standard_drive::Truth& truth, const std::vector<Case>& cases,
                        const Options& options, std::uint64_t seed) {
  batch_pairs::PairOptions drawn;
  drawn.reference_class = options.reference_class;
  const auto run = batch_pairs::run(truth, drawn, seed);
  std::vector<Totals> totals(cases.size());
  for (std::size_t c = 0; c < cases.size(); ++c) {
    for (std::size_t i = 0; i < standard_drive::kStudies; ++i) {
      Pair pair{run.reference, run.studies[i]};
      // Another drive: the same one, half a minute on, so that nothing fits anything.
      ImuRecord other = run.studies[i];
      std::rotate(other.omega_radps.begin(), other.omega_radps.begin() + 3000, other.omega_radps.end());
      std::rotate(other.f_mps2.begin(), other.f_mps2.begin() + 3000, other.f_mps2.end());
      cases[c].make(pair, other);
      account(batch::estimate_mounting(pair.reference, pair.study), batch_pairs::true_sensor(run.draw, i),
              options.each ? fmt::format("{}, seed {}, S-IMU {}", cases[c].name, seed, i + 1) : std::string{},
              totals[c]);
    }
  }
  return totals;
}

std::vector<Totals> run_all(const std::vector<Case>& cases, const Options& options) {
  const standard_drive::Truth truth(imusim::Scenario{}, options.duration_s, imusim::WorldKind::kHarsh);
  std::vector<std::vector<Totals>> each(options.seeds);
  on_all_threads(options.seeds, options.threads,
                 [&](std::size_t i) { each[i] = run(truth, cases, options, options.first + i); });
  std::vector<Totals> sums(cases.size());
  for (const auto& one : each)
    for (std::size_t c = 0; c < cases.size(); ++c) sums[c].add(one[c]);
  return sums;
}

bool print(const std::vector<Case>& cases, const std::vector<Totals>& totals) {
  bool ok = true;
  fmt::print("{:40} {:>7} {:>5} {:>14} {:>11} {:>9} {:>9}\n", "what is wrong", "refused", "found",
             "sure and wrong", "worst NEES6", "psi deg", "r mm");
  for (std::size_t c = 0; c < cases.size(); ++c) {
    const Totals& t = totals[c];
    fmt::print("{:40} {:7} {:5} {:14} {:11.1f} {:9.3f} {:9.1f}\n", cases[c].name, t.refused, t.found,
               t.sure_and_wrong, t.worst_nees, t.worst_psi_rad * kDegPerRad, t.worst_r_m * kMmPerM);
    if (!t.sentence.empty()) fmt::print("    \"{}\"\n", t.sentence);
    ok = ok && t.sure_and_wrong == 0;
  }
  return ok;
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app(
      "What the batch estimate makes of records that are wrong: 0 when it is never sure of a wrong one");
  app.add_option("--seeds", options.seeds, "runs of three S-IMUs each");
  app.add_option("--first", options.first, "first seed");
  app.add_option("--threads", options.threads, "runs at a time");
  app.add_option("--duration", options.duration_s, "length of the drive, s");
  app.add_option("--reference-class", options.reference_class, "1 (navigation grade) to 5");
  app.add_option("--only", options.only, "cases whose name holds this text");
  app.add_flag("--each", options.each, "prints every mounting that is found");
  CLI11_PARSE(app, argc, argv);
  std::vector<Case> chosen;
  for (Case& one : cases())
    if (one.name.find(options.only) != std::string::npos) chosen.push_back(std::move(one));
  return print(chosen, run_all(chosen, options)) ? 0 : 1;
}
