#include "service/recording/replay.h"

#include <fmt/format.h>
#include <algorithm>

#include "base/units.h"
#include "rt/host_clock.h"
#include "rt/periodic.h"
#include "service/pipeline/device_factory.h"
#include "service/recording/decoded_reads.h"
#include "service/recording/sink_beside.h"

namespace imuscope {

namespace {

/// Decoded samples on their way into the core's ring.
class RingSink final : public SampleSink {
 public:
  /// @param refused  sequence numbers that the live run's ring refused
  /// @param tap      sees every sample; must outlive the sink, may be empty
  RingSink(SampleRing& ring, NumberRanges refused, const std::function<void(const Sample&)>& tap)
      : ring_(&ring), refused_live_(std::move(refused)), tap_(&tap) {}

  void on_sample(const Sample& sample) noexcept override {
    newest_arrival_ = std::max(newest_arrival_, sample.arrival);
    if (*tap_) (*tap_)(sample);
    if (refused_live_.contains(static_cast<std::int64_t>(sample.sequence)) || !ring_->try_push(sample))
      ++refused_;
  }
  [[nodiscard]] HostTime newest_arrival() const { return newest_arrival_; }
  [[nodiscard]] std::uint64_t refused() const { return refused_; }
  [[nodiscard]] bool half_full() const { return ring_->counters().level > ring_->capacity() / 2; }

 private:
  SampleRing* ring_;
  NumberRanges refused_live_;
  const std::function<void(const Sample&)>* tap_;
  HostTime newest_arrival_{HostTime::min()};
  std::uint64_t refused_ = 0;
};

/// One device of the recording: its decoded reads and its ring.
class Feed {
 public:
  Feed(std::unique_ptr<DecodedReads> reads, RingSink sink)
      : reads_(std::move(reads)), sink_(std::move(sink)) {}

  /// Reads the first bytes, so that first_arrival() can be asked.
  Result<void> start() {
    if (auto fetched = fetch(); !fetched) return fetched;
    // Without stamps, arrivals are known once something was decoded.
    while (pending_ && !pending_->arrival && sink_.newest_arrival() == HostTime::min()) {
      if (auto pushed = push_pending(); !pushed) return pushed;
    }
    return {};
  }

  [[nodiscard]] std::optional<HostTime> first_arrival() const {
    if (pending_ && pending_->arrival) return pending_->arrival;
    return sink_.newest_arrival() == HostTime::min() ? std::nullopt : std::optional(sink_.newest_arrival());
  }

  /// Takes everything that had arrived by `cut`, and a little more where arrivals come from the device's time.
  Result<void> feed(HostTime cut) {
    has_fed_ = false;
    while (pending_ && due(cut)) {
      has_fed_ = true;
      if (auto pushed = push_pending(); !pushed) return pushed;
    }
    return {};
  }
  /// Whether the last feed() had something.
  [[nodiscard]] bool has_fed() const { return has_fed_; }

  [[nodiscard]] bool at_end() const { return !pending_; }
  /// When its next bytes are due; nothing at its end.
  [[nodiscard]] std::optional<HostTime> next_due() const {
    if (!pending_) return std::nullopt;
    return pending_->arrival.value_or(sink_.newest_arrival());
  }
  [[nodiscard]] std::uint64_t bytes_read() const { return bytes_; }
  [[nodiscard]] std::uint64_t bytes_total() const { return reads_->bytes_total(); }
  /// Reads that were taken; of a feed that was left before its end the decoder has seen more.
  [[nodiscard]] std::uint64_t taken() const { return taken_; }
  [[nodiscard]] const DeviceDecoder& decoder() const { return reads_->decoder(); }
  [[nodiscard]] const RingSink& sink() const { return sink_; }

 private:
  [[nodiscard]] bool due(HostTime cut) const {
    if (pending_->arrival) return *pending_->arrival <= cut;
    return sink_.newest_arrival() <= cut && !sink_.half_full();
  }

