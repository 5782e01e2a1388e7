#include "models/noise/power_law.h"

#include "models/noise/nnls.h"

namespace imuscope::noise {
namespace {

constexpr int kLevels = 24;
constexpr double kFastest = 2.0;  // of a sample: nearly white
constexpr double kFactor = 8.0;   // between neighbouring rates
constexpr int kRates = 10;        // the slowest: 2 / 8^9 a sample, 2^26 samples

/// G-39: the sum for an amplitude of 1.
std::vector<Component> unit_sum(const Component& power_law) {
  std::vector<Component> terms{{ProcessKind::kWhiteNoise, 0.0, {}}};
  double rate = kFastest;
  for (int i = 0; i < kRates; ++i, rate /= kFactor)
    terms.push_back({ProcessKind::kGaussMarkov, 0.0, {rate, 0.0}});
  terms.push_back({ProcessKind::kRandomWalk, 0.0, {}});
  // Relative deviations: every level counts alike.
  Design columns(kLevels, static_cast<Eigen::Index>(terms.size()));
  ColumnVector length(columns.cols());
  for (Eigen::Index c = 0; c < columns.cols(); ++c) {
    const Component& term = terms[static_cast<std::size_t>(c)];
    for (int level = 1; level <= kLevels; ++level) {
      columns(level - 1, c) =
          unit_wv(term.kind, term.shape, level).value / unit_wv(power_law.kind, power_law.shape, level).value;
    }
    length[c] = columns.col(c).norm();
    columns.col(c) /= length[c];
  }
  const ColumnVector amplitude = nnls(columns, RowVector::Ones(kLevels));
  std::vector<Component> sum;
  for (Eigen::Index c = 0; c < columns.cols(); ++c) {
    Component term = terms[static_cast<std::size_t>(c)];
    term.amplitude = amplitude[c] / length[c];
    if (term.amplitude > 0.0) sum.push_back(term);
  }
  return sum;
}

}  // namespace

bool is_power_law(ProcessKind kind) noexcept {
  return kind == ProcessKind::kFlicker || kind == ProcessKind::kPowerLaw;
}

std::vector<Component> power_law_sum(const Component& power_law) {
  static const std::vector<Component> kFlicker = unit_sum({ProcessKind::kFlicker, 1.0, {}});
  std::vector<Component> sum = power_law.kind == ProcessKind::kFlicker ? kFlicker : unit_sum(power_law);
  for (Component& term : sum) term.amplitude *= power_law.amplitude;
  return sum;
}

Model without_power_laws(const Model& model) {
  Model out;
  for (const Component& c : model.components) {
    if (!is_power_law(c.kind)) {
      out.components.push_back(c);
      continue;
    }
    const std::vector<Component> sum = power_law_sum(c);
    out.components.insert(out.components.end(), sum.begin(), sum.end());
  }
  return out;
}

}  // namespace imuscope::noise
