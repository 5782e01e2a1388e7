/// How well the batch estimate does what it claims: Monte-Carlo of a drive with three S-IMUs in a world that
/// it is not told of. Prints errors beside the published sd, NEES of (psi, r) and coverage, with the goals.
///
/// A gyro triad whose axes are not at right angles has several frames that could be called its own. The truth
/// is turned to the one that the estimate publishes: x along the x gyro, y in the plane of the x and y gyros.

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <Eigen/Dense>
#include <atomic>
#include <thread>
#include <vector>

#include "base/units.h"
#include "batch/batch_mounting.h"
#include "navigation/so3.h"
#include "tools/studies/study_drive.h"

namespace {

using namespace imuscope;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Vector6 = Eigen::Matrix<double, 6, 1>;

struct Options {
  std::size_t seeds = 20;
  std::size_t threads = 1;
  std::uint64_t first = 1;
  double duration_s = 900.0;
  int reference_class = 1;
  imusim::WorldKind world = imusim::WorldKind::kHarsh;
};

/// Sums over S-IMUs and seeds.
struct Totals {
  int n = 0;
  int failed = 0;
  int chips = 0;
  double nees = 0.0;
  double t_d2 = 0.0, t_d_var = 0.0;
  Vector6 error2 = Vector6::Zero();
  Vector6 variance = Vector6::Zero();
  Vector6 inside = Vector6::Zero();  ///< within 1.96 sd
  double t_d_inside = 0.0;

  void add(const Totals& t) {
    n += t.n, failed += t.failed, chips += t.chips, nees += t.nees;
    t_d2 += t.t_d2, t_d_var += t.t_d_var, t_d_inside += t.t_d_inside;
    error2 += t.error2, variance += t.variance, inside += t.inside;
  }
};

/// C of A = L C with L lower triangular, its diagonal positive.
Matrix3d frame_of(const Matrix3d& gyro) {
  Matrix3d C;
  C.row(0) = gyro.row(0).normalized();
  C.row(1) = (gyro.row(1) - gyro.row(1).dot(C.row(0)) * C.row(0)).normalized();
  C.row(2) = C.row(0).cross(C.row(1));
  return C;
}

Matrix3d true_frame(const study_drive::Draw& draw, std::size_t study) {
  const auto& gyro = draw.studies[study].gyro;
  const Matrix3d shape = Matrix3d::Identity() + Matrix3d(gyro.scale.asDiagonal()) + gyro.misalignment;
  return frame_of(shape * study_drive::mounting_of(study));
}

void account(const batch::BatchMounting& found, const study_drive::Draw& draw, std::size_t study,
             Totals& totals) {
  const auto truth = study_drive::truth_of(draw, study);
  Vector6 error;
  error << -log_so3(found.sensor.C_b_s.transpose() * true_frame(draw, study)),
      study_drive::lever_arm_of(study) - found.sensor.lever_arm_b_m();
  const Eigen::Matrix<double, 6, 6> P = found.covariance.topLeftCorner<6, 6>();
  const double t_d_error = truth.t_d_s - found.sensor.x[batch::kTimeOffset];
  const double t_d_sd = found.sd(batch::kTimeOffset);
  ++totals.n;
  totals.chips += found.one_chip ? 1 : 0;
  totals.nees += error.dot(P.ldlt().solve(error));
  totals.error2 += error.cwiseAbs2();
  totals.variance += P.diagonal();
  totals.t_d2 += t_d_error * t_d_error;
  totals.t_d_var += t_d_sd * t_d_sd;
  constexpr double k95 = 1.96;
  totals.t_d_inside += std::abs(t_d_error) < k95 * t_d_sd ? 1.0 : 0.0;
  for (Eigen::Index i = 0; i < 6; ++i)
    totals.inside[i] += std::abs(error[i]) < k95 * std::sqrt(P(i, i)) ? 1.0 : 0.0;
}

batch::ImuRecord& record_of(std::vector<batch::ImuRecord>& records, const Sample& sample) {
  return records[sample.device - study_drive::kReferenceDevice];
}

Totals run(const study_drive::Truth& truth, const Options& options, std::uint64_t seed) {
  imusim::Random random(seed, "study");
  study_drive::DrawOptions drawn;
  drawn.world = options.world;
  drawn.reference_class = options.reference_class;
  drawn.mtx.gyro_noise = imusim::GyroNoiseChoice::kAllDynamic;
  const auto draw = study_drive::draw(drawn, random, seed);
  study_drive::Instruments instruments(truth, draw, seed);
  std::vector<batch::ImuRecord> records(1 + study_drive::kStudies);
  for (std::size_t k = 0; k < truth.ticks(); ++k) {
    for (const Sample& sample : instruments.next()) {
      if (sample.kind != SampleKind::kImu) continue;
      const auto vector = [](const Vector3& v) { return Vector3d(v[0], v[1], v[2]).cast<float>().eval(); };
      record_of(records, sample)
          .add(to_seconds(sample.time.time_since_epoch()), vector(sample.imu.omega_radps),
               vector(sample.imu.f_mps2));
    }
  }
  Totals totals;
  for (std::size_t i = 0; i < study_drive::kStudies; ++i) {
    const auto found = batch::estimate_mounting(records[0], records[1 + i]);
    if (found) {
      account(*found, draw, i, totals);
    } else {
      ++totals.failed;
    }
  }
  return totals;
}

/// Every seed on its own; summed in their order, so that the number of threads changes nothing.
Totals run_all(const Options& options) {
  const study_drive::Truth truth(imusim::Scenario{}, options.duration_s, options.world);
  std::vector<Totals> each(options.seeds);
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t i = next++; i < options.seeds; i = next++)
      each[i] = run(truth, options, options.first + i);
  };
  std::vector<std::thread> helpers;
  for (std::size_t i = 1; i < options.threads; ++i) helpers.emplace_back(work);
  work();
  for (std::thread& helper : helpers) helper.join();
  Totals sum;
  for (const Totals& totals : each) sum.add(totals);
  return sum;
}

