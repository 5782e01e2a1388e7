#pragma once

/// Refits the noise models of every S-IMU, axis and regime while the run goes on, in a thread of the lowest
/// priority. Soft world.

#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "noise/model.h"
#include "noise/streaming_wv.h"
#include "publish/reports.h"
#include "rt/spsc_ring.h"
#include "rt/thread_setup.h"
#include "service/config.h"
#include "service/core.h"
#include "service/noise_series.h"

namespace imuscope {

/// Wavelet variances and models of one S-IMU after a refit.
struct Refit {
  std::size_t study = 0;
  HostTime time{};  ///< of the last sample used
  HostTime first_reference_time{};
  WaveletVarianceReport wavelet_variance;
  NoiseModelReport noise_model;
  double duration_s = 0.0;
};

/// The statistics alone, without the thread: rows in, refits out by sample count. Memory is bounded: one
/// streaming wavelet variance of 16 levels (512 KiB) an axis and regime, whatever the length of the run.
class ModelBook {
 public:
  ModelBook(const Configuration& configuration, noise::ModelSpec spec);

  /// Takes one row. A refit falls due with every refit interval's worth of samples of its S-IMU.
  void add(const ErrorRecord& record);
  /// The refit that fell due, if any.
  [[nodiscard]] std::optional<Refit> refit();

 private:
  /// One axis in one regime.
  using Streams = std::array<std::array<noise::StreamingWv, kRegimeCount>, kAxisCount>;

  struct Study {
    std::string name;
    double rate_hz = 0.0;
    std::size_t samples_per_refit = 0;
    std::size_t samples_since_refit = 0;
    Streams streams;
    bool started = false;
    std::int64_t next_counter = 0;
    Regime regime = Regime::kStatic;
    HostTime last_time{};
    HostTime first_reference_time{};
  };

  static void push(Study& study, const ErrorRow& row);
  [[nodiscard]] Refit fit(std::size_t index) const;

  std::vector<Study> studies_;
  noise::ModelSpec spec_;
};

/// The thread around the book. Rows come from one thread through a ring; refits are taken by the same thread.
class Modeller {
 public:
  Modeller(const Configuration& configuration, noise::ModelSpec spec);
  ~Modeller();
  Modeller(const Modeller&) = delete;
  Modeller& operator=(const Modeller&) = delete;

  void start(const ThreadPlan& plan);
  /// Fits what is due and ends.
  void stop();

  /// Hands in a row. A modeller that cannot keep up loses rows, counted by the ring.
  void add(const ErrorRecord& record) { (void)rows_->try_push(record); }
  /// Refits since the last call.
  [[nodiscard]] std::vector<Refit> take();
  [[nodiscard]] RingCounters ring() const { return rows_->counters(); }

 private:
  using RowRing = SpscRing<ErrorRecord, 16384>;
  void loop();
  void drain();

  ModelBook book_;
  std::unique_ptr<RowRing> rows_;
  std::mutex mutex_;
  std::vector<Refit> refits_;
  std::atomic<bool> running_{false};
  std::thread thread_;
};

}  // namespace imuscope
