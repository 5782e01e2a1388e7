/// Speed and memory of the noise engine on simulated WN + 2 GM: processor time, median of several runs, of
/// every job at three lengths of the signal, and the most memory that it takes beyond its input.
///
/// Ratios are within the run. The floor of the wavelet variance is one pass over the signal a level: reading
/// every sample and adding its square. A fit and its intervals work on the wavelet variance and do not see
/// the samples; they are held against making it. Goals are absolute, of this class of machine; the
/// established packages (wv 0.1.3, gmwm 3.0.0) took 369 ms for the wavelet variance of 1e6, 9 s for the
/// robust one, 2.5 s for the fit and 69 s for its intervals on another two-core machine.

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "models/noise/fit.h"
#include "models/noise/select.h"
#include "models/noise/streaming_wv.h"
#include "models/noise/wv_covariance.h"
#include "tools/benchmarks/bench_report.h"

namespace {

namespace noise = imuscope::noise;

constexpr double kRate_hz = 100.0;

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

double median_ms(int runs, const std::function<void()>& job) {
  std::vector<double> times;
  for (int i = 0; i < runs; ++i) {
    const double start_s = bench::processor_time_s();
    job();
    times.push_back(1e3 * (bench::processor_time_s() - start_s));
  }
  return bench::median(times);
}

/// One addition of a square a sample and level, and nothing else; the sum is handed out so that it is made.
double floor_of(std::span<const double> x, std::size_t levels) {
  constexpr std::size_t kLanes = 8;  // independent sums, so that no addition waits for the one before
  std::array<double, kLanes> sums{};
  for (std::size_t level = 0; level < levels; ++level) {
    for (std::size_t i = 0; i + kLanes <= x.size(); i += kLanes) {
      for (std::size_t lane = 0; lane < kLanes; ++lane) sums[lane] += x[i + lane] * x[i + lane];
    }
  }
  double sum = 0.0;
  for (const double lane : sums) sum += lane;
  return sum;
}

class Bench {
 public:
  explicit Bench(int runs) : runs_(runs) {}

  /// Every job on the first n samples.
  void measure(std::span<const double> x, const std::string& size) {
    const auto wv = noise::haar_wavelet_variance(x).value();
    volatile double sink = 0.0;
    const double floor_ms = median_ms(runs_, [&] { sink = floor_of(x, wv.levels.size()); });
    const auto classical = [&] { (void)noise::haar_wavelet_variance(x).value(); };
    const double classical_ms = median_ms(runs_, classical);
    const double million = static_cast<double>(x.size()) * 1e-6;
    add("wavelet variance of " + size, classical_ms, floor_ms, "x a pass over the samples a level", classical,
        15.0 * million);
    noise::WvOptions options;
    options.robust = noise::RobustOptions{};
    const auto robust = [&] { (void)noise::haar_wavelet_variance(x, options).value(); };
    add("robust wavelet variance of " + size, median_ms(std::min(runs_, 3), robust), classical_ms,
        "x the classical one", robust, 500.0 * million);
    measure_fits(wv, classical_ms, size);
    sizes_.push_back(static_cast<double>(x.size()));
    wv_ms_.push_back(classical_ms);
    fit_ms_.push_back(rows_.back().value);
  }

  void measure_streaming(std::span<const double> x) {
    std::vector<double> levels;
    std::vector<double> costs;
    for (const int n : {8, 12, 16, 20, 24}) {
      noise::StreamingOptions options;
      options.levels = n;
      noise::StreamingWv stream(options);
      const double ms = median_ms(runs_, [&] {
        for (const double v : x) stream.push(v);
      });
      noise::WvOptions same;
      same.levels = std::min(n, 19);
      const double batch_ms = median_ms(runs_, [&] { (void)noise::haar_wavelet_variance(x, same).value(); });
      const double ns_per_ms = 1e6 / static_cast<double>(x.size());
      bench::Row row;
      row.group = "noise";
      row.what = fmt::format("streaming, a sample at {} levels", n);
      row.value = ms * ns_per_ms;
      row.reference = batch_ms * ns_per_ms;
      row.ratio = ms / batch_ms;
      row.against = fmt::format("x the batch of 1e6 at {} levels", same.levels);
      row.unit = "ns";
      row.memory_mb = bench::peak_memory_mb([&] {
        noise::StreamingWv fresh(options);
        for (const double v : x) fresh.push(v);
      });
      if (n == 16) row.goal = bench::Goal{bench::Goal::Side::kAtMost, 60.0, bench::Goal::Of::kValue};
      rows_.push_back(row);
      levels.push_back(n);
      costs.push_back(ms);
    }
    add_growth("streaming, with levels 8 to 24", levels, costs, 1.0);
  }

