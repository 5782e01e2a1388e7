/// What one epoch of the estimator costs: one R sample and one sample of each of three S-IMUs at 100 Hz, GNSS
/// at 5 Hz, mechanisation and everything else included; beside it the covariance alone, and the same
/// covariance written densely with Eigen in Joseph's form. Medians of processor time in one run on one core.

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <vector>

#include "calibration/covariance_kernel.h"
#include "calibration/estimator.h"
#include "calibration/study_model.h"
#include "tools/studies/dense_joseph.h"
#include "tools/studies/study_drive.h"

namespace {

using imuscope::InstructionSet;
using study_drive::processor_time_s;

constexpr std::size_t kStudies = study_drive::kStudies;
constexpr std::size_t kUpdates = 2 * kStudies;

struct Flavour {
  InstructionSet set;
  DenseJosephEpoch joseph;
};

struct Size {
  const char* what;
  std::uint32_t blocks;
};

constexpr std::array<Size, 3> kSizes{{
    {"6 a S-IMU (psi, r)", imuscope::kPaperStudyBlocks},
    {"12 a S-IMU (and biases)", imuscope::kPaperStudyBlocks | imuscope::kBiasStudyBlocks},
    {"19 a S-IMU (all)", imuscope::kFullStudyBlocks},
}};

double median_us(int repeats, double epochs, const std::function<void()>& work) {
  std::vector<double> times;
  for (int i = 0; i < repeats; ++i) {
    const double begin_s = processor_time_s();
    work();
    times.push_back((processor_time_s() - begin_s) / epochs * 1e6);
  }
  std::nth_element(times.begin(), times.begin() + repeats / 2, times.end());
  return times[static_cast<std::size_t>(repeats / 2)];
}

/// The filter then runs from the first sample on.
imuscope::EstimatorConfig known_mounting(const imusim::Motion& motion) {
  imuscope::EstimatorConfig config = study_drive::configuration(motion);
  for (std::size_t i = 0; i < kStudies; ++i) {
    config.studies[i].prior_C_b_s = study_drive::to_array(study_drive::mounting_of(i));
    config.studies[i].prior_r_bs_b_m = study_drive::to_array(study_drive::lever_arm_of(i));
    config.studies[i].prior_t_d_s = study_drive::kTimeOffset_s;
  }
  return config;
}

std::size_t dimension(const Size& size) {
  return imuscope::kNavigationStates + kStudies * imuscope::StudyLayout::make(size.blocks, 0).size;
}

double estimator_us(const Size& size, InstructionSet set, const std::vector<study_drive::Tick>& drive,
                    const imuscope::EstimatorConfig& pattern, int repeats) {
  imuscope::EstimatorConfig config = pattern;
  config.instruction_set = set;
  for (imuscope::StudyConfig& study : config.studies) study.blocks = size.blocks;
  return median_us(repeats, static_cast<double>(drive.size()), [&] {
    imuscope::Estimator estimator(config);
    for (const study_drive::Tick& tick : drive) {
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
  const std::size_t own = (n - imuscope::kNavigationStates) / kStudies;
  std::array<imuscope::SparseMeasurement, kUpdates> H;
  for (std::size_t u = 0; u < kUpdates; ++u) {
    const bool gyro = u % 2 == 0;
    const std::size_t first = imuscope::kNavigationStates + u / 2 * own;
    for (std::size_t column = first; column + 3 <= first + own; column += gyro ? 6 : 3)
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
      for (std::size_t u = 0; u < kUpdates; ++u) {
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
      const double trace =
          epoch(P.data(), Phi.data(), Q.data(), H.data(), R.data(), static_cast<std::size_t>(n), kUpdates);
      if (!std::isfinite(trace)) fmt::print(stderr, "the dense update lost its numbers\n");
    }
  });
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Cost of one epoch of the estimator, beside a dense Joseph update of the same size and flags"};
  int repeats = 5;
  double seconds = 90.0;
  app.add_option("--repeats", repeats, "runs of which the median counts")->check(CLI::Range(1, 1000));
  app.add_option("--seconds", seconds, "drive that each run goes through")->check(CLI::Range(1.0, 900.0));
  CLI11_PARSE(app, argc, argv);

  const study_drive::Truth truth(imusim::Scenario{}, seconds);
  study_drive::Instruments instruments(truth, study_drive::Draw{}, 1);
  std::vector<study_drive::Tick> drive;
  for (std::size_t k = 0; k < truth.ticks(); ++k) drive.push_back(instruments.next());
  const imuscope::EstimatorConfig pattern = known_mounting(truth.motion());
  const std::array<Flavour, 3> flavours{{{InstructionSet::kBaseline, dense_joseph_baseline},
                                         {InstructionSet::kAvx2, dense_joseph_avx2},
                                         {InstructionSet::kAvx512, dense_joseph_avx512}}};
  fmt::print("{:26} {:>6} {:>9} {:>12} {:>12} {:>12} {:>10} {:>10}\n", "states", "n", "set", "epoch us",
             "covariance us", "Joseph us", "J/epoch", "J/cov");
  for (const Size& size : kSizes) {
    for (const Flavour& flavour : flavours) {
      const imuscope::CovarianceLoops* loops = imuscope::covariance_loops(flavour.set);
      if (loops == nullptr) continue;
      const double whole = estimator_us(size, flavour.set, drive, pattern, repeats);
      const double covariance = covariance_us(size, flavour.set, repeats);
      const double joseph = joseph_us(size, flavour.joseph, repeats);
      fmt::print("{:26} {:>6} {:>9} {:>12.2f} {:>12.2f} {:>12.1f} {:>10.1f} {:>10.1f}\n", size.what,
                 dimension(size), loops->name, whole, covariance, joseph, joseph / whole,
                 joseph / covariance);
    }
  }
  fmt::print("goals: 72 states at most 12 us an epoch with AVX2 or AVX-512, 30 us baseline\n");
  return 0;
}
