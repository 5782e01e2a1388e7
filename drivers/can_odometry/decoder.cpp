#include "drivers/can_odometry/decoder.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <utility>

namespace imuscope::can_odometry {
namespace {

constexpr double kMpsPerKmph = 1.0 / 3.6;
constexpr double kMpsPerMph = 0.44704;  // international mile, 1609.344 m

/// A wheel whose frame is older than this many periods does not belong to the set.
constexpr double kSetPeriods = 1.5;
/// A speed that jumped is believed when so many in a row say the same: then the one before was wrong.
constexpr int kJumpBelieved = 10;
/// A wheel that leaves its sensor's dead band shows its speed at once.
constexpr double kDeadBand_mps = 1.0;
/// Speeds further apart in time are not compared.
constexpr double kCompared_s = 1.0;
/// A gap lacks a set when it is longer than these periods and mean deviations from the period together; one
/// of more than kGapTaken periods says nothing more about the rate.
constexpr double kGapPeriods = 1.5;
constexpr double kGapJitters = 4.0;
constexpr double kGapTaken = 4.0;
constexpr double kLearned = 1.0 / 16.0;
constexpr double kLearnedOfGaps = 1.0 / 128.0;
constexpr std::uint64_t kSetsToLearn = 64;
/// What was wrong is told for so long after it was seen last.
constexpr Duration kRemarkStays = std::chrono::seconds(60);

struct UnitName {
  std::string_view name;
  SpeedUnit unit;
};
constexpr auto kUnitNames = std::to_array<UnitName>({{"m/s", SpeedUnit::kMps},
                                                     {"mps", SpeedUnit::kMps},
                                                     {"km/h", SpeedUnit::kKmph},
                                                     {"kmh", SpeedUnit::kKmph},
                                                     {"kph", SpeedUnit::kKmph},
                                                     {"kmph", SpeedUnit::kKmph},
                                                     {"mph", SpeedUnit::kMph},
                                                     {"rad/s", SpeedUnit::kRadps}});

std::string lower_case(std::string_view text) {
  std::string lower(text);
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return lower;
}

std::optional<SpeedUnit> unit_of(std::string_view name) {
  const std::string lower = lower_case(name);
  for (const UnitName& known : kUnitNames) {
    if (known.name == lower) return known.unit;
  }
  return std::nullopt;
}

double to_mps(SpeedUnit unit, double wheel_radius_m) {
  switch (unit) {
    case SpeedUnit::kKmph:
      return kMpsPerKmph;
    case SpeedUnit::kMph:
      return kMpsPerMph;
    case SpeedUnit::kRadps:
      return wheel_radius_m;
    case SpeedUnit::kMps:
      break;
  }
  return 1.0;
}

/// A number in a speed's place that has such a name is no speed.
bool means_no_speed(std::string_view name) {
  constexpr auto kWords =
      std::to_array<std::string_view>({"invalid", "not avail", "notavail", "not_avail", "unavailable",
                                       "error", "fault", "fail", "sna", "init", "undefined", "unknown"});
  const std::string lower = lower_case(name);
  return std::any_of(kWords.begin(), kWords.end(),
                     [&](std::string_view word) { return lower.find(word) != std::string::npos; });
}

std::int64_t number_of(const dbc::SignalLayout& layout, std::uint64_t raw) noexcept {
  return layout.coding == dbc::Coding::kSigned ? dbc::signed_of(layout, raw) : static_cast<std::int64_t>(raw);
}

bool contains(const std::vector<std::int64_t>& numbers, std::int64_t number) noexcept {
  return std::find(numbers.begin(), numbers.end(), number) != numbers.end();
}

}  // namespace

Result<std::unique_ptr<Decoder>> Decoder::make(const dbc::Database& database, const Choice& choice,
                                               const DecoderConfig& config) {
  std::unique_ptr<Decoder> decoder(new Decoder(config));
  if (choice.speed_signals.empty())
    return usage_error("no speed_signals are chosen",
                       "name the wheel speeds in the DBC file, MESSAGE.SIGNAL");
  for (const std::string& name : choice.speed_signals) {
    if (auto added = decoder->add_speed(database, name, choice); !added)
      return tl::unexpected<Error>(added.error());
  }
  decoder->wheels_.resize(choice.speed_signals.size());
  decoder->has_no_sign_ = choice.has_no_sign;
  if (auto added = decoder->add_direction(database, choice); !added)
    return tl::unexpected<Error>(added.error());
  for (const std::string& name : choice.fault_signals) {
    if (auto added = decoder->add(database, name, Use::kFault); !added)
      return tl::unexpected<Error>(added.error());
  }
  if (!choice.counter_signal.empty()) {
    if (auto added = decoder->add(database, choice.counter_signal, Use::kCounter); !added)
      return tl::unexpected<Error>(added.error());
  }
  // Within one frame: faults and direction before the speeds that they concern.
  std::stable_sort(decoder->signals_.begin(), decoder->signals_.end(), [](const Signal& a, const Signal& b) {
    return a.use != Use::kSpeed && b.use == Use::kSpeed;
  });
  return decoder;
}

Result<std::size_t> Decoder::add(const dbc::Database& database, const std::string& name, Use use) {
  const auto found = database.choose(name);
  if (!found) return tl::unexpected<Error>(found.error());
  const dbc::Message& message = database.messages[found->message];
  const auto known = std::find_if(messages_.begin(), messages_.end(),
                                  [&](const dbc::Message& m) { return m.line == message.line; });
  const auto index = static_cast<std::size_t>(known - messages_.begin());
  if (known == messages_.end()) messages_.push_back(message);
  Signal signal;
  signal.message = index;
  signal.signal = found->signal;
  signal.use = use;
  signals_.push_back(std::move(signal));
  return signals_.size() - 1;
}

Result<void> Decoder::add_speed(const dbc::Database& database, const std::string& name,
                                const Choice& choice) {
  const auto added = add(database, name, Use::kSpeed);
  if (!added) return tl::unexpected<Error>(added.error());
  Signal& signal = signals_[*added];
  const dbc::Signal& described = messages_[signal.message].signals[signal.signal];
  const auto unit = choice.unit ? choice.unit : unit_of(described.unit);
  if (!unit) {
    return usage_error(fmt::format("{}: signal {} is in \"{}\", which is no unit of speed", database.file,
                                   name, described.unit),
                       "give speed_unit: m/s, km/h, mph or rad/s");
  }
  if (*unit == SpeedUnit::kRadps && choice.wheel_radius_m <= 0.0) {
    return usage_error(fmt::format("{}: signal {} is an angular rate", database.file, name),
                       "give wheel_radius_m");
  }
  signal.to_mps = to_mps(*unit, choice.wheel_radius_m);
  signal.wheel = *added;
  for (const dbc::NamedValue& value : described.names) {
    if (means_no_speed(value.name)) signal.numbers.push_back(value.number);
  }
  for (const double number : choice.invalid_raw) signal.numbers.push_back(std::llround(number));
  return {};
}

Result<void> Decoder::add_direction(const dbc::Database& database, const Choice& choice) {
  if (choice.direction_signal.empty()) return {};
  const auto added = add(database, choice.direction_signal, Use::kDirection);
  if (!added) return tl::unexpected<Error>(added.error());
  Signal& signal = signals_[*added];
  const dbc::Signal& described = messages_[signal.message].signals[signal.signal];
  std::vector<std::string> names;
  for (const dbc::NamedValue& value : described.names) names.push_back(value.name);
  for (const std::string& wanted : choice.backward_values) {
    std::int64_t number = 0;
    const auto [end, error] = std::from_chars(wanted.data(), wanted.data() + wanted.size(), number);
    const auto named = std::find(names.begin(), names.end(), wanted);
    if (named != names.end()) {
      number = described.names[static_cast<std::size_t>(named - names.begin())].number;
    } else if (error != std::errc{} || end != wanted.data() + wanted.size()) {
      return usage_error(fmt::format("{}: signal {} has no value called '{}'", database.file,
                                     choice.direction_signal, wanted),
                         names.empty() ? "its values have no names: give a number"
                                       : fmt::format("it has {}", fmt::join(names, ", ")));
    }
    signal.numbers.push_back(number);
  }
  return {};
}

std::vector<CanId> Decoder::ids() const {
  std::vector<CanId> ids;
  for (const dbc::Message& message : messages_) ids.push_back({message.id, message.is_extended});
  return ids;
}

void Decoder::on_frame(const CanFrame& frame, HostTime arrival, SampleSink& sink) noexcept {
  const dbc::Message* too_short = nullptr;
  bool has_speed = false;
  for (const Signal& signal : signals_) {
    const dbc::Message& message = messages_[signal.message];
    if (message.id != frame.id || message.is_extended != frame.is_extended) continue;
    const dbc::SignalLayout& layout = message.signals[signal.signal].layout;
    const auto raw = dbc::raw_in_frame(message, signal.signal, frame.payload());
    if (!raw) {
      // Another multiplex is no fault; a frame without room for the signal is.
      if (frame.length >= dbc::bytes_needed(layout)) continue;
      too_short = &message;
      continue;
    }
    switch (signal.use) {
      case Use::kDirection:
        backward_ = contains(signal.numbers, number_of(layout, *raw));
        break;
      case Use::kFault:
        fault_ = *raw != 0;
        break;
      case Use::kCounter:
        on_counter(signal, *raw);
        break;
      case Use::kSpeed:
        has_speed = true;
        take_speed(signal, *raw, frame.stamp);
        break;
    }
  }
  if (too_short != nullptr) on_short_frame(*too_short, frame);
  if (has_speed) emit(arrival, sink);
}

// Without numbers that grow: a sentence that stays the same is said once.
void Decoder::on_short_frame(const dbc::Message& message, const CanFrame& frame) noexcept {
  ++odometry_counters_.too_short;
  ++counters_.bad_contents;
  remarked_ = frame.stamp;
  remark_.say(
      "frames of {} are too short for a chosen signal ({} bytes received, {} in the DBC file); check that "
      "the DBC file is this vehicle's",
      message.name, frame.length, message.length);
}

void Decoder::on_impossible(double speed_mps, HostTime stamp) noexcept {
  ++counters_.bad_contents;
  ++odometry_counters_.impossible;
  remarked_ = stamp;
  if (std::exchange(impossible_told_, true)) return;
  remark_.say(
      "impossible speeds were refused, such as {:.1f} m/s; check unit and factor of the speed signals",
      speed_mps);
}

void Decoder::on_invalid() noexcept {
  ++odometry_counters_.invalid;
  if (counters_.samples == 0)
    remark_.say("every speed was marked as invalid by the vehicle; is the ignition on?");
}

void Decoder::on_counter(const Signal& signal, std::uint64_t raw) noexcept {
  const dbc::SignalLayout& layout = messages_[signal.message].signals[signal.signal].layout;
  const std::uint64_t mask =
      layout.length >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << layout.length) - 1;
  if (last_count_) {
    const std::uint64_t step = (raw - *last_count_) & mask;
    if (step > 1) counters_.samples_lost += step - 1;
  }
  last_count_ = raw;
}

