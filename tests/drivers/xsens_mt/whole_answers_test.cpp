// Everything that comes out of rich streams, held as it once was: each kind of message, gaps, restarts, damage.
#include <gtest/gtest.h>

#include <functional>

#include "drivers/xsens_mt/decoder.h"
#include "drivers/xsens_mt/layout_guess.h"
#include "drivers/xsens_mt/mtb_file.h"
#include "tests/drivers/support/sample_text.h"
#include "tests/drivers/xsens_mt/mt_frames.h"
#include "tests/support/recorded_answer.h"
#include "tests/support/shared_data.h"

namespace imuscope::xsens {
namespace {

using namespace test_frames;
using std::chrono::microseconds;
using std::chrono::milliseconds;
using test::expect_recorded;

constexpr HostTime kBegin = host_time_from_ns(5'000'000'000'000);
constexpr Matrix3 kTurned{0, 1, 0, 0, 0, -1, -1, 0, 0};

void append_all(Bytes& bytes, const Bytes& more) { bytes.insert(bytes.end(), more.begin(), more.end()); }

Bytes utc_bytes(std::uint32_t ns, std::uint16_t year, std::initializer_list<std::uint8_t> month_to_flags) {
  Bytes bytes = u32(ns);
  append_all(bytes, u16(year));
  append_all(bytes, Bytes(month_to_flags));
  return bytes;
}

/// A solution of a receiver inside, as item 0x7010.
Bytes gnss_item(std::uint32_t itow_ms, std::uint8_t fix, std::uint8_t flags) {
  Bytes b = u32(itow_ms);
  append_all(b, u16(2026));
  append_all(b, Bytes{3, 14, 12, 34, 56, 0x37});
  append_all(b, u32(25));
  append_all(b, u32(static_cast<std::uint32_t>(-125'000'000)));
  append_all(b, Bytes{fix, flags, 17, 0});
  for (const std::int32_t v : {23'522'190, 488'566'140, 81'500, 35'250, 14, 20, 1250, -500, -125, 1346,
                               33'812'300, 50, 180'000, 33'800'000}) {
    append_all(b, u32(static_cast<std::uint32_t>(v)));
  }
  for (const std::uint16_t v : std::array<std::uint16_t, 7>{112, 113, 114, 115, 116, 117, 118})
    append_all(b, u16(v));
  return b;
}

/// The receiver of an MTi-G in legacy data.
Bytes legacy_gps(std::uint32_t itow_ms) {
  Bytes b = u16(1013);
  b.push_back(3);
  for (const std::int32_t v :
       {static_cast<std::int32_t>(itow_ms), 488'566'140, -23'522'190, 81'500, 125, -50, 12, 1400, 2100, 30}) {
    append_all(b, u32(static_cast<std::uint32_t>(v)));
  }
  b.push_back(7);
  return b;
}

/// Messages, one read each, every 10 ms; a pause may stand between them.
struct Played {
  explicit Played(const MtDecoderConfig& config) : decoder(config) {}
  void push(const Bytes& bytes) {
    decoder.push(bytes, {now, now - microseconds(300)}, sink);
    now += milliseconds(10);
  }
  void wait(Duration pause) { now += pause; }
  std::string text() {
    decoder.finish(now, sink);
    std::string all;
    for (const Sample& sample : sink.samples) all += test::sample_text(sample) + '\n';
    all +=
        test::counts_text(decoder.counters()) + " drift " + test::real_text(decoder.clock_drift_ppm()) + '\n';
    if (!decoder.remark().empty()) all += "remark " + std::string(decoder.remark()) + '\n';
    return all;
  }
  MtDecoder decoder;
  test::CollectingSink sink;
  HostTime now = kBegin;
};

double wiggle(int i, int k) { return 0.01 * ((7 * i + 13 * k) % 29 - 14); }

Bytes counted(std::uint16_t counter) {
  return mtdata(counter, {0.1 + wiggle(counter, 0), -0.2 + wiggle(counter, 1), 9.8 + wiggle(counter, 2)},
                {0.01 + wiggle(counter, 3), 0.02, wiggle(counter, 4)});
}

MtDecoderConfig default_config() {
  MtDecoderConfig config;
  config.device = 3;
  config.axes = kTurned;
  return config;
}

TEST(MtWhole, LegacyCountsWithGapsRepeatsPausesAndRestarts) {
  Played played(default_config());
  for (const int counter : {65530, 65531, 65533, 65533, 65534, 65535, 0, 1, 5, 6}) {
    played.push(counted(static_cast<std::uint16_t>(counter)));
  }
  Bytes damaged = counted(7);
  damaged[9] ^= 0x10U;
  played.push(damaged);
  played.push(counted(8));
  played.push(frame(0x31));  // told to pause
  played.wait(milliseconds(2000));
  played.push(counted(210));
  played.push(counted(211));
  played.push(counted(40'000));  // ahead of host time: damage
  played.push(counted(213));
  for (int counter = 30'000; counter < 30'004; ++counter)
    played.push(counted(static_cast<std::uint16_t>(counter)));
  played.push(frame(mid::kMtData, Bytes(10, 0)));  // of another length
  played.push(frame(mid::kError, {0x1E}));
  played.push(frame(mid::kConfiguration, Bytes(20, 0)));
  expect_recorded("drivers/xsens_mt/legacy_counts.txt", played.text(), test::kSampleShare);
}

TEST(MtWhole, ConfigurationsOverruleWhatWasExpected) {
  Played played(default_config());
  for (std::uint16_t counter = 10; counter < 13; ++counter) played.push(counted(counter));
  played.push(configuration(2304, 0, 1, 38, kDefaultLayout.mode, kDefaultLayout.settings));  // 50 Hz
  for (std::uint16_t counter = 13; counter < 16; ++counter) played.push(counted(counter));
  played.push(configuration(1152, 3, 1, 38, kDefaultLayout.mode, kDefaultLayout.settings));  // every fourth
  for (const int counter : {16, 20, 24, 36, 41, 47, 48})
    played.push(counted(static_cast<std::uint16_t>(counter)));
  played.push(
      configuration(576, 0, 1, 37, kDefaultLayout.mode, kDefaultLayout.settings));  // contradicts itself
  played.push(configuration(576, 0, 0, 38, kDefaultLayout.mode, kDefaultLayout.settings));  // no device
  played.push(configuration(0, 0, 1, 38, kDefaultLayout.mode, kDefaultLayout.settings));    // no period
  played.push(configuration(576, 0, 1, 0, 0, 0));                                           // sends MTData2
  played.push(counted(52));
  // Without a counter, messages are counted.
  played.push(configuration(1152, 0, 1, 36, output_mode::kCalibrated, 0));
  for (int i = 0; i < 3; ++i) {
    played.push(frame(mid::kMtData, floats({1, 2, 3, 4, 5, 6, 0.1 * i, 8, 9})));
  }
  expect_recorded("drivers/xsens_mt/configurations.txt", played.text(), test::kSampleShare);
}

/// Data of one device with all that a layout can hold besides raw readings.
Bytes everything(int i, std::uint32_t settings) {
  Bytes data = legacy_gps(400'000'000U + 250U * static_cast<std::uint32_t>(i / 2));
  append_all(data, floats({21.5 + 0.25 * i}));
  append_all(data, floats({0.25 + wiggle(i, 0), -0.5, 9.75 + wiggle(i, 1)}));
  append_all(data, floats({0.125 + wiggle(i, 2), -0.0625, 0.03125}));
  append_all(data, floats({0.5, 0.25, -0.75}));
  switch (settings & output_settings::kOrientationMask) {
    case output_settings::kQuaternion:
      append_all(data, floats({0.9 + 0.01 * i, 0.1, -0.2, 0.3}));
      break;
    case output_settings::kEuler:
      append_all(data, floats({12.5 + i, -21.25, 200.0 - 70.0 * i}));
      break;
    default:
      append_all(data, floats({0.36, 0.48, -0.8, -0.8, 0.6, 0.0, 0.48, 0.64, 0.6}));
      break;
  }
  append_all(data, u16(1001));
  append_all(data, u16(2002));
  append_all(data, floats({48.5, 2.25, 81.5}));
  append_all(data, floats({1.5, -2.5, 0.5}));
  data.push_back(static_cast<std::uint8_t>(i % 8));
  append_all(data, u16(static_cast<std::uint16_t>(65534 + i)));
  append_all(data, utc_bytes(250'000'000U * static_cast<std::uint32_t>(i % 5), 2026,
                             {3, 14, 12, 34, static_cast<std::uint8_t>(55 + i),
                              static_cast<std::uint8_t>(i % 2 == 0 ? 7 : 2)}));
  return frame(mid::kMtData, data);
}

TEST(MtWhole, LegacyMessagesThatHoldEverything) {
  constexpr std::uint16_t kModes = output_mode::kGpsPvt | output_mode::kTemperature |
                                   output_mode::kCalibrated | output_mode::kOrientation |
                                   output_mode::kAuxiliary | output_mode::kPosition | output_mode::kVelocity |
                                   output_mode::kStatus;
  std::string text;
  for (const std::uint32_t orientation :
       {output_settings::kQuaternion, output_settings::kEuler, output_settings::kMatrix}) {
    for (const std::uint32_t frame_bit : {0U, output_settings::kNorthEastDown}) {
      MtDecoderConfig config = default_config();
      config.wants_attitude = true;
      config.wants_gnss = true;
      config.layout = {kModes,
                       output_settings::kSampleCounter | output_settings::kUtcTime | orientation | frame_bit};
      if (frame_bit != 0) config.clock = ClockMapConfig::fixed(kBegin, 1.0 + 1e-4);
      Played played(config);
      for (int i = 0; i < 5; ++i) played.push(everything(i, config.layout.settings));
      text += played.text();
    }
  }
  expect_recorded("drivers/xsens_mt/legacy_everything.txt", text, test::kSampleShare);
}

/// An Xbus Master's message: blocks of default layout without their own heads.
Bytes bus_message(std::uint16_t counter, std::initializer_list<int> readings) {
  Bytes data = u16(counter);
  for (const int reading : readings) {
    const Bytes block = counted(static_cast<std::uint16_t>(reading));
    data.insert(data.end(), block.begin() + 4, block.end() - 1);
  }
  return frame(mid::kMtData, data);
}

TEST(MtWhole, DevicesBehindAnXbusMaster) {
  MtDecoderConfig config;
  config.bus = {BusDevice{5, kTurned}, std::nullopt, BusDevice{7, {1, 0, 0, 0, 1, 0, 0, 0, 1}}};
  Played played(config);
  for (std::uint16_t i = 0; i < 3; ++i) played.push(bus_message(i, {i, 100 + i, 200 + i}));
  for (std::uint16_t i = 3; i < 8; ++i) played.push(bus_message(i, {i, 103, 203}));  // two fell off the bus
  for (std::uint16_t i = 10; i < 12; ++i) played.push(bus_message(i, {i, 104 + i, 204 + i}));
  played.push(bus_message(12, {1, 2}));
  played.push(configuration(1152, 0, 2, 38, kDefaultLayout.mode, kDefaultLayout.settings, 0x00100001));
  for (std::uint16_t i = 12; i < 15; ++i) played.push(bus_message(i, {i, 110 + i}));
  expect_recorded("drivers/xsens_mt/xbus.txt", played.text(), test::kSampleShare);
}

/// MTData2 with counter and time; `more` adds to it.
Bytes message2(std::uint16_t count, std::uint32_t fine, const std::function<void(Bytes&)>& more) {
  Bytes data;
  append_item(data, xdi::kPacketCounter, u16(count));
  append_item(data, xdi::kSampleTimeFine, u32(fine));
  more(data);
  return frame(mid::kMtData2, data);
}

void plain(Bytes& data) {
  append_item(data, xdi::kAcceleration, floats({0.25, -0.5, 9.75}));
  append_item(data, xdi::kRateOfTurn, floats({0.125, -0.0625, 0.03125}));
}

TEST(MtWhole, EveryItemOfMtData2) {
  MtDecoderConfig config = default_config();
  config.wants_attitude = true;
  config.wants_gnss = true;
  Played played(config);
  std::uint16_t count = 65533;
  std::uint32_t fine = 4'294'967'000U;  // wraps within
  const auto send = [&](const std::function<void(Bytes&)>& more) {
    played.push(message2(count++, fine += 100, more));
  };
  send(plain);
  send([](Bytes& d) {
    plain(d);
    append_item(d, xdi::kTemperature, floats({36.5}));
    append_item(d, xdi::kUtcTime, utc_bytes(999'999'999, 2026, {12, 31, 23, 59, 60, 3}));
    append_item(d, xdi::kStatusWord, u32(0x00002902U));
    append_item(d, xdi::kQuaternion | 0x4U, floats({0.9, 0.1, -0.2, 0.3}));
  });
  send([](Bytes& d) {
    append_item(d, xdi::kAccelerationHr, floats({1.25, -1.5, 8.75}));
    append_item(d, xdi::kRateOfTurnHr, floats({1.125, -1.0625, 1.03125}));
    append_item(d, xdi::kStatusByte, {0x02});
    append_item(d, xdi::kEulerAngles | 0x0U, floats({12.5, -21.25, 170.0}));
  });
  send([](Bytes& d) {
    plain(d);
    append_item(d, xdi::kAccelerationHr, floats({5, 5, 5}));
    append_item(d, xdi::kRateOfTurnHr, floats({5, 5, 5}));
    append_item(d, xdi::kStatusWord, u32(0x00001600U));
    append_item(d, xdi::kStatusByte, {0x02});
    append_item(d, xdi::kRotationMatrix | 0x8U, floats({0.36, 0.48, -0.8, -0.8, 0.6, 0.0, 0.48, 0.64, 0.6}));
  });
  for (const double w : {0.99995, -0.99995, 0.5, 1.0}) {
    send([w](Bytes& d) {
      append_item(d, xdi::kDeltaV, floats({0.0025, -0.005, 0.0975}));
      append_item(d, xdi::kDeltaQ, w == 1.0 ? floats({1, 0, 0, 0}) : floats({w, 0.006, -0.008, 0.002}));
    });
  }
  fine += 300;  // three periods are missing, and one message of the counter
  ++count;
  send([](Bytes& d) { append_item(d, xdi::kDeltaV, floats({0.01, 0.02, 0.03})); });
  send([](Bytes& d) { append_item(d, xdi::kDeltaQ, floats({1.0, 0.001, 0.002, 0.003})); });
  send([](Bytes& d) {
    append_item(d, xdi::kStatusWord, u32(2U << 27U | 4U));
    append_item(d, xdi::kGnssPvt, gnss_item(400'000'000, 3, 1));
  });
  send([](Bytes& d) {
    plain(d);
    append_item(d, xdi::kStatusWord, u32(1U << 27U));
    append_item(d, xdi::kGnssPvt, gnss_item(400'000'250, 4, 3));
  });
  send([](Bytes& d) {
    plain(d);
    append_item(d, xdi::kGnssPvt, gnss_item(400'000'250, 4, 3));  // the same epoch again
  });
  send([](Bytes& d) { append_item(d, xdi::kGnssPvt, gnss_item(400'000'500, 2, 1)); });
  send([](Bytes& d) { append_item(d, xdi::kGnssPvt, gnss_item(400'000'750, 3, 0)); });
  send([](Bytes& d) {
    plain(d);
    append_item(d, xdi::kUtcTime, Bytes(11, 1));  // items of a wrong size
    append_item(d, xdi::kStatusWord, u16(3));
    append_item(d, xdi::kStatusByte, u16(3));
    append_item(d, xdi::kTemperature, u16(3));
    append_item(d, xdi::kGnssPvt, Bytes(93, 1));
    append_item(d, xdi::kQuaternion, floats({1, 2, 3}));
    append_item(d, 0x7777, {1, 2, 3});
  });
  send([](Bytes& d) {
    plain(d);
    d.push_back(0x10);  // rest that is no item
  });
  fine -= 100;
  send(plain);  // the same time again
  fine -= 400'000;
  send(plain);  // goes back: first refused, then a restart
  send(plain);
  send(plain);
  played.push(frame(0xC1, [] {
    Bytes items;
    for (const std::uint16_t v :
         std::array<std::uint16_t, 8>{0x4020, 50, 0x8020, 200, 0x1020, 0xFFFF, 0x7010, 400})
      append_all(items, u16(v));
    return items;
  }()));
  for (int i = 0; i < 3; ++i) {
    fine -= 50;
    send(plain);
  }
  expect_recorded("drivers/xsens_mt/mtdata2.txt", played.text(), test::kSampleShare);
}

TEST(MtWhole, MtData2WithoutSampleTime) {
  MtDecoderConfig config;
  config.rate_hz = 400.0;
  config.wants_imu = true;
  Played played(config);
  const auto send = [&](std::optional<std::uint16_t> count) {
    Bytes data;
    if (count) append_item(data, xdi::kPacketCounter, u16(*count));
    append_item(data, xdi::kDeltaV, floats({0.0025, -0.005, 0.0245}));
    append_item(data, xdi::kDeltaQ, floats({0.99, 0.006, -0.008, 0.002}));
    played.push(frame(mid::kMtData2, data));
  };
  for (const int count : {65533, 65534, 65534, 1, 2, 3, 40'000, 4}) send(static_cast<std::uint16_t>(count));
  for (int i = 0; i < 3; ++i) send(std::nullopt);
  for (const int count : {20'000, 20'001, 20'004}) send(static_cast<std::uint16_t>(count));
  expect_recorded("drivers/xsens_mt/mtdata2_untimed.txt", played.text(), test::kSampleShare);
}

// ------------------------------------------------------------------------------------------------- damage

std::string outcome(const Bytes& bytes) {
  MtDecoderConfig config = default_config();
  config.wants_attitude = true;
  config.wants_gnss = true;
  config.clock = ClockMapConfig::fixed(kBegin, 1.0);
  MtDecoder decoder(config);
  return test::outcome_text(decoder, bytes, kBegin);
}

/// Frames of every length form, and data that holds a frame.
Bytes damaged_stream() {
  Bytes stream = counted(1);
  append_all(stream, frame(0x31));
  Bytes holds_a_frame = u16(9);
  append_all(holds_a_frame, counted(2));
  append_all(stream, frame(0x13, holds_a_frame));
  append_all(stream, message2(7, 1000, plain));
  append_all(stream, Bytes{0xFA, 0xFF, 0x13});
  append_all(stream, counted(3));
  Bytes long_data(260, 0);
  long_data[100] = 0xFA;
  append_all(stream, frame(0x91, long_data));
  append_all(stream, counted(4));
  return stream;
}

TEST(MtWhole, AFlippedBitAtEveryPlace) {
  const Bytes stream = damaged_stream();
  const auto flipped = [&](std::size_t at) {
    Bytes bytes = stream;
    bytes[at] ^= 0x21U;
    return bytes;
  };
  expect_recorded("drivers/xsens_mt/flips.txt", test::at_every_place(stream.size(), flipped, outcome));
}

TEST(MtWhole, AStreamCutOffAtEveryPlace) {
  const Bytes stream = damaged_stream();
  const auto cut = [&](std::size_t at) {
    return Bytes(stream.begin(), stream.begin() + static_cast<std::ptrdiff_t>(at));
  };
  expect_recorded("drivers/xsens_mt/cuts.txt", test::at_every_place(stream.size() + 1, cut, outcome));
}

/// Data that are wrong under a right checksum.
TEST(MtWhole, AnotherByteAtEveryPlaceOfMessagesThatAreWhole) {
  Bytes data;
  append_item(data, xdi::kPacketCounter, u16(1));
  append_item(data, xdi::kSampleTimeFine, u32(100));
  plain(data);
  append_item(data, xdi::kUtcTime, utc_bytes(250'000'000, 2026, {3, 14, 12, 34, 56, 3}));
  append_item(data, xdi::kStatusWord, u32(2));
  append_item(data, xdi::kQuaternion, floats({0.9, 0.1, -0.2, 0.3}));
  append_item(data, xdi::kGnssPvt, gnss_item(400'000'000, 3, 1));
  std::string text;
  for (const std::uint8_t other : Bytes{0x00, 0x7F, 0xFF}) {
    const auto changed = [&](std::size_t at) {
      Bytes bytes = data;
      bytes[at] = other;
      return frame(mid::kMtData2, bytes);
    };
    text += "byte " + std::to_string(other) + '\n' + test::at_every_place(data.size(), changed, outcome);
  }
  expect_recorded("drivers/xsens_mt/other_bytes.txt", text);
}

// -------------------------------------------------------------------------------------------- the vectors

TEST(MtWhole, EveryVectorAsItIs) {
  std::string text;
  for (const char* name : {"xsens_control", "xsens_mtdata", "xsens_mtdata2"}) {
    for (const auto& vector :
         test::load_vectors(test::source_path(std::string("tests/vectors/") + name + ".hex"))) {
      text += vector.name + ": " + outcome(vector.bytes) + '\n';
    }
  }
  expect_recorded("drivers/xsens_mt/vectors.txt", text);
}

TEST(MtWhole, EveryNameAndEveryError) {
  std::string text;
  for (unsigned id = 0; id < 256; ++id) {
    const auto byte = static_cast<std::uint8_t>(id);
    text += test::hex_text(std::array{byte}) + " \"" + std::string(message_name(byte)) + "\" \"" +
            std::string(error_text(byte)) + "\"\n";
  }
  for (unsigned id = 0; id < 0x10000U; id += 0x10) {
    if (const ItemKind* kind = find_item_kind(static_cast<std::uint16_t>(id | 0x7U))) {
      text += std::to_string(id) + ' ' + std::string(kind->name) + ' ' +
              std::to_string(static_cast<int>(kind->content)) + ' ' + std::to_string(kind->count) + '\n';
    }
  }
  expect_recorded("drivers/xsens_mt/names.txt", text);
}

std::string configuration_text(const Configuration& c) {
  std::string text = std::to_string(c.master_id) + " period " + std::to_string(c.period) + " skip " +
                     std::to_string(c.skip_factor) + " sync " + std::to_string(c.sync_in_mode) + ' ' +
                     std::to_string(c.sync_in_skip) + ' ' + std::to_string(c.sync_in_offset) + " rate " +
                     test::real_text(c.rate_hz()) + (c.is_xbus_master() ? " of a bus" : "") + ' ' +
                     std::string(c.date.data(), c.date.size()) + ' ' +
                     std::string(c.time.data(), c.time.size());
  for (std::size_t k = 0; k < c.n_devices; ++k) {
    const DeviceRecord& d = c.devices[k];
    text += "; " + std::to_string(d.device_id) + ' ' + std::to_string(d.data_length) + ' ' +
            std::to_string(d.output_mode) + ' ' + std::to_string(d.output_settings) + ' ' +
            std::to_string(d.scenario) + ' ' + test::hex_text(d.firmware);
  }
  return text;
}

TEST(MtWhole, ConfigurationsOfEveryLength) {
  Bytes data(98 + 20 * 3);
  for (std::size_t i = 0; i < data.size(); ++i) data[i] = static_cast<std::uint8_t>('A' + i % 26);
  data[96] = 0;
  std::string text;
  for (const int n_devices : {0, 1, 2, 3, 40, 41, 255}) {
    data[97] = static_cast<std::uint8_t>(n_devices);
    std::string before;
    for (std::size_t size = 0; size <= data.size(); ++size) {
      const auto read = read_configuration(std::span(data).first(size));
      const std::string now = read ? configuration_text(*read) : "nothing";
      if (now != before)
        text += std::to_string(n_devices) + " devices in " + std::to_string(size) + ": " + now + '\n';
      before = now;
    }
  }
  expect_recorded("drivers/xsens_mt/configuration_lengths.txt", text);
}

TEST(MtWhole, FramesToTheDevice) {
  std::string text;
  for (const std::size_t size : {0U, 1U, 2U, 20U, 127U, 128U}) {
    Bytes data(size);
    for (std::size_t i = 0; i < size; ++i) data[i] = static_cast<std::uint8_t>(3 * i + 1);
    text += test::hex_text(OutgoingFrame(0x02, 0xD0, data).bytes()) + '\n';
  }
  expect_recorded("drivers/xsens_mt/outgoing.txt", text);
}

TEST(MtWhole, WhenUtcIsBelieved) {
  const UtcFields good{250'000'000, 2026, 3, 14, 12, 34, 56, 3};
  std::string text;
  const auto add = [&](UtcFields utc) {
    const auto ns = utc_ns(utc);
    text += (ns ? test::in_groups(*ns) : "nothing") + '\n';
  };
  for (const int year : {1969, 1970, 2200, 2201}) {
    UtcFields utc = good;
    utc.year = static_cast<std::uint16_t>(year);
    add(utc);
  }
  const auto each = [&](auto UtcFields::*field, std::initializer_list<std::uint32_t> values) {
    for (const std::uint32_t value : values) {
      UtcFields utc = good;
      utc.*field = static_cast<std::decay_t<decltype(utc.*field)>>(value);
      add(utc);
    }
  };
  each(&UtcFields::month, {0, 1, 12, 13});
  each(&UtcFields::day, {0, 1, 31, 32});
  each(&UtcFields::hour, {0, 23, 24});
  each(&UtcFields::minute, {0, 59, 60});
  each(&UtcFields::second, {0, 59, 60, 61});
  each(&UtcFields::nanoseconds, {0, 999'999'999, 1'000'000'000});
  each(&UtcFields::flags, {0, 1, 2, 3, 4, 7});
  expect_recorded("drivers/xsens_mt/utc.txt", text);
}

// -------------------------------------------------------------------------------------------- counts

std::string counted_text(const UnwrapConfig& config,
                         const std::vector<std::pair<std::int64_t, double>>& taken) {
  constexpr std::array<std::string_view, 5> kSteps{"first", "forward", "repeated", "restarted", "rejected"};
  CountUnwrapper unwrapper(config);
  std::string text;
  for (const auto& [raw, time_s] : taken) {
    const CountStep step = unwrapper.take(raw, kBegin + from_seconds(time_s));
    text += std::to_string(raw) + " at " + test::real_text(time_s) + ": " +
            std::string(kSteps.at(static_cast<std::size_t>(step))) + ' ' + std::to_string(unwrapper.step()) +
            " to " + test::in_groups(unwrapper.count()) + '\n';
  }
  return text;
}

TEST(MtWhole, CountsThatWrapStallAndJump) {
  std::string text;
  const UnwrapConfig hundred{1000, 0, 100.0, true};
  text += counted_text(hundred,
                       {{998, 0.0},   {999, 0.01}, {0, 0.02},    {2, 0.04},    {2, 0.05},    {400, 0.06},
                        {401, 0.07},  {402, 0.08}, {3, 0.5},     {700, 0.51},  {740, 0.52},  {780, 0.9},
                        {781, 10.0},  {782, 31.0}, {783, 31.01}, {200, 31.02}, {260, 31.03}, {310, 31.04},
                        {311, 31.05}, {312, 46.0}, {313, 61.0},  {314, 61.01}, {313, 61.02}});
  // Late, and prompt again: how far a count may be ahead.
  for (const int ahead : {340, 350, 351, 352, 360, 400}) {
    text += "ahead by " + std::to_string(ahead) + '\n' +
            counted_text(hundred, {{0, 0.0}, {ahead, 0.0}, {ahead + 1, 0.01}});
  }
  for (const double pause : {4.9, 5.0, 5.1, 9.9, 10.1, 14.9, 15.1, 24.9, 25.1}) {
    text += "pause " + test::real_text(pause) + '\n' +
            counted_text(hundred, {{0, 0.0}, {10, 1.0}, {300, 3.9}, {500, 3.9 + pause}, {510, 4.0 + pause}});
  }
  for (const int follows : {50, 51, 0, -1, 1}) {
    text += "follows by " + std::to_string(follows) + '\n' +
            counted_text(hundred, {{0, 0.0}, {1, 0.01}, {600, 0.02}, {600 + follows, 0.03}, {2, 0.04}});
  }
  // A stall that ends at once, and what is late for long.
  std::vector<std::pair<std::int64_t, double>> late;
  for (int i = 0; i < 12; ++i) late.emplace_back(100 + 10 * i, 1.0 + 0.1 * i);
  for (int i = 12; i < 24; ++i) late.emplace_back(100 + 10 * i, 4.0 + 0.1 * i);
  for (int i = 24; i < 34; ++i) late.emplace_back(400 + 10 * i, 4.0 + 0.1 * i);
  text += "late\n" + counted_text(hundred, late);
  const UnwrapConfig two_moduli{2000, 1500, 100.0, true};
  text += "two moduli\n" + counted_text(two_moduli, {{1499, 0.0},
                                                     {0, 0.01},
                                                     {1, 0.02},
                                                     {1600, 16.0},
                                                     {1999, 20.0},
                                                     {0, 20.01},
                                                     {1499, 35.0},
                                                     {1500, 35.01},
                                                     {0, 35.02}});
  const UnwrapConfig no_host{100'000, 0, 100.0, false};
  text += "no host time\n" + counted_text(no_host, {{5, 0},
                                                    {6, 0},
                                                    {6, 0},
                                                    {49'006, 0},
                                                    {50'000, 0},
                                                    {100, 0},
                                                    {60'101, 0},
                                                    {60'100, 0},
                                                    {0, 0},
                                                    {60'000, 0},
                                                    {99'999, 0},
                                                    {49'999, 0}});
  const UnwrapConfig no_host_slow{100'000, 0, 1.0, false};
  text += counted_text(no_host_slow, {{5, 0}, {605, 0}, {1206, 0}, {51'206, 0}, {1207, 0}});
  expect_recorded("drivers/xsens_mt/counts.txt", text);
}

// -------------------------------------------------------------------------------------------- guesses

/// Legacy data of `n` messages whose numbers are given, in the order of the fields.
using Number = std::function<Bytes(double)>;
Bytes float32(double value) { return floats({value}); }
Bytes float64(double value) {
  Bytes bytes;
  const auto bits = std::bit_cast<std::uint64_t>(value);
  append_all(bytes, u32(static_cast<std::uint32_t>(bits >> 32U)));
  append_all(bytes, u32(static_cast<std::uint32_t>(bits)));
  return bytes;
}

std::string guess_text(const std::vector<Bytes>& messages) {
  const std::vector<std::span<const std::uint8_t>> spans(messages.begin(), messages.end());
  const auto guess = guess_layout(spans);
  if (!guess) return "nothing\n";
  return "mode " + std::to_string(guess->mode) + " settings " + std::to_string(guess->settings) + '\n';
}

std::vector<Bytes> made(const Number& number, const std::vector<double>& values, int counter_step,
                        const Bytes& behind = {}) {
  std::vector<Bytes> messages;
  for (int i = 0; i < 4; ++i) {
    Bytes data;
    for (const double value : values) append_all(data, number(value));
    append_all(data, behind);
    if (counter_step != 0) append_all(data, u16(static_cast<std::uint16_t>(65533 + counter_step * i)));
    messages.push_back(data);
  }
  return messages;
}

const std::vector<double> kForce{0.3, -0.4, 9.8};
const std::vector<double> kRate{0.1, -0.2, 0.05};
const std::vector<double> kField{0.5, 0.2, -0.8};
const std::vector<double> kQuaternion{0.5, -0.5, 0.5, 0.5};
const std::vector<double> kAngles{10.0, -20.0, 150.0};
const std::vector<double> kMatrix{0.36, 0.48, -0.8, -0.8, 0.6, 0.0, 0.48, 0.64, 0.6};

std::vector<double> joined(std::initializer_list<std::vector<double>> parts) {
  std::vector<double> all;
  for (const auto& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}
std::vector<double> times(double factor, std::vector<double> values) {
  for (double& value : values) value *= factor;
  return values;
}

TEST(MtWhole, GuessesOfOrdinaryLayouts) {
  std::string text;
  for (const Number& number : {Number(float32), Number(float64)}) {
    for (const int step : {0, 1, 15, 16, 200}) {
      for (const auto& values : {joined({kForce, kRate, kField}), joined({kForce, kRate}), kForce, kRate,
                                 kQuaternion, kAngles, kMatrix, joined({kForce, kRate, kField, kQuaternion}),
                                 joined({{23.5}, kForce, kRate, kField, kAngles})}) {
        text += std::to_string(step) + ' ' + test::real_text(values) + ": " +
                guess_text(made(number, values, step));
      }
    }
  }
  expect_recorded("drivers/xsens_mt/guesses.txt", text);
}

/// Each number just inside and just outside of what it may be.
TEST(MtWhole, GuessesAtTheLimitsOfWhatIsPossible) {
  std::string text;
  const auto add = [&](const std::vector<double>& values, const Bytes& behind = {}) {
    text += test::real_text(values) + ' ' + test::hex_text(behind) + ": " +
            guess_text(made(float64, values, 1, behind));
  };
  for (const double norm : {0.499, 0.501, 199.9, 200.1, 0.0}) add(joined({{0.0, 0.0, norm}, kRate, kField}));
  for (const double norm : {39.9, 40.1, 0.0, 1e-14, 1e-16}) add(joined({kForce, {0.0, norm, 0.0}, kField}));
  for (const double norm : {0.049, 0.051, 9.99, 10.01}) add(joined({kForce, kRate, {norm, 0.0, 0.0}}));
  for (const double off : {-0.0011, -0.0009, 0.0009, 0.0011})
    add(joined({kForce, times(1.0 + off, kQuaternion)}));
  for (const double off : {-0.0006, -0.0004, 0.0004, 0.0006}) add(times(1.0 + off, kMatrix));
  for (std::size_t i = 0; i < 9; ++i) {
    std::vector<double> matrix = kMatrix;
    matrix[i] += 0.002;
    add(matrix);
  }
  for (const auto& angles : {std::vector<double>{180.0, 10.0, 10.0},
                             {180.5, 10.0, 10.0},
                             {10.0, -90.0, 10.0},
                             {10.0, 90.5, 10.0},
                             {10.0, 10.0, -180.0},
                             {10.0, 10.0, 180.5},
                             {5e-7, 5e-7, 0.0},
                             {9e-7, 9e-7, 0.0},
                             {10.0, 1e-16, 10.0}}) {
    add(joined({kForce, kRate, kField, angles}));
  }
  for (const double temperature : {-55.1, -54.9, 124.9, 125.1, 9e-7, 2e-6})
    add(joined({{temperature}, kForce, kRate, kField}));
  for (const auto& position : {std::vector<double>{-90.0, -180.0, -500.0},
                               {90.0, 360.0, 20000.0},
                               {-90.1, 0.5, 10.0},
                               {90.1, 0.5, 10.0},
                               {48.0, -180.1, 10.0},
                               {48.0, 360.1, 10.0},
                               {48.0, 2.0, -500.1},
                               {48.0, 2.0, 20000.1},
                               {5e-7, 5e-7, 0.0},
                               {9e-7, 9e-7, 0.0},
                               {48.0, 1e-16, 1.0}}) {
    add(joined({kForce, kRate, kField, position, {0.5, 0.5, 0.5}}));
  }
  for (const double speed : {0.0, 199.9, 200.1})
    add(joined({kForce, kRate, kField, {48.0, 2.0, 100.0}, {speed, 0.0, 0.0}}));
  for (const std::uint8_t status : Bytes{0, 7, 8}) add(joined({kForce, kRate, kField}), {status});
  expect_recorded("drivers/xsens_mt/guesses_at_limits.txt", text);
}

TEST(MtWhole, WhereTheDataOfAFileBegin) {
  std::string text;
  for (const int junk : {0, 1, 7, 40}) {
    for (int chained = 1; chained < 8; ++chained) {
      Bytes bytes(static_cast<std::size_t>(junk), 0x55);
      append_all(bytes, counted(1));
      bytes.push_back(0x00);
      for (int i = 0; i < chained; ++i)
        append_all(bytes, i % 2 == 0 ? counted(static_cast<std::uint16_t>(i)) : frame(0x31));
      const auto at = data_offset_of_mtb(bytes);
      text += std::to_string(junk) + ' ' + std::to_string(chained) + ": " +
              (at ? std::to_string(*at) : "nothing") + '\n';
    }
  }
  // A false frame around the first good ones.
  for (int inside = 1; inside < 4; ++inside) {
    Bytes hidden;
    for (int i = 0; i < inside; ++i) append_all(hidden, counted(static_cast<std::uint16_t>(i)));
    Bytes bytes = frame(0x13, hidden);
    bytes.pop_back();
    // The frame's last byte is its checksum: give the false one a right sum within the good ones.
    for (int i = 0; i < 6; ++i) append_all(bytes, counted(static_cast<std::uint16_t>(10 + i)));
    const auto at = data_offset_of_mtb(bytes);
    text += "around " + std::to_string(inside) + ": " + (at ? std::to_string(*at) : "nothing") + '\n';
  }
  expect_recorded("drivers/xsens_mt/mtb_offsets.txt", text);
}

}  // namespace
}  // namespace imuscope::xsens
