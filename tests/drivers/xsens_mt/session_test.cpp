#include "drivers/xsens_mt/session.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <optional>

#include "base/bytes.h"
#include "tests/drivers/xsens_mt/mt_frames.h"

namespace imuscope::xsens {
namespace {

using namespace test_frames;
using std::chrono::milliseconds;
using std::chrono::seconds;

/// An MTx as the protocol sheet describes it: keeps its settings, answers in its configuration state, sends
/// data in measurement and goes on sending until it acts on GoToConfig.
struct ScriptedDevice {
  bool powered = true;
  bool measuring = false;
  std::uint16_t period = 1152;
  std::uint16_t skip = 0;
  std::uint16_t mode = output_mode::kOrientation;  // as it comes from the factory
  std::uint32_t settings = output_settings::kSampleCounter;
  int ignores_go_to_config = 0;  ///< that many
  bool sends_text = false;       ///< NMEA, as its string output type says
  std::uint16_t n_devices = 1;   ///< more than one, or an Xbus head: behind it
  std::uint32_t id = 0x00300123;
  std::uint16_t sync_mode = 0;
  std::uint16_t sync_skip = 0;
  std::uint32_t sync_offset = 0;
  std::uint16_t sync_modes_known = 0xFFFF;
  std::uint16_t modes_known = 0xFFFF;            ///< other bits of an output mode are dropped
  std::map<std::uint8_t, std::uint8_t> refuses;  ///< message id to error code, each once
  std::optional<std::uint8_t> never_answers;     ///< this message id
  bool sends_nothing = false;                    ///< acknowledges the measurement and measures nothing
  std::uint16_t counter = 0;
  HostTime next_sample{};
  std::vector<std::uint8_t> heard;  ///< message ids, in order
  Bytes out;

  void send(const Bytes& bytes) { out.insert(out.end(), bytes.begin(), bytes.end()); }
  [[nodiscard]] std::uint16_t length() const {
    return static_cast<std::uint16_t>(data_length({mode, settings}).value_or(0));
  }

  void hear(const Frame& f) {
    heard.push_back(f.mid);
    if (f.mid == never_answers) return;
    if (const auto refused = refuses.find(f.mid); refused != refuses.end()) {
      send(frame(mid::kError, {refused->second}));
      refuses.erase(refused);
      return;
    }
    if (f.mid == mid::kGoToConfig) {
      if (ignores_go_to_config-- > 0) return;
      measuring = false;
      send(frame(0x31));
      return;
    }
    if (f.mid == mid::kReset) {
      measuring = false;
      ignores_go_to_config = 0;
      send(frame(mid::kWakeUp));
      return;
    }
    if (measuring || f.mid == mid::kWakeUpAck) return;
    switch (f.mid) {
      case mid::kReqDid:
        send(frame(mid::kDeviceId, u32(id)));
        break;
      case mid::kReqConfiguration:
        send(configuration(period, skip, n_devices, length(), mode, settings, id, sync_mode, sync_skip,
                           sync_offset));
        break;
      case mid::kPeriod:
        period = read_be<std::uint16_t>(f.data);
        send(frame(0x05));
        break;
      case mid::kOutputSkipFactor:
        skip = read_be<std::uint16_t>(f.data);
        send(frame(0xD5));
        break;
      case mid::kOutputMode:
        mode = static_cast<std::uint16_t>(read_be<std::uint16_t>(f.data) & modes_known);
        send(frame(0xD1));
        break;
      case mid::kOutputSettings:
        settings = read_be<std::uint32_t>(f.data);
        send(frame(0xD3));
        break;
      case mid::kSyncInSettings:
        if (f.data[0] == 0) sync_mode = read_be<std::uint16_t>(f.data, 1) & sync_modes_known;
        if (f.data[0] == 1) sync_skip = read_be<std::uint16_t>(f.data, 1);
        if (f.data[0] == 2) sync_offset = read_be<std::uint32_t>(f.data, 1);
        send(frame(0xD7));
        break;
      case mid::kStringOutputType:
        sends_text = read_be<std::uint16_t>(f.data) != 0;
        send(frame(0x8F));
        break;
      case mid::kReqDataLength:
        send(frame(mid::kDataLength, u16(length())));
        break;
      case mid::kGoToMeasurement:
        send(frame(0x11));
        measuring = true;
        counter = 0;
        break;
      default:
        send(frame(mid::kError, {0x04}));
        break;
    }
  }

