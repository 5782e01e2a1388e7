/// How well the batch estimate does what it claims: Monte-Carlo of a drive with three S-IMUs in a world that
/// it is not told of. Prints errors beside the published sd, NEES of (psi, r) and coverage, with the goals.
/// A mean misses its goal where it lies beyond the band by more than 3.3 of its own sd, which is that of the seeds.

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <Eigen/Core>
#include <array>
#include <cmath>
#include <fstream>
#include <map>
#include <mutex>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "base/units.h"
#include "estimation/batch/batch_mounting.h"
#include "estimation/calibration/estimator.h"
#include "tools/trials/all_threads.h"
#include "tools/trials/batch_pairs.h"
#include "tools/trials/own_sd.h"
#include "tools/trials/standard_drive.h"

namespace {

using namespace imuscope;

struct Options {
  std::size_t seeds = 20;
  std::size_t threads = 1;
  std::uint64_t first = 1;
  double duration_s = 900.0;
  std::string results;  ///< file of the S-IMUs so far; empty: none
  batch_pairs::PairOptions pair;

  /// What seeds of one file have in common.
  [[nodiscard]] std::string world() const {
    return fmt::format("world {} class {} duration {}",
                       pair.world == imusim::WorldKind::kHarsh ? "harsh" : "ideal", pair.reference_class,
                       duration_s);
  }
};

/// Parameters whose intervals are pooled.
struct Kind {
  const char* name;
  Eigen::Index first;
  Eigen::Index count;
};
constexpr std::array<Kind, 13> kKinds{{{"psi", batch::kPsi, 3},
                                       {"lever arm", batch::kLeverArm, 3},
                                       {"t_d", batch::kTimeOffset, 1},
                                       {"clock rate", batch::kClockRate, 1},
                                       {"gyro scale", batch::kGyroShape, 3},
                                       {"gyro axes", batch::kGyroShape + 3, 3},
                                       {"triads apart", batch::kAlpha, 3},
                                       {"accel scale", batch::kAccelShape, 3},
                                       {"accel axes", batch::kAccelShape + 3, 3},
                                       {"accel delay", batch::kAccelDelay, 1},
                                       {"ref. delay", batch::kReferenceAccelDelay, 1},
                                       {"accel places", batch::kPlaces, 6},
                                       {"g-sensitivity", batch::kGSensitivity, 9}}};

/// What came of one S-IMU.
struct Outcome {
  bool found = false;
  bool one_chip = false;
  bool settled = false;
  double nees = 0.0;
  batch::ParameterVector error = batch::ParameterVector::Zero();
  batch::ParameterVector variance = batch::ParameterVector::Ones();
};
using Seed = std::array<Outcome, standard_drive::kStudies>;

/// Sums over S-IMUs and seeds.
struct Totals {
  int n = 0;
  int failed = 0;
  int chips = 0;
  int unsettled = 0;
  double nees = 0.0;
  batch::ParameterVector error2 = batch::ParameterVector::Zero();
  batch::ParameterVector variance = batch::ParameterVector::Zero();
  batch::ParameterVector z2 = batch::ParameterVector::Zero();
  batch::ParameterVector inside = batch::ParameterVector::Zero();  ///< the 95 % interval

  void add(const Outcome& one) {
    if (!one.found) {
      ++failed;
      return;
    }
    ++n;
    chips += one.one_chip ? 1 : 0;
    unsettled += one.settled ? 0 : 1;
    nees += one.nees;
    error2 += one.error.cwiseAbs2();
    variance += one.variance;
    const batch::ParameterVector share = one.error.cwiseAbs2().cwiseQuotient(one.variance);
    z2 += share;
    constexpr double k95 = 1.96;
    inside += (share.array() < k95 * k95).cast<double>().matrix();
  }
};

/// The S-IMUs of a seed share one reference, whose axes are off for all of them: what scatters is the seeds.
struct Sums {
  Totals all;
  std::vector<Totals> of_seeds;  ///< those in which one was found

