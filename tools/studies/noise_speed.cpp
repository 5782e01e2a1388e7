/// Speed of the noise engine: processor time of each job on simulated WN + 2 GM, median of several runs.
///
///   noise_speed [runs = 5]

#include <fmt/format.h>

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

void report(const std::string& job, double value, double goal, const char* unit) {
  fmt::print("{:<44} {:>10.2f} {:<3} goal {:>6g} {}\n", job, value, unit, goal,
             value <= goal ? "" : "  MISSED");
}

}  // namespace

int main(int argc, char** argv) {
  const int runs = argc > 1 ? std::max(1, std::atoi(argv[1])) : 5;
  constexpr std::size_t kMillion = 1'000'000;
  const auto x = signal(10 * kMillion);
  const std::span<const double> million(x.data(), kMillion);
  const auto classical = [](std::span<const double> s) { return noise::haar_wavelet_variance(s).value(); };
  report("wavelet variance of 1e6", median_ms(runs, [&] { classical(million); }), 15.0, "ms");
  report("wavelet variance of 1e7", median_ms(runs, [&] { classical(x); }), 150.0, "ms");
  noise::WvOptions robust;
  robust.robust = noise::RobustOptions{};
  report("robust wavelet variance of 1e6",
         median_ms(runs, [&] { (void)noise::haar_wavelet_variance(million, robust).value(); }), 500.0, "ms");
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
  report("WN+2*GM, ci weights, with intervals", median_ms(runs, [&] { fit(two, ci); }), 10.0, "ms");
  report("WN+2*GM, optimal, with intervals", median_ms(runs, [&] { fit(two, {}); }), 10.0, "ms");
  report("WN+3*GM, optimal, with intervals", median_ms(runs, [&] { fit(three, {}); }), 50.0, "ms");
  const auto earlier = fit(two, {});
  noise::FitOptions warm;
  warm.warm_start = &earlier;
  report("WN+2*GM, optimal, refit with intervals", median_ms(runs, [&] { fit(two, warm); }), 5.0, "ms");
  report("covariance of the wavelet variance",
         median_ms(runs, [&] { (void)noise::wv_covariance(earlier.model, wv, wv.levels.size()); }), 5.0,
         "ms");
  return 0;
}