void Decoder::take_speed(const Signal& signal, std::uint64_t raw, HostTime stamp) noexcept {
  const dbc::SignalLayout& layout = messages_[signal.message].signals[signal.signal].layout;
  Wheel& wheel = wheels_[signal.wheel];
  const double value = dbc::value_of(layout, raw);
  wheel.is_new = true;
  wheel.is_good = !fault_ && std::isfinite(value) && !contains(signal.numbers, number_of(layout, raw));
  wheel.stamp = stamp;
  wheel.speed_mps = signal.to_mps * value;
}

void Decoder::emit(HostTime arrival, SampleSink& sink) noexcept {
  HostTime newest = wheels_.front().stamp;
  for (const Wheel& wheel : wheels_) {
    if (!wheel.is_new) return;
    newest = std::max(newest, wheel.stamp);
  }
  const Duration set = from_seconds(kSetPeriods / config_.rate_hz);
  bool complete = true;
  for (Wheel& wheel : wheels_) {
    if (newest - wheel.stamp <= set) continue;
    wheel.is_new = false;
    complete = false;
  }
  if (!complete) {
    ++odometry_counters_.incomplete;
    return;
  }
  bool good = true;
  double sum_mps = 0.0;
  for (Wheel& wheel : wheels_) {
    wheel.is_new = false;
    good = good && wheel.is_good;
    sum_mps += wheel.speed_mps;
  }
  if (!good) {
    on_invalid();
    return;
  }
  const double mean_mps = sum_mps / static_cast<double>(wheels_.size());
  count_by_time(newest);
  const double speed_mps = backward_ ? -std::abs(mean_mps) : mean_mps;
  if (!is_possible(speed_mps, newest)) {
    on_impossible(speed_mps, newest);
    return;
  }
  if (counters_.samples == 0 || newest - remarked_ > kRemarkStays) {
    remark_.clear();
    impossible_told_ = false;
  }
  Sample sample{};
  sample.kind = SampleKind::kOdometry;
  sample.device = config_.device;
  sample.sequence = sequence_++;
  sample.arrival = arrival;
  sample.time = newest - config_.latency;
  sample.odometry.speed_mps = speed_mps;
  sample.odometry.flags = has_no_sign_ ? kSpeedHasNoSign : 0U;
  ++counters_.samples;
  sink.on_sample(sample);
}

