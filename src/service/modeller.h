#pragma once

/// Refits the noise models of every S-IMU, axis and regime while the run goes on, in a thread of the lowest
/// priority. Soft world.

#include <atomic>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>
#include <vector>

#include "base/output_folder.h"
#include "configuration/config.h"
#include "noise/fit.h"
#include "noise/streaming_wv.h"
#include "rt/heartbeat.h"
#include "rt/host_clock.h"
#include "rt/spsc_ring.h"
#include "rt/thread_setup.h"
#include "service/core.h"
#include "service/motion_book.h"
#include "service/noise_series.h"
#include "service/refit.h"

namespace imuscope {

/// What the refits of a run say last, S-IMU by S-IMU.
class NewestModels {
 public:
  void take(const Refit& refit);
  /// Writes models.json, if there was a refit.
  [[nodiscard]] Result<void> write(const OutputFolder& folder) const;

 private:
  std::map<std::size_t, nlohmann::json> models_;  ///< entries of models.json
};

/// The statistics alone, without the thread: rows in, refits out by sample count. Memory is bounded: one
/// streaming wavelet variance of 16 levels (512 KiB) an axis and regime, whatever the length of the run.
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
  void add(const ErrorRecord& record);
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
  static void push(Study& study, const ErrorRow& row);
  [[nodiscard]] Refit fit(std::size_t index);
  /// Absent where the regime has not been met yet: it has no model.
  [[nodiscard]] std::optional<AxisRefit> refit_track(double rate_hz, Track& track, std::size_t axis,
                                                     Regime regime) const;

  std::vector<Study> studies_;
  noise::ModelSpec spec_;
};

/// The thread around the book. Rows come from one thread through a ring; refits are taken by the same thread.
///
/// The thread runs when nothing else wants to, and on a busy PC a fit may take minutes. Rows are handed over
/// in blocks made on demand, so that they wait for it without a ring that is large all the time. A thread
/// that falls half a minute behind runs as any other until it has caught up.
class Modeller {
  using RowBlock = std::vector<ErrorRecord>;
  static constexpr std::size_t kRowsPerBlock = 64;
  static constexpr std::size_t kBlocks = 4096;
  using BlockRing = SpscRing<RowBlock*, kBlocks>;

 public:
  Modeller(const Configuration& configuration, noise::ModelSpec spec);
  ~Modeller();
  Modeller(const Modeller&) = delete;
  Modeller& operator=(const Modeller&) = delete;

  void start(const ThreadPlan& plan);
  /// Another model or refit interval, from the next refit on. Any thread of the soft world.
  void set_options(noise::ModelSpec spec, double refit_interval_s);
  /// Fits what is due and ends.
  void stop();

  /// Hands in a row. A modeller that is a quarter of an hour behind (of three S-IMUs) loses blocks of rows;
  /// their rows are counted.
  void add(const ErrorRecord& record);
  /// Refits since the last call.
  [[nodiscard]] std::vector<Refit> take();
  /// What waits for the thread and what was refused, in rows. Thread: that of add().
  static constexpr std::size_t row_capacity() { return kBlocks * kRowsPerBlock; }
  [[nodiscard]] RingCounters rows() const;
  [[nodiscard]] const Heartbeat& heartbeat() const { return heartbeat_; }

 private:
  void loop();
  void drain();
  void hand_over();
  void keep_up();

  ModelBook book_;
  std::unique_ptr<RowBlock> filling_;
  std::unique_ptr<BlockRing> blocks_;  ///< owns the blocks that it holds
  std::uint64_t rows_added_ = 0;
  std::uint64_t rows_refused_ = 0;
  bool hurries_ = false;  ///< not at the lowest priority
  std::mutex mutex_;
  std::vector<Refit> refits_;
  struct Options {
    noise::ModelSpec spec;
    double refit_interval_s;
  };
  std::optional<Options> new_options_;
  Heartbeat heartbeat_{host_now()};
  std::atomic<bool> running_{false};
  std::thread thread_;
};

}  // namespace imuscope
