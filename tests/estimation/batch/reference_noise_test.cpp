#include "estimation/batch/reference_noise.h"

#include <gtest/gtest.h>
#include <algorithm>
#include <random>

#include "estimation/batch/normal_equations.h"

namespace {

using namespace imuscope::batch;

/// Two IMUs that are one: motion that comes and goes, and noise of each, drawn in time.
struct Scene {
  double reference_sd = 0.0;
  double study_sd = 1.0;
  double excess_sd = 0.0;  ///< of the reference's noise, in the second half of the record, on top
  double quietest = 0.01;  ///< the least that the motion is, of its size

  /// The reference's share of the noise at a band, as estimated and as it is.
  struct Share {
    Eigen::Vector2d found;
    double drawn;
  };

  [[nodiscard]] Share share() const {
    constexpr Eigen::Index kInstants = 15'000;
    constexpr double kRate_hz = 50.0;
    std::mt19937_64 random(11);
    std::normal_distribution<double> normal;
    Eigen::MatrixXd reference = Eigen::MatrixXd::Zero(kInstants, kReferenceColumns);
    Eigen::MatrixXd study(kInstants, 6);
    Eigen::RowVectorXd motion = Eigen::RowVectorXd::Zero(6);
    double of_reference = 0.0;
    for (Eigen::Index i = 0; i < kInstants; ++i) {
      const double strength = std::max(quietest, 0.5 * (1.0 - std::cos(0.0041 * static_cast<double>(i))));
      const double sd = i < kInstants / 2 ? reference_sd : std::hypot(reference_sd, excess_sd);
      of_reference += sd * sd / (sd * sd + study_sd * study_sd) / kInstants;
      for (Eigen::Index j = 0; j < 6; ++j) {
        motion[j] = 0.7 * motion[j] + strength * 3.0 * normal(random);
        reference(i, j) = motion[j] + sd * normal(random);
        study(i, j) = motion[j] + study_sd * normal(random);
      }
    }
    Problem problem;
    problem.plan = plan_windows(std::vector<char>(kInstants, 1), kRate_hz, 8.0);
    problem.bands = Bands(problem.plan.n_frequencies);
    problem.constant = window_spectrum(problem.plan);
    problem.reference = Spectra(problem.plan, reference);
    const auto windows = static_cast<Eigen::Index>(problem.plan.starts.size());
    problem.from_middle_s.setZero(windows);
    Estimate rigid;
    rigid.deviation.assign(static_cast<std::size_t>(problem.bands.size()), DeviationVector::Zero());
    const Residuals e = residuals(problem, Spectra(problem.plan, study), rigid);
    const NoiseBands noise(problem.bands, windows, problem.plan.n_frequencies, e,
                           Eigen::MatrixX2d::Zero(problem.bands.size(), 2));
    const ReferenceNoise found(problem.plan, problem.bands, problem.reference, e, rigid.sensor, noise);
    return {found.mean_share(noise, problem.bands.size() / 2), of_reference};
  }
};

TEST(ReferenceNoise, TellsAPerfectReferenceFromOneLikeTheSensorAndFromAWorseOne) {
  for (const double reference_sd : {0.0, 0.5, 1.0, 2.0}) {
    Scene scene;
    scene.reference_sd = reference_sd;
    const auto [found, drawn] = scene.share();
    EXPECT_NEAR(found[0], drawn, 0.06) << reference_sd;
    EXPECT_NEAR(found[1], drawn, 0.06) << reference_sd;
  }
}

/// No window in which the vehicle rests: what the reference shows in its quietest one is motion.
TEST(ReferenceNoise, NeedsNoRest) {
  for (const double reference_sd : {0.0, 2.0}) {
    Scene scene;
    scene.reference_sd = reference_sd;
    scene.quietest = 0.3;
    const auto [found, drawn] = scene.share();
    // Before the record it is 0.5 +- 0.5.
    EXPECT_NEAR(found[0], drawn, 0.15) << reference_sd;
    EXPECT_NEAR(found[1], drawn, 0.15) << reference_sd;
  }
}

/// Vibration that one of the two shows, aliased, only while the engine turns so.
TEST(ReferenceNoise, FollowsNoiseThatComesAndGoes) {
  Scene scene;
  scene.reference_sd = 0.1;
  scene.excess_sd = 2.0;
  const auto [found, drawn] = scene.share();
  EXPECT_NEAR(found[0], drawn, 0.1);
  EXPECT_NEAR(found[1], drawn, 0.1);
}

TEST(ReferenceNoise, IsOfTheGivenShareWhereItIsSaid) {
  const Bands bands(12);
  const Residuals e = Residuals::Random(3 * 12, 6);
  const NoiseBands noise(bands, 3, 12, e, Eigen::MatrixX2d::Zero(bands.size(), 2));
  const auto half = ReferenceNoise::even(bands, 0.5);
  EXPECT_NEAR(half.mean_share(noise, 1)[0], 0.5, 1e-12);
  EXPECT_EQ(half.shifted(0).mean_share(noise, 1), half.mean_share(noise, 1));
}

}  // namespace
