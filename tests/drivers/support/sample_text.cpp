#include "tests/drivers/support/sample_text.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <map>

namespace imuscope::test {
namespace {

constexpr std::array<std::string_view, 6> kKindNames{"imu",      "gnss",  "attitude",
                                                     "odometry", "pulse", "steering"};

std::string flags_text(std::uint32_t flags) {
  std::array<char, 16> text{};
  std::snprintf(text.data(), text.size(), "x%X", flags);
  return text.data();
}

std::string data_text(const Sample& sample) {
  switch (sample.kind) {
    case SampleKind::kImu: {
      const ImuData& imu = sample.imu;
      return "w " + real_text(imu.omega_radps) + " f " + real_text(imu.f_mps2) + " a " +
             real_text(imu.angular_acceleration_radps2) + " n " + in_groups(imu.counter) + ' ' +
             flags_text(imu.flags) + " T " + real_text(static_cast<double>(imu.temperature_degC));
    }
    case SampleKind::kGnss: {
      const GnssData& gnss = sample.gnss;
      return "llh " + real_text(gnss.latitude_rad) + ' ' + real_text(gnss.longitude_rad) + ' ' +
             real_text(gnss.height_m) + " v " + real_text(gnss.v_n_mps) + " sd " +
             real_text(gnss.sd_position_m) + " sd " + real_text(gnss.sd_velocity_mps) + " q" +
             std::to_string(static_cast<int>(gnss.solution)) + ' ' + flags_text(gnss.flags);
    }
    case SampleKind::kAttitude: {
      const AttitudeData& attitude = sample.attitude;
      return "rph " + real_text(attitude.roll_rad) + ' ' + real_text(attitude.pitch_rad) + ' ' +
             real_text(attitude.heading_rad) + " sd " + real_text(attitude.sd_rpy_rad) + ' ' +
             flags_text(attitude.flags);
    }
    case SampleKind::kOdometry:
      return "v " + real_text(sample.odometry.speed_mps) + ' ' + flags_text(sample.odometry.flags);
    case SampleKind::kPulse:
      return "wall " + in_groups(sample.pulse.wall_ns);
    case SampleKind::kSteering:
      return "unsteered " + in_groups(sample.steering.unsteered_ns) + " rate " +
             real_text(sample.steering.rate);
  }
  return {};
}

/// The numbers of one kind, each with the weight of its place.
void add_to_sums(const Sample& sample, double weight, std::vector<double>& sums) {
  std::vector<double> numbers{1.0, static_cast<double>(sample.device), static_cast<double>(sample.sequence),
                              sample.has_utc ? 1.0 : 0.0};
  const auto add = [&](std::initializer_list<double> more) { numbers.insert(numbers.end(), more); };
  const auto add_all = [&](const Vector3& v) { numbers.insert(numbers.end(), v.begin(), v.end()); };
  switch (sample.kind) {
    case SampleKind::kImu:
      add_all(sample.imu.omega_radps), add_all(sample.imu.f_mps2);
      add({static_cast<double>(sample.imu.counter), static_cast<double>(sample.imu.flags)});
      break;
    case SampleKind::kGnss:
      add({sample.gnss.latitude_rad, sample.gnss.longitude_rad, sample.gnss.height_m});
      add_all(sample.gnss.v_n_mps), add_all(sample.gnss.sd_position_m), add_all(sample.gnss.sd_velocity_mps);
      add({static_cast<double>(sample.gnss.solution), static_cast<double>(sample.gnss.flags)});
      break;
    case SampleKind::kAttitude:
      add({sample.attitude.roll_rad, sample.attitude.pitch_rad, sample.attitude.heading_rad});
      add_all(sample.attitude.sd_rpy_rad);
      add({static_cast<double>(sample.attitude.flags)});
      break;
    case SampleKind::kOdometry:
      add({sample.odometry.speed_mps, static_cast<double>(sample.odometry.flags)});
      break;
    case SampleKind::kPulse:
    case SampleKind::kSteering:
      break;
  }
  sums.resize(std::max(sums.size(), numbers.size()));
  for (std::size_t i = 0; i < numbers.size(); ++i) sums[i] += weight * numbers[i];
}

std::string printable(std::span<const std::uint8_t> bytes) {
  const bool is_text = std::all_of(bytes.begin(), bytes.end(), [](std::uint8_t byte) {
    return (byte >= ' ' && byte <= '~') || byte == '\r' || byte == '\n';
  });
  if (!is_text) return hex_text(bytes);
  std::string text = "\"";
  for (const std::uint8_t byte : bytes) {
    if (byte >= ' ') text += static_cast<char>(byte);
  }
  return text + '"';
}

}  // namespace

std::string in_groups(std::int64_t number) {
  std::string digits = std::to_string(number);
  const std::size_t first = number < 0 ? 1 : 0;
  for (std::size_t at = digits.size(); at > first + 3; at -= 3) digits.insert(at - 3, "_");
  return digits;
}

std::string real_text(double value, int digits) {
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%.*g", digits, value == 0.0 ? 0.0 : value);
  return text.data();
}

std::string real_text(std::span<const double> values) {
  std::string text;
  for (const double value : values) text += (text.empty() ? "" : " ") + real_text(value);
  return text;
}

std::string hex_text(std::span<const std::uint8_t> bytes) {
  constexpr std::string_view kHex = "0123456789abcdef";
  std::string text = "x";
  for (const std::uint8_t byte : bytes) {
    text += ' ';
    text += kHex[byte >> 4U];
    text += kHex[byte & 0xFU];
  }
  return text;
}

std::string sample_text(const Sample& sample) {
  return std::string(kKindNames.at(static_cast<std::size_t>(sample.kind))) + " d" +
         std::to_string(sample.device) + " #" + std::to_string(sample.sequence) + " at " +
         in_groups(to_ns(sample.arrival)) + " t " + in_groups(to_ns(sample.time)) +
         (sample.has_utc ? " utc " + in_groups(to_ns(sample.utc)) : " no utc") + ' ' + data_text(sample);
}

std::string counts_text(const DecoderCounters& c) {
  std::string text = "counts";
  const auto add = [&](std::string_view name, std::uint64_t count) {
    if (count > 0) text += ' ' + std::string(name) + '=' + std::to_string(count);
  };
  add("bytes", c.bytes);
  add("skipped", c.bytes_skipped);
  add("frames", c.frames);
  add("checksums", c.bad_checksums);
  add("lengths", c.bad_lengths);
  add("contents", c.bad_contents);
  add("samples", c.samples);
  add("lost", c.samples_lost);
  add("resets", c.clock_resets);
  return text;
}

std::string decoded_text(DeviceDecoder& decoder, std::span<const std::uint8_t> bytes, std::size_t read_size,
                         HostTime begin, Duration apart) {
  CollectingSink sink;
  HostTime now = begin;
  for (std::size_t at = 0; at < bytes.size(); at += read_size) {
    decoder.push(bytes.subspan(at, std::min(read_size, bytes.size() - at)), now, sink);
    now += apart;
  }
  decoder.finish(now, sink);
  std::string text;
  for (const Sample& sample : sink.samples) text += sample_text(sample) + '\n';
  text += counts_text(decoder.counters()) + '\n';
  if (!decoder.remark().empty()) text += "remark " + std::string(decoder.remark()) + '\n';
  return text;
}

std::string sums_text(std::span<const Sample> samples) {
  std::map<SampleKind, std::vector<double>> sums;
  std::map<SampleKind, double> weights;
  for (const Sample& sample : samples) add_to_sums(sample, 1.0 + weights[sample.kind]++, sums[sample.kind]);
  std::string text;
  for (const auto& [kind, numbers] : sums) {
    text += std::string(kKindNames.at(static_cast<std::size_t>(kind)));
    for (const double number : numbers) text += ' ' + real_text(number, 7);
    text += ' ';
  }
  return text;
}

std::string outcome_text(DeviceDecoder& decoder, std::span<const std::uint8_t> bytes, HostTime begin) {
  CollectingSink sink;
  decoder.push(bytes, begin, sink);
  decoder.finish(begin, sink);
  DecoderCounters counts = decoder.counters();
  counts.bytes -= bytes.size();
  return sums_text(sink.samples) + counts_text(counts);
}

std::string listening_text(const std::function<std::unique_ptr<DeviceSession>()>& make_session,
                           const Bytes& good) {
  struct Case {
    std::string_view name;
    Bytes noise;
    int good_until_ms;
  };
  const std::vector<Case> cases{{"silence", {}, 0},
                                {"64 bytes of noise", Bytes(64, 0x55), 0},
                                {"65 bytes of noise", Bytes(65, 0x55), 0},
                                {"good", {}, 9000},
                                {"good, then silence", {}, 2000},
                                {"good, then noise", Bytes(20, 0x55), 2000}};
  std::string text;
  for (const Case& one : cases) {
    const auto session = make_session();
    SessionDiary diary(*session);
    for (int ms = 0; ms < 12'000; ms += 10) {
      const HostTime now = host_time_from_ns(1'000'000LL * (ms + 5000));
      diary.step(now);
      if (ms % 500 == 0 && ms < one.good_until_ms) session->on_bytes(good, now);
      const bool noise_time = one.good_until_ms == 0 ? ms == 1000 : ms % 500 == 0 && ms >= one.good_until_ms;
      if (noise_time && !one.noise.empty()) session->on_bytes(one.noise, now);
    }
    text += "-- " + std::string(one.name) + '\n' + diary.text();
  }
  return text;
}

Bytes SessionDiary::step(HostTime now) {
  constexpr std::array<std::string_view, 4> kStates{"connecting", "configuring", "streaming", "failed"};
  const auto said = session_->poll(now);
  const std::string is = std::string(kStates.at(static_cast<std::size_t>(session_->state()))) +
                         (session_->wants_other_baud() ? ", other baud" : "") + ", \"" +
                         std::string(session_->problem()) + '"';
  const std::string when = in_groups(to_ns(now) / 1'000'000) + " ms ";
  if (!said.empty()) text_ += when + "says " + printable(said) + '\n';
  if (is != before_) text_ += when + "is " + is + '\n';
  before_ = is;
  return {said.begin(), said.end()};
}

}  // namespace imuscope::test