  Result<void> fetch() {
    auto read = reads_->next();
    if (!read) return tl::unexpected<Error>(read.error());
    pending_ = *read;
    return {};
  }

  Result<void> push_pending() {
    for (const Sample& sample : pending_->samples) sink_.on_sample(sample);
    bytes_ = pending_->bytes_so_far;
    ++taken_;
    return fetch();
  }

  std::unique_ptr<DecodedReads> reads_;
  RingSink sink_;
  std::optional<DecodedRead> pending_;
  std::uint64_t bytes_ = 0;
  std::uint64_t taken_ = 0;
  bool has_fed_ = false;
};

class Replayer {
 public:
  Replayer(const Configuration& configuration, const EstimatorConfig& estimator, const Recording& recording,
           CoreSink& sink, const ReplayOptions& options)
      : configuration_(configuration),
        recording_(recording),
        sink_(sink),
        options_(options),
        core_(estimator, configuration.devices.size(),
              recording.schedule ? recording.schedule->core : CoreSchedule{}, options.history),
        feeds_(configuration.devices.size()) {}

  Result<ReplayResult> run() {
    if (auto opened = open(); !opened) return tl::unexpected<Error>(opened.error());
    const auto t0 = first_cut();
    if (!t0)
      return work_error("the recording holds no data that a decoder understands",
                        "check protocols and files");
    if (recording_.pc_clock) core_.set_pc_clock(recording_.pc_clock->time, recording_.pc_clock->utc);
    ReplayResult result;
    result.t0 = *t0;
    if (auto ran = run_ticks(*t0, result.ticks); !ran) return tl::unexpected<Error>(ran.error());
    result.pauses = pauses_;
    for (std::size_t i = 0; i < feeds_.size(); ++i) result.devices.push_back(device_record(i));
    if (auto checked = check(result); !checked) return tl::unexpected<Error>(checked.error());
    return result;
  }

 private:
  Result<void> open() {
    // All devices in the order of their arrivals: one pass over a capture serves them all.
    auto sources = recording_.open_side_by_side(options_.reading);
    if (!sources) return tl::unexpected<Error>(sources.error());
    const bool is_ahead = options_.reading == Reading::kAhead && recording_.has_lines_apart;
    for (std::size_t i = 0; i < feeds_.size(); ++i) {
      if (!recording_.present[i]) continue;
      const auto index = static_cast<DeviceIndex>(i);
      feeds_[i] = std::make_unique<Feed>(
          std::make_unique<DecodedReads>(std::move((*sources)[i]), decoder_of(index), is_ahead),
          RingSink(core_.ring(index), refused(index), options_.on_sample));
      if (auto started = feeds_[i]->start(); !started) return started;
    }
    return {};
  }

  [[nodiscard]] std::unique_ptr<DeviceDecoder> decoder_of(DeviceIndex index) const {
    return make_decoder(configuration_.devices[index], index, recording_.clocks[index].map);
  }

  [[nodiscard]] NumberRanges refused(DeviceIndex device) const {
    if (!recording_.schedule) return {};
    const auto found = recording_.schedule->refused_samples.find(device);
    return found == recording_.schedule->refused_samples.end() ? NumberRanges{} : found->second;
  }

  [[nodiscard]] std::optional<HostTime> first_cut() const {
    if (recording_.schedule) return recording_.schedule->t0;
    std::optional<HostTime> first;
    for (const auto& feed : feeds_) {
      const auto arrival = feed ? feed->first_arrival() : std::nullopt;
      if (arrival && (!first || *arrival < *first)) first = arrival;
    }
    if (!first) return first;
    // On a whole tick, so that the same recording is cut the same way wherever it begins.
    return HostTime{(first->time_since_epoch() / kTickPeriod) * kTickPeriod};
  }

  [[nodiscard]] bool finished(std::int64_t index) const {
    return std::all_of(feeds_.begin(), feeds_.end(),
                       [](const auto& feed) { return !feed || feed->at_end(); }) &&
           index > last_needed_tick_ && !core_.catches_up();
  }

