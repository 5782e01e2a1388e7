#pragma once

/// Fixed-lag smoothing of a live run: the core hands the filter's history out through a ring, and the
/// publisher's thread writes what it says of the navigation and the biases five to ten seconds later,
/// smoothed.

#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "base/limits.h"
#include "base/output_folder.h"
#include "estimation/calibration/fixed_lag.h"
#include "rt/spsc_ring.h"
#include "service/pipeline/core.h"
#include "service/run/run_folder.h"

namespace imuscope {

/// One epoch of the history on its way out of the core.
struct HistoryRecord {
  /// Enough for a filter with every state of six S-IMUs, and a few more.
  static constexpr std::size_t kDoubles = 42'500;
  std::size_t size = 0;
  bool continues = true;  ///< false: the epoch before was refused by a full ring
  std::array<double, kDoubles> values;
};

/// The core's end. A filter too large for a record is not smoothed live. Core: no allocation after
/// construction.
class LiveHistory final : public HistorySink {
 public:
  using Ring = SpscRing<HistoryRecord, kHistoryRingCapacity>;

  LiveHistory() : ring_(std::make_unique<Ring>()), scratch_(std::make_unique<HistoryRecord>()) {}
  void on_history(const HistoryEpoch& epoch) noexcept override;
  [[nodiscard]] Ring& ring() noexcept { return *ring_; }

 private:
  std::unique_ptr<Ring> ring_;
  std::unique_ptr<HistoryRecord> scratch_;
  bool refused_ = false;
};

/// The non-real-time end: writes smoothed_navigation.csv and smoothed_NAME.csv of a live run.
class LiveSmoothing {
 public:
  /// @param blocks  state blocks of every S-IMU (SImuConfig::blocks)
  LiveSmoothing(LiveHistory& history, const std::vector<std::uint32_t>& blocks);

  [[nodiscard]] Result<void> open(const OutputFolder& folder, std::vector<SImuFileInfo> infos);
  /// Empties the ring. @param last  newest snapshot, for what smoothing does not change
  /// @param utc   of the run so far
  void drain(const Snapshot& last, const UtcTrack& utc);
  [[nodiscard]] Result<void> close();

 private:
  void write(const SmoothedEpoch& epoch, const Snapshot& last, const UtcTrack& utc);

  LiveHistory& history_;
  std::vector<SImuLayout> layouts_;
  std::optional<FixedLagSmoother> smoother_;
  std::vector<SImuFileInfo> infos_;
  CsvFile navigation_;
  std::vector<CsvFile> studies_;
};

/// The estimate of one S-IMU at a smoothed epoch; what is not a state of the filter is as in `base`.
SImuOutput smoothed_output(const SImuOutput& base, const SmoothedEpoch& epoch, std::size_t index,
                           const SImuLayout& layout);

}  // namespace imuscope
