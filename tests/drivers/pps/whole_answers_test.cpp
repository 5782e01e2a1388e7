// Everything that comes out of pulses and of how the clock is steered, held as it once was.
#include <gtest/gtest.h>

#include "drivers/pps/decoder.h"
#include "drivers/pps/session.h"
#include "tests/drivers/support/sample_text.h"
#include "tests/support/recorded_answer.h"

namespace imuscope::pps {
namespace {

using test::Bytes;
using namespace std::chrono_literals;

constexpr HostTime kRead = host_time_from_ns(5'000'000'000'000);

Bytes pulse_bytes(std::uint32_t sequence, HostTime time, Duration apart = 60ns,
                  PulseEdge edge = PulseEdge::kAssert) {
  Bytes bytes(kPulseRecordBytes);
  write_pulse_record({edge, sequence, time, utc_time_from_ns(1'773'480'600'000'000'000 + to_ns(time)), apart},
                     bytes);
  return bytes;
}
Bytes steering_bytes(HostTime time, double rate, Duration apart = 60ns) {
  Bytes bytes(kPulseRecordBytes);
  write_steering_record({time, time - 17s, rate, apart}, bytes);
  return bytes;
}

TEST(PpsWhole, PulsesAtEveryLimit) {
  std::string text;
  Decoder decoder(DecoderConfig{3});
  test::CollectingSink sink;
  const auto push = [&](const Bytes& bytes, HostTime read) { decoder.push(bytes, {read, read - 1ms}, sink); };
  std::uint32_t sequence = 100;
  HostTime time = kRead;
  const auto next = [&](std::uint32_t step, Duration after, Duration apart, Duration late) {
    sequence += step;
    time += after;
    push(pulse_bytes(sequence, time, apart), time + late);
  };
  next(1, 0s, 60ns, 1ms);
  next(1, 1s, 100us, 1ms);
  next(1, 1s, 100'001ns, 1ms);
  next(1, 1s, 0ns, 5s);
  next(1, 1s, 0ns, 5s + 1ns);
  next(1, 1s, 0ns, 0ns);
  next(1, 1s, 0ns, -1ns);
  next(3, 1s, 0ns, 1ms);
  next(0, 1s, 0ns, 1ms);
  next(1, 0s, 0ns, 1ms);
  next(1, -1s, 0ns, 1ms);
  next(1U << 20U, 3s, 0ns, 1ms);
  next((1U << 20U) + 1U, 1s, 0ns, 1ms);
  next(0xFFFFFFFFU, 1s, 0ns, 1ms);
  push(pulse_bytes(sequence + 1, time + 1s, 5ns, PulseEdge::kClear), time + 1s);
  push(steering_bytes(time, 1.25e-5), time + 1ms);
  for (const Duration late : {Duration{0ns}, Duration{-1ns}, Duration{5s}, Duration{5s + 1ns}})
    push(steering_bytes(time, -0.2, 100us), time + late);
  push(steering_bytes(time, 0.5, 100'001ns), time);
  push(steering_bytes(time, 0.5, 100us), time);
  Bytes both = steering_bytes(time, 1e-9);
  const Bytes pulse = pulse_bytes(sequence + 5, time + 9s);
  both.insert(both.end(), pulse.begin(), pulse.end());
  both.insert(both.end(), {'P', 'P'});
  push(both, time + 10s);
  for (const Sample& sample : sink.samples) text += test::sample_text(sample) + '\n';
  test::expect_recorded("drivers/pps/pulses.txt", text + test::counts_text(decoder.counters()),
                        test::kSampleShare);
}

std::string read_text(const Bytes& bytes) {
  if (const auto pulse = read_pulse_record(bytes)) {
    return "pulse " + std::to_string(static_cast<int>(pulse->edge)) + ' ' + std::to_string(pulse->sequence) +
           ' ' + test::in_groups(to_ns(pulse->time)) + ' ' + test::in_groups(to_ns(pulse->wall)) + ' ' +
           test::in_groups(pulse->apart.count());
  }
  if (const auto steering = read_steering_record(bytes)) {
    return "steering " + test::in_groups(to_ns(steering->time)) + ' ' +
           test::in_groups(to_ns(steering->unsteered)) + ' ' + test::real_text(steering->rate) + ' ' +
           test::in_groups(steering->apart.count());
  }
  return "nothing";
}

TEST(PpsWhole, RecordsAsBytes) {
  std::string text;
  constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max() / 4;
  for (const std::int64_t ns : {std::int64_t{0}, std::int64_t{-1}, kMost, kMost + 1, -kMost, -kMost - 1}) {
    Bytes bytes(kPulseRecordBytes);
    write_pulse_record({PulseEdge::kClear, 7, host_time_from_ns(ns), utc_time_from_ns(5), 3ns}, bytes);
    text += test::hex_text(bytes) + ' ' + read_text(bytes) + '\n';
    write_pulse_record({PulseEdge::kAssert, 7, host_time_from_ns(5), utc_time_from_ns(ns), -3ns}, bytes);
    text += test::hex_text(bytes) + ' ' + read_text(bytes) + '\n';
    write_steering_record({host_time_from_ns(ns), host_time_from_ns(5), 1e-6, 3ns}, bytes);
    text += test::hex_text(bytes) + ' ' + read_text(bytes) + '\n';
    write_steering_record({host_time_from_ns(5), host_time_from_ns(ns), -1e-6, 5s}, bytes);
    text += test::hex_text(bytes) + ' ' + read_text(bytes) + '\n';
  }
  for (const double rate : {0.2, 0.3, -0.2, -0.3, 1.4e-9, 1.6e-9, -0.6e-9})
    text += test::hex_text(steering_bytes(kRead, rate)) + ' ' + read_text(steering_bytes(kRead, rate)) + '\n';
  Bytes too_steep = steering_bytes(kRead, 0.2);
  too_steep[24] = static_cast<std::uint8_t>(too_steep[24] + 1);
  text += read_text(too_steep) + '\n';
  for (const Bytes& whole : {pulse_bytes(258, kRead), steering_bytes(kRead, 0.125)}) {
    for (std::size_t at = 0; at < whole.size(); ++at) {
      Bytes bytes = whole;
      bytes[at] ^= 0x12U;
      text += std::to_string(at) + ' ' + read_text(bytes) + '\n';
    }
    text += read_text(Bytes(whole.begin(), whole.end() - 1)) + '\n';
  }
  test::expect_recorded("drivers/pps/records.txt", text, test::kSampleShare);
}

TEST(PpsWhole, WhatTheSessionTells) {
  const auto make = [] { return std::make_unique<Session>(); };
  Bytes both = steering_bytes(kRead, 1e-9);
  const Bytes pulse = pulse_bytes(5, kRead);
  both.insert(both.end(), pulse.begin(), pulse.end());
  test::expect_recorded("drivers/pps/session.txt",
                        test::listening_text(make, pulse) + test::listening_text(make, both) +
                            test::listening_text(make, steering_bytes(kRead, 0.0)) +
                            test::listening_text(make, Bytes(both.begin(), both.end() - 1)));
}

}  // namespace
}  // namespace imuscope::pps