  /// Fits of a million samples that the sizes above do not show.
  void measure_other_fits(std::span<const double> x) {
    const auto wv = noise::haar_wavelet_variance(x).value();
    const auto two = noise::parse_model("WN+2*GM").value();
    const auto three = noise::parse_model("WN+3*GM").value();
    const auto earlier = noise::fit(wv, two, kRate_hz).value();
    const double first_ms = median_ms(runs_, [&] { (void)noise::fit(wv, two, kRate_hz).value(); });
    noise::FitOptions warm;
    warm.warm_start = &earlier;
    const auto refit = [&] { (void)noise::fit(wv, two, kRate_hz, warm).value(); };
    add("refit from an earlier fit, WN+2*GM", median_ms(runs_, refit), first_ms, "x a first fit", refit, 5.0);
    const auto larger = [&] { (void)noise::fit(wv, three, kRate_hz).value(); };
    add("fit, WN+3*GM", median_ms(runs_, larger), first_ms, "x WN+2*GM", larger, 50.0);
    const auto select = [&] {
      (void)noise::rank_models(wv, noise::parse_model("QN+WN+2*GM+RW").value(), kRate_hz).value();
    };
    add("selection among 23 models", median_ms(std::min(runs_, 3), select), first_ms, "x WN+2*GM", select,
        1000.0);
    // A drive's regime: a hundred stretches, of a few seconds to minutes.
    std::vector<std::uint8_t> mask(x.size(), 1);
    std::mt19937_64 random(2);
    constexpr int kStretches = 100;
    for (int i = 0; i < kStretches; ++i) mask[random() % x.size()] = 0;
    noise::WvOptions masked;
    masked.mask = mask;
    const auto in_stretches = noise::haar_wavelet_variance(x, masked).value();
    const auto of_stretches = [&] { (void)noise::fit(in_stretches, two, kRate_hz).value(); };
    add("fit of 100 stretches, WN+2*GM", median_ms(runs_, of_stretches), first_ms, "x of one stretch",
        of_stretches, 50.0);
  }

  [[nodiscard]] std::vector<bench::Row> rows() {
    if (sizes_.size() > 1) {
      add_growth("wavelet variance, with samples", sizes_, wv_ms_, 1.1);
      add_growth("fit with intervals, with samples", sizes_, fit_ms_, 0.3);
    }
    return rows_;
  }

 private:
  void measure_fits(const noise::WaveletVariance& wv, double wv_ms, const std::string& size) {
    const auto two = noise::parse_model("WN+2*GM").value();
    noise::FitOptions ci;
    ci.weighting = noise::Weighting::kCi;
    const auto earlier = noise::fit(wv, two, kRate_hz).value();
    const auto intervals = [&] { (void)noise::wv_covariance(earlier.model, wv, wv.levels.size()); };
    const double intervals_ms = median_ms(runs_, intervals);
    const auto with_ci = [&] { (void)noise::fit(wv, two, kRate_hz, ci).value(); };
    const double fit_ms = median_ms(runs_, with_ci) - intervals_ms;
    add("fit alone, WN+2*GM, ci weights, of " + size, fit_ms, wv_ms, "x its wavelet variance", with_ci, 5.0);
    add("intervals alone, of " + size, intervals_ms, fit_ms, "x the fit alone", intervals, 5.0);
    const auto optimal = [&] { (void)noise::fit(wv, two, kRate_hz).value(); };
    add("fit with intervals, WN+2*GM, optimal, of " + size, median_ms(runs_, optimal), wv_ms,
        "x its wavelet variance", optimal, 10.0);
  }

  void add(std::string what, double ms, double reference_ms, const char* against,
           const std::function<void()>& job, double goal_ms) {
    bench::Row row;
    row.group = "noise";
    row.what = std::move(what);
    row.ratio = ms / reference_ms;
    row.against = against;
    row.value = ms;
    row.reference = reference_ms;
    row.unit = "ms";
    row.memory_mb = bench::peak_memory_mb(job);
    row.goal = bench::Goal{bench::Goal::Side::kAtMost, goal_ms, bench::Goal::Of::kValue};
    rows_.push_back(std::move(row));
  }

  void add_growth(std::string what, const std::vector<double>& sizes, const std::vector<double>& costs,
                  double goal) {
    rows_.push_back(bench::growth_row(std::move(what), sizes, costs, goal));
  }

  int runs_;
  std::vector<bench::Row> rows_;
  std::vector<double> sizes_;
  std::vector<double> wv_ms_;
  std::vector<double> fit_ms_;
};

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Speed and memory of wavelet variance, fits and streaming"};
  int runs = 5;
  bool quick = false;
  std::string json;
  app.add_option("--runs", runs, "of which the median counts")->check(CLI::Range(1, 1000));
  app.add_flag("--quick", quick, "without the ten million samples");
  app.add_option("--json", json, "write the rows here")->type_name("FILE");
  CLI11_PARSE(app, argc, argv);

  constexpr std::size_t kMillion = 1'000'000;
  const auto x = signal(quick ? kMillion : 10 * kMillion);
  const std::span<const double> all(x);
  Bench bench(runs);
  bench.measure(all.first(kMillion / 10), "1e5");
  bench.measure(all.first(kMillion), "1e6");
  if (!quick) bench.measure(all, "1e7");
  bench.measure_other_fits(all.first(kMillion));
  bench.measure_streaming(all.first(kMillion));
  return bench::finish(bench.rows(), json);
}
