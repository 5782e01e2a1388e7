#include <gtest/gtest.h>
#include <bit>
#include <optional>
#include <string>

#include "firmware_sim/devices/gnss_encoders.h"
#include "firmware_sim/devices/gnss_talker.h"
#include "firmware_sim/devices/greis_receiver.h"
#include "firmware_sim/devices/stdbin_unit.h"
#include "firmware_sim/devices/xsens_mti.h"
#include "firmware_sim/devices/xsens_mtx.h"
#include "firmware_sim/devices/xsens_xbus.h"
#include "tests/firmware_sim/vectors.h"

namespace imusim {
namespace {

using xsens::frame;

class XsensMtxTest : public testing::Test {
 protected:
  struct Frame {
    std::uint8_t mid;
    Bytes data;
    double at_s;
  };

  static XsensMtx device(const XsensMtx::Options& options = {}) {
    return {options, [](double, std::int64_t) { return xsens::MtSample{}; }, 0.0};
  }

  /// Frames that a device sends until t_s.
  static std::vector<Frame> until(XsensMtx& device, double t_s) {
    std::vector<Emission> emissions;
    device.run_until(t_s, emissions);
    std::vector<Frame> frames;
    for (const Emission& emission : emissions) {
      const Bytes& bytes = emission.bytes;
      EXPECT_EQ(bytes[0], 0xFA);
      EXPECT_EQ(bytes.size(), bytes[3] + 5U);
      frames.push_back({bytes[2], Bytes(bytes.begin() + 4, bytes.end() - 1), emission.ready_s});
    }
    return frames;
  }

  /// Sends a command at t_s and returns the answer, skipping data.
  static Frame ask(XsensMtx& device, double t_s, std::uint8_t mid, const Bytes& data = {}) {
    device.receive(frame(mid, data), t_s);
    for (const Frame& answer : until(device, t_s + 0.01))
      if (answer.mid != xsens::kMtData) return answer;
    return {0xFF, {}, 0.0};
  }

