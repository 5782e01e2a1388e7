#include "models/noise/signal.h"

#include <cmath>

#include "models/noise/fit.h"
#include "models/noise/tails.h"

namespace imuscope::noise {
namespace {

/// What is there and finite: lines are looked for in that alone.
std::vector<std::uint8_t> finite_mask(std::span<const double> x, std::span<const std::uint8_t> mask) {
  std::vector<std::uint8_t> finite(x.size());
  for (std::size_t i = 0; i < x.size(); ++i)
    finite[i] = (mask.empty() || mask[i] != 0) && std::isfinite(x[i]) ? 1 : 0;
  return finite;
}

std::optional<std::string> spikes_in(std::span<const double> x, const WaveletVariance& wv, double rate_hz,
                                     WvOptions options) {
  if (options.robust) return std::nullopt;
  const auto model = fit(wv, parse_model("QN+WN+2*GM").value(), rate_hz);
  if (!model) return std::nullopt;
  options.levels = 0;
  return spike_warning(test_tails(x, options, model->model), rate_hz);
}

}  // namespace

Result<SignalLook> look_at_signal(std::span<const double> x, const WvOptions& options, double rate_hz,
                                  Lines lines) {
  // First, as it refuses what is no signal.
  auto wv = haar_wavelet_variance(x, options);
  if (!wv) return tl::unexpected(wv.error());
  const auto mask = finite_mask(x, options.mask);
  LineOptions line_options;
  line_options.rate_hz = rate_hz;
  SignalLook look;
  look.lines = find_lines(x, mask, line_options);
  std::vector<double> without;
  if (lines == Lines::kTakenOut && !look.lines.empty()) {
    without.assign(x.begin(), x.end());
    remove_lines(without, mask, look.lines, rate_hz);
    x = without;
    wv = haar_wavelet_variance(x, options);
    if (!wv) return tl::unexpected(wv.error());
    Spectra spectra(without, mask);
    Remainders(spectra, look.lines, rate_hz).take_out_of(*wv, options.confidence);
  }
  look.spikes = spikes_in(x, *wv, rate_hz, options);
  look.wv = std::move(*wv);
  return look;
}

}  // namespace imuscope::noise
