/// Speed and memory of the noise engine: processor time of each job on simulated WN + 2 GM, median of several
/// runs, and the most memory that a job takes beyond its input. The last column is the same job's time or
/// memory in the established R packages (wv 0.1.3, gmwm 3.0.0), measured on another two-core machine.
///
///   noise_speed [runs = 5]

#include <fmt/format.h>

#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "noise/fit.h"
#include "noise/streaming_wv.h"
#include "noise/wv_covariance.h"

namespace {

namespace noise = imuscope::noise;

std::vector<double> signal(std::size_t n) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  std::vector<double> x(n);
  double fast = 0.0;
  double slow = 0.0;
  for (double& v : x) {
    fast = 0.9 * fast + 0.3 * normal(random);
    slow = 0.9995 * slow + 0.01 * normal(random);
    v = normal(random) + fast + slow;
  }
  return x;
}

double processor_ms() {
  return 1e3 * static_cast<double>(std::clock()) / static_cast<double>(CLOCKS_PER_SEC);
}

double median_ms(int runs, const std::function<void()>& job) {
  std::vector<double> times;
  for (int i = 0; i < runs; ++i) {
    const double start = processor_ms();
    job();
    times.push_back(processor_ms() - start);
  }
  std::sort(times.begin(), times.end());
  return times[times.size() / 2];
}

/// Most memory the process has held so far, MB.
double peak_mb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  constexpr double kKibPerMb = 1e6 / 1024.0;
  return static_cast<double>(usage.ru_maxrss) / kKibPerMb;
}

/// `reference`: of the established packages; 0 where they have no such job.
void report(const std::string& job, double value, double goal, const char* unit, double reference = 0.0) {
  fmt::print("{:<44} {:>9.2f} {:<2}  goal {:>4g}{}", job, value, unit, goal,
             value <= goal ? "         " : "  MISSED ");
  if (reference > 0.0) fmt::print("{:>8g} {} elsewhere, {:.0f} times", reference, unit, reference / value);
  fmt::print("\n");
}

}  // namespace

int main(int argc, char** argv) {
  const int runs = argc > 1 ? std::max(1, std::atoi(argv[1])) : 5;
  constexpr std::size_t kMillion = 1'000'000;
  const auto x = signal(10 * kMillion);
  const std::span<const double> million(x.data(), kMillion);
  const auto classical = [](std::span<const double> s) { return noise::haar_wavelet_variance(s).value(); };
  const double before_mb = peak_mb();
  classical(million);
  report("memory of that beyond the input, 1e6", peak_mb() - before_mb, 20.0, "MB", 277.0);
  report("wavelet variance of 1e6", median_ms(runs, [&] { classical(million); }), 15.0, "ms", 369.0);
  report("wavelet variance of 1e7", median_ms(runs, [&] { classical(x); }), 150.0, "ms", 7500.0);
  noise::WvOptions robust;
  robust.robust = noise::RobustOptions{};
  report("robust wavelet variance of 1e6",
         median_ms(runs, [&] { (void)noise::haar_wavelet_variance(million, robust).value(); }), 500.0, "ms",
         9000.0);
  noise::StreamingWv stream;
  const double streaming_ms = median_ms(runs, [&] {
    for (const double v : million) stream.push(v);
  });
  report("streaming, a sample at 16 levels", streaming_ms * 1e6 / static_cast<double>(kMillion), 60.0, "ns");

  const auto wv = classical(million);
  const auto two = noise::parse_model("WN+2*GM").value();
  const auto three = noise::parse_model("WN+3*GM").value();
  noise::FitOptions ci;
  ci.weighting = noise::Weighting::kCi;
  const auto fit = [&](const noise::ModelSpec& spec, const noise::FitOptions& options) {
    return noise::fit(wv, spec, 100.0, options).value();
  };
  const auto earlier = fit(two, {});
  const double covariance_ms =
      median_ms(runs, [&] { (void)noise::wv_covariance(earlier.model, wv, wv.levels.size()); });
  const double ci_ms = median_ms(runs, [&] { fit(two, ci); });
  report("WN+2*GM, ci weights, without intervals", ci_ms - covariance_ms, 5.0, "ms", 2460.0);
  report("intervals: covariance of the wavelet variance", covariance_ms, 5.0, "ms", 68700.0);
  report("WN+2*GM, ci weights, with intervals", ci_ms, 10.0, "ms");
  report("WN+2*GM, optimal, with intervals", median_ms(runs, [&] { fit(two, {}); }), 10.0, "ms");
  report("WN+3*GM, optimal, with intervals", median_ms(runs, [&] { fit(three, {}); }), 50.0, "ms");
  noise::FitOptions warm;
  warm.warm_start = &earlier;
  report("WN+2*GM, optimal, refit with intervals", median_ms(runs, [&] { fit(two, warm); }), 5.0, "ms");
  // A drive's regime: a hundred stretches, of a few seconds to minutes.
  std::vector<std::uint8_t> mask(kMillion, 1);
  std::mt19937_64 random(2);
  constexpr int kStretches = 100;
  for (int i = 0; i < kStretches; ++i) mask[random() % kMillion] = 0;
  noise::WvOptions masked;
  masked.mask = mask;
  const auto in_stretches = noise::haar_wavelet_variance(million, masked).value();
  report("WN+2*GM, optimal, of 100 stretches",
         median_ms(runs, [&] { (void)noise::fit(in_stretches, two, 100.0).value(); }), 50.0, "ms");
  return 0;
}
