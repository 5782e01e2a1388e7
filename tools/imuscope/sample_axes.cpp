#include "sample_axes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include "time_column.h"

namespace imuscope::cli {
namespace {

/// Holes longer than this, alone or together, are not filled sample by sample.
constexpr std::int64_t kHolesMost = 10'000'000;
constexpr std::size_t kTriad = 3;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// Samples that are missing before a row.
struct Hole {
  std::size_t before_row = 0;
  std::size_t samples = 0;
};

/// Rows of the record, and where samples are missing between them.
struct RowPlaces {
  double rate_hz = 0.0;
  std::size_t rows = 0;
  std::vector<Hole> holes;
  std::size_t samples = 0;  ///< with those that are missing
};

/// @param first_row  of which the first of `rows` is row 0
Result<void> add_holes(RowPlaces& places, std::size_t first_row,
                       std::span<const std::int64_t> missing_before) {
  for (std::size_t i = 0; i < missing_before.size(); ++i) {
    if (missing_before[i] == 0) continue;
    places.holes.push_back({first_row + i, static_cast<std::size_t>(missing_before[i])});
    places.samples += places.holes.back().samples;
    if (places.samples <= places.rows + static_cast<std::size_t>(kHolesMost)) continue;
    return work_error(fmt::format("the times leave out more than {} samples", kHolesMost),
                      "cut the file where the long gaps are");
  }
  return {};
}

/// A column with NaN where samples are missing; `read` gives rows [first, first + size) of it.
template <typename Value, typename Read>
Result<std::vector<Value>> filled(const RowPlaces& places, Read&& read) {
  std::vector<Value> out;
  out.reserve(places.samples + 1);  // who fetches adds one
  std::size_t row = 0;
  const auto up_to = [&](std::size_t end) -> Result<void> {
    const std::size_t at = out.size();
    out.resize(at + (end - row));
    auto done = read(row, std::span<Value>(out).subspan(at));
    row = end;
    return done;
  };
  for (const Hole& hole : places.holes) {
    if (auto done = up_to(hole.before_row); !done) return tl::unexpected(done.error());
    out.insert(out.end(), hole.samples, std::numeric_limits<Value>::quiet_NaN());
  }
  if (auto done = up_to(places.rows); !done) return tl::unexpected(done.error());
  return out;
}

/// An axis with its temperatures, piece by piece, and NaN where samples are missing.
class AxisWithTemperature {
 public:
  using Take = std::function<void(const certificate::PieceWithTemperature&)>;

  AxisWithTemperature(const RowPlaces& places, const Spool& axis, const Spool& temperature, const Take& take)
      : places_(places), axis_(axis), temperature_(temperature), take_(take) {}

  Result<void> read() {
    std::size_t row = 0;
    for (const Hole& hole : places_.holes) {
      if (auto done = rows(row, hole.before_row); !done) return done;
      row = hole.before_row;
      missing(hole.samples);
    }
    return rows(row, places_.rows);
  }

 private:
  static constexpr std::size_t kPiece = std::size_t{1} << 16U;

  Result<void> rows(std::size_t begin, std::size_t end) {
    for (std::size_t n = 0; begin < end; begin += n) {
      n = std::min(kPiece, end - begin);
      x_.resize(n);
      t_.resize(n);
      if (auto done = axis_.read(begin, x_); !done) return done;
      if (auto done = temperature_.read(begin, t_); !done) return done;
      give(t_);
    }
    return {};
  }
  void missing(std::size_t samples) {
    for (std::size_t n = 0; samples > 0; samples -= n) {
      n = std::min(kPiece, samples);
      x_.assign(n, kNan);
      give(x_);
    }
  }
  void give(const std::vector<double>& temperature_c) {
    t_as_float_.resize(temperature_c.size());
    std::ranges::transform(temperature_c, t_as_float_.begin(),
                           [](double t) { return static_cast<float>(t); });
    take_({x_, {}, t_as_float_});
  }

