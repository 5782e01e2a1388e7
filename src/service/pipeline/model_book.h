#pragma once

/// The noise models of a run that goes on, as statistics alone: rows in, refits out.

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "configuration/config.h"
#include "models/noise/fit.h"
#include "models/noise/streaming_wv.h"
#include "service/pipeline/core.h"
#include "service/pipeline/motion_book.h"
#include "service/pipeline/noise_series.h"
#include "service/pipeline/refit.h"

namespace imuscope {

/// Refits fall due by sample count. Memory is bounded: one streaming wavelet variance of 16 levels (544 KiB)
/// per axis and regime, whatever the length of the run.
///
/// A refit starts from the earlier model; a search over all rates is made at the first, whenever the samples
/// have doubled, and after a change. What came in since the last refit is held against the model of before: a
/// distance whose chance is below kChangeLevel is a change of behaviour.
class ModelBook {
 public:
  ModelBook(const Configuration& configuration, noise::ModelSpec spec);

  /// From the next refit on; the statistics gathered so far stay.
  void set_options(noise::ModelSpec spec, double refit_interval_s);
  /// Takes one row. A refit falls due with every refit interval's worth of samples of its S-IMU.
  /// @param regime  that holds at the row, whatever the row says; absent: the row belongs to none
  void add(const ErrorRecord& record, std::optional<Regime> regime);
  /// The refit that fell due, if any.
  [[nodiscard]] std::optional<Refit> refit();

  /// Of 36 axes and regimes looked at once a minute one is called changed by chance about every five hours.
  static constexpr double kChangeLevel = 1e-4;

 private:
  /// One axis in one regime.
  struct Track {
    noise::StreamingWv recent;  ///< since the last refit
    noise::WvSums before;       ///< everything up to there
    std::optional<noise::FitResult> fit;
    std::uint64_t searched_at = 0;  ///< samples at the last search over all rates
  };
  using Tracks = std::array<std::array<Track, kRegimeCount>, kAxisCount>;

  struct Study {
    std::string name;
    double rate_hz = 0.0;
    std::size_t samples_per_refit = 0;
    std::size_t samples_since_refit = 0;
    Tracks tracks;
    std::int64_t samples = 0;
    MotionBook motion;
    bool started = false;
    std::int64_t next_counter = 0;
    HostTime last_time{};
    UtcStamp last_utc{};
    HostTime first_reference_time{};
  };

  void set_refit_interval(double interval_s);
  static void push(Study& study, const ErrorRow& row, std::optional<Regime> regime);
  [[nodiscard]] Refit fit(std::size_t index);
  /// Absent where the regime has not been met yet: it has no model.
  [[nodiscard]] std::optional<AxisRefit> refit_track(double rate_hz, Track& track, std::size_t axis,
                                                     Regime regime) const;

  std::vector<Study> studies_;
  noise::ModelSpec spec_;
};

}  // namespace imuscope
