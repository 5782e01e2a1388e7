#pragma once

/// Refits the noise models of every S-IMU, axis and regime while the run goes on, in a thread of the lowest
/// priority. Non-real-time.

#include <atomic>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>
#include <vector>

#include "base/limits.h"
#include "base/output_folder.h"
#include "configuration/config.h"
#include "models/noise/model.h"
#include "rt/heartbeat.h"
#include "rt/host_clock.h"
#include "rt/spsc_ring.h"
#include "rt/thread_setup.h"
#include "service/pipeline/core.h"
#include "service/pipeline/live_models.h"
#include "service/pipeline/refit.h"

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

/// The thread around the book. Rows come from one thread through a ring; refits are taken by the same thread.
///
/// The thread runs when nothing else wants to, and on a busy PC a fit may take minutes. Rows are handed over
/// in blocks made on demand, so that they wait for it without a ring that is large all the time. A thread
/// that falls half a minute behind runs like any other until it has caught up.
class Modeller {
  using RowBlock = std::vector<ErrorRecord>;
  using BlockRing = SpscRing<RowBlock*, kModellerBlocks>;

 public:
  Modeller(const Configuration& configuration, noise::ModelSpec spec);
  ~Modeller();
  Modeller(const Modeller&) = delete;
  Modeller& operator=(const Modeller&) = delete;

  void start(const ThreadPlan& plan);
  /// Another model or refit interval, from the next refit on. Any non-real-time thread.
  void set_options(noise::ModelSpec spec, double refit_interval_s);
  /// Fits what is due and ends.
  void stop();

  /// Hands in a row. A modeller that is a quarter of an hour behind (of three S-IMUs) loses blocks of rows;
  /// their rows are counted.
  void add(const ErrorRecord& record);
  /// Refits since the last call.
  [[nodiscard]] std::vector<Refit> take();
  /// What waits for the thread and what was refused, in rows. Thread: that of add().
  static constexpr std::size_t row_capacity() { return kModellerBlocks * kRowsPerModellerBlock; }
  [[nodiscard]] RingCounters rows() const;
  [[nodiscard]] const Heartbeat& heartbeat() const { return heartbeat_; }

 private:
  void loop();
  void drain();
  void hand_over();
  void keep_up();

  LiveModels models_;
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
