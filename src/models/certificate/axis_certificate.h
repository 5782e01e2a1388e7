#pragma once

/// All that one axis' record at rest tells: curves, model, data-sheet terms, lines, resonances, and what
/// limits them.

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "models/certificate/data_sheet_terms.h"
#include "models/certificate/temperature.h"
#include "models/noise/allan.h"
#include "models/noise/fit.h"
#include "models/noise/lines.h"
#include "models/noise/resonances.h"
#include "models/noise/spectrum.h"
#include "models/noise/tails.h"

namespace imuscope::certificate {

/// Hands out the samples of an axis. Asked several times, by one thread at a time.
using FetchSamples = std::function<Result<std::vector<double>>()>;

/// One axis as recorded.
struct AxisRecord {
  std::string name;  ///< "gyro_x"
  noise::SignalUnit unit = noise::SignalUnit::kNone;
  double rate_hz = 0.0;
  std::vector<double> values;
  std::vector<std::uint8_t> mask;  ///< empty: all are there; NaN and infinity count as missing
  /// One a sample, degrees Celsius, shared by the axes of a sensor; null where not recorded.
  std::shared_ptr<const std::vector<float>> temperature_c{};
  /// In place of `values`, of a record that is too long to lie in memory as a whole.
  FetchSamples fetch{};
  /// In place of `temperature_c`, of such a record: samples and temperatures.
  ReadWithTemperature read_with_temperature{};
};

/// Do the two halves of the record come from one model?
struct HalvesTest {
  double p_value = 1.0;
  int level = 0;       ///< where they differ most
  double ratio = 1.0;  ///< second over first wavelet variance there
};

struct AxisCertificate {
  std::string name;
  noise::SignalUnit unit = noise::SignalUnit::kNone;
  std::uint64_t n_samples = 0;
  std::uint64_t n_missing = 0;
  double mean = 0.0;
  double sd = 0.0;
  std::optional<double> resolution;  ///< step of the numbers, where they lie on a grid
  std::vector<noise::Line> lines;    ///< taken out before the fit
  std::vector<noise::Resonance> resonances;
  std::optional<double> low_pass_hz;
  noise::FitResult fit;
  std::vector<std::string> rivals;  ///< models that fit the record as well
  /// The most by which the model's curve lies beyond the interval of a scale, of that interval's end; zero
  /// where it leaves none.
  double largest_miss = 0.0;
  std::vector<noise::AllanPoint> allan;
  std::vector<noise::DensityPoint> density;
  std::vector<TermValue> terms;
  std::optional<HalvesTest> halves;
  std::optional<noise::TailTest> tails;
  std::optional<Temperature> temperature;
  std::vector<std::string> warnings;  ///< what is wrong with the record: sentences, the worst first
  std::vector<std::string> limits;    ///< what limits the numbers, and how long a record would mend it
};

struct AxisOptions {
  double confidence = 0.95;
  std::string model;  ///< as for parse_model(); empty: selected among those of candidate_models()
  noise::CovarianceTables* covariances = nullptr;  ///< of other fits, too; nothing: the axes' own
};

/// Errors (kWork), each naming the axis: fewer than kFewestSamples valid samples, a constant signal. kUsage:
/// a model that does not exist.
Result<AxisCertificate> characterize_axis(const AxisRecord& record, const AxisOptions& options);

/// Below this nothing that would be worth a page can be said.
inline constexpr std::uint64_t kFewestSamples = 200;

/// Told the number of axes that are done, by one thread at a time, whichever ended last.
using AxisDone = std::function<void(std::size_t done)>;

/// Axes side by side on all cores; the result does not depend on their number. One entry a record, in order.
/// Records that are fetched are taken one after the other: no more than one of them is in memory, while models
/// of those before are looked for, and their temperatures.
std::vector<Result<AxisCertificate>> characterize_axes(std::span<const AxisRecord> records,
                                                       const AxisOptions& options, const AxisDone& told = {});

}  // namespace imuscope::certificate
