/// What one epoch of the estimator costs: one R sample and one sample of each of none to six S-IMUs at 100
/// Hz, GNSS at 5 Hz, mechanisation and everything else included; beside it the covariance alone, and the same
/// covariance written densely with Eigen in Joseph's form. Medians of processor time in one run on one core.

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "estimation/calibration/covariance_kernel.h"
#include "estimation/calibration/estimator.h"
#include "estimation/calibration/s_imu_model.h"
#include "tools/benchmarks/bench_report.h"
#include "tools/trials/dense_joseph.h"
#include "tools/trials/standard_drive.h"

namespace {

using imuscope::InstructionSet;

/// A navigation epoch without S-IMU has no update of its own; the dense one is then the prediction.
constexpr std::size_t kUpdatesOfStudy = 2;
/// Of an S-IMU with every state, one triad shows so many.
constexpr std::size_t kSeenStates = 30;
constexpr std::size_t kMostStudies = 2 * standard_drive::kStudies;

struct Flavour {
  InstructionSet set;
  DenseJosephEpoch joseph;
};

struct Size {
  const char* what;
  std::size_t studies;
  std::uint32_t blocks;
  /// 1: an update for every sample, as the dense filter beside it. 0: as the filter chooses, C-15.
  int average_samples = 1;
};

constexpr std::array<Size, 8> kSizes{{
    {"no S-IMU", 0, 0},
    {"3 x 6 (boresight, lever arm)", 3, imuscope::kPaperSImuBlocks},
    {"3 x 12 (and biases)", 3, imuscope::kPaperSImuBlocks | imuscope::kBiasSImuBlocks},
    {"3 x 19 (rigid)", 3, imuscope::kFullSImuBlocks},
    {"6 x 19 (rigid)", kMostStudies, imuscope::kFullSImuBlocks},
    {"3 x 19 (rigid), windows", 3, imuscope::kFullSImuBlocks, 0},
    {"3 x 45 (all), windows", 3, imuscope::kCompleteSImuBlocks, 0},
    {"6 x 45 (all), windows", kMostStudies, imuscope::kCompleteSImuBlocks, 0},
}};
/// Where the published goal of 12 us an epoch, 30 us without AVX, belongs: as the filter is shipped.
constexpr std::size_t kGoalStates = 72;
constexpr double kGoal_us = 12.0;
constexpr double kGoalBaseline_us = 30.0;

std::size_t updates(const Size& size) { return kUpdatesOfStudy * size.studies; }

double median_us(int repeats, double epochs, const std::function<void()>& work) {
  std::vector<double> times;
  for (int i = 0; i < repeats; ++i) {
    const double begin_s = bench::processor_time_s();
    work();
    times.push_back((bench::processor_time_s() - begin_s) / epochs * 1e6);
  }
  return bench::median(times);
}

/// Of the second three S-IMUs, which stand where the first three stand.
imuscope::DeviceIndex device_of(std::size_t study) {
  return static_cast<imuscope::DeviceIndex>(
      study < standard_drive::kStudies ? standard_drive::kFirstStudyDevice + study
                                       : standard_drive::kGnssDevice + 1 + study - standard_drive::kStudies);
}

/// The filter then runs from the first sample on.
imuscope::EstimatorConfig known_mounting(const imusim::Motion& motion, const Size& size) {
  imuscope::EstimatorConfig config = standard_drive::configuration(motion);
  const imuscope::SImuConfig pattern = config.studies.front();
  config.studies.assign(size.studies, pattern);
  for (std::size_t i = 0; i < size.studies; ++i) {
    const std::size_t place = i % standard_drive::kStudies;
    config.studies[i].device = device_of(i);
    config.studies[i].blocks = size.blocks;
    config.studies[i].average_samples = size.average_samples;
    config.studies[i].prior_C_b_s = imuscope::to_array(standard_drive::mounting_of(place));
    config.studies[i].prior_r_bs_b_m = imuscope::to_array(standard_drive::lever_arm_of(place));
    config.studies[i].prior_t_d_s = standard_drive::kTimeOffset_s;
  }
  return config;
}

std::size_t own_states(const Size& size) {
  return size.studies == 0 ? 0 : imuscope::SImuLayout::make(size.blocks, 0).size;
}

std::size_t dimension(const Size& size) {
  return imuscope::kNavigationStates + size.studies * own_states(size);
}

/// The drive as `studies` S-IMUs see it.
std::vector<standard_drive::Tick> drive_of(const std::vector<standard_drive::Tick>& three,
                                           std::size_t studies) {
  std::vector<standard_drive::Tick> drive;
  for (const standard_drive::Tick& tick : three) {
    standard_drive::Tick& own = drive.emplace_back();
    for (const imuscope::Sample& sample : tick) {
      const bool study =
          sample.device >= standard_drive::kFirstStudyDevice && sample.device < standard_drive::kGnssDevice;
      if (!study) {
        own.push_back(sample);
        continue;
      }
      for (std::size_t i = sample.device - standard_drive::kFirstStudyDevice; i < studies;
           i += standard_drive::kStudies) {
        own.push_back(sample);
        own.back().device = device_of(i);
      }
    }
  }
  return drive;
}

double estimator_us(InstructionSet set, const std::vector<standard_drive::Tick>& drive,
                    imuscope::EstimatorConfig config, int repeats) {
  config.instruction_set = set;
  return median_us(repeats, static_cast<double>(drive.size()), [&] {
    imuscope::Estimator estimator(config);
    for (const standard_drive::Tick& tick : drive) {
      for (const imuscope::Sample& sample : tick) estimator.add(sample);
      estimator.advance(tick.front().arrival);
    }
  });
}

/// P = I with a measurement of unit noise: the values do not matter, the operations do.
double covariance_us(const Size& size, InstructionSet set, int repeats) {
  const std::size_t n = dimension(size);
  imuscope::CovarianceKernel P(n, set);
  for (std::size_t i = 0; i < n; ++i) P.set(i, i, 1.0);
  imuscope::KernelTransition transition;
  for (std::size_t i = 0; i < imuscope::kNavigationStates; ++i) {
    transition.phi[i * imuscope::KernelTransition::kStride + i] = 0.999;
    transition.noise[i * imuscope::KernelTransition::kStride + i] = 1e-3;
  }
  const std::size_t own = own_states(size);
  std::array<imuscope::SparseMeasurement, kUpdatesOfStudy * kMostStudies> H;
  for (std::size_t u = 0; u < updates(size); ++u) {
    const bool gyro = u % 2 == 0;
    const std::size_t first = imuscope::kNavigationStates + u / 2 * own;
    const std::size_t step = gyro ? 6 : 3;
    for (std::size_t column = first; column + 3 <= first + std::min(own, kSeenStates); column += step)
      H[u].append(column, 3).h = {{{0.5, 0.1, 0.2}, {0.3, 0.4, 0.1}, {0.2, 0.1, 0.6}}};
    H[u].append(9, 3).h = {{{0.5, 0.1, 0.2}, {0.3, 0.4, 0.1}, {0.2, 0.1, 0.6}}};
    if (!gyro) H[u].append(12, 3).h = {{{0.5, 0.1, 0.2}, {0.3, 0.4, 0.1}, {0.2, 0.1, 0.6}}};
  }
  const std::array<double, 9> R{1, 0, 0, 0, 1, 0, 0, 0, 1};
  const std::array<double, 3> decay{0.999, 0.999, 0.999};
  const std::array<double, 3> variance{1e-3, 1e-3, 1e-3};
  constexpr int kEpochs = 2000;
  return median_us(repeats, kEpochs, [&] {
    for (int k = 0; k < kEpochs; ++k) {
      P.predict_navigation(transition);
      for (std::size_t u = 0; u < updates(size); ++u) {
        P.predict_states(imuscope::kNavigationStates + u / 2 * own, decay, variance);
        P.project(H[u], R);
        if (!P.update({0.1, 0.2, 0.3}, {true, true, true})) fmt::print(stderr, "update refused\n");
      }
    }
  });
}

double joseph_us(const Size& size, DenseJosephEpoch epoch, int repeats) {
  const auto n = static_cast<Eigen::Index>(dimension(size));
  Eigen::MatrixXd P = Eigen::MatrixXd::Identity(n, n);
  const Eigen::MatrixXd Phi = 0.999 * Eigen::MatrixXd::Identity(n, n);
  const Eigen::MatrixXd Q = 1e-3 * Eigen::MatrixXd::Identity(n, n);
  const Eigen::MatrixXd H = Eigen::MatrixXd::Constant(3, n, 0.01) + Eigen::MatrixXd::Identity(3, n);
  const Eigen::MatrixXd R = Eigen::MatrixXd::Identity(3, 3);
  constexpr int kEpochs = 50;
  return median_us(repeats, kEpochs, [&] {
    for (int k = 0; k < kEpochs; ++k) {
      const double trace = epoch(P.data(), Phi.data(), Q.data(), H.data(), R.data(),
                                 static_cast<std::size_t>(n), updates(size));
      if (!std::isfinite(trace)) fmt::print(stderr, "the dense update lost its numbers\n");
    }
  });
}

struct Costs {
  double epoch_us;
  double covariance_us;
  double joseph_us;
};

bench::Row epoch_row(const Size& size, InstructionSet set, const Costs& costs) {
  bench::Row row;
  row.group = "epoch";
  row.what =
      fmt::format("{} states, {}: {}", dimension(size), size.what, imuscope::covariance_loops(set)->name);
  row.ratio = costs.joseph_us / costs.epoch_us;
  row.against = "times faster than the dense covariance alone";
  row.value = costs.epoch_us;
  row.reference = costs.joseph_us;
  row.unit = "us";
  if (dimension(size) == kGoalStates && size.average_samples == 0) {
    row.goal =
        bench::Goal{bench::Goal::Side::kAtMost,
                    set == InstructionSet::kBaseline ? kGoalBaseline_us : kGoal_us, bench::Goal::Of::kValue};
  }
  return row;
}

bench::Row covariance_row(const Size& size, InstructionSet set, const Costs& costs) {
  bench::Row row = epoch_row(size, set, costs);
  row.group = "epoch, covariance";
  row.ratio = costs.joseph_us / costs.covariance_us;
  row.against = "times faster than the dense covariance";
  row.value = costs.covariance_us;
  row.goal.reset();
  return row;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Cost of one epoch of the estimator, beside a dense Joseph update of the same size and flags"};
  int repeats = 5;
  double seconds = 90.0;
  std::string json;
  app.add_option("--repeats", repeats, "runs of which the median counts")->check(CLI::Range(1, 1000));
  app.add_option("--seconds", seconds, "drive that each run goes through")->check(CLI::Range(1.0, 900.0));
  app.add_option("--json", json, "write the rows here")->type_name("FILE");
  CLI11_PARSE(app, argc, argv);

  const standard_drive::Truth truth(imusim::Scenario{}, seconds);
  standard_drive::Instruments instruments(truth, standard_drive::Draw{}, 1);
  std::vector<standard_drive::Tick> three;
  for (std::size_t k = 0; k < truth.ticks(); ++k) three.push_back(instruments.next());
  const std::array<Flavour, 3> flavours{{{InstructionSet::kBaseline, dense_joseph_baseline},
                                         {InstructionSet::kAvx2, dense_joseph_avx2},
                                         {InstructionSet::kAvx512, dense_joseph_avx512}}};
  std::vector<bench::Row> epochs;
  std::vector<bench::Row> covariances;
  std::vector<double> states;
  std::vector<double> best_us;
  for (const Size& size : kSizes) {
    const auto drive = drive_of(three, size.studies);
    const auto config = known_mounting(truth.motion(), size);
    double best = 0.0;
    for (const Flavour& flavour : flavours) {
      if (imuscope::covariance_loops(flavour.set) == nullptr) continue;
      const Costs costs{estimator_us(flavour.set, drive, config, repeats),
                        covariance_us(size, flavour.set, repeats), joseph_us(size, flavour.joseph, repeats)};
      epochs.push_back(epoch_row(size, flavour.set, costs));
      epochs.back().memory_mb =
          bench::peak_memory_mb([&] { (void)estimator_us(flavour.set, drive, config, 1); });
      covariances.push_back(covariance_row(size, flavour.set, costs));
      best = costs.epoch_us;
    }
    if (size.average_samples != 1) continue;
    states.push_back(static_cast<double>(dimension(size)));
    best_us.push_back(best);
  }
  epochs.insert(epochs.end(), covariances.begin(), covariances.end());
  // The dense one grows with the third power a update.
  epochs.push_back(bench::growth_row("epoch, with states 15 to 129", states, best_us, 2.0));
  return bench::finish(epochs, json);
}
