#include <gtest/gtest.h>
#include <string>

#include "firmware_sim/devices/greis_receiver.h"
#include "firmware_sim/devices/stdbin_unit.h"
#include "firmware_sim/devices/xsens_mtx.h"
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
  IMUSCOPE_NEEDS_SHARED("oracle/protocols/xsens_mtdata.hex");
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

}  // namespace
}  // namespace imusim