  const RowPlaces& places_;
  const Spool& axis_;
  const Spool& temperature_;
  const Take& take_;
  std::vector<double> x_;
  std::vector<double> t_;
  std::vector<float> t_as_float_;
};

/// A sensor's clock drifts by far less in a day; what differs by more was set to another rate.
constexpr double kDriftMost = 0.01;

/// Where samples are missing, window by window: each tells its own rate, so that a clock's drift over a day is
/// no loss. A window's second half only shows how late the rows of its first one are.
Result<RowPlaces> row_places_of(const Spool& stamps, std::size_t window, std::optional<double> rate_hz) {
  RowPlaces places;
  places.rows = places.samples = stamps.size();
  std::vector<double> stamps_s(std::min(places.rows, window));
  for (std::size_t first = 0;;) {
    const auto part = std::span(stamps_s).first(std::min(window, places.rows - first));
    if (auto done = stamps.read(first, part); !done) return tl::unexpected(done.error());
    const auto rows = rows_of_stamps(part, {}, rate_hz, first);
    if (!rows) return tl::unexpected<Error>(rows.error());
    if (first == 0) places.rate_hz = rows->rate_hz;
    if (std::abs(rows->rate_hz / places.rate_hz - 1.0) > kDriftMost) {
      return work_error(fmt::format("the rate changes from {:g} to {:g} Hz, by row {}", places.rate_hz,
                                    rows->rate_hz, first + part.size()),
                        "cut the record where the sensor was set to another rate");
    }
    const bool is_last = first + part.size() == places.rows;
    // The next window begins with the last row that is told here: what is missing before its first row, it
    // cannot know.
    const std::size_t told = is_last ? part.size() : window / 2 + 1;
    if (auto done = add_holes(places, first, std::span(rows->missing_before).first(told)); !done)
      return tl::unexpected(done.error());
    if (is_last) return places;
    first += window / 2;
  }
}

}  // namespace

void AxesSink::on_sample(const Sample& sample) noexcept {
  if (sample.kind != SampleKind::kImu || failure_) return;
  if (!first_) first_ = sample.time;
  const bool has_gyros = (sample.imu.flags & kGyroValid) != 0;
  const bool has_accelerometers = (sample.imu.flags & kAccelValid) != 0;
  for (std::size_t axis = 0; axis < kTriad; ++axis) {
    columns_[axis].push_back(has_gyros ? sample.imu.omega_radps[axis] : kNan);
    columns_[kTriad + axis].push_back(has_accelerometers ? sample.imu.f_mps2[axis] : kNan);
    is_sent_[axis] = is_sent_[axis] || has_gyros;
    is_sent_[kTriad + axis] = is_sent_[kTriad + axis] || has_accelerometers;
  }
  columns_[kStamps].push_back(to_seconds(sample.time - *first_));
  const bool has_temperature = (sample.imu.flags & kHasTemperature) != 0;
  auto& temperature = columns_[kTemperature];
  temperature.push_back(has_temperature       ? static_cast<double>(sample.imu.temperature_degC)
                        : temperature.empty() ? kNan
                                              : temperature.back());
  ++rows_;
  if (keeps_ == Keeps::kAllInMemory || columns_.front().size() <= rows_together_) return;
  if (auto spilled = spill(); !spilled) failure_ = spilled.error();
}

Result<void> AxesSink::spill() {
  while (spools_.size() < kColumns) {
    auto spool = Spool::create();
    if (!spool) return tl::unexpected<Error>(spool.error());
    spools_.push_back(std::move(*spool));
  }
  for (std::size_t i = 0; i < kColumns; ++i) {
    // All but the last row, by which the next temperature is known.
    if (auto done = spools_[i].append(std::span(columns_[i]).first(columns_[i].size() - 1)); !done)
      return done;
    columns_[i] = {columns_[i].back()};
  }
  return {};
}

Result<SampleAxes> AxesSink::axes(std::optional<double> rate_hz) && {
  if (failure_) return tl::unexpected<Error>(*failure_);
  auto axes = spools_.empty() ? axes_in_memory(rate_hz) : axes_on_disk(rate_hz);
  if (axes) axes->is_sent = is_sent_;
  return axes;
}

Result<SampleAxes> AxesSink::axes_in_memory(std::optional<double> rate_hz) {
  const auto rows = rows_of_stamps(columns_[kStamps], {}, rate_hz);
  if (!rows) return tl::unexpected<Error>(rows.error());
  RowPlaces places{rows->rate_hz, rows_, {}, rows_};
  if (auto done = add_holes(places, 0, rows->missing_before); !done) return tl::unexpected(done.error());
  const auto column = [&]<typename Value>(std::size_t i, Value) {
    return *filled<Value>(places, [&](std::size_t first, std::span<Value> values) -> Result<void> {
      std::ranges::transform(std::span(columns_[i]).subspan(first, values.size()), values.begin(),
                             [](double v) { return static_cast<Value>(v); });
      return {};
    });
  };
  SampleAxes out;
  if (std::isfinite(columns_[kTemperature].back()))
    out.temperature_c = std::make_shared<const std::vector<float>>(column(kTemperature, float{}));
  for (std::size_t axis = 0; axis < out.axes.size(); ++axis) {
    Signal& signal = out.axes[axis];
    signal.rate_hz = places.rate_hz;
    signal.values = column(axis, double{});
    columns_[axis] = std::vector<double>();
    for (double& value : signal.values) {
      signal.mask.push_back(std::isnan(value) ? 0 : 1);
      if (std::isnan(value)) value = 0.0;
    }
  }
  return out;
}

Result<SampleAxes> AxesSink::axes_on_disk(std::optional<double> rate_hz) {
  const bool has_temperature = std::isfinite(columns_[kTemperature].back());
  for (std::size_t i = 0; i < kColumns; ++i) {
    if (auto done = spools_[i].append(columns_[i]); !done) return tl::unexpected(done.error());
    columns_[i] = std::vector<double>();
  }
  auto found = row_places_of(spools_[kStamps], 2 * rows_together_, rate_hz);
  if (!found) return tl::unexpected<Error>(found.error());
  const auto places = std::make_shared<const RowPlaces>(std::move(*found));
  SampleAxes out;
  const auto temperature = std::make_shared<const Spool>(std::move(spools_[kTemperature]));
  for (std::size_t axis = 0; axis < out.axes.size(); ++axis) {
    const auto spool = std::make_shared<const Spool>(std::move(spools_[axis]));
    out.axes[axis].rate_hz = places->rate_hz;
    out.fetches[axis] = [places, spool] {
      return filled<double>(
          *places, [&](std::size_t first, std::span<double> values) { return spool->read(first, values); });
    };
    if (!has_temperature) continue;
    out.read_with_temperature[axis] = [places, spool, temperature](const AxisWithTemperature::Take& take) {
      return AxisWithTemperature(*places, *spool, *temperature, take).read();
    };
  }
  return out;
}

}  // namespace imuscope::cli