  [[nodiscard]] bool is_xbus() const { return (id & 0x00F00000U) == 0x00100000U; }

  void sample() {
    Bytes data;
    if (sends_nothing) return;
    if (sends_text) {
      send(test::bytes_of("$HCHDM,123.4,M*20\r\n"));
      return;
    }
    if (is_xbus()) {
      append(data, be16(counter++));
      for (int k = 0; k < n_devices; ++k) {
        const Bytes block = mtdata(counter);
        data.insert(data.end(), block.begin() + 4, block.end() - 1);
      }
      send(frame(mid::kMtData, data));
      return;
    }
    const DataLayout layout{mode, settings};
    if (layout == kDefaultLayout) {
      send(mtdata(counter++));
      return;
    }
    data.resize(length());
    send(frame(mid::kMtData, data));
    ++counter;
  }
};

/// Session and device on one line, stepped every millisecond.
struct Bench {
  explicit Bench(const MtSessionConfig& config = {}) : session(config) {}

  void run(Duration duration) {
    for (const HostTime end = now + duration; now < end; now += milliseconds{1}) step();
  }
  void step() {
    const auto written = session.poll(now);
    if (!written.empty() && device.powered) {
      to_device.append(written, now);
      Frame f;
      while (to_device.next(f)) device.hear(f);
    }
    if (device.powered && device.measuring && now >= device.next_sample) {
      device.sample();
      device.next_sample = now + from_seconds(device.period * (device.skip + 1) / kPeriodTicksPerSecond);
    }
    if (stalled) return;
    if (!device.out.empty()) session.on_bytes(device.out, now);
    device.out.clear();
  }
  [[nodiscard]] std::size_t times_heard(std::uint8_t mid) const {
    return static_cast<std::size_t>(std::count(device.heard.begin(), device.heard.end(), mid));
  }