  /// Sd of the mean over all S-IMUs of what `value` gives of a seed's total, S-IMUs counted; at least what they
  /// would have by themselves.
  template <typename Value>
  [[nodiscard]] double sd_of_mean(const Value& value, double alone) const {
    const double mean = value(all) / all.n;
    double sum = 0.0;
    for (const Totals& seed : of_seeds) sum += std::pow(value(seed) - seed.n * mean, 2);
    return std::max(alone, std::sqrt(sum) / all.n);
  }
};

Seed run(const standard_drive::Truth& truth, const Options& options, std::uint64_t seed) {
  const auto run = batch_pairs::run(truth, options.pair, seed);
  Seed outcomes;
  for (std::size_t i = 0; i < standard_drive::kStudies; ++i) {
    const auto found = batch::estimate_mounting(run.reference, run.studies[i]);
    if (!found) continue;
    Outcome& out = outcomes[i];
    out.found = true;
    out.one_chip = found->one_chip;
    out.settled = found->settled;
    out.error = batch_pairs::error_of(*found, batch_pairs::true_sensor(run.draw, i));
    out.variance = found->covariance.diagonal();
    out.nees = batch_pairs::nees6(*found, out.error);
  }
  return outcomes;
}

/// Seeds that were run, kept in a text file, so that a long run may be broken off and taken up again.
class Results {
 public:
  explicit Results(const Options& options) : file_(options.results) {
    if (file_.empty()) return;
    std::ifstream in(file_);
    std::string line;
    if (std::getline(in, line)) {
      if (line != options.world()) throw std::runtime_error(file_ + " is of another study: " + line);
      while (std::getline(in, line)) read(line);
    } else {
      std::ofstream(file_) << options.world() << '\n';
    }
  }

  [[nodiscard]] bool has(std::uint64_t seed) const { return seeds_.contains(seed); }
  [[nodiscard]] const Seed& at(std::uint64_t seed) const { return seeds_.at(seed); }

  void add(std::uint64_t seed, const Seed& outcomes) {
    const std::lock_guard<std::mutex> lock(mutex_);
    seeds_[seed] = outcomes;
    if (file_.empty()) return;
    std::ofstream out(file_, std::ios::app);
    out.precision(17);
    out << seed;
    for (const Outcome& one : outcomes) {
      out << ' ' << one.found << ' ' << one.one_chip << ' ' << one.settled << ' ' << one.nees;
      for (const double value : one.error) out << ' ' << value;
      for (const double value : one.variance) out << ' ' << value;
    }
    out << '\n';
  }

 private:
  /// A line that was cut short is run again.
  void read(const std::string& line) {
    std::istringstream in(line);
    std::uint64_t seed = 0;
    Seed outcomes;
    in >> seed;
    for (Outcome& one : outcomes) {
      in >> one.found >> one.one_chip >> one.settled >> one.nees;
      for (double& value : one.error) in >> value;
      for (double& value : one.variance) in >> value;
    }
    if (in) seeds_[seed] = outcomes;
  }

