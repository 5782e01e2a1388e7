// Wheel speeds out of CAN frames: what becomes a sample, and what is refused and counted.
#include "drivers/can_odometry/decoder.h"

#include <gtest/gtest.h>
#include <cmath>
#include <fstream>
#include <functional>
#include <sstream>

#include "drivers/dbc/parser.h"
#include "tests/drivers/support/sample_text.h"
#include "tests/drivers/support/streams.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/recorded_answer.h"
#include "tests/support/shared_data.h"

namespace imuscope::can_odometry {
namespace {

using namespace std::chrono_literals;

constexpr std::string_view kCar = R"(BO_ 170 REAR: 8 ECU
 SG_ RL : 7|16@0- (0.01,0) [0|0] "km/h" X
 SG_ RR : 23|16@0- (0.01,0) [0|0] "km/h" X
 SG_ BROKEN : 39|1@0+ (1,0) [0|0] "" X
 SG_ COUNT : 35|4@0+ (1,0) [0|0] "" X
BO_ 171 FRONT: 4 ECU
 SG_ FL : 0|16@1+ (0.5,0) [0|0] "rad/s" X
 SG_ FR : 16|16@1+ (1,0) [0|0] "counts" X
BO_ 2147483650 GEAR: 1 ECU
 SG_ LEVER : 0|8@1+ (1,0) [0|0] "" X
BO_ 300 MUXED: 3 ECU
 SG_ PAGE M : 0|8@1+ (1,0) [0|0] "" X
 SG_ V m1 : 8|16@1+ (1,0) [0|0] "m/s" X
VAL_ 170 RL 32767 "not available" 0 "standstill" ;
VAL_ 2147483650 LEVER 0 "park" 1 "reverse" 2 "drive" ;
)";

dbc::Database car() {
  auto database = dbc::parse(kCar, "car.dbc");
  EXPECT_TRUE(database) << database.error().text();
  return std::move(*database);
}

struct Rig {
  explicit Rig(const Choice& choice, DecoderConfig config = {}) {
    auto made = Decoder::make(car(), choice, config);
    EXPECT_TRUE(made) << made.error().text();
    decoder = std::move(*made);
  }
  /// One frame, read 1 ms after its stamp.
  void frame(std::uint32_t id, std::vector<std::uint8_t> data, HostTime stamp, bool is_extended = false) {
    CanFrame can;
    can.id = id;
    can.is_extended = is_extended;
    can.length = static_cast<std::uint8_t>(data.size());
    std::copy(data.begin(), data.end(), can.data.begin());
    can.stamp = stamp;
    std::array<std::uint8_t, kCanRecordMaxBytes> record{};
    const std::size_t size = write_can_record(can, record);
    decoder->push(std::span(record).first(size), stamp + 1ms, sink);
  }
  void rear(int left_raw, int right_raw, std::uint8_t flags = 0) {
    const auto high = [](int raw) {
      return static_cast<std::uint8_t>(static_cast<unsigned>(raw) >> 8U & 0xFFU);
    };
    const auto low = [](int raw) { return static_cast<std::uint8_t>(static_cast<unsigned>(raw) & 0xFFU); };
    frame(170, {high(left_raw), low(left_raw), high(right_raw), low(right_raw), flags, 0, 0, 0}, now);
    now += 20ms;
  }
  HostTime now{1s};
  std::unique_ptr<Decoder> decoder;
  test::CollectingSink sink;
};

Choice rear_wheels() {
  Choice choice;
  choice.speed_signals = {"REAR.RL", "RR"};
  return choice;
}

TEST(CanOdometry, TheMeanOfTheChosenWheelsIsTheSpeed) {
  DecoderConfig config;
  config.device = 3;
  config.latency = 15ms;
  Rig rig(rear_wheels(), config);
  rig.rear(3600, 3960);
  ASSERT_EQ(rig.sink.samples.size(), 1U);
  const Sample& sample = rig.sink.samples[0];
  EXPECT_EQ(sample.kind, SampleKind::kOdometry);
  EXPECT_EQ(sample.device, 3);
  EXPECT_NEAR(sample.odometry.speed_mps, 10.5, 1e-12);
  EXPECT_EQ(sample.time, HostTime{1s - 15ms});
  EXPECT_EQ(sample.arrival, HostTime{1s + 1ms});
  rig.now += 2s;
  rig.rear(-360, -360);
  EXPECT_NEAR(rig.sink.samples.at(1).odometry.speed_mps, -1.0, 1e-12) << "the signal has a sign";
  EXPECT_EQ(rig.decoder->counters().samples, 2U);
}

/// The speed of a wheel whose signal has the unit, at 100 of it.
double speed_at_100(const std::string& name, std::optional<SpeedUnit> chosen) {
  const std::string file = "BO_ 1 M: 2 X\n SG_ V : 0|16@1+ (1,0) [0|0] \"" + name + "\" X\n";
  const auto database = dbc::parse(file, "units.dbc");
  Choice choice;
  choice.speed_signals = {"V"};
  choice.unit = chosen;
  choice.wheel_radius_m = 0.3;
  auto made = Decoder::make(*database, choice, {});
  if (!made) return std::nan("");
  CanFrame can;
  can.id = 1;
  can.length = 2;
  can.data[0] = 100;
  std::array<std::uint8_t, kCanRecordMaxBytes> record{};
  test::CollectingSink sink;
  (*made)->push(std::span(record).first(write_can_record(can, record)), HostTime{1s}, sink);
  return sink.samples.size() == 1 ? sink.samples[0].odometry.speed_mps : std::nan("");
}

TEST(CanOdometry, EveryUnitThatADbcOrAConfigurationGivesIsItself) {
  const double at_100_mph = 100.0 * 1609.344 / 3600.0;  // the international mile's metres
  for (const char* name : {"m/s", "mps", "M/S"}) EXPECT_NEAR(speed_at_100(name, {}), 100.0, 1e-12) << name;
  for (const char* name : {"km/h", "kmh", "kph", "kmph", "KPH"})
    EXPECT_NEAR(speed_at_100(name, {}), 1e5 / 3600.0, 1e-12) << name;
  for (const char* name : {"mph", "MPH"}) EXPECT_NEAR(speed_at_100(name, {}), at_100_mph, 1e-12) << name;
  EXPECT_NEAR(speed_at_100("rad/s", {}), 30.0, 1e-12);
  // What a person chose holds against what the file says.
  EXPECT_NEAR(speed_at_100("km/h", SpeedUnit::kMph), at_100_mph, 1e-12);
  EXPECT_NEAR(speed_at_100("counts", SpeedUnit::kKmph), 1e5 / 3600.0, 1e-12);
  EXPECT_NEAR(speed_at_100("mph", SpeedUnit::kMps), 100.0, 1e-12);
  EXPECT_NEAR(speed_at_100("", SpeedUnit::kRadps), 30.0, 1e-12);
  for (const char* name : {"knots", "m/s2", "mp", ""})
    EXPECT_TRUE(std::isnan(speed_at_100(name, {}))) << name;
}

TEST(CanOdometry, AsksTheKernelForItsMessagesAlone) {
  Choice choice = rear_wheels();
  choice.direction_signal = "GEAR.LEVER";
  choice.backward_values = {"reverse"};
  const Rig rig(choice);
  EXPECT_EQ(rig.decoder->ids(), (std::vector<CanId>{{170, false}, {2, true}}));
}

TEST(CanOdometry, WheelsInTwoMessagesMakeOneSampleOfBoth) {
  Choice choice;
  choice.speed_signals = {"REAR.RL", "FRONT.FL"};
  choice.wheel_radius_m = 0.3;
  Rig rig(choice);
  rig.frame(170, {0x0E, 0x10, 0, 0, 0, 0, 0, 0}, HostTime{1s});  // 36 km/h
  EXPECT_TRUE(rig.sink.samples.empty());
  rig.frame(171, {80, 0, 0, 0}, HostTime{1s + 3ms});  // 40 rad/s, 12 m/s
  ASSERT_EQ(rig.sink.samples.size(), 1U);
  EXPECT_NEAR(rig.sink.samples[0].odometry.speed_mps, 11.0, 1e-12);
  EXPECT_EQ(rig.sink.samples[0].time, HostTime{1s + 3ms});
  // The front's frames stay away for a while: an old wheel is not held.
  rig.frame(170, {0x0E, 0x10, 0, 0, 0, 0, 0, 0}, HostTime{1s + 20ms});
  rig.frame(171, {80, 0, 0, 0}, HostTime{1s + 500ms});
  EXPECT_EQ(rig.sink.samples.size(), 1U);
  EXPECT_EQ(rig.decoder->odometry_counters().incomplete, 1U);
  rig.frame(170, {0x0E, 0x10, 0, 0, 0, 0, 0, 0}, HostTime{1s + 501ms});
  EXPECT_EQ(rig.sink.samples.size(), 2U);
}

TEST(CanOdometry, SpeedsThatTheVehicleMarksAsInvalidAreRefused) {
  Choice choice = rear_wheels();
  choice.fault_signals = {"BROKEN"};
  choice.invalid_raw = {-1};
  Rig rig(choice);
  rig.rear(3600, 3600, 0x80);  // fault bit
  rig.rear(32767, 3600);       // named "not available"
  rig.rear(3600, -1);          // configured
  EXPECT_TRUE(rig.sink.samples.empty());
  EXPECT_EQ(rig.decoder->odometry_counters().invalid, 3U);
  EXPECT_EQ(rig.decoder->remark(), "every speed was marked as invalid by the vehicle; is the ignition on?");
  rig.rear(0, 0);  // "standstill" is a speed with a name
  rig.rear(100, 100);
  EXPECT_EQ(rig.sink.samples.size(), 2U);
  EXPECT_EQ(rig.decoder->remark(), "");
}

TEST(CanOdometry, AFrameTooShortForASignalGivesNoSampleAndIsCounted) {
  Rig rig(rear_wheels());
  rig.frame(170, {0x0E, 0x10, 0x0E}, HostTime{1s});
  EXPECT_TRUE(rig.sink.samples.empty());
  EXPECT_EQ(rig.decoder->odometry_counters().too_short, 1U);
  EXPECT_EQ(rig.decoder->counters().bad_contents, 1U);
  EXPECT_EQ(rig.decoder->remark(),
            "frames of REAR are too short for a chosen signal (3 bytes received, 8 in the DBC file); check "
            "that the DBC file is this vehicle's");
}

TEST(CanOdometry, AnotherPageOfAMultiplexedMessageIsNoFault) {
  Choice choice;
  choice.speed_signals = {"MUXED.V"};
  Rig rig(choice);
  rig.frame(300, {0, 10, 0}, HostTime{1s});
  EXPECT_TRUE(rig.sink.samples.empty());
  rig.frame(300, {1, 10, 0}, HostTime{1s + 10ms});
  ASSERT_EQ(rig.sink.samples.size(), 1U);
  EXPECT_EQ(rig.sink.samples[0].odometry.speed_mps, 10.0);
  EXPECT_EQ(rig.decoder->counters().bad_contents, 0U);
}

TEST(CanOdometry, ImpossibleSpeedsAreRefusedCountedAndNamed) {
  DecoderConfig config;
  config.max_speed_mps = 70.0;
  Rig rig(rear_wheels(), config);
  rig.rear(3600, 3600);
  rig.rear(32000, 32000);  // 88.9 m/s
  rig.rear(14400, 14400);  // from 10 to 40 m/s in 40 ms
  rig.rear(3600, 3600);
  EXPECT_EQ(rig.sink.samples.size(), 2U);
  EXPECT_EQ(rig.decoder->odometry_counters().impossible, 2U);
  EXPECT_EQ(rig.decoder->remark(),
            "impossible speeds were refused, such as 88.9 m/s; check unit and factor of the speed signals");
}

TEST(CanOdometry, WhatWasWrongIsToldUntilAMinuteWithoutIt) {
  DecoderConfig config;
  config.max_speed_mps = 70.0;
  Rig rig(rear_wheels(), config);
  const auto drive = [&](int frames) {
    for (int i = 0; i < frames; ++i) rig.rear(3600, 3600);
  };
  drive(1);
  rig.rear(32000, 32000);
  drive(50 * 59);  // 20 ms apart
  EXPECT_NE(rig.decoder->remark(), "");
  drive(50 * 2);
  EXPECT_EQ(rig.decoder->remark(), "");
  rig.rear(28800, 28800);
  EXPECT_EQ(rig.decoder->remark(),
            "impossible speeds were refused, such as 80.0 m/s; check unit and factor of the speed signals");
}

TEST(CanOdometry, AJumpThatStaysIsBelieved) {
  Rig rig(rear_wheels());
  rig.rear(3600, 3600);
  for (int i = 0; i < 20; ++i) rig.rear(7200, 7200);
  EXPECT_EQ(rig.decoder->odometry_counters().impossible, 9U);
  EXPECT_EQ(rig.sink.samples.size(), 12U);
}

TEST(CanOdometry, ALeaverOfTheDeadBandIsNoJump) {
  Rig rig(rear_wheels());
  rig.rear(0, 0);
  rig.rear(200, 200);  // 2 km/h at once
  EXPECT_EQ(rig.sink.samples.size(), 2U);
}

TEST(CanOdometry, TheDirectionSignalGivesTheSign) {
  Choice choice = rear_wheels();
  choice.direction_signal = "GEAR.LEVER";
  choice.backward_values = {"reverse", "7"};
  Rig rig(choice);
  const auto speed_in = [&](std::uint8_t lever) {
    rig.frame(2, {lever}, rig.now, true);
    rig.now += 200ms;
    rig.rear(360, 360);
    return rig.sink.samples.back().odometry.speed_mps;
  };
  EXPECT_NEAR(speed_in(2), 1.0, 1e-12);
  EXPECT_NEAR(speed_in(1), -1.0, 1e-12);
  EXPECT_NEAR(speed_in(7), -1.0, 1e-12);
  EXPECT_NEAR(speed_in(0), 1.0, 1e-12);
  // A standard frame with the same number is another message.
  rig.frame(2, {1}, rig.now);
  rig.rear(360, 360);
  EXPECT_NEAR(rig.sink.samples.back().odometry.speed_mps, 1.0, 1e-12);
}

TEST(CanOdometry, TheVehiclesOwnCounterTellsLosses) {
  Choice choice = rear_wheels();
  choice.counter_signal = "COUNT";
  Rig rig(choice);
  for (const unsigned count : {13U, 14U, 15U, 0U, 1U, 4U, 5U})
    rig.rear(3600, 3600, static_cast<std::uint8_t>(count));
  EXPECT_EQ(rig.decoder->counters().samples_lost, 2U);
}

TEST(CanOdometry, WithoutACounterTheStampsTellLossesOnceTheRateIsKnown) {
  for (const double configured_hz : {50.0, 200.0}) {
    Rig rig(rear_wheels(), {0, configured_hz});
    for (int i = 0; i < 200; ++i) rig.rear(3600, 3600);  // every 20 ms
    EXPECT_EQ(rig.decoder->counters().samples_lost, 0U) << configured_hz;
    rig.now += 20ms;
    for (int i = 0; i < 50; ++i) rig.rear(3600, 3600);
    EXPECT_EQ(rig.decoder->counters().samples_lost, 1U) << configured_hz;
    rig.now += 1s;
    rig.rear(3600, 3600);
    EXPECT_NEAR(static_cast<double>(rig.decoder->counters().samples_lost), 51.0, 1.0) << configured_hz;
  }
}

TEST(CanOdometry, StampsThatBunchAreNoHigherRateAndWhatFollowsIsNoLoss) {
  Rig rig(rear_wheels(), {0, 50.0});
  for (int i = 0; i < 200; ++i) rig.rear(3600, 3600);  // every 20 ms
  const HostTime read = rig.now;
  for (int i = 0; i < 200; ++i) {
    rig.now = read;
    rig.rear(3600, 3600);
  }
  for (int i = 0; i < 200; ++i) rig.rear(3600, 3600);
  EXPECT_EQ(rig.decoder->counters().samples_lost, 0U);
}

TEST(CanOdometry, WhatCannotBeChosenIsRefusedWithTheRemedy) {
  const auto refused = [](const Choice& choice) {
    const auto made = Decoder::make(car(), choice, {});
    EXPECT_FALSE(made);
    EXPECT_EQ(made.error().kind, ErrorKind::kUsage);
    return made.error().text();
  };
  Choice choice;
  EXPECT_EQ(refused(choice),
            "no speed_signals are chosen; name the wheel speeds in the DBC file, MESSAGE.SIGNAL");
  choice.speed_signals = {"REAR.RX"};
  EXPECT_EQ(refused(choice), "car.dbc: no signal 'REAR.RX'; did you mean 'REAR.RL'?");
  choice.speed_signals = {"FRONT.FR"};
  EXPECT_EQ(refused(choice),
            "car.dbc: signal FRONT.FR is in \"counts\", which is no unit of speed; give "
            "speed_unit: m/s, km/h, mph or rad/s");
  choice.speed_signals = {"FRONT.FL"};
  EXPECT_EQ(refused(choice), "car.dbc: signal FRONT.FL is an angular rate; give wheel_radius_m");
  choice = rear_wheels();
  choice.direction_signal = "GEAR.LEVER";
  choice.backward_values = {"backwards"};
  EXPECT_EQ(refused(choice),
            "car.dbc: signal GEAR.LEVER has no value called 'backwards'; it has park, reverse, drive");
}

TEST(CanOdometry, ErrorAndRemoteFramesAndDamagedRecordsGiveNothing) {
  Rig rig(rear_wheels());
  std::array<std::uint8_t, kCanRecordMaxBytes> record{};
  CanFrame can;
  can.id = 170;
  can.length = 8;
  can.is_remote = true;
  rig.decoder->push(std::span(record).first(write_can_record(can, record)), HostTime{1s}, rig.sink);
  can.is_remote = false;
  can.is_error = true;
  rig.decoder->push(std::span(record).first(write_can_record(can, record)), HostTime{1s}, rig.sink);
  can.is_error = false;
  const std::size_t size = write_can_record(can, record);
  rig.decoder->push(std::span(record).first(size - 1), HostTime{1s}, rig.sink);
  EXPECT_TRUE(rig.sink.samples.empty());
  EXPECT_EQ(rig.decoder->counters().bytes_skipped, size - 1);
}

TEST(CanOdometry, DecodingAllocatesNothing) {
  Rig rig(rear_wheels());
  rig.sink.samples.reserve(1000);
  std::vector<std::uint8_t> data{0x0E, 0x10, 0x0E, 0x10, 0, 0, 0, 0};
  CanFrame can;
  can.id = 170;
  can.length = 8;
  std::copy(data.begin(), data.end(), can.data.begin());
  std::array<std::uint8_t, kCanRecordMaxBytes> record{};
  const std::uint64_t before = test::allocation_count();
  for (int i = 0; i < 500; ++i) {
    can.stamp = HostTime{1s} + i * 20ms;
    const std::size_t size = write_can_record(can, record);
    rig.decoder->push(std::span(record).first(size), can.stamp, rig.sink);
  }
  EXPECT_EQ(test::allocation_count(), before);
  EXPECT_EQ(rig.sink.samples.size(), 500U);
}

// A real car's log through the decoder, against the published speeds of its rear wheels.
TEST(CanOdometry, ARealDriveDecodesToItsPublishedSpeeds) {
  IMUSCOPE_NEEDS_SHARED("data/can_car/car.candump.log");
  const auto text = dbc::read_text(test::source_path("config/toyota_rav4.dbc"));
  ASSERT_TRUE(text);
  const auto database = dbc::parse(*text, "toyota_rav4.dbc");
  ASSERT_TRUE(database);
  Choice choice;
  choice.speed_signals = {"WHEEL_SPEEDS.RR", "WHEEL_SPEEDS.RL"};
  choice.has_no_sign = true;
  auto made = Decoder::make(*database, choice, {0, 80.0});
  ASSERT_TRUE(made);
  Rig rig(rear_wheels());
  rig.decoder = std::move(*made);
  std::ifstream log(test::shared_path("data/can_car/car.candump.log"));
  for (std::string line; std::getline(log, line);) {
    const auto hash = line.find('#');
    const auto id_at = line.rfind(' ', hash) + 1;
    std::vector<std::uint8_t> data;
    for (std::size_t at = hash + 1; at + 1 < line.size(); at += 2)
      data.push_back(static_cast<std::uint8_t>(std::stoul(line.substr(at, 2), nullptr, 16)));
    const double time_s = std::stod(line.substr(1, line.find(')') - 1));
    rig.frame(static_cast<std::uint32_t>(std::stoul(line.substr(id_at, hash - id_at), nullptr, 16)), data,
              HostTime{from_seconds(time_s)}, hash - id_at == 8);
  }
  std::ifstream csv(test::shared_path("data/can_car/wheel_speed.csv"));
  std::string row;
  std::getline(csv, row);
  std::size_t rows = 0;
  double largest = 0.0;
  for (; std::getline(csv, row); ++rows) {
    std::array<double, 5> cells{};
    std::istringstream in(row);
    for (double& cell : cells) {
      std::string text_of_cell;
      std::getline(in, text_of_cell, ',');
      cell = std::stod(text_of_cell);
    }
    const Sample& sample = rig.sink.samples.at(rows);
    EXPECT_NEAR(to_seconds(sample.time.time_since_epoch()), cells[0], 1e-6);
    largest = std::max(largest, std::abs(sample.odometry.speed_mps - 0.5 * (cells[3] + cells[4])));
  }
  EXPECT_EQ(rig.sink.samples.size(), rows);
  EXPECT_LT(largest, 1e-6);
  EXPECT_EQ(rig.decoder->remark(), "");
  EXPECT_EQ(rig.decoder->counters().samples_lost, 0U) << "stamps that jitter by a period are no loss";
}

TEST(CanOdometry, SignalsThatAreNotInTheFileAreRefusedByName) {
  Choice fault = rear_wheels();
  fault.fault_signals = {"REAR.BROKN"};
  Choice counter = rear_wheels();
  counter.counter_signal = "REAR.COUNTER";
  Choice direction = rear_wheels();
  direction.direction_signal = "GEAR.LEVR";
  for (const auto& [choice, name] :
       {std::pair{fault, "BROKN"}, std::pair{counter, "COUNTER"}, std::pair{direction, "LEVR"}}) {
    const auto made = Decoder::make(car(), choice, {});
    ASSERT_FALSE(made) << name;
    EXPECT_NE(made.error().text().find(name), std::string::npos) << made.error().text();
  }
}

// Everything that comes out of rich streams, held as it once was.

std::string all_of(Rig& rig) {
  std::string text;
  for (const Sample& sample : rig.sink.samples) text += test::sample_text(sample) + '\n';
  const OdometryCounters& c = rig.decoder->odometry_counters();
  return text + test::counts_text(rig.decoder->counters()) + " short " + std::to_string(c.too_short) +
         " invalid " + std::to_string(c.invalid) + " impossible " + std::to_string(c.impossible) +
         " incomplete " + std::to_string(c.incomplete) + '\n' + std::string(rig.decoder->remark()) + "\n--\n";
}

Choice whole_choice() {
  Choice choice = rear_wheels();
  choice.direction_signal = "LEVER";
  choice.backward_values = {"reverse", "7"};
  choice.fault_signals = {"BROKEN"};
  choice.invalid_raw = {-500.0, 123.4};
  choice.counter_signal = "COUNT";
  return choice;
}

TEST(CanOdometryWhole, FaultsDirectionsInvalidNumbersAndCounts) {
  DecoderConfig config;
  config.device = 3;
  config.latency = 15ms;
  Rig rig(whole_choice(), config);
  std::uint8_t count = 0;
  const auto rear = [&](int left, int right, unsigned broken = 0, int step = 1) {
    count = static_cast<std::uint8_t>((count + step) & 0xF);
    rig.rear(left, right, static_cast<std::uint8_t>(broken << 7U | count));
  };
  rear(32767, 100), rear(100, 32767), rear(-500, 100), rear(123, 100), rear(124, 100), rear(100, 123);
  rear(3600, 3960), rear(3610, 3970, 1), rear(3620, 3980), rear(3630, 3990, 0, 3), rear(3640, 4000, 0, 0);
  for (int i = 0; i < 14; ++i) rear(3640 + i, 4000);
  for (const int lever : {1, 2, 7, 0, 8}) {
    rig.frame(2, {static_cast<std::uint8_t>(lever)}, rig.now, true);
    rig.frame(2, {1}, rig.now);
    rear(360, 364), rear(-360, 364), rear(-360, -364);
  }
  rig.frame(170, {1, 2, 3}, rig.now);
  rig.frame(170, {1, 2, 3, 4}, rig.now);
  rear(360, 364);
  rig.now += 61s;
  rear(360, 364);
  for (int i = 0; i < 13; ++i) rear(20'000, 20'004);
  for (int i = 0; i < 3; ++i) rear(32'000, -32'001);
  rear(20'000, 20'004);
  std::string text = all_of(rig);
  Choice magnitudes = rear_wheels();
  magnitudes.has_no_sign = true;
  Rig another(magnitudes);
  another.rear(3600, 3960), another.rear(32'767, 3960);
  text += all_of(another);
  test::expect_recorded("drivers/can_odometry/faults.txt", text, test::kSampleShare);
}

TEST(CanOdometryWhole, WheelsOfSeveralFrames) {
  Choice choice;
  choice.speed_signals = {"RL", "FL", "MUXED.V"};
  choice.wheel_radius_m = 0.3;
  DecoderConfig config;
  config.rate_hz = 50.0;
  Rig rig(choice, config);
  const auto wheels = [&](Duration rear, Duration front, Duration third, std::uint8_t page = 1) {
    rig.frame(170, {0x0E, 0x10, 0, 0, 0, 0, 0, 0}, rig.now + rear);
    rig.frame(171, {66, 0, 0, 0}, rig.now + front);
    rig.frame(300, {page, 9, 0}, rig.now + third);
    rig.now += 20ms;
  };
  wheels(0ms, 1ms, 2ms);
  wheels(2ms, 1ms, 0ms);
  wheels(0ms, 1ms, 2ms, 2);
  wheels(0ms, 1ms, 2ms);
  wheels(0ms, 1ms, 30ms);
  wheels(0ms, 1ms, Duration{30ms} + Duration{1});
  wheels(-31ms, 1ms, 0ms);
  wheels(0ms, 1ms, 2ms);
  rig.frame(300, {1, 9}, rig.now);
  rig.frame(300, {2, 9}, rig.now);
  rig.frame(171, {66}, rig.now);
  test::expect_recorded("drivers/can_odometry/several_frames.txt", all_of(rig), test::kSampleShare);
}

TEST(CanOdometryWhole, GapsAreLearnedFromTheStamps) {
  std::string text;
  for (const double rate_hz : {50.0, 20.0, 100.0}) {
    for (const int jitter_us : {0, 3000}) {
      DecoderConfig config;
      config.rate_hz = rate_hz;
      Rig rig(rear_wheels(), config);
      std::string line;
      for (int i = 0; i < 260; ++i) {
        const auto off = std::chrono::microseconds(jitter_us * ((i * 7) % 11 - 5) / 5);
        rig.now += off;
        rig.rear(3600, 3960);
        rig.now -= off;
        if (i == 40 || i == 100 || i % 50 == 49) rig.now += 20ms * (i % 7);
        if (i == 130) rig.now += 31ms;
        if (i > 200) rig.now += 20ms;
        if (i % 5 == 4) line += ' ' + std::to_string(rig.decoder->counters().samples_lost);
      }
      text += test::real_text(rate_hz) + ' ' + std::to_string(jitter_us) + ':' + line + '\n';
    }
  }
  test::expect_recorded("drivers/can_odometry/gaps.txt", text);
}

// The configured rate is the first idea of it, however little was learned.
TEST(CanOdometry, ALossIsSeenAsSoonAsARateIsLearned) {
  constexpr int kSetsToLearn = 64;
  Rig rig(rear_wheels(), {.rate_hz = 50.0});
  for (int i = 0; i < kSetsToLearn + 1; ++i) rig.rear(3600, 3960);
  rig.now += 14ms;
  rig.rear(3600, 3960);
  EXPECT_EQ(rig.decoder->counters().samples_lost, 1U);
}

TEST(CanOdometryWhole, WhatIsPossible) {
  std::string text;
  for (const int after : {3600, 3600 + 359, 3600 + 361, 3600 + 503, 3600 + 505, 7300, 35'900, -3600}) {
    for (const Duration pause :
         {Duration{0ms}, Duration{80ms}, Duration{979ms}, Duration{980ms}, Duration{981ms}}) {
      Rig rig(rear_wheels());
      rig.rear(3600, 3600);
      rig.now += pause;
      for (int i = 0; i < 12; ++i) rig.rear(std::min(after, 32'700), std::min(after, 32'700));
      text += std::to_string(after) + ' ' + test::in_groups(pause.count()) + ' ' +
              std::to_string(rig.sink.samples.size()) + ' ' +
              std::to_string(rig.decoder->odometry_counters().impossible) + ' ' +
              std::string(rig.decoder->remark()) + '\n';
    }
  }
  for (const double most : {99.9, 100.0, 100.1}) {
    DecoderConfig config;
    config.max_speed_mps = most;
    config.max_acceleration_mps2 = 1e6;
    Choice choice = rear_wheels();
    choice.unit = SpeedUnit::kMps;
    Rig rig(choice, config);
    rig.rear(10'000, 10'000), rig.rear(-10'000, -10'000), rig.rear(10'001, 10'001);
    text += all_of(rig);
  }
  test::expect_recorded("drivers/can_odometry/possible.txt", text, test::kSampleShare);
}

TEST(CanOdometryWhole, SentencesAboutChoices) {
  std::string text;
  const auto add = [&](const std::function<void(Choice&)>& change) {
    Choice choice = rear_wheels();
    change(choice);
    const auto made = Decoder::make(car(), choice, {});
    if (!made) {
      text += made.error().text() + '\n';
      return;
    }
    for (const CanId& id : (*made)->ids()) text += std::to_string(id.id) + (id.is_extended ? "x " : " ");
    text += '\n';
  };
  add([](Choice&) {});
  add([](Choice& c) { c.speed_signals.clear(); });
  add([](Choice& c) { c.speed_signals = {"RLL"}; });
  add([](Choice& c) { c.speed_signals = {"FR"}; });
  add([](Choice& c) { c.speed_signals = {"FL"}; });
  add([](Choice& c) { c.speed_signals = {"FL"}, c.wheel_radius_m = -1.0; });
  add([](Choice& c) { c.speed_signals = {"FL"}, c.wheel_radius_m = 0.3; });
  add([](Choice& c) { c.speed_signals = {"FR"}, c.unit = SpeedUnit::kRadps; });
  add([](Choice& c) { c.direction_signal = "LEVERR"; });
  add([](Choice& c) { c.direction_signal = "LEVER", c.backward_values = {"back"}; });
  add([](Choice& c) { c.direction_signal = "LEVER", c.backward_values = {"1x"}; });
  add([](Choice& c) { c.direction_signal = "LEVER", c.backward_values = {"1", "reverse"}; });
  add([](Choice& c) { c.direction_signal = "PAGE", c.backward_values = {"back"}; });
  add([](Choice& c) { c.fault_signals = {"BROKE"}; });
  add([](Choice& c) { c.counter_signal = "COUN"; });
  add([](Choice& c) { c = whole_choice(); });
  test::expect_recorded("drivers/can_odometry/choices.txt", text);
}

}  // namespace
}  // namespace imuscope::can_odometry