bool print(const Totals& t, const Options& options) {
  constexpr double kMdeg = 1e3 * kDegPerRad;
  const double n = t.n;
  const Vector6 rms = (t.error2 / n).cwiseSqrt();
  const Vector6 sd = (t.variance / n).cwiseSqrt();
  fmt::print("reference class {}, {} world, {} S-IMUs, {} without a mounting, {} taken for one chip\n",
             options.reference_class, options.world == imusim::WorldKind::kHarsh ? "harsh" : "ideal", t.n,
             t.failed, t.chips);
  fmt::print("  psi  rms {:.1f} / {:.1f} / {:.1f} mdeg, sd {:.1f} / {:.1f} / {:.1f}\n", rms[0] * kMdeg,
             rms[1] * kMdeg, rms[2] * kMdeg, sd[0] * kMdeg, sd[1] * kMdeg, sd[2] * kMdeg);
  fmt::print("  r    rms {:.2f} / {:.2f} / {:.2f} mm, sd {:.2f} / {:.2f} / {:.2f}\n", rms[3] * kMmPerM,
             rms[4] * kMmPerM, rms[5] * kMmPerM, sd[3] * kMmPerM, sd[4] * kMmPerM, sd[5] * kMmPerM);
  fmt::print("  t_d  rms {:.0f} us, sd {:.0f}\n", std::sqrt(t.t_d2 / n) * 1e6,
             std::sqrt(t.t_d_var / n) * 1e6);
  const double nees = t.nees / n;
  const double psi = 100.0 * t.inside.head<3>().sum() / (3.0 * n);
  const double r = 100.0 * t.inside.tail<3>().sum() / (3.0 * n);
  const double t_d = 100.0 * t.t_d_inside / n;
  fmt::print("  95 % intervals hold: psi {:.1f} %, r {:.1f} %, t_d {:.1f} % (goal 93 to 97)\n", psi, r, t_d);
  fmt::print("  NEES6 {:.2f} (goal 5.4 to 6.6)\n", nees);
  const auto within = [](double value, double low, double high) { return value >= low && value <= high; };
  return t.failed == 0 && within(nees, 5.4, 6.6) && within(psi, 93, 97) && within(r, 93, 97) &&
         within(t_d, 93, 97);
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
  app.add_option("--reference-class", options.reference_class, "1 (navigation grade) to 5");
  app.add_option("--world", world, "ideal or harsh")->check(CLI::IsMember({"ideal", "harsh"}));
  CLI11_PARSE(app, argc, argv);
  options.world = world == "harsh" ? imusim::WorldKind::kHarsh : imusim::WorldKind::kIdeal;
  return print(run_all(options), options) ? 0 : 1;
}