  std::string file_;
  std::map<std::uint64_t, Seed> seeds_;
  std::mutex mutex_;
};

using Variances6 = Eigen::Matrix<double, 6, 1>;

/// Posterior Cramer-Rao bound of (psi, r): variances that the same states and priors have where the motion is
/// as it was, the noise is known and everything is linear and Gaussian, and what the reference's own axes add to them. A Kalman filter tells just these; its
/// covariance hangs on the motion and hardly on the draw, so that one run does. Of a rough road it has what shakes
/// below kTop_hz, where the estimate ends. Where the reference is as
/// noisy as the sensors (class 5), the filter's windows lose a little, and the bound is an upper one.
Variances6 bound_of(const standard_drive::Truth& truth, const Options& options) {
  const int reference_class = options.pair.reference_class;
  EstimatorConfig config = standard_drive::configuration(truth.motion(), reference_class);
  config.navigation.enabled = config.gnss.enabled = false;
  const batch::SensorClass sensor;
  const auto alike = [](double value) { return Vector3{value, value, value}; };
  for (std::size_t i = 0; i < config.studies.size(); ++i) {
    SImuConfig& study = config.studies[i];
    study.blocks = kCompleteSImuBlocks;
    study.average_samples = reference_class < imusim::kReferenceClasses ? 1 : 0;
    study.prior_C_b_s = imuscope::to_array(standard_drive::mounting_of(i));
    study.prior_boresight_sd_rad = alike(1.0);
    study.prior_t_d_s = standard_drive::kTimeOffset_s;
    study.prior_r_bs_b_m = imuscope::to_array(standard_drive::lever_arm_of(i));
    study.prior_r_bs_b_sd_m = alike(sensor.lever_arm_sd_m);
    study.turn_on_gyro_sd_radps = alike(sensor.gyro_bias_sd_radps);
    study.turn_on_accel_sd_mps2 = alike(sensor.accel_bias_sd_mps2);
    study.prior_gyro_scale_sd = alike(sensor.gyro_scale_sd);
    study.prior_accel_scale_sd = alike(sensor.accel_scale_sd);
    study.prior_axes_sd_rad = 0.5 * sensor.axis_sd_rad;
    study.prior_accel_boresight_sd_rad = alike(sensor.triad_sd_rad);
    study.prior_accel_t_d_sd_s = study.prior_reference_accel_t_d_sd_s = sensor.accel_delay_sd_s;
    study.prior_place_sd_m = sensor.place_sd_m;
    study.prior_g_sensitivity_sd = sensor.g_sensitivity_sd;
  }
  Estimator filter(config);
  imusim::Random random(options.first, "study");
  standard_drive::DrawOptions drawn;
  drawn.reference_class = reference_class;
  drawn.mtx.gyro_noise = imusim::GyroNoiseChoice::kAllDynamic;
  imusim::Scenario same_drive;
  if (options.pair.world == imusim::WorldKind::kHarsh) same_drive.rough_road_to_hz = batch::kTop_hz;
  const standard_drive::Truth ideal(same_drive, options.duration_s);
  standard_drive::Instruments instruments(ideal, standard_drive::draw(drawn, random, options.first),
                                          options.first);
  for (std::size_t k = 0; k < ideal.ticks(); ++k) {
    const standard_drive::Tick& tick = instruments.next();
    for (const Sample& sample : tick) filter.add(sample);
    filter.advance(tick.front().arrival);
  }
  Variances6 mean = Variances6::Zero();
  for (std::size_t i = 0; i < standard_drive::kStudies; ++i) {
    const Vector3& psi = filter.study(i).sd_psi_rad;
    const Vector3& r = filter.study(i).sd_r_bs_b_m;
    for (Eigen::Index k = 0; k < 3; ++k) {
      const auto axis = static_cast<std::size_t>(k);
      mean[k] += psi[axis] * psi[axis] / standard_drive::kStudies;
      mean[3 + k] += r[axis] * r[axis] / standard_drive::kStudies;
    }
  }
  // What no drive shows: each axis of the reference leans by half of a pair's departure, and its scale is the
  // lever arm's where forces come from angular acceleration.
  const imusim::Imperfections unseen =
      imusim::reference_imperfections(options.pair.world, imusim::reference_class(reference_class));
  for (std::size_t i = 0; i < standard_drive::kStudies; ++i) {
    mean.head<3>().array() += std::pow(0.5 * unseen.non_orthogonality_sd_rad, 2) / standard_drive::kStudies;
    mean.tail<3>().array() +=
        (unseen.scale_sd * standard_drive::lever_arm_of(i)).array().square() / standard_drive::kStudies;
  }
  return mean;
}

/// Every seed on its own; summed in their order, so that the number of threads changes nothing.
Sums run_all(const standard_drive::Truth& truth, const Options& options) {
  Results results(options);
  std::vector<std::uint64_t> missing;
  for (std::uint64_t seed = options.first; seed < options.first + options.seeds; ++seed)
    if (!results.has(seed)) missing.push_back(seed);
  on_all_threads(missing.size(), options.threads,
                 [&](std::size_t i) { results.add(missing[i], run(truth, options, missing[i])); });
  Sums sum;
  for (std::uint64_t seed = options.first; seed < options.first + options.seeds; ++seed) {
    Totals of_seed;
    for (const Outcome& one : results.at(seed)) {
      sum.all.add(one);
      of_seed.add(one);
    }
    if (of_seed.n > 0) sum.of_seeds.push_back(of_seed);
  }
  return sum;
}

/// Whether a mean is within its band, or beyond it by no more than chance makes of so few runs.
bool holds(double value, double low, double high, double sd) {
  return low - kOwnSd * sd <= value && value <= high + kOwnSd * sd;
}

bool print(const Sums& results, const Variances6& bound, const Options& options) {
  const Totals& t = results.all;
  constexpr double kMdeg = 1e3 * kDegPerRad;
  const double n = t.n;
  const batch::ParameterVector rms = (t.error2 / n).cwiseSqrt();
  const batch::ParameterVector sd = (t.variance / n).cwiseSqrt();
  fmt::print(
      "reference class {}, {} world, {} S-IMUs, {} without a mounting, {} not settled, {} taken for one "
      "chip\n",
      options.pair.reference_class, options.pair.world == imusim::WorldKind::kHarsh ? "harsh" : "ideal", t.n,
      t.failed, t.unsettled, t.chips);
  fmt::print("  psi  rms {:.1f} / {:.1f} / {:.1f} mdeg, sd {:.1f} / {:.1f} / {:.1f}\n", rms[0] * kMdeg,
             rms[1] * kMdeg, rms[2] * kMdeg, sd[0] * kMdeg, sd[1] * kMdeg, sd[2] * kMdeg);
  fmt::print("  r    rms {:.2f} / {:.2f} / {:.2f} mm, sd {:.2f} / {:.2f} / {:.2f}\n", rms[3] * kMmPerM,
             rms[4] * kMmPerM, rms[5] * kMmPerM, sd[3] * kMmPerM, sd[4] * kMmPerM, sd[5] * kMmPerM);
  constexpr double kRatioGoal = 1.15;
  const Variances6 least = bound.cwiseSqrt();
  fmt::print("  bound     {:.1f} / {:.1f} / {:.1f} mdeg, {:.2f} / {:.2f} / {:.2f} mm\n", least[0] * kMdeg,
             least[1] * kMdeg, least[2] * kMdeg, least[3] * kMmPerM, least[4] * kMmPerM, least[5] * kMmPerM);
  const double psi_ratio = std::sqrt(t.error2.head<3>().sum() / n / bound.head<3>().sum());
  const double r_ratio = std::sqrt(t.error2.segment<3>(batch::kLeverArm).sum() / n / bound.tail<3>().sum());
  fmt::print("  rms over bound: psi {:.3f}, r {:.3f} (goal {})\n", psi_ratio, r_ratio, kRatioGoal);
  fmt::print("  t_d  rms {:.0f} us, sd {:.0f}\n", rms[batch::kTimeOffset] * 1e6,
             sd[batch::kTimeOffset] * 1e6);
  // Three components of n S-IMUs: relative sd of their root mean square.
  const double ratio_sd = 1.0 / std::sqrt(6.0 * n);
  const auto sharp = [&](double ratio) { return ratio <= kRatioGoal * (1.0 + kOwnSd * ratio_sd); };
  bool ok = t.failed == 0 && sharp(psi_ratio) && sharp(r_ratio);
  fmt::print("  {:14} {:>9} {:>9} {:>8} {:>9} {:>9}  (95 % intervals: goal 93 to 97)\n", "kind", "rms", "sd",
             "mean z2", "inside %", "own sd");
  for (const Kind& kind : kKinds) {
    const auto count = static_cast<double>(kind.count);
    const double inside = 100.0 * t.inside.segment(kind.first, kind.count).sum() / (count * n);
    fmt::print("  {:14} {:9.2e} {:9.2e} {:8.2f} {:9.1f}", kind.name,
               std::sqrt(t.error2.segment(kind.first, kind.count).sum() / (count * n)),
               std::sqrt(t.variance.segment(kind.first, kind.count).sum() / (count * n)),
               t.z2.segment(kind.first, kind.count).sum() / (count * n), inside);
    const auto share = [&](const Totals& of) {
      return of.inside.segment(kind.first, kind.count).sum() / count;
    };
    const double own_sd = 100.0 * results.sd_of_mean(share, std::sqrt(0.95 * 0.05 / (count * n)));
    const bool good = holds(inside, 93.0, 97.0, own_sd);
    fmt::print(" {:9.2f}  {}\n", own_sd, good ? "" : "MISSED");
    ok = ok && good;
  }
  const double nees = t.nees / n;
  const auto sum_of = [](const Totals& of) { return of.nees; };
  const double nees_sd = results.sd_of_mean(sum_of, std::sqrt(12.0 / n));
  fmt::print("  NEES6 {:.2f}, own sd {:.2f} (goal 5.4 to 6.6)\n", nees, nees_sd);
  const bool good = ok && holds(nees, 5.4, 6.6, nees_sd);
  fmt::print("  {}\n", good ? "goals met" : "a goal is missed by more than chance");
  return good;
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  std::string world = "harsh";
  CLI::App app("Errors and consistency of the batch estimate in simulated worlds");
  app.add_option("--seeds", options.seeds, "runs of three S-IMUs each");
  app.add_option("--first", options.first, "first seed");
  app.add_option("--threads", options.threads, "runs at a time");
  app.add_option("--duration", options.duration_s, "length of the drive, s");
  app.add_option("--reference-class", options.pair.reference_class, "1 (navigation grade) to 5");
  app.add_option("--results", options.results, "file that keeps the seeds run; only missing ones are run");
  app.add_option("--world", world, "ideal or harsh")->check(CLI::IsMember({"ideal", "harsh"}));
  CLI11_PARSE(app, argc, argv);
  options.pair.world = world == "harsh" ? imusim::WorldKind::kHarsh : imusim::WorldKind::kIdeal;
  try {
    const standard_drive::Truth truth(imusim::Scenario{}, options.duration_s, options.pair.world);
    return print(run_all(truth, options), bound_of(truth, options), options) ? 0 : 1;
  } catch (const std::runtime_error& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 2;
  }
}