  /// A device that has gone to Config at 1 s.
  static XsensMtx configured() {
    XsensMtx mtx = device();
    until(mtx, 1.0);
    EXPECT_EQ(ask(mtx, 1.0, xsens::kGoToConfig).mid, xsens::kGoToConfig + 1);
    return mtx;
  }
};

TEST_F(XsensMtxTest, WakesAndStreamsItsFactorySettingWhenNobodyAnswers) {
  XsensMtx mtx = device();
  const std::vector<Frame> frames = until(mtx, 1.0);
  ASSERT_GT(frames.size(), 40U);
  EXPECT_EQ(frames[0].mid, xsens::kWakeUp);
  EXPECT_EQ(frames[1].mid, xsens::kConfiguration);
  EXPECT_NEAR(frames[1].at_s, 0.5, 1e-9);
  EXPECT_EQ(frames[2].mid, xsens::kMtData);
  EXPECT_EQ(frames[2].data.size(), 18U);  // quaternion and counter
  EXPECT_NEAR(frames[10].at_s - frames[9].at_s, 0.01, 1e-9);
}

TEST_F(XsensMtxTest, WakeUpAckTakesItToConfigWithoutData) {
  XsensMtx mtx = device();
  until(mtx, 0.1);
  mtx.receive(frame(xsens::kWakeUpAck, {}), 0.1);
  EXPECT_TRUE(until(mtx, 2.0).empty());
  EXPECT_EQ(mtx.state(), XsensMtx::State::kConfig);
}

TEST_F(XsensMtxTest, StreamsUntilGoToConfigIsAcknowledgedAndNoLonger) {
  XsensMtx mtx = device();
  until(mtx, 1.0);
  mtx.receive(frame(xsens::kGoToConfig, {}), 1.0);
  const std::vector<Frame> frames = until(mtx, 3.0);
  ASSERT_FALSE(frames.empty());
  EXPECT_EQ(frames.back().mid, xsens::kGoToConfig + 1);
  for (std::size_t i = 0; i + 1 < frames.size(); ++i) EXPECT_EQ(frames[i].mid, xsens::kMtData);
  EXPECT_EQ(mtx.state(), XsensMtx::State::kConfig);
}

TEST_F(XsensMtxTest, AnswersWhatItIsAskedInConfig) {
  XsensMtx mtx = configured();
  EXPECT_EQ(ask(mtx, 1.1, xsens::kReqDid).data, (Bytes{0x00, 0x30, 0x00, 0x01}));
  EXPECT_EQ(ask(mtx, 1.2, xsens::kPeriod).data, (Bytes{0x04, 0x80}));
  EXPECT_EQ(ask(mtx, 1.3, xsens::kReqDataLength).data, (Bytes{0x00, 18}));
  EXPECT_EQ(ask(mtx, 1.4, xsens::kReqProductCode).data.size(), 20U);
  EXPECT_EQ(ask(mtx, 1.5, xsens::kReqConfiguration).data.size(), 118U);
}

TEST_F(XsensMtxTest, ItsConfigurationMessageIsThatOfTheVector) {
  XsensMtx::Options options;
  options.device_id = 0x00300123;
  XsensMtx mtx = device(options);
  until(mtx, 1.0);
  ask(mtx, 1.0, xsens::kGoToConfig);
  ask(mtx, 1.1, xsens::kOutputMode, {0x00, 0x06});
  ask(mtx, 1.2, xsens::kOutputSettings, {0x00, 0x00, 0x00, 0x01});
  const Frame answer = ask(mtx, 1.3, xsens::kReqConfiguration);
  Bytes expected = test::load_vectors("xsens_mtdata").at("configuration_1dev").bytes;
  expected = Bytes(expected.begin() + 4, expected.end() - 1);
  std::fill(expected.begin() + 16, expected.begin() + 32, std::uint8_t{0});  // date and time: ours has none
  EXPECT_EQ(answer.data, expected);
}

TEST_F(XsensMtxTest, TheUsualHandshakeLeadsToCalibratedDataWithACounter) {
  XsensMtx::Options options;
  options.first_counter = 65534;
  XsensMtx mtx(
      options,
      [](double, std::int64_t) {
        xsens::MtSample sample;
        sample.acc_mps2 = {1.0, 2.0, 3.0};
        return sample;
      },
      0.0);
  until(mtx, 1.0);
  ask(mtx, 1.0, xsens::kGoToConfig);
  EXPECT_EQ(ask(mtx, 1.1, xsens::kPeriod, {0x04, 0x80}).mid, xsens::kPeriod + 1);
  EXPECT_EQ(ask(mtx, 1.2, xsens::kOutputMode, {0x00, 0x02}).mid, xsens::kOutputMode + 1);
  EXPECT_EQ(ask(mtx, 1.3, xsens::kOutputSettings, {0x00, 0x00, 0x00, 0x41}).mid, xsens::kOutputSettings + 1);
  EXPECT_EQ(ask(mtx, 1.4, xsens::kReqDataLength).data, (Bytes{0x00, 26}));
  EXPECT_EQ(ask(mtx, 1.5, xsens::kGoToMeasurement).mid, xsens::kGoToMeasurement + 1);
  const std::vector<Frame> frames = until(mtx, 3.0);
  ASSERT_GT(frames.size(), 100U);
  for (std::size_t i = 1; i < frames.size(); ++i) {
    ASSERT_EQ(frames[i].data.size(), 26U);
    const auto counter = get_be<std::uint16_t>(std::span(frames[i].data).subspan(24));
    const auto before = get_be<std::uint16_t>(std::span(frames[i - 1].data).subspan(24));
    EXPECT_EQ(static_cast<std::uint16_t>(counter - before), 1);
  }
  EXPECT_EQ(std::bit_cast<float>(get_be<std::uint32_t>(frames[0].data)), 1.0F);
}

TEST_F(XsensMtxTest, RefusesWhatIsInvalidWithTheRightErrorAndKeepsItsSetting) {
  XsensMtx mtx = configured();
  const auto expect_error = [&](double t_s, std::uint8_t mid, const Bytes& data, std::uint8_t code) {
    const Frame answer = ask(mtx, t_s, mid, data);
    EXPECT_EQ(answer.mid, xsens::kError);
    EXPECT_EQ(answer.data, Bytes{code});
  };
  expect_error(1.1, xsens::kPeriod, {0x00, 0x01}, 0x03);      // 115.2 kHz
  expect_error(1.2, xsens::kPeriod, {0x01}, 0x04);            // one byte of two
  expect_error(1.3, xsens::kOutputMode, {0x40, 0x02}, 0x21);  // raw and calibrated
  expect_error(1.4, xsens::kBaudrate, {0x7F}, 0x20);
  expect_error(1.5, 0xC0, {}, 0x04);  // OutputConfiguration came with later devices
  EXPECT_EQ(ask(mtx, 1.6, xsens::kPeriod).data, (Bytes{0x04, 0x80}));
}

TEST_F(XsensMtxTest, IgnoresSettingsWhileMeasuring) {
  XsensMtx mtx = device();
  until(mtx, 1.0);
  EXPECT_EQ(ask(mtx, 1.0, xsens::kOutputMode, {0x00, 0x02}).mid, 0xFF);
  EXPECT_EQ(until(mtx, 1.1).back().data.size(), 18U);
}

TEST_F(XsensMtxTest, TakesANewBaudRateAtItsNextReset) {
  XsensMtx mtx = configured();
  EXPECT_EQ(ask(mtx, 1.1, xsens::kBaudrate, {0x00}).mid, xsens::kBaudrate + 1);
  EXPECT_EQ(mtx.baud(), 115200);
  EXPECT_EQ(ask(mtx, 1.2, xsens::kReset).mid, xsens::kReset + 1);
  EXPECT_EQ(mtx.baud(), 460800);
}

TEST_F(XsensMtxTest, FindsACommandBehindLineNoise) {
  XsensMtx mtx = device();
  until(mtx, 1.0);
  Bytes bytes = {0x00, 0xFA, 0x12, 0xFA};  // two false preambles
  put_bytes(bytes, frame(xsens::kGoToConfig, {}));
  for (const std::uint8_t byte : bytes) mtx.receive(std::span(&byte, 1), 1.0);
  mtx.receive(Bytes(140, 0x00), 1.0);
  until(mtx, 1.1);
  EXPECT_EQ(mtx.state(), XsensMtx::State::kConfig);
}

TEST_F(XsensMtxTest, ItsClockSkewStretchesTheSamplingGrid) {
  XsensMtx::Options options;
  options.clock_skew_ppm = 100.0;
  XsensMtx mtx = device(options);
  mtx.start_calibrated(0.0);
  const std::vector<Frame> frames = until(mtx, 100.5);
  ASSERT_EQ(frames[0].mid, xsens::kConfiguration);
  ASSERT_EQ(frames[1].mid, xsens::kGoToMeasurement + 1);
  EXPECT_NEAR(frames[10002].at_s - frames[2].at_s, 100.0 / (1.0 + 100e-6), 1e-9);
}

TEST(StdbinUnit, StampsTimeOfDayInUtcAndTurnsTheDateAtMidnight) {
  using namespace std::chrono;
  StdbinUnit::Options options;
  options.utc_begin = sys_days(year(2026) / 12 / 31) + hours(23) + minutes(59) + seconds(59);
  options.phase_100us = 37;
  StdbinUnit unit(options, [](double) { return stdbin::Telegram{}; });
  std::vector<Emission> emissions;
  unit.run_until(2.0, emissions);
  const auto validity = [&](std::size_t i) {
    return get_be<std::uint32_t>(std::span(emissions[i].bytes).subspan(17));
  };
  const auto day = [&](std::size_t i) { return emissions[i].bytes[25]; };
  EXPECT_EQ(validity(0), 863990037U);
  EXPECT_EQ(validity(99), 863999937U);
  EXPECT_EQ(validity(100), 37U);
  EXPECT_EQ(day(99), 31);
  EXPECT_EQ(day(100), 1);
  EXPECT_NEAR(emissions[0].ready_s, 0.0037 + options.latency_s, 1e-12);
}

/// 2016-12-31 ended with 23:59:60. StdBin's time of day ends at 24 h: the unit repeats its last second.
TEST(StdbinUnit, ShowsTheLastSecondTwiceWhereALeapSecondIsInserted) {
  using namespace std::chrono;
  StdbinUnit::Options options;
  options.utc_begin = sys_days(year(2016) / 12 / 31) + hours(23) + minutes(59) + seconds(59);
  StdbinUnit unit(options, [](double) { return stdbin::Telegram{}; });
  std::vector<Emission> emissions;
  unit.run_until(3.0, emissions);
  const auto validity = [&](std::size_t i) {
    return get_be<std::uint32_t>(std::span(emissions[i].bytes).subspan(17));
  };
  EXPECT_EQ(validity(99), 863'999'900U);
  EXPECT_EQ(validity(100), 863'990'000U);
  EXPECT_EQ(validity(199), 863'999'900U);
  EXPECT_EQ(validity(200), 0U);
  EXPECT_EQ(emissions[199].bytes[25], 31);
  EXPECT_EQ(emissions[200].bytes[25], 1);
}

TEST(Utc, GpsTimeRunsOnThroughALeapSecondAndUtcCountsSixty) {
  using namespace std::chrono;
  const Utc begin = sys_days(year(2016) / 12 / 31) + hours(23) + minutes(59) + seconds(59);
  EXPECT_EQ(gps_after(begin, 0.0), Gps(local_days(year(2017) / 1 / 1) + seconds(16)));
  EXPECT_EQ(gps_after(begin, 2.0), Gps(local_days(year(2017) / 1 / 1) + seconds(18)));
  const CalendarTime leap = utc_time(gps_after(begin, 1.25));
  EXPECT_EQ(leap.day, 31U);
  EXPECT_EQ(leap.time_of_day, hours(24) + milliseconds(250));
  const CalendarTime after = utc_time(gps_after(begin, 2.0));
  EXPECT_EQ(after.day, 1U);
  EXPECT_EQ(after.time_of_day, seconds(0));
  const Bytes sentences = encode_nmea(greis::Solution{}, gps_after(begin, 1.25), {});
  EXPECT_EQ(std::string(sentences.begin(), sentences.begin() + 17), "$GNGGA,235960.25,");
}

class GreisReceiverTest : public testing::Test {
 protected:
  static GreisReceiver receiver() {
    using namespace std::chrono;
    GreisReceiver::Options options;
    options.utc_begin = sys_days(year(2026) / 3 / 14) + hours(23) + minutes(59) + seconds(42);
    return {options, [](double) { return greis::Solution{}; }};
  }
  static std::string until(GreisReceiver& receiver, double t_s) {
    std::vector<Emission> emissions;
    receiver.run_until(t_s, emissions);
    std::string text;
    for (const Emission& emission : emissions) text.append(emission.bytes.begin(), emission.bytes.end());
    return text;
  }
  static void say(GreisReceiver& receiver, const std::string& line, double t_s) {
    receiver.receive(Bytes(line.begin(), line.end()), t_s);
  }
};

TEST_F(GreisReceiverTest, TagsItsEpochsInGpsTimeEighteenSecondsAheadOfUtc) {
  GreisReceiver gnss = receiver();
  std::vector<Emission> emissions;
  gnss.run_until(0.05, emissions);
  ASSERT_EQ(emissions.size(), 1U);
  EXPECT_NEAR(emissions[0].ready_s, 0.040, 1e-12);
  const Bytes& bytes = emissions[0].bytes;
  // 23:59:42 UTC is midnight of the next day in GPS time.
  EXPECT_EQ(std::string(bytes.begin(), bytes.begin() + 5), "~~005");
  EXPECT_EQ(Bytes(bytes.begin() + 5, bytes.begin() + 9), (Bytes{0, 0, 0, 0}));
  const std::string text(bytes.begin(), bytes.end());
  const std::size_t date = text.find("RD006");
  ASSERT_NE(date, std::string::npos);
  EXPECT_EQ(bytes[date + 8], 15);  // day
  EXPECT_EQ(bytes[date + 9], 0);   // base: GPS
}

TEST_F(GreisReceiverTest, StopsStartsAndAnswersAsCommanded) {
  GreisReceiver gnss = receiver();
  EXPECT_FALSE(until(gnss, 0.5).empty());
  say(gnss, "dm\r\n", 0.5);
  EXPECT_TRUE(until(gnss, 1.0).empty());
  say(gnss, "%7%em,,jps/{RT,PG,ET}:0.2\n", 1.0);
  const std::string text = until(gnss, 2.0);
  EXPECT_NE(text.find("RE003%7%"), std::string::npos);
  EXPECT_NE(text.find("PG"), std::string::npos);
  EXPECT_EQ(text.find("VG012"), std::string::npos);
  std::size_t epochs = 0;
  for (std::size_t at = text.find("~~005"); at != std::string::npos; at = text.find("~~005", at + 1))
    ++epochs;
  EXPECT_EQ(epochs, 5U);
  say(gnss, "%8%nonsense\n", 2.0);
  EXPECT_NE(until(gnss, 2.2).find("ER"), std::string::npos);
}

TEST_F(XsensMtxTest, KeepsSyncSettingsAndAnswersTheRestOfTheManual) {
  XsensMtx mtx = configured();
  EXPECT_EQ(ask(mtx, 1.1, xsens::kSyncInSettings, {0x00, 0x00, 0x05}).mid, xsens::kSyncInSettings + 1);
  EXPECT_EQ(ask(mtx, 1.2, xsens::kSyncInSettings, {0x02, 0x00, 0x00, 0x01, 0x00}).mid,
            xsens::kSyncInSettings + 1);
  EXPECT_EQ(ask(mtx, 1.3, xsens::kSyncInSettings, {0x00}).data, (Bytes{0x00, 0x00, 0x05}));
  EXPECT_EQ(ask(mtx, 1.4, xsens::kSyncInSettings, {0x03}).data, Bytes{0x21});  // SyncIn has three
  EXPECT_EQ(ask(mtx, 1.5, xsens::kSyncOutSettings, {0x03}).data, (Bytes{0x03, 0, 0, 0, 0}));
  EXPECT_EQ(ask(mtx, 1.6, xsens::kRunSelftest).data, (Bytes{0x01, 0xFF}));
  EXPECT_EQ(ask(mtx, 1.7, xsens::kReqHardwareVersion).data.size(), 2U);
  const Bytes configuration = ask(mtx, 1.8, xsens::kReqConfiguration).data;
  EXPECT_EQ(Bytes(configuration.begin() + 8, configuration.begin() + 16), (Bytes{0, 5, 0, 0, 0, 0, 1, 0}));
}

TEST_F(XsensMtxTest, SendsOnlyWhenAskedWithTheSkipFactorThatSaysSo) {
  XsensMtx mtx = configured();
  ask(mtx, 1.1, xsens::kOutputSkipFactor, {0xFF, 0xFF});
  ask(mtx, 1.2, xsens::kGoToMeasurement);
  EXPECT_TRUE(until(mtx, 2.0).empty());
  mtx.receive(frame(xsens::kReqData, {}), 2.0);
  const std::vector<Frame> frames = until(mtx, 3.0);
  ASSERT_EQ(frames.size(), 1U);
  EXPECT_EQ(frames[0].mid, xsens::kMtData);
}

TEST_F(XsensMtxTest, WhatTheLineCannotCarryIsLostAndToldAsTheErrorModeSays) {
  for (const int mode : {1, 2, 3}) {
    XsensMtx::Options options;
    options.baud = 9600;  // 23 bytes at 100 Hz want 23000
    XsensMtx mtx = device(options);
    until(mtx, 1.0);
    ask(mtx, 1.0, xsens::kGoToConfig);
    ask(mtx, 1.1, xsens::kErrorMode, {0x00, static_cast<std::uint8_t>(mode)});
    ask(mtx, 1.2, xsens::kGoToMeasurement);
    std::size_t data = 0;
    std::size_t errors = 0;
    for (const Frame& message : until(mtx, 3.2)) {
      data += message.mid == xsens::kMtData ? 1 : 0;
      errors += message.mid == xsens::kError && message.data == Bytes{0x1E} ? 1 : 0;
    }
    if (mode == 3) {
      EXPECT_EQ(errors, 1U);
      EXPECT_EQ(mtx.state(), XsensMtx::State::kConfig);
    } else {
      EXPECT_NEAR(static_cast<double>(data), 2.0 * 960.0 / 23.0, 4.0);
      EXPECT_EQ(errors > 0, mode == 2);
    }
  }
}

TEST_F(XsensMtxTest, AfterALossOfPowerItKeepsItsSettingsAndCountsAnew) {
  XsensMtx mtx = configured();
  ask(mtx, 1.1, xsens::kOutputMode, {0x00, 0x02});
  mtx.power_cycle(2.0, 1.0);
  mtx.receive(frame(xsens::kGoToConfig, {}), 2.5);  // nobody hears
  const std::vector<Frame> frames = until(mtx, 6.0);
  ASSERT_GT(frames.size(), 2U);
  EXPECT_EQ(frames[0].mid, xsens::kWakeUp);
  EXPECT_NEAR(frames[0].at_s, 4.7, 1e-9);
  EXPECT_EQ(frames[1].mid, xsens::kConfiguration);
  EXPECT_EQ(get_be<std::uint16_t>(std::span(frames[1].data).subspan(104)), 0x0002);
  EXPECT_EQ(get_be<std::uint16_t>(std::span(frames[2].data).subspan(frames[2].data.size() - 2)), 50);
}

class XsensMtiTest : public XsensMtxTest {
 protected:
  struct Item {
    std::uint16_t id;
    Bytes data;
  };
  static std::vector<Item> items_of(const Bytes& payload) {
    std::vector<Item> items;
    for (std::size_t at = 0; at + 3 <= payload.size();) {
      const std::size_t size = payload[at + 2];
      items.push_back({get_be<std::uint16_t>(std::span(payload).subspan(at)),
                       Bytes(payload.begin() + static_cast<std::ptrdiff_t>(at) + 3,
                             payload.begin() + static_cast<std::ptrdiff_t>(at + 3 + size))});
      at += 3 + size;
    }
    return items;
  }
  static std::vector<Frame> frames_until(XsensMti& mti, double t_s) {
    std::vector<Emission> emissions;
    mti.run_until(t_s, emissions);
    std::vector<Frame> frames;
    for (const Emission& emission : emissions)
      frames.push_back(
          {emission.bytes[2], Bytes(emission.bytes.begin() + 4, emission.bytes.end() - 1), emission.ready_s});
    return frames;
  }
  static Frame ask_mti(XsensMti& mti, double t_s, std::uint8_t mid, const Bytes& data = {}) {
    mti.receive(frame(mid, data), t_s);
    for (const Frame& answer : frames_until(mti, t_s + 0.01))
      if (answer.mid != xsens::kMtData2) return answer;
    return {0xFF, {}, 0.0};
  }
  static XsensMti mti(const XsensMti::Options& options = {}) {
    return {options, [](double, std::int64_t) { return xsens::MtSample{}; }, 0.0};
  }
};

TEST_F(XsensMtiTest, AcknowledgesTheOutputsThatItReallyTook) {
  XsensMti device = mti();
  frames_until(device, 1.0);
  EXPECT_EQ(ask_mti(device, 1.0, xsens::kGoToConfig).mid, xsens::kGoToConfig + 1);
  // Counter with a rate, acceleration faster than it can, field at the fastest, something unknown.
  const Frame taken = ask_mti(device, 1.1, xsens::kOutputConfiguration,
                              {0x10, 0x20, 0x00, 0x64, 0x40, 0x20, 0x07, 0xD0, 0xC0, 0x20,
                               0xFF, 0xFF, 0x12, 0x30, 0x00, 0x0A, 0x80, 0x20, 0x00, 0x64});
  EXPECT_EQ(taken.data, (Bytes{0x10, 0x20, 0xFF, 0xFF, 0x40, 0x20, 0x01, 0x90, 0xC0, 0x20, 0x00, 0x64, 0x80,
                               0x20, 0x00, 0x64}));
  EXPECT_EQ(ask_mti(device, 1.2, xsens::kOutputConfiguration).data, taken.data);
  EXPECT_EQ(ask_mti(device, 1.3, xsens::kOutputMode, {0x00, 0x02}).data, Bytes{0x04});
  const Frame configuration = ask_mti(device, 1.4, xsens::kReqConfiguration);
  EXPECT_EQ(get_be<std::uint16_t>(std::span(configuration.data).subspan(102)), 0);  // no legacy data
}

TEST_F(XsensMtiTest, ItemsComeAtTheirOwnRatesAndGnssTakesCounterValues) {
  XsensMti::Options options;
  options.has_gnss = true;
  options.first_packet = 65530;
  XsensMti device = mti(options);
  device.start_inertial(0.0, 100);
  std::size_t inertial = 0;
  std::size_t gnss = 0;
  std::optional<std::uint16_t> counter;
  std::optional<std::uint32_t> time;
  for (const Frame& message : frames_until(device, 10.0)) {
    const std::vector<Item> items = items_of(message.data);
    ASSERT_EQ(items[0].id, 0x1020);
    const auto count = get_be<std::uint16_t>(items[0].data);
    if (counter) {
      ASSERT_EQ(static_cast<std::uint16_t>(count - *counter), 1);
    }
    counter = count;
    const bool is_gnss = items.back().id == 0x7010;
    gnss += is_gnss ? 1 : 0;
    if (is_gnss) continue;
    ++inertial;
    const auto ticks = get_be<std::uint32_t>(items[1].data);
    if (time) {
      ASSERT_EQ(ticks - *time, 100U);
    }
    time = ticks;
  }
  EXPECT_NEAR(static_cast<double>(inertial), 1000.0, 1.0);
  EXPECT_NEAR(static_cast<double>(gnss), 40.0, 1.0);
}

TEST_F(XsensMtiTest, ItsSampleTimeBeginsAnewAfterADay) {
  XsensMti::Options options;
  options.first_sample_time = 864'000'000 - 200;
  XsensMti device = mti(options);
  device.start_inertial(0.0, 100);
  const std::vector<Frame> frames = frames_until(device, 0.05);
  const auto time = [&](std::size_t i) { return get_be<std::uint32_t>(items_of(frames[i].data)[1].data); };
  EXPECT_EQ(time(0), 864'000'000U - 200);
  EXPECT_EQ(time(1), 864'000'000U - 100);
  EXPECT_EQ(time(2), 0U);
}

class XsensXbusTest : public XsensMtxTest {
 protected:
  static XsensXbus xbus(std::size_t devices) {
    XsensXbus::Options options;
    for (std::size_t i = 0; i < devices; ++i)
      options.bus_devices.push_back(0x00300100 + static_cast<std::uint32_t>(i));
    return {options,
            [](std::size_t device, double, std::int64_t counter) {
              xsens::MtSample sample;
              sample.acc_mps2 = {static_cast<double>(device), static_cast<double>(counter), 0.0};
              return sample;
            },
            0.0};
  }
  static std::vector<Emission> all_until(XsensXbus& device, double t_s) {
    std::vector<Emission> emissions;
    device.run_until(t_s, emissions);
    return emissions;
  }
  static Bytes ask_xbus(XsensXbus& device, double t_s, std::uint8_t bid, std::uint8_t mid,
                        const Bytes& data = {}) {
    device.receive(frame(mid, data, bid), t_s);
    const std::vector<Emission> answers = all_until(device, t_s + 0.02);
    return answers.empty() ? Bytes{} : answers.back().bytes;
  }
};

TEST_F(XsensXbusTest, AddressesEachDeviceByItsBusId) {
  XsensXbus device = xbus(3);
  all_until(device, 0.1);
  EXPECT_EQ(ask_xbus(device, 0.1, 0xFF, xsens::kGoToConfig), frame(xsens::kGoToConfig + 1, {}));
  EXPECT_EQ(ask_xbus(device, 0.2, 0xFF, xsens::kReqDid),
            frame(xsens::kDeviceId, Bytes{0x00, 0x10, 0x00, 0x01}));
  EXPECT_EQ(ask_xbus(device, 0.3, 2, xsens::kReqDid),
            frame(xsens::kDeviceId, Bytes{0x00, 0x30, 0x01, 0x01}, 2));
  EXPECT_EQ(ask_xbus(device, 0.4, 2, xsens::kOutputMode, {0x00, 0x02}), frame(xsens::kOutputMode + 1, {}, 2));
  EXPECT_EQ(ask_xbus(device, 0.5, 1, xsens::kOutputMode),
            frame(xsens::kOutputMode + 1, Bytes{0x00, 0x04}, 1));
  EXPECT_EQ(ask_xbus(device, 0.6, 4, xsens::kOutputMode), frame(xsens::kError, Bytes{0x01}, 4));
  EXPECT_EQ(ask_xbus(device, 0.7, 0xFF, xsens::kInitMt).size(), 5U + 12U);
  EXPECT_EQ(ask_xbus(device, 0.8, 0xFF, xsens::kReqConfiguration).size(), 5U + 98U + 60U);
}

TEST_F(XsensXbusTest, LeadsTheBlocksByACounterAndUsesTheExtendedLength) {
  XsensXbus device = xbus(10);
  device.start_calibrated(0.0);
  const std::vector<Emission> messages = all_until(device, 0.1);
  const Bytes& bytes = messages.back().bytes;
  // 10 blocks of 26 bytes and the counter.
  ASSERT_EQ(bytes[3], 0xFF);
  EXPECT_EQ(get_be<std::uint16_t>(std::span(bytes).subspan(4)), 262);
  EXPECT_EQ(bytes.size(), 6U + 262U + 1U);
  unsigned sum = 0;
  for (std::size_t i = 1; i < bytes.size(); ++i) sum += bytes[i];
  EXPECT_EQ(sum & 0xFFU, 0U);
  for (std::size_t i = 0; i < 10; ++i) {
    EXPECT_EQ(std::bit_cast<float>(get_be<std::uint32_t>(std::span(bytes).subspan(8 + 26 * i))),
              static_cast<float>(i));
  }
}

TEST_F(XsensXbusTest, ADeviceThatFellOffTheBusRepeatsItsBlock) {
  XsensXbus device = xbus(2);
  device.start_calibrated(0.0);
  all_until(device, 0.1);
  EXPECT_FALSE(device.leave_out({"3"}));
  ASSERT_TRUE(device.leave_out({"2"}));
  const std::vector<Emission> messages = all_until(device, 0.2);
  const auto y_of = [&](std::size_t message, std::size_t block) {
    return std::bit_cast<float>(
        get_be<std::uint32_t>(std::span(messages[message].bytes).subspan(4 + 2 + 26 * block + 4)));
  };
  EXPECT_EQ(y_of(5, 0), y_of(4, 0) + 1.0F);
  EXPECT_EQ(y_of(5, 1), y_of(4, 1));
}

class GnssTalkerTest : public testing::Test {
 protected:
  static std::string first_epoch(GnssTalker::Language language,
                                 const std::vector<std::string>& left_out = {}) {
    using namespace std::chrono;
    GnssTalker::Options options;
    options.language = language;
    options.utc_begin = sys_days(year(2026) / 3 / 14) + hours(9) + minutes(30);
    GnssTalker talker(options, [](double) {
      greis::Solution solution;
      solution.latitude_rad = 46.52 * kRad;
      solution.longitude_rad = -6.57 * kRad;
      solution.height_m = 420.0;
      solution.north_mps = 3.0F;
      solution.east_mps = -4.0F;
      solution.horizontal_position_sd_m = 0.0141421F;
      solution.vertical_position_sd_m = 0.02F;
      return solution;
    });
    EXPECT_TRUE(talker.leave_out(left_out));
    std::vector<Emission> emissions;
    talker.run_until(0.05, emissions);
    std::string text;
    for (const Emission& emission : emissions) text.append(emission.bytes.begin(), emission.bytes.end());
    return text;
  }
  static constexpr double kRad = 3.14159265358979323846 / 180.0;
};

TEST_F(GnssTalkerTest, SpeaksNmeaWithTheRightChecksums) {
  // Sums by hand: exclusive or of all between $ and *.
  const std::string text = first_epoch(GnssTalker::Language::kNmea);
  EXPECT_NE(
      text.find("$GNGGA,093000.00,4631.2000000,N,00634.2000000,W,4,14,0.7,371.0000,M,49.0000,M,1.0,0001*"),
      std::string::npos)
      << text;
  EXPECT_NE(text.find("$GNRMC,093000.00,A,4631.2000000,N,00634.2000000,W,9.719,306.87,140326,,,R*"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("$GNZDA,093000.00,14,03,2026,00,00*72\r\n"), std::string::npos) << text;
  EXPECT_EQ(first_epoch(GnssTalker::Language::kNmea, {"GST", "ZDA"}).find("GST"), std::string::npos);
}

TEST_F(GnssTalkerTest, SpeaksUbxWithFletchersChecksum) {
  const std::string text = first_epoch(GnssTalker::Language::kUbx);
  ASSERT_EQ(text.size(), 100U);
  EXPECT_EQ(text.substr(0, 6), std::string("\xB5\x62\x01\x07\x5C\x00", 6));
  const auto* const data = reinterpret_cast<const std::uint8_t*>(text.data());
  const auto i32 = [&](std::size_t at) {
    return static_cast<std::int32_t>(data[at] | data[at + 1] << 8 | data[at + 2] << 16 |
                                     static_cast<std::uint32_t>(data[at + 3]) << 24U);
  };
  // Saturday 09:30:18 GPS time.
  EXPECT_EQ(i32(6), ((6 * 24 + 9) * 3600 + 30 * 60 + 18) * 1000);
  EXPECT_EQ(i32(6 + 24), -65700000);
  EXPECT_EQ(i32(6 + 28), 465200000);
  EXPECT_EQ(data[6 + 21], 0x83);  // fix, differential, carrier fixed
  unsigned a = 0;
  unsigned b = 0;
  for (std::size_t i = 2; i < 98; ++i) {
    a = (a + data[i]) & 0xFFU;
    b = (b + a) & 0xFFU;
  }
  EXPECT_EQ(data[98], a);
  EXPECT_EQ(data[99], b);
}

TEST_F(GnssTalkerTest, WritesAnRtklibSolutionBehindItsHeader) {
  const std::string text = first_epoch(GnssTalker::Language::kRtklib);
  EXPECT_EQ(text.substr(0, 2), "% ");
  EXPECT_NE(text.find("\n%  GPST "), std::string::npos);
  EXPECT_NE(text.find("\n2026/03/14 09:30:18.000    46.520000000   -6.570000000   420.0000   1  14   0.0100"),
            std::string::npos)
      << text;
}

}  // namespace
}  // namespace imusim
