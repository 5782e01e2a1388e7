#include "drivers/xsens_mt/session.h"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>

#include "base/bytes.h"
#include "base/contracts.h"
#include "drivers/xsens_mt/inertial.h"

namespace imuscope::xsens {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr int kWantedToTakeOver = 20;
// How long to listen for them: not less than this, and in messages.
constexpr Duration kListenAtLeast = milliseconds{600};
constexpr double kListenMessages = 30.0;
// 20 messages in bursts of 16 ms at 100 Hz: 8 %.
constexpr double kRateTolerance = 0.15;
// Some devices ignore GoToConfig while they boot, and repeat data meanwhile.
constexpr Duration kGoToConfigEvery = milliseconds{150};
constexpr int kGoToConfigAttempts = 20;
constexpr int kGoToConfigAttemptsInSearch = 6;
constexpr Duration kWakeUpWithin = seconds{3};
constexpr Duration kReplyWithin = milliseconds{500};
constexpr Duration kFirstDataWithin = seconds{2};
constexpr int kAttempts = 4;
constexpr int kRounds = 3;
constexpr Duration kAfterWakeUp = milliseconds{50};
// A stream is gone after this, or after kSilentMessages of a slow device.
constexpr Duration kSilence = seconds{1};
constexpr double kSilentMessages = 20.0;
// Then it is asked to measure, which does not disturb one that does, before it is set up again.
constexpr Duration kAskToMeasureEvery = seconds{1};
constexpr int kAskToMeasureAttempts = 10;
// Of the line's capacity; more leaves no room for the device's own jitter.
constexpr double kLineLoadMax = 0.9;
constexpr double kPeriodTolerance = 1e-3;
// What a vehicle can do to a sensor, to tell real data from bytes that happen to have the right length.
constexpr double kForceMin_mps2 = 1.0;
constexpr double kForceMax_mps2 = 500.0;
constexpr double kRateMax_radps = 50.0;

struct WantedItem {
  std::uint16_t id;
  bool at_rate;  ///< else with every message
};
constexpr std::array<WantedItem, 5> kWantedItems{{{xdi::kPacketCounter, false},
                                                  {xdi::kSampleTimeFine, false},
                                                  {xdi::kAcceleration, true},
                                                  {xdi::kRateOfTurn, true},
                                                  {xdi::kStatusWord, false}}};

double norm(const std::array<double, 3>& v) { return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

bool is_plausible(const std::array<double, 3>& rate_radps, const std::array<double, 3>& force_mps2) {
  return norm(rate_radps) < kRateMax_radps && norm(force_mps2) > kForceMin_mps2 &&
         norm(force_mps2) < kForceMax_mps2;  // false for NaN
}

}  // namespace

MtSession::MtSession(const MtSessionConfig& config) : config_(config) {
  IMUSCOPE_EXPECTS(config.rate_hz > 0.0);
  const auto length = data_length(config.layout);
  IMUSCOPE_EXPECTS(length.has_value());
  wanted_length_ = *length;
  listen_for_ = std::max(kListenAtLeast, from_seconds(kListenMessages / config.rate_hz));
  const double period = kPeriodTicksPerSecond / config.rate_hz;
  period_ = static_cast<std::uint16_t>(std::clamp(std::round(period), 1.0, 65535.0));
  const std::size_t data_bytes =
      config.bus_devices == 0 ? wanted_length_ : sizeof(std::uint16_t) + config.bus_devices * wanted_length_;
  const std::size_t header = data_bytes < kExtendedLength ? kHeaderSize : kExtendedHeaderSize;
  const double frame_bits =
      (kBitsBeforeStop + config.stop_bits) * static_cast<double>(header + data_bytes + kChecksumSize);
  if (std::abs(period / period_ - 1.0) > kPeriodTolerance) {
    step_ = Step::kFailed;
    say("an MT device cannot send %.6g times a second; the nearest it can is %.6g: set rate_hz",
        config.rate_hz, kPeriodTicksPerSecond / period_);
  } else if (config.baud > 0.0 && frame_bits * config.rate_hz > kLineLoadMax * config.baud) {
    step_ = Step::kFailed;
    say("%.0f bit/s are wanted of a line of %.0f baud; raise the baud rate, lower rate_hz or send less",
        frame_bits * config.rate_hz, config.baud);
  }
}

SessionState MtSession::state() const noexcept {
  switch (step_) {
    case Step::kListen:
    case Step::kGoToConfig:
    case Step::kReset:
    case Step::kSilent:
      return SessionState::kConnecting;
    case Step::kStreaming:
      return SessionState::kStreaming;
    case Step::kFailed:
      return SessionState::kFailed;
    default:
      return SessionState::kConfiguring;
  }
}

void MtSession::on_bytes(std::span<const std::uint8_t> bytes, HostTime now) noexcept {
  bytes_ += bytes.size();
  look_for_text(bytes);
  Frame frame;
  while (!bytes.empty()) {
    bytes = bytes.subspan(scanner_.append(bytes, now));
    while (scanner_.next(frame)) {
      if (frame.nested) continue;  // the device repeats what it was asked for
      ++frames_;
      on_frame(frame, now);
    }
  }
}

// A line that begins with '$': no measurement looks like that for long, since every data frame ends the
// search.
void MtSession::look_for_text(std::span<const std::uint8_t> bytes) noexcept {
  for (const std::uint8_t byte : bytes) {
    if (byte == '$' && last_byte_ == '\n') sends_text_ = true;
    last_byte_ = byte;
  }
}

std::span<const std::uint8_t> MtSession::poll(HostTime now) noexcept {
  if (step_ == Step::kFailed) return {};
  if (!started_) {
    started_ = true;
    enter(config_.device_id ? Step::kGoToConfig : Step::kListen, now);
  }
  if (acknowledge_wake_up_) {
    acknowledge_wake_up_ = false;
    next_send_ = now + kAfterWakeUp;
    return wake_up_ack_.bytes();
  }
  if (step_ == Step::kStreaming) watch_stream(now);
  if (step_ == Step::kListen && now - step_since_ >= listen_for_) enter(Step::kGoToConfig, now);
  if (step_ == Step::kMeasure && !to_send_ && now - step_since_ >= kFirstDataWithin) {
    say("the device acknowledged GoToMeasurement but sends nothing; it will be set up again");
    fail_round(now);
  }
  if (step_ == Step::kReset && attempts_ > 0 && now - step_since_ >= kWakeUpWithin)
    enter(Step::kGoToConfig, now);
  if (to_send_ && now >= next_send_) on_timeout(now);
  if (!to_send_ || now < next_send_) return {};
  ++attempts_;
  next_send_ = now + repeat_after(step_);
  if (step_ == Step::kReset) to_send_ = false;
  return request_.bytes();
}

Duration MtSession::repeat_after(Step step) noexcept {
  switch (step) {
    case Step::kGoToConfig:
      return kGoToConfigEvery;
    case Step::kSilent:
      return kAskToMeasureEvery;
    default:
      return kReplyWithin;
  }
}

// Called when the time to send has come: the first time it does nothing, later the reply is overdue.
void MtSession::on_timeout(HostTime now) noexcept {
  if (step_ == Step::kGoToConfig) {
    if (attempts_ < (config_.searching_baud ? kGoToConfigAttemptsInSearch : kGoToConfigAttempts)) return;
    say_why_there_is_no_answer();
    wants_other_baud_ = frames_ == 0;
    enter(Step::kReset, now);
  } else if (step_ == Step::kSilent) {
    if (attempts_ >= kAskToMeasureAttempts) enter(Step::kGoToConfig, now);
  } else if (attempts_ >= kAttempts) {
    say("the device does not answer message 0x%02X; it will be set up again",
        static_cast<unsigned>(awaited_ - 1));
    fail_round(now);
  }
}

void MtSession::fail_round(HostTime now) noexcept {
  if (++rounds_ < kRounds) {
    enter(Step::kGoToConfig, now);
  } else {
    step_ = Step::kFailed;
    to_send_ = false;
  }
}

void MtSession::refuse_device() noexcept {
  say("this is device %08X, and %08X was expected: are two sensors' plugs exchanged? Exchange "
      "them again, or their device_id",
      static_cast<unsigned>(*device_id_), static_cast<unsigned>(*config_.device_id));
  step_ = Step::kFailed;
  to_send_ = false;
}

void MtSession::enter(Step step, HostTime now) noexcept {
  step_ = step;
  step_since_ = now;
  next_send_ = now;
  attempts_ = 0;
  to_send_ = false;
  switch (step) {
    case Step::kListen:
    case Step::kGoToConfig:
      bytes_ = 0;
      frames_ = 0;
      data_frames_ = 0;
      wanted_in_a_row_ = 0;
      break;
    case Step::kStreaming:
      last_data_ = now;
      last_wanted_ = now;
      rounds_ = 0;
      no_problem();
      break;
    default:
      break;
  }
  prepare();
}

void MtSession::prepare() noexcept {
  const SyncIn sync = config_.sync_in.value_or(SyncIn{});
  const auto sync_u16 = [](std::uint8_t parameter, std::uint16_t value) {
    const auto v = be16(value);
    return std::array<std::uint8_t, 3>{parameter, v[0], v[1]};
  };
  switch (step_) {
    case Step::kGoToConfig:
      set_request(kMasterBid, mid::kGoToConfig);
      break;
    case Step::kReset:
      set_request(kMasterBid, mid::kReset);
      break;
    case Step::kIdentify:
      set_request(kMasterBid, mid::kReqDid);
      break;
    case Step::kLeaveTextMode:
      set_request(kMasterBid, mid::kStringOutputType, be16(0));
      break;
    case Step::kReadConfiguration:
    case Step::kCheckConfiguration:
      set_request(kMasterBid, mid::kReqConfiguration);
      break;
    case Step::kSetPeriod:
      set_request(kMasterBid, mid::kPeriod, be16(period_));
      break;
    case Step::kSetSkipFactor:
      set_request(kMasterBid, mid::kOutputSkipFactor, be16(0));
      break;
    case Step::kSetMode:
      set_request(bid_of_device(), mid::kOutputMode, be16(config_.layout.mode));
      break;
    case Step::kSetSettings:
      set_request(bid_of_device(), mid::kOutputSettings, be32(config_.layout.settings));
      break;
    case Step::kSetSyncInMode:
      set_request(kMasterBid, mid::kSyncInSettings, sync_u16(0, sync.mode));
      break;
    case Step::kSetSyncInSkip:
      set_request(kMasterBid, mid::kSyncInSettings, sync_u16(1, sync.skip));
      break;
    case Step::kSetSyncInOffset: {
      const auto v = be32(sync.offset);
      set_request(kMasterBid, mid::kSyncInSettings, std::array<std::uint8_t, 5>{2, v[0], v[1], v[2], v[3]});
      break;
    }
    case Step::kCheckDataLength:
      set_request(kMasterBid, mid::kReqDataLength);
      break;
    case Step::kSetOutputConfiguration: {
      std::array<std::uint8_t, kWantedItems.size() * kOutputItemSize> data{};
      const auto rate = static_cast<std::uint16_t>(std::lround(config_.rate_hz));
      for (std::size_t i = 0; i < kWantedItems.size(); ++i) {
        const auto id = be16(kWantedItems[i].id);
        const auto hz = be16(kWantedItems[i].at_rate ? rate : kEveryMessage);
        std::copy(id.begin(), id.end(), data.begin() + static_cast<std::ptrdiff_t>(kOutputItemSize * i));
        std::copy(hz.begin(), hz.end(), data.begin() + static_cast<std::ptrdiff_t>(kOutputItemSize * i + 2));
      }
      set_request(kMasterBid, mid::kOutputConfiguration, data);
      break;
    }
    case Step::kMeasure:
    case Step::kSilent:
      set_request(kMasterBid, mid::kGoToMeasurement);
      break;
    case Step::kListen:
    case Step::kStreaming:
    case Step::kFailed:
      break;
  }
}

void MtSession::set_request(std::uint8_t bid, std::uint8_t mid, std::span<const std::uint8_t> data) noexcept {
  request_ = OutgoingFrame(bid, mid, data);
  awaited_ = mid::reply_to(mid);
  to_send_ = true;
}

std::uint8_t MtSession::bid_of_device() const noexcept {
  const bool on_bus = configuration_ && configuration_->is_xbus_master();
  return on_bus ? static_cast<std::uint8_t>(device_ + 1) : kMasterBid;
}

void MtSession::on_frame(const Frame& frame, HostTime now) noexcept {
  if (step_ == Step::kFailed && frame.mid != mid::kWakeUp) return;
  switch (frame.mid) {
    case mid::kMtData:
    case mid::kMtData2:
      on_data(frame, now);
      return;
    case mid::kWakeUp:
      // The device started anew. Acknowledged within 500 ms it waits for settings, else it measures.
      rounds_ = 0;
      enter(Step::kGoToConfig, now);
      acknowledge_wake_up_ = true;
      return;
    case mid::kError:
      if (!frame.data.empty()) on_error(frame.data[0], now);
      return;
    default:
      if (to_send_ && attempts_ > 0 && frame.mid == awaited_) on_reply(frame, now);
      return;
  }
}

void MtSession::on_error(std::uint8_t code, HostTime now) noexcept {
  const std::string_view text = error_text(code);
  say("the device reports error 0x%02X: %.*s", code, static_cast<int>(text.size()), text.data());
  if (step_ == Step::kSetOutputConfiguration && config_.output == MtSessionConfig::Output::kAsDevice) {
    // An older device that had nothing selected.
    legacy_after_refusal_ = true;
    enter(Step::kSetPeriod, now);
    return;
  }
  const bool asked = state() == SessionState::kConfiguring && attempts_ > 0;
  if (asked && attempts_ >= kAttempts) {
    fail_round(now);
  } else if (asked) {
    next_send_ = now;
  }
}

void MtSession::on_reply(const Frame& frame, HostTime now) noexcept {
  switch (step_) {
    case Step::kGoToConfig:
      enter(Step::kIdentify, now);
      break;
    case Step::kIdentify:
      if (frame.data.size() < 4) return;
      device_id_ = read_be<std::uint32_t>(frame.data);
      if (config_.device_id && device_id_ != config_.device_id) return refuse_device();
      enter(sends_text_ ? Step::kLeaveTextMode : Step::kReadConfiguration, now);
      break;
    case Step::kLeaveTextMode:
      sends_text_ = false;
      enter(Step::kReadConfiguration, now);
      break;
    case Step::kReadConfiguration:
    case Step::kCheckConfiguration:
      configuration_ = read_configuration(frame.data);
      if (!configuration_) return;
      if (step_ == Step::kReadConfiguration) {
        on_configuration_read(now);
      } else {
        on_configuration_checked(now);
      }
      break;
    case Step::kSetPeriod:
      enter(Step::kSetSkipFactor, now);
      break;
    case Step::kSetSkipFactor:
      device_ = 0;
      enter(Step::kSetMode, now);
      break;
    case Step::kSetMode:
      enter(Step::kSetSettings, now);
      break;
    case Step::kSetSettings:
      next_device_or(Step::kCheckDataLength, now);
      break;
    case Step::kSetSyncInMode:
      enter(Step::kSetSyncInSkip, now);
      break;
    case Step::kSetSyncInSkip:
      enter(Step::kSetSyncInOffset, now);
      break;
    case Step::kSetSyncInOffset:
      sync_in_written_ = true;
      set_output(now);
      break;
    case Step::kCheckDataLength:
      if (frame.data.size() < 2) return;
      if (const std::size_t length = read_be<std::uint16_t>(frame.data);
          !configuration_->is_xbus_master() && length != wanted_length_) {
        say("the device will send %zu bytes a message, %zu were asked for; is this output mode known to it?",
            length, wanted_length_);
        fail_round(now);
      } else {
        enter(Step::kCheckConfiguration, now);
      }
      break;
    case Step::kSetOutputConfiguration:
      on_output_configuration(frame.data, now);
      break;
    case Step::kMeasure:
      // Streaming begins with the first data.
      to_send_ = false;
      break;
    default:
      break;
  }
}

void MtSession::next_device_or(Step step, HostTime now) noexcept {
  if (configuration_->is_xbus_master() && device_ + 1 < configuration_->n_devices) {
    ++device_;
    enter(Step::kSetMode, now);
  } else {
    enter(step, now);
  }
}

bool MtSession::speaks_mtdata2() const noexcept {
  switch (config_.output) {
    case MtSessionConfig::Output::kLegacy:
      return false;
    case MtSessionConfig::Output::kMtData2:
      return true;
    case MtSessionConfig::Output::kAsDevice:
      break;
  }
  if (legacy_after_refusal_ || !configuration_ || configuration_->n_devices == 0) return false;
  const DeviceRecord& device = configuration_->devices[0];
  return device.data_length == 0 && device.output_mode == 0;
}

void MtSession::on_configuration_read(HostTime now) noexcept {
  const std::size_t expected = std::max<std::size_t>(config_.bus_devices, 1);
  if (configuration_->n_devices == 0) {
    say("no device answers on the Xbus; check the bus cables");
    fail_round(now);
  } else if (configuration_->n_devices != expected ||
             configuration_->is_xbus_master() != (config_.bus_devices > 0)) {
    say("%zu devices answer behind this line, the configuration has %zu; check the bus cables, and "
        "give each [[device]] its bus_id",
        configuration_->n_devices, expected);
    fail_round(now);
  } else if (!sync_in_is_wanted()) {
    enter(Step::kSetSyncInMode, now);
  } else {
    set_output(now);
  }
}

void MtSession::set_output(HostTime now) noexcept {
  if (speaks_mtdata2()) {
    enter(Step::kSetOutputConfiguration, now);
  } else if (sends_what_is_wanted(*configuration_)) {
    enter(sync_in_written_ ? Step::kCheckConfiguration : Step::kMeasure, now);
  } else {
    enter(Step::kSetPeriod, now);
  }
}

bool MtSession::sync_in_is_wanted() const noexcept {
  return !config_.sync_in || (configuration_->sync_in_mode == config_.sync_in->mode &&
                              configuration_->sync_in_skip == config_.sync_in->skip &&
                              configuration_->sync_in_offset == config_.sync_in->offset);
}

void MtSession::on_configuration_checked(HostTime now) noexcept {
  sync_in_written_ = false;
  if (!sync_in_is_wanted()) {
    say("the device took SyncIn mode 0x%04X, skip %u, offset %u; wanted: 0x%04X, %u, %u; "
        "check what its manual allows",
        static_cast<unsigned>(configuration_->sync_in_mode),
        static_cast<unsigned>(configuration_->sync_in_skip),
        static_cast<unsigned>(configuration_->sync_in_offset), static_cast<unsigned>(config_.sync_in->mode),
        static_cast<unsigned>(config_.sync_in->skip), static_cast<unsigned>(config_.sync_in->offset));
    fail_round(now);
    return;
  }
  if (sends_what_is_wanted(*configuration_)) {
    enter(Step::kMeasure, now);
    return;
  }
  const DeviceRecord& device = configuration_->devices[0];
  say("the device took mode 0x%04X, settings 0x%08X at %.6g Hz; wanted: 0x%04X, 0x%08X at %.6g Hz",
      static_cast<unsigned>(device.output_mode), static_cast<unsigned>(device.output_settings),
      configuration_->rate_hz(), static_cast<unsigned>(config_.layout.mode),
      static_cast<unsigned>(config_.layout.settings), config_.rate_hz);
  fail_round(now);
}

bool MtSession::sends_what_is_wanted(const Configuration& configuration) const noexcept {
  if (configuration.period != period_ || configuration.skip_factor != 0) return false;
  const auto begin = configuration.devices.begin();
  return std::all_of(begin, begin + static_cast<std::ptrdiff_t>(configuration.n_devices),
                     [this](const DeviceRecord& device) {
                       return DataLayout{device.output_mode, device.output_settings} == config_.layout &&
                              device.data_length == wanted_length_;
                     });
}

// The acknowledgement lists what the device really took: an unknown item is missing, a rate is clamped.
void MtSession::on_output_configuration(std::span<const std::uint8_t> data, HostTime now) noexcept {
  const auto wanted_rate = static_cast<std::uint16_t>(std::lround(config_.rate_hz));
  for (const WantedItem& wanted : kWantedItems) {
    if (!wanted.at_rate) continue;
    std::uint16_t taken = 0;
    for (std::size_t at = 0; at + kOutputItemSize <= data.size(); at += kOutputItemSize) {
      if (read_be<std::uint16_t>(data, at) == wanted.id) taken = read_be<std::uint16_t>(data, at + 2);
    }
    if (taken == wanted_rate) continue;
    say("the device took %u Hz for item 0x%04X, %u Hz are wanted; set rate_hz to a rate that it offers",
        static_cast<unsigned>(taken), static_cast<unsigned>(wanted.id), static_cast<unsigned>(wanted_rate));
    fail_round(now);
    return;
  }
  enter(Step::kMeasure, now);
}

void MtSession::on_data(const Frame& frame, HostTime now) noexcept {
  ++data_frames_;
  sends_text_ = false;
  last_data_ = now;
  const auto count = wanted_count(frame);
  switch (step_) {
    case Step::kListen:
      if (!count) {
        wanted_in_a_row_ = 0;
      } else if (takes_over(*count, now)) {
        enter(Step::kStreaming, now);
      }
      break;
    case Step::kMeasure:
      // In its configuration state a device sends no data: this is the measurement, acknowledged or not.
      if (attempts_ > 0) enter(Step::kStreaming, now);
      break;
    case Step::kStreaming:
      if (count) last_wanted_ = now;
      break;
    case Step::kSilent:
      if (count) enter(Step::kStreaming, now);
      break;
    default:
      break;  // a device in measurement goes on sending until it has heard GoToConfig
  }
}

// The count of a message that is what is wanted, in messages; nothing where it is something else. A message
// names neither its layout nor its rate, so the numbers must make sense as well.
std::optional<std::int64_t> MtSession::wanted_count(const Frame& frame) const noexcept {
  if (frame.mid == mid::kMtData && config_.bus_devices > 0) return wanted_bus_count(frame.data);
  if (frame.mid == mid::kMtData && config_.output != MtSessionConfig::Output::kMtData2) {
    MtData data;
    if (!read_mtdata(frame.data, config_.layout, data) || !data.has(Field::kCounter)) return std::nullopt;
    const bool inertial = data.has(Field::kRate) && data.has(Field::kAcceleration);
    if (inertial && !is_plausible(data.rate_radps, data.acceleration_mps2)) return std::nullopt;
    return data.counter;
  }
  if (frame.mid != mid::kMtData2 || config_.output == MtSessionConfig::Output::kLegacy) return std::nullopt;
  InertialMessage message;
  constexpr std::uint32_t kNeeded =
      InertialMessage::kRate | InertialMessage::kAcceleration | InertialMessage::kSampleTimeFine;
  if (!read_inertial(frame.data, message) || (message.items & kNeeded) != kNeeded) return std::nullopt;
  if (!is_plausible(message.rate_radps, message.acceleration_mps2)) return std::nullopt;
  return std::llround(message.sample_time_fine * config_.rate_hz / kSampleTimeFinePerSecond);
}

// An Xbus head's count, then the blocks of all devices.
std::optional<std::int64_t> MtSession::wanted_bus_count(std::span<const std::uint8_t> data) const noexcept {
  if (data.size() != sizeof(std::uint16_t) + config_.bus_devices * wanted_length_) return std::nullopt;
  for (std::size_t k = 0; k < config_.bus_devices; ++k) {
    MtData block;
    read_mtdata_of_known_length(data.subspan(sizeof(std::uint16_t) + k * wanted_length_, wanted_length_),
                                config_.layout, block);
    const bool inertial = block.has(Field::kRate) && block.has(Field::kAcceleration);
    if (inertial && !is_plausible(block.rate_radps, block.acceleration_mps2)) return std::nullopt;
  }
  return read_be<std::uint16_t>(data);
}

bool MtSession::takes_over(std::int64_t count, HostTime now) noexcept {
  const bool follows =
      wanted_in_a_row_ > 0 && (count - last_count_ == 1 || count - last_count_ == 1 - kCounterModulus);
  if (!follows) {
    wanted_in_a_row_ = 0;
    first_wanted_ = now;
  }
  last_count_ = count;
  if (++wanted_in_a_row_ < kWantedToTakeOver) return false;
  const double rate_hz = (wanted_in_a_row_ - 1) / to_seconds(std::max(now - first_wanted_, Duration{1}));
  return std::abs(rate_hz / config_.rate_hz - 1.0) < kRateTolerance;
}

void MtSession::watch_stream(HostTime now) noexcept {
  const Duration patience = std::max(kSilence, from_seconds(kSilentMessages / config_.rate_hz));
  if (now - last_data_ > patience) {
    say("the device stopped sending; check its power and cable");
    enter(Step::kSilent, now);
  } else if (now - last_wanted_ > patience) {
    say("the device sends data other than what was asked for; it is set up again");
    enter(Step::kGoToConfig, now);
  }
}

void MtSession::say_why_there_is_no_answer() noexcept {
  if (data_frames_ > 0) {
    say("the device sends data but does not hear commands; check the transmit line (and two stop bits "
        "for a device made before 2008)");
  } else if (frames_ > 0) {
    say("the device does not go to its configuration state; it will be reset");
  } else if (bytes_ > 0) {
    say("%llu bytes came but no message; is the baud rate right?", static_cast<unsigned long long>(bytes_));
  } else {
    say("no answer; check the device's power, its cable and the port");
  }
}

void MtSession::say(const char* format, ...) noexcept {
  va_list arguments;
  va_start(arguments, format);
  const int n = std::vsnprintf(problem_.data(), problem_.size(), format, arguments);
  va_end(arguments);
  problem_size_ = static_cast<std::size_t>(std::clamp(n, 0, static_cast<int>(problem_.size()) - 1));
}

}  // namespace imuscope::xsens