  Result<void> run_ticks(HostTime t0, std::int64_t& ticks) {
    const auto skipped = recording_.schedule ? recording_.schedule->skipped_ticks : NumberRanges{};
    const HostTime started = host_now();
    for (std::int64_t index = 0; !finished(index); ++index) {
      if (options_.is_given_up != nullptr && *options_.is_given_up)
        return work_error("the replay was given up");
      const HostTime cut = t0 + index * kTickPeriod;
      for (auto& feed : feeds_) {
        if (!feed) continue;
        if (auto fed = feed->feed(cut); !fed) return fed;
        // What is decoded must be consumed, and waited for as long as the estimator waits for a late
        // reference.
        if (feed->sink().newest_arrival() > HostTime::min()) {
          last_needed_tick_ =
              std::max(last_needed_tick_, (feed->sink().newest_arrival() - t0) / kTickPeriod + kTailTicks);
        }
      }
      if (core_.catches_up() || is_busy(cut)) last_busy_tick_ = index;
      if (index > last_busy_tick_ + kTailTicks) {
        const std::int64_t stepped = pause(index, cut);
        if (stepped < 0) break;
        if (stepped > 0) {
          index += stepped - 1;
          ticks += stepped;
          continue;
        }
      }
      if (skipped.contains(index)) continue;
      if (options_.realtime) sleep_until(started + index * kTickPeriod);
      core_.tick(index, cut, sink_);
      ++ticks;
      if (index % kProgressTicks == 0 && options_.progress) options_.progress(share_read());
    }
    return {};
  }

  /// Whether the tick of this cut has something to consume that came since the one before.
  [[nodiscard]] bool is_busy(HostTime cut) {
    for (std::size_t i = 0; i < feeds_.size(); ++i) {
      if (!feeds_[i]) continue;
      if (feeds_[i]->has_fed()) return true;
      const Sample* sample = core_.ring(static_cast<DeviceIndex>(i)).front();
      if (sample != nullptr && sample->arrival <= cut && sample->arrival > cut - kTickPeriod) return true;
    }
    return false;
  }

  /// When something next happens; nothing where nothing is left.
  [[nodiscard]] std::optional<HostTime> next_event(HostTime cut) {
    std::optional<HostTime> next;
    const auto consider = [&](std::optional<HostTime> time) {
      if (time && (!next || *time < *next)) next = time;
    };
    for (std::size_t i = 0; i < feeds_.size(); ++i) {
      if (!feeds_[i]) continue;
      consider(feeds_[i]->next_due());
      const Sample* sample = core_.ring(static_cast<DeviceIndex>(i)).front();
      // What is held back as late is no event: its tick is run, or was stepped over.
      if (sample != nullptr && sample->arrival > cut) consider(sample->arrival);
    }
    return next;
  }

  /// One tick of a pause: how many ticks are stepped over from here; 0 to run this one, less where the
  /// recording is at its end, or to be left here.
  [[nodiscard]] std::int64_t pause(std::int64_t index, HostTime cut) {
    const auto next = next_event(cut);
    if (!next) return -1;
    if (*next - cut > kLongestPause - idle_) return -1;
    idle_ += kTickPeriod;
    if ((index - last_busy_tick_) * kTickPeriod <= kLongestIdle) return 0;
    // The first tick whose cut is not before the event is the next to be run.
    const Duration rest = *next - cut;
    const std::int64_t n = (rest + kTickPeriod - Duration{1}) / kTickPeriod;
    if (n <= 1) return 0;
    idle_ += (n - 1) * kTickPeriod;
    const Duration whole = rest + (index - last_busy_tick_) * kTickPeriod;
    pauses_.n += 1;
    pauses_.total += whole;
    pauses_.longest = std::max(pauses_.longest, whole);
    return n;
  }