  bool stalled = false;  ///< the host reads nothing; what came meanwhile comes all at once
  HostTime now = host_time_from_ns(1'000'000'000'000);
  ScriptedDevice device;
  MtSession session;
  Scanner to_device;
};

TEST(MtSession, SetsUpADeviceFromTheFactoryAndChecksWhatItTook) {
  Bench bench;
  bench.device.measuring = true;
  bench.run(seconds{3});
  EXPECT_EQ(bench.session.state(), SessionState::kStreaming) << bench.session.problem();
  EXPECT_EQ(bench.session.problem(), "");
  EXPECT_EQ(bench.session.device_id(), 0x00300123U);
  EXPECT_EQ((DataLayout{bench.device.mode, bench.device.settings}), kDefaultLayout);
  EXPECT_EQ(bench.device.period, 1152);
  EXPECT_EQ(bench.times_heard(mid::kReset), 0U);
  ASSERT_TRUE(bench.session.configuration());
  EXPECT_EQ(bench.session.configuration()->devices[0].output_mode, kDefaultLayout.mode);
}

TEST(MtSession, TakesOverADeviceThatSendsWhatIsWantedWithoutAWord) {
  Bench bench;
  bench.device.mode = kDefaultLayout.mode;
  bench.device.settings = kDefaultLayout.settings;
  bench.device.counter = 65530;  // wraps meanwhile
  bench.device.measuring = true;
  bench.run(seconds{2});
  EXPECT_EQ(bench.session.state(), SessionState::kStreaming);
  EXPECT_TRUE(bench.device.heard.empty());
}

TEST(MtSession, ADeviceWithAnExpectedIdIsAskedForItBeforeItsDataCounts) {
  MtSessionConfig config;
  config.device_id = 0x00300123;
  Bench bench(config);
  bench.device.mode = kDefaultLayout.mode;
  bench.device.settings = kDefaultLayout.settings;
  bench.device.measuring = true;
  bench.run(seconds{2});
  EXPECT_EQ(bench.session.state(), SessionState::kStreaming) << bench.session.problem();
  EXPECT_EQ(bench.times_heard(mid::kReqDid), 1U);
}

TEST(MtSession, AnotherDeviceInItsPlaceIsRefusedByItsIdAndSendsNothingMore) {
  MtSessionConfig config;
  config.device_id = 0x00300124;
  Bench bench(config);
  bench.device.mode = kDefaultLayout.mode;
  bench.device.settings = kDefaultLayout.settings;
  bench.device.measuring = true;
  bench.run(seconds{20});
  EXPECT_EQ(bench.session.state(), SessionState::kFailed);
  EXPECT_NE(bench.session.problem().find("this is device 00300123, and 00300124 was expected"),
            std::string_view::npos)
      << bench.session.problem();
  EXPECT_FALSE(bench.device.measuring) << "its data would be taken for the other's";
}

TEST(MtSession, DoesNotTakeOverADeviceThatSendsAtAnotherRateOrOtherNumbersOfTheSameLength) {
  Bench rate;
  rate.device.mode = kDefaultLayout.mode;
  rate.device.settings = kDefaultLayout.settings;
  rate.device.period = 2304;  // 50 Hz
  rate.device.measuring = true;
  rate.run(seconds{3});
  EXPECT_EQ(rate.session.state(), SessionState::kStreaming);
  EXPECT_EQ(rate.device.period, 1152);

  Bench format;
  format.device.mode = kDefaultLayout.mode;
  format.device.settings = kDefaultLayout.settings | 0x100;  // 12.20: as long as float32
  format.device.measuring = true;
  format.run(seconds{3});
  EXPECT_EQ(format.session.state(), SessionState::kStreaming);
  EXPECT_EQ(format.device.settings, kDefaultLayout.settings);
}

TEST(MtSession, WritesNoSettingThatTheDeviceHasAlready) {
  Bench bench;
  bench.device.mode = kDefaultLayout.mode;
  bench.device.settings = kDefaultLayout.settings;
  bench.run(seconds{3});
  EXPECT_EQ(bench.session.state(), SessionState::kStreaming);
  for (const auto mid : {mid::kPeriod, mid::kOutputSkipFactor, mid::kOutputMode, mid::kOutputSettings}) {
    EXPECT_EQ(bench.times_heard(mid), 0U);
  }
}

TEST(MtSession, RepeatsGoToConfigWhileTheDeviceSendsDataInstead) {
  Bench bench;
  bench.device.measuring = true;
  bench.device.ignores_go_to_config = 7;
  bench.run(seconds{4});
  EXPECT_EQ(bench.session.state(), SessionState::kStreaming);
  EXPECT_EQ(bench.times_heard(mid::kGoToConfig), 8U);
  EXPECT_EQ(bench.times_heard(mid::kReset), 0U);
}

TEST(MtSession, ResetsADeviceThatNeverGoesToConfigAndAcknowledgesItsWakeUp) {
  Bench bench;
  bench.device.measuring = true;
  bench.device.ignores_go_to_config = 1000;
  bench.run(seconds{8});
  EXPECT_EQ(bench.session.state(), SessionState::kStreaming) << bench.session.problem();
  EXPECT_EQ(bench.times_heard(mid::kReset), 1U);
  EXPECT_EQ(bench.times_heard(mid::kWakeUpAck), 1U);
}

TEST(MtSession, SendsAgainWhatTheDeviceRefusedOnce) {
  Bench bench;
  bench.device.refuses = {{mid::kOutputMode, 0x04}, {mid::kReqDid, 0x04}};
  bench.run(seconds{4});
  EXPECT_EQ(bench.session.state(), SessionState::kStreaming) << bench.session.problem();
  EXPECT_EQ(bench.times_heard(mid::kOutputMode), 2U);
}

TEST(MtSession, GivesUpWithTheReasonWhenTheDeviceTakesSomethingElse) {
  MtSessionConfig config;
  config.layout = {output_mode::kCalibrated | output_mode::kStatus, output_settings::kSampleCounter};
  Bench bench(config);
  bench.device.modes_known = 0x7FF;  // an old firmware without the status byte
  bench.run(seconds{10});
  EXPECT_EQ(bench.session.state(), SessionState::kFailed);
  EXPECT_NE(bench.session.problem().find("38 bytes a message, 39 were asked for"), std::string_view::npos)
      << bench.session.problem();
}

TEST(MtSession, SaysWhatToCheckWhenNothingComesAndGoesOnTrying) {
  Bench bench;
  bench.device.powered = false;
  bench.run(seconds{5});
  EXPECT_EQ(bench.session.state(), SessionState::kConnecting);
  EXPECT_NE(bench.session.problem().find("no answer; check the device's power"), std::string_view::npos);
  bench.device.powered = true;
  bench.run(seconds{8});
  EXPECT_EQ(bench.session.state(), SessionState::kStreaming);
}

TEST(MtSession, SuspectsTheBaudRateWhenBytesComeButNoMessage) {
  Bench bench;
  bench.device.powered = false;
  for (int i = 0; i < 5000; ++i) {
    const Bytes noise{0x00, 0x80, 0xF8, static_cast<std::uint8_t>(i)};
    bench.session.on_bytes(noise, bench.now);
    bench.run(milliseconds{1});
  }
  EXPECT_NE(bench.session.problem().find("is the baud rate right?"), std::string_view::npos)
      << bench.session.problem();
}

TEST(MtSession, ADeviceThatFallsSilentOrRestartsIsSetUpAgain) {
  Bench bench;
  bench.run(seconds{3});
  ASSERT_EQ(bench.session.state(), SessionState::kStreaming);
  bench.device.powered = false;
  bench.run(milliseconds{1500});
  EXPECT_EQ(bench.session.state(), SessionState::kConnecting);
  EXPECT_NE(bench.session.problem().find("stopped sending"), std::string_view::npos);
  // Power is back: the device says WakeUp and has forgotten nothing but that it measured.
  bench.device.powered = true;
  bench.device.measuring = false;
  bench.device.send(frame(mid::kWakeUp));
  bench.run(seconds{2});
  EXPECT_EQ(bench.session.state(), SessionState::kStreaming);
  EXPECT_EQ(bench.session.problem(), "");
}

TEST(MtSession, AStallThatEndsByItselfNeverTakesTheDeviceOutOfItsMeasurement) {
  for (const Duration stall : {Duration(milliseconds{900}), Duration(milliseconds{1100}),
                               Duration(seconds{3}), Duration(seconds{9})}) {
    SCOPED_TRACE(to_seconds(stall));
    Bench bench;
    bench.run(seconds{3});
    ASSERT_EQ(bench.session.state(), SessionState::kStreaming);
    const auto set_up = bench.times_heard(mid::kGoToConfig);
    const std::uint16_t before = bench.device.counter;
    bench.stalled = true;
    bench.run(stall);
    bench.stalled = false;
    bench.run(seconds{2});
    EXPECT_EQ(bench.session.state(), SessionState::kStreaming);
    EXPECT_EQ(bench.session.problem(), "");
    EXPECT_EQ(bench.times_heard(mid::kGoToConfig), set_up);
    EXPECT_EQ(bench.times_heard(mid::kReset), 0U);
    EXPECT_NEAR(bench.device.counter - before, 100.0 * to_seconds(stall + seconds{2}), 1.0)
        << "the device measured all the time";
  }
}

TEST(MtSession, ADeviceThatWaitsInItsConfigurationStateIsStartedWithoutBeingSetUpAgain) {
  Bench bench;
  bench.run(seconds{3});
  const auto set_up = bench.times_heard(mid::kReqConfiguration);
  bench.device.measuring = false;
  bench.run(seconds{3});
  EXPECT_EQ(bench.session.state(), SessionState::kStreaming);
  EXPECT_TRUE(bench.device.measuring);
  EXPECT_EQ(bench.times_heard(mid::kReqConfiguration), set_up);
}

TEST(MtSession, ADeviceThatStaysSilentIsSetUpAgainInTheEnd) {
  Bench bench;
  bench.run(seconds{3});
  bench.device.measuring = false;
  bench.device.powered = false;
  bench.run(seconds{13});
  EXPECT_EQ(bench.session.state(), SessionState::kConnecting);
  bench.device.powered = true;  // without a word
  bench.run(seconds{6});
  EXPECT_EQ(bench.session.state(), SessionState::kStreaming) << bench.session.problem();
  EXPECT_GE(bench.times_heard(mid::kReqConfiguration), 2U);
}

TEST(MtSession, RefusesBeforehandWhatTheLineOrTheDeviceCannotDo) {
  MtSessionConfig slow_line;
  slow_line.baud = 38400;
  EXPECT_EQ(MtSession(slow_line).state(), SessionState::kFailed);
  EXPECT_NE(
      std::string(MtSession(slow_line).problem()).find("43000 bit/s are wanted of a line of 38400 baud"),
      std::string::npos);
  MtSessionConfig odd_rate;
  odd_rate.rate_hz = 30000.0;
  EXPECT_EQ(MtSession(odd_rate).state(), SessionState::kFailed);
}

TEST(MtSession, SetsTheSyncInput) {
  MtSessionConfig config;
  config.sync_in = SyncIn{0x05, 3, 29491};
  Bench bench(config);
  bench.run(seconds{3});
  EXPECT_EQ(bench.session.state(), SessionState::kStreaming);
  EXPECT_EQ(bench.times_heard(mid::kSyncInSettings), 3U);
  EXPECT_EQ(bench.device.sync_mode, 0x05);
  EXPECT_EQ(bench.device.sync_skip, 3);
  EXPECT_EQ(bench.device.sync_offset, 29491U);

  // What is there already is not written again, and what the device did not take is told.
  Bench again(config);
  again.device = bench.device;
  again.device.measuring = false;
  again.device.next_sample = {};
  again.device.heard.clear();
  again.run(seconds{3});
  EXPECT_EQ(again.session.state(), SessionState::kStreaming);
  EXPECT_EQ(again.times_heard(mid::kSyncInSettings), 0U);

  Bench refuses(config);
  refuses.device.sync_modes_known = 0x03;
  refuses.run(seconds{10});
  EXPECT_EQ(refuses.session.state(), SessionState::kFailed);
  EXPECT_NE(refuses.session.problem().find("took SyncIn mode 0x0001"), std::string_view::npos)
      << refuses.session.problem();
}

TEST(MtSession, SetsUpEveryDeviceBehindAnXbusMasterAndTakesItOverLater) {
  MtSessionConfig config;
  config.bus_devices = 3;
  config.baud = 460800.0;
  Bench bench(config);
  bench.device.id = 0x00100456;
  bench.device.n_devices = 3;
  bench.run(seconds{3});
  EXPECT_EQ(bench.session.state(), SessionState::kStreaming) << bench.session.problem();
  EXPECT_EQ(bench.times_heard(mid::kOutputMode), 3U);  // one a device
  EXPECT_EQ((DataLayout{bench.device.mode, bench.device.settings}), kDefaultLayout);

  Bench later(config);
  later.device = bench.device;
  later.device.next_sample = {};
  later.device.heard.clear();
  later.run(seconds{2});
  EXPECT_EQ(later.session.state(), SessionState::kStreaming);
  EXPECT_TRUE(later.device.heard.empty());
}

TEST(MtSession, TellsWhenAnotherNumberOfDevicesIsBehindTheLine) {
  Bench bench{MtSessionConfig{}};
  bench.device.id = 0x00100456;
  bench.device.n_devices = 2;
  bench.run(seconds{10});
  EXPECT_EQ(bench.session.state(), SessionState::kFailed);
  EXPECT_NE(bench.session.problem().find("2 devices answer behind this line"), std::string_view::npos)
      << bench.session.problem();
}

TEST(MtSession, BringsADeviceBackThatWasLeftSendingText) {
  Bench bench;
  bench.device.mode = kDefaultLayout.mode;
  bench.device.settings = kDefaultLayout.settings;
  bench.device.measuring = true;
  bench.device.sends_text = true;
  bench.run(seconds{4});
  EXPECT_EQ(bench.session.state(), SessionState::kStreaming) << bench.session.problem();
  EXPECT_EQ(bench.times_heard(mid::kStringOutputType), 1U);
  EXPECT_FALSE(bench.device.sends_text);
}

TEST(MtSession, WantsAnotherBaudRateOnlyWhenNothingThatCameWasAMessage) {
  Bench silent;
  silent.device.powered = false;
  silent.run(seconds{5});
  EXPECT_TRUE(silent.session.wants_other_baud());

  MtSessionConfig guess;
  guess.searching_baud = true;
  Bench sooner(guess);
  sooner.device.powered = false;
  sooner.run(milliseconds{2000});
  EXPECT_TRUE(sooner.session.wants_other_baud());

  Bench deaf;  // its data come, so the rate is right
  deaf.device.measuring = true;
  deaf.device.ignores_go_to_config = 1000;
  deaf.run(seconds{5});
  EXPECT_FALSE(deaf.session.wants_other_baud());
}

TEST(MtSession, AnOlderDeviceWithNothingSelectedIsAskedForLegacyDataOnceItRefusesItems) {
  Bench bench;
  bench.device.mode = 0;
  bench.device.settings = 0;
  bench.run(seconds{5});
  EXPECT_EQ(bench.times_heard(mid::kOutputConfiguration), 1U);
  EXPECT_EQ(bench.session.state(), SessionState::kStreaming) << bench.session.problem();
  EXPECT_EQ((DataLayout{bench.device.mode, bench.device.settings}), kDefaultLayout);
}

TEST(MtSession, SaysWhichMessageTheDeviceNeverAnswers) {
  Bench bench;
  bench.device.period = 2304;
  bench.device.never_answers = mid::kPeriod;
  bench.run(seconds{8});
  EXPECT_NE(bench.session.state(), SessionState::kStreaming);
  EXPECT_NE(bench.session.problem().find("does not answer message 0x04"), std::string_view::npos)
      << bench.session.problem();
  EXPECT_GT(bench.times_heard(mid::kPeriod), 1U);
}

TEST(MtSession, SaysThatNoDataFollowsTheAcknowledgedMeasurement) {
  Bench bench;
  bench.device.sends_nothing = true;
  bool said = false;
  for (int i = 0; i < 100 && !said; ++i) {
    bench.run(milliseconds{100});
    said = bench.session.problem().find("acknowledged GoToMeasurement but sends nothing") !=
           std::string_view::npos;
  }
  EXPECT_TRUE(said) << bench.session.problem();
  bench.device.sends_nothing = false;
  bench.run(seconds{40});
  EXPECT_EQ(bench.session.state(), SessionState::kStreaming) << bench.session.problem();
}

TEST(MtSession, AStreamThatTurnsIntoAnotherIsSetUpAgain) {
  Bench bench;
  bench.run(seconds{3});
  ASSERT_EQ(bench.session.state(), SessionState::kStreaming) << bench.session.problem();
  bench.device.mode = output_mode::kOrientation;
  bench.run(seconds{5});
  EXPECT_EQ(bench.session.state(), SessionState::kStreaming) << bench.session.problem();
  EXPECT_EQ((DataLayout{bench.device.mode, bench.device.settings}), kDefaultLayout);
}

TEST(MtSession, AnXbusMasterWithoutDevicesIsToldFromOneWithTooFew) {
  MtSessionConfig config;
  config.bus_devices = 2;
  Bench bench(config);
  bench.device.id = 0x00100456;
  bench.device.n_devices = 0;
  bench.run(seconds{5});
  EXPECT_NE(bench.session.state(), SessionState::kStreaming);
  EXPECT_NE(bench.session.problem().find("no device answers on the Xbus"), std::string_view::npos)
      << bench.session.problem();
}

TEST(MtSession, AsksAnMtData2DeviceForItemsAndChecksTheRatesThatItTook) {
  for (const std::uint8_t rate_taken : {std::uint8_t{100}, std::uint8_t{40}}) {
    MtSession session(MtSessionConfig{});
    HostTime now{};
    std::vector<std::uint8_t> heard;
    Scanner to_device;
    for (int i = 0; i < 3000; ++i, now += milliseconds{1}) {
      Bytes answers;
      to_device.append(session.poll(now), now);
      Frame f;
      while (to_device.next(f)) {
        heard.push_back(f.mid);
        Bytes data;
        switch (f.mid) {
          case mid::kGoToConfig:
            answers = frame(0x31);
            break;
          case mid::kReqDid:
            answers = frame(mid::kDeviceId, u32(0x03700123));
            break;
          case mid::kReqConfiguration:
            answers = configuration(1152, 0, 1, 0, 0, 0, 0x03700123);
            break;
          case mid::kOutputConfiguration:
            data.assign(f.data.begin(), f.data.end());
            for (std::size_t at = 0; at + 4 <= data.size(); at += 4) {
              if (data[at + 2] == 0xFF) continue;  // with every message
              data[at + 2] = 0;
              data[at + 3] = rate_taken;
            }
            answers = frame(0xC1, data);
            break;
          case mid::kGoToMeasurement:
            answers = frame(0x11);
            break;
          default:
            break;
        }
      }
      if (!heard.empty() && heard.back() == mid::kGoToMeasurement && i % 10 == 0) {
        Bytes data;
        append_item(data, xdi::kSampleTimeFine, u32(static_cast<std::uint32_t>(10 * i)));
        append_item(data, xdi::kAcceleration, floats({0, 0, 9.8}));
        append_item(data, xdi::kRateOfTurn, floats({0, 0, 0}));
        answers = frame(mid::kMtData2, data);
      }
      if (!answers.empty()) session.on_bytes(answers, now);
    }
    EXPECT_EQ(session.state(), rate_taken == 100 ? SessionState::kStreaming : SessionState::kFailed);
    if (rate_taken != 100) {
      EXPECT_NE(session.problem().find("took 40 Hz"), std::string_view::npos);
    }
  }
}

}  // namespace
}  // namespace imuscope::xsens
