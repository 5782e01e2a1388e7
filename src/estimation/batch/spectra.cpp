#include "estimation/batch/spectra.h"

#include <cmath>
#include <numbers>
#include <unsupported/Eigen/FFT>

namespace imuscope::batch {

namespace {

/// Twenty seconds resolve the motion of a vehicle; more of them tell more of the noise.
constexpr Eigen::Index kLongestWindow = 1024;
constexpr Eigen::Index kShortestWindow = 256;
/// As few windows as this make an sd of their scatter no more than a guess; shorter ones are taken first.
constexpr std::size_t kFewWindows = 12;

std::vector<Eigen::Index> starts_of(const std::vector<char>& valid, Eigen::Index length) {
  std::vector<Eigen::Index> starts;
  const auto n = static_cast<Eigen::Index>(valid.size());
  Eigen::Index run_start = 0;
  for (Eigen::Index i = 0; i <= n; ++i) {
    const bool ends = i == n || valid[static_cast<std::size_t>(i)] == 0;
    if (!ends) continue;
    // B-3: windows overlap by half.
    for (Eigen::Index start = run_start; start + length <= i; start += length / 2) starts.push_back(start);
    run_start = i + 1;
  }
  return starts;
}

/// B-3: the window.
Eigen::VectorXd half_sine(Eigen::Index length) {
  Eigen::VectorXd window(length);
  for (Eigen::Index i = 0; i < length; ++i)
    window[i] = std::sin(std::numbers::pi * (static_cast<double>(i) + 0.5) / static_cast<double>(length));
  return window;
}

/// Forward transform of one real series, scaled so that the sum of squares is kept.
class Transform {
 public:
  explicit Transform(Eigen::Index length) : length_(length), in_(static_cast<std::size_t>(length)) {
    fft_.SetFlag(Eigen::FFT<double>::HalfSpectrum);
  }
  template <typename Series>
  const std::vector<std::complex<double>>& of(const Series& series) {
    for (Eigen::Index i = 0; i < length_; ++i) in_[static_cast<std::size_t>(i)] = series[i];
    fft_.fwd(out_, in_);
    return out_;
  }

 private:
  Eigen::Index length_;
  Eigen::FFT<double> fft_;
  std::vector<double> in_;
  std::vector<std::complex<double>> out_;
};

}  // namespace

WindowPlan plan_windows(const std::vector<char>& valid, double rate_hz, double top_hz) {
  for (Eigen::Index length = kLongestWindow;; length /= 2) {
    WindowPlan plan = plan_windows_of(length, valid, rate_hz, top_hz);
    if (plan.starts.size() >= kFewWindows || length == kShortestWindow) return plan;
  }
}

WindowPlan plan_windows_of(Eigen::Index length, const std::vector<char>& valid, double rate_hz,
                           double top_hz) {
  WindowPlan plan;
  plan.length = length;
  plan.starts = starts_of(valid, length);
  plan.frequency_step_hz = rate_hz / static_cast<double>(length);
  plan.n_frequencies = static_cast<Eigen::Index>(top_hz / plan.frequency_step_hz) + 1;
  return plan;
}

// B-3
Spectra::Spectra(const WindowPlan& plan, const Eigen::MatrixXd& series) : n_frequencies_(plan.n_frequencies) {
  const auto n_windows = static_cast<Eigen::Index>(plan.starts.size());
  values_.resize(n_windows * n_frequencies_, series.cols());
  const Eigen::VectorXd window = half_sine(plan.length);
  const double scale = 1.0 / std::sqrt(static_cast<double>(plan.length));
  Transform transform(plan.length);
  for (Eigen::Index w = 0; w < n_windows; ++w) {
    const Eigen::Index start = plan.starts[static_cast<std::size_t>(w)];
    for (Eigen::Index column = 0; column < series.cols(); ++column) {
      const auto& spectrum = transform.of(
          (series.col(column).segment(start, plan.length).array() * window.array()).matrix().eval());
      for (Eigen::Index k = 0; k < n_frequencies_; ++k)
        values_(w * n_frequencies_ + k, column) = spectrum[static_cast<std::size_t>(k)] * scale;
    }
  }
}

Eigen::VectorXcd window_spectrum(const WindowPlan& plan) {
  Transform transform(plan.length);
  const auto& spectrum = transform.of(half_sine(plan.length));
  Eigen::VectorXcd values(plan.n_frequencies);
  for (Eigen::Index k = 0; k < plan.n_frequencies; ++k)
    values[k] = spectrum[static_cast<std::size_t>(k)] / std::sqrt(static_cast<double>(plan.length));
  return values;
}

}  // namespace imuscope::batch