  [[nodiscard]] double share_read() const {
    double read = 0.0;
    double total = 0.0;
    for (const auto& feed : feeds_) {
      if (!feed) continue;
      read += static_cast<double>(feed->bytes_read());
      total += static_cast<double>(feed->bytes_total());
    }
    return total > 0.0 ? read / total : 1.0;
  }

  /// What the decoder counted in the reads that were taken, of a feed that was left before its end.
  [[nodiscard]] DecoderCounters counted_so_far(std::size_t i) const {
    const auto index = static_cast<DeviceIndex>(i);
    auto source = recording_.open(index);
    if (!source) return {};
    DecodedReads again(std::move(*source), decoder_of(index), false);
    for (std::uint64_t n = 0; n < feeds_[i]->taken(); ++n) {
      if (!again.next()) break;
    }
    return again.decoder().counters();
  }

  [[nodiscard]] DeviceRecord device_record(std::size_t i) const {
    DeviceRecord record;
    record.clock = recording_.clocks[i].how;
    record.clock_shift_s = recording_.clocks[i].shift_s;
    if (!feeds_[i]) return record;
    const Feed& feed = *feeds_[i];
    record.refused = feed.sink().refused();
    record.counters = feed.at_end() ? feed.decoder().counters() : counted_so_far(i);
    record.problem =
        feed.at_end()
            ? decoder_problem(configuration_.devices[i], feed.decoder())
            : fmt::format("only {} of {} bytes are used: {} more than {} h{}", record.counters.bytes,
                          feed.bytes_total(),
                          pauses_.n == 0 ? "the next stamp lies" : "with the next stamp, the pauses are",
                          std::chrono::duration_cast<std::chrono::hours>(kLongestPause).count(),
                          pauses_.n == 0 ? " ahead" : " together");
    return record;
  }

  [[nodiscard]] Result<void> check(const ReplayResult& result) const {
    for (std::size_t i = 0; i < result.devices.size(); ++i) {
      if (!recording_.present[i] || result.devices[i].counters.samples > 0) continue;
      return tl::unexpected<Error>(
          no_sample_error(configuration_.devices[i], recording_.inputs, feeds_[i]->decoder()));
    }
    return {};
  }

  static constexpr std::int64_t kProgressTicks = 500;

  const Configuration& configuration_;
  const Recording& recording_;
  CoreSink& sink_;
  const ReplayOptions& options_;
  Core core_;
  std::vector<std::unique_ptr<Feed>> feeds_;
  std::int64_t last_needed_tick_ = 0;
  std::int64_t last_busy_tick_ = 0;
  Duration idle_{};  ///< of the pauses so far
  SteppedPauses pauses_;
};

}  // namespace

std::vector<SImuFileInfo> study_file_infos(const Configuration& configuration, const Recording& recording) {
  std::vector<SImuFileInfo> infos;
  for (const auto index : configuration.study_indices()) {
    infos.push_back({configuration.devices[index].name, recording.clocks[index].shift_s});
  }
  return infos;
}

Result<ReplayResult> replay(const Configuration& configuration, const EstimatorConfig& estimator,
                            const Recording& recording, CoreSink& sink, const ReplayOptions& options) {
  if (!options.has_sink_beside) return Replayer(configuration, estimator, recording, sink, options).run();
  SinkBeside beside(sink);
  return Replayer(configuration, estimator, recording, beside, options).run();
}

std::vector<std::string> warnings_of(const Recording& recording, const ReplayResult& result) {
  std::vector<std::string> warnings = recording.damage;
  const SteppedPauses& pauses = result.pauses;
  if (pauses.n == 0) return warnings;
  warnings.push_back(fmt::format(
      "{} times no device said anything for more than {} minutes, {:.2f} h in all and {:.2f} h at most; "
      "these pauses were stepped over",
      pauses.n, std::chrono::duration_cast<std::chrono::minutes>(kLongestIdle).count(),
      to_seconds(pauses.total) / kSecondsPerHour, to_seconds(pauses.longest) / kSecondsPerHour));
  return warnings;
}

}  // namespace imuscope
