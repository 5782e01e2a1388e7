/// The worked example of docs/noise.md, run as it is written.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <random>
#include <string>

#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

constexpr double kRate_hz = 100.0;
constexpr double kWhiteVariance = 1e-4;
constexpr double kBiasVariance = 4e-6;
constexpr double kBeta_per_s = 1.0;
constexpr int kSamples = 60'000;

std::string read_file(const std::filesystem::path& path) {
  std::ifstream in(path);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// White noise and a Gauss-Markov process, `noisier` times as large.
void write_signal(const std::filesystem::path& file, unsigned seed, double noisier) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const double phi = std::exp(-kBeta_per_s / kRate_hz);
  double bias = std::sqrt(kBiasVariance) * normal(random);
  std::ofstream out(file);
  out.precision(12);
  out << "gyro_x\n";
  for (int i = 0; i < kSamples; ++i) {
    out << noisier * (bias + std::sqrt(kWhiteVariance) * normal(random)) << "\n";
    bias = phi * bias + std::sqrt(kBiasVariance * (1.0 - phi * phi)) * normal(random);
  }
}

class GuideExample : public testing::Test {
 protected:
  /// The first block in this language after the example's heading.
  std::string block(const std::string& language) const {
    const std::string begin = "```" + language + "\n";
    const auto from = guide_.find(begin, guide_.find("## A worked example"));
    if (from == std::string::npos) return {};
    return guide_.substr(from + begin.size(), guide_.find("```", from + begin.size()) - from - begin.size());
  }

  /// The mean that the example prints.
  double run(double noisier) {
    write_signal(folder_ / "parked.csv", 1, 1.0);
    write_signal(folder_ / "another_day.csv", 2, noisier);
    std::ofstream(folder_ / "filter.py") << block("python");
    std::ofstream(folder_ / "run.sh") << block("sh");
    const std::string command = "cd '" + folder_.string() + "' && PATH='" +
                                program_path("imuscope").parent_path().string() +
                                "':$PATH bash -e run.sh >out.txt 2>err.txt";
    EXPECT_EQ(std::system(command.c_str()), 0) << read_file(folder_ / "err.txt");
    const std::string said = read_file(folder_ / "out.txt");
    const std::string before = "innovation squared ";
    const auto at = said.find(before);
    EXPECT_NE(at, std::string::npos) << said;
    return at == std::string::npos ? 0.0 : std::stod(said.substr(at + before.size()));
  }

  std::filesystem::path folder_ = scratch_folder();
  std::string guide_ = read_file(source_path("docs/noise.md"));
};

// The mean of 60,000 squares has an sd of 0.6 %, the fitted white noise one of 0.6 %, too.
constexpr double kTolerance = 0.03;

TEST_F(GuideExample, AFilterFedWithTheModelIsConsistentOnAnotherDay) {
  EXPECT_NEAR(run(1.0), 1.0, kTolerance);
}

TEST_F(GuideExample, ASensorThatIsNoisierThanItsModelShows) {
  constexpr double kNoisier = 1.3;
  EXPECT_NEAR(run(kNoisier), kNoisier * kNoisier, kNoisier * kNoisier * kTolerance);
}

}  // namespace
}  // namespace imuscope::test