void Decoder::count_by_time(HostTime stamp) noexcept {
  const double gap_s = to_seconds(stamp - last_set_);
  const bool has_gap = sets_ > 0;
  last_set_ = stamp;
  ++sets_;
  if (!has_gap) {
    period_s_ = 1.0 / config_.rate_hz;
    return;
  }
  const double periods = gap_s / period_s_;
  const bool lacks = gap_s > kGapPeriods * period_s_ + kGapJitters * jitter_s_;
  if (lacks && sets_ > kSetsToLearn && !last_count_) {
    counters_.samples_lost += static_cast<std::uint64_t>(std::llround(periods)) - 1;
  }
  // Losses hardly count for the rate; one that really changes is learned within seconds all the same.
  const double learned = lacks && sets_ > kSetsToLearn ? kLearnedOfGaps : kLearned;
  period_s_ += learned * (std::min(gap_s, kGapTaken * period_s_) - period_s_);
  // Stamps that bunch, as those of one read do, are no higher rate.
  period_s_ = std::max(period_s_, 1.0 / config_.rate_hz);
  if (!lacks) jitter_s_ += kLearned * (std::abs(gap_s - period_s_) - jitter_s_);
}

bool Decoder::is_possible(double speed_mps, HostTime stamp) noexcept {
  if (std::abs(speed_mps) > config_.max_speed_mps) return false;
  const double dt_s = to_seconds(stamp - last_stamp_);
  const bool jumped =
      has_last_ && dt_s < kCompared_s &&
      std::abs(speed_mps - last_speed_mps_) >
          kDeadBand_mps + config_.max_acceleration_mps2 * std::max(dt_s, 1.0 / config_.rate_hz);
  if (jumped && ++impossible_in_a_row_ < kJumpBelieved) return false;
  impossible_in_a_row_ = 0;
  has_last_ = true;
  last_speed_mps_ = speed_mps;
  last_stamp_ = stamp;
  return true;
}

}  // namespace imuscope::can_odometry
