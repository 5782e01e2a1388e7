#include "drivers/xsens_mt/session.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <map>
#include <optional>

#include "base/bytes.h"
#include "tests/drivers/support/sample_text.h"
#include "tests/drivers/xsens_mt/mt_frames.h"
#include "tests/support/recorded_answer.h"

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
  std::uint16_t shortest_period = 0;             ///< a shorter one is not taken
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
        period = std::max(read_be<std::uint16_t>(f.data), shortest_period);
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
    const Bytes written = diary.step(now);
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
  test::SessionDiary diary{session};  ///< of all that was said
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

TEST(MtSession, TriesThreeTimesAndGivesUpWhenTheDeviceTakesAnotherRate) {
  MtSessionConfig config;
  config.rate_hz = 200.0;
  Bench bench(config);
  bench.device.shortest_period = 1152;
  bench.run(seconds{10});
  EXPECT_EQ(bench.session.state(), SessionState::kFailed);
  EXPECT_NE(bench.session.problem().find("at 100 Hz; wanted"), std::string_view::npos)
      << bench.session.problem();
  EXPECT_EQ(bench.times_heard(mid::kPeriod), 3U);
  EXPECT_EQ(bench.times_heard(mid::kReqConfiguration), 6U) << "before and after, each time";
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

// Whole conversations, word by word: every message in its order, its repetitions and their times, every state and every
// sentence.

struct Conversation {
  std::string_view name;
  MtSessionConfig config;
  std::function<void(Bench&)> run;
};

void run_measuring(Bench& bench) {
  bench.device.measuring = true;
  bench.run(seconds{3});
}

MtSessionConfig config_with(const std::function<void(MtSessionConfig&)>& change) {
  MtSessionConfig config;
  change(config);
  return config;
}

void set_up_already(ScriptedDevice& device) {
  device.mode = kDefaultLayout.mode;
  device.settings = kDefaultLayout.settings;
}

/// What a device that sends MTData2 says in one message.
Bytes wanted_mtdata2(std::uint32_t fine, double force_z_mps2 = 9.8) {
  Bytes data;
  append_item(data, xdi::kSampleTimeFine, u32(fine));
  append_item(data, xdi::kAcceleration, floats({0.1, 0.2, force_z_mps2}));
  append_item(data, xdi::kRateOfTurn, floats({0.01, 0.02, 0.03}));
  return frame(mid::kMtData2, data);
}

/// Hears nothing; what it sends is given.
void run_deaf(Bench& bench, const std::function<Bytes(int)>& sent, Duration period, int n) {
  bench.device.powered = false;
  for (int i = 0; i < n; ++i) {
    bench.session.on_bytes(sent(i), bench.now);
    bench.run(period);
  }
}

std::vector<Conversation> conversations() {
  std::vector<Conversation> all;
  const auto add = [&](std::string_view name, const MtSessionConfig& config,
                       const std::function<void(Bench&)>& run) {
    all.push_back({name, config, run});
  };
  add("from the factory", {}, run_measuring);
  add("silent from the factory", {}, [](Bench& bench) { bench.run(seconds{3}); });
  add("as wanted", {}, [](Bench& bench) {
    set_up_already(bench.device);
    run_measuring(bench);
  });
  add("as wanted but for the period", {}, [](Bench& bench) {
    set_up_already(bench.device);
    bench.device.period = 1400;
    run_measuring(bench);
  });
  add("with a skip factor", {}, [](Bench& bench) {
    set_up_already(bench.device);
    bench.device.skip = 1;
    run_measuring(bench);
  });
  add("at 50 Hz", config_with([](auto& c) { c.rate_hz = 50.0; }), run_measuring);
  add("no power", {}, [](Bench& bench) {
    bench.device.powered = false;
    bench.run(seconds{15});
  });
  add("no power, searching", config_with([](auto& c) { c.searching_baud = true; }), [](Bench& bench) {
    bench.device.powered = false;
    bench.run(seconds{8});
  });
  add("data without ears", {}, [](Bench& bench) {
    run_deaf(
        bench, [](int) { return frame(mid::kMtData, Bytes(5)); }, milliseconds{100}, 100);
  });
  add("messages without ears", {}, [](Bench& bench) {
    run_deaf(
        bench, [](int) { return frame(0x31, {}, 3); }, milliseconds{100}, 50);
  });
  add("noise", {}, [](Bench& bench) {
    run_deaf(
        bench, [](int) { return Bytes(10, 0x55); }, milliseconds{100}, 60);
  });
  add("slow to hear", {}, [](Bench& bench) {
    bench.device.ignores_go_to_config = 5;
    run_measuring(bench);
  });
  add("never goes to config before a reset", {}, [](Bench& bench) {
    bench.device.ignores_go_to_config = 1000;
    bench.device.measuring = true;
    bench.run(seconds{8});
  });
  for (const std::uint8_t id :
       {mid::kReqDid, mid::kReqConfiguration, mid::kPeriod, mid::kOutputSkipFactor, mid::kOutputMode,
        mid::kOutputSettings, mid::kReqDataLength, mid::kGoToMeasurement}) {
    add("one message is never answered", {}, [id](Bench& bench) {
      bench.device.never_answers = id;
      bench.run(seconds{12});
    });
    add("one message is refused once", {}, [id](Bench& bench) {
      bench.device.refuses[id] = 0x21;
      bench.run(seconds{3});
    });
  }
  add("measures nothing", {}, [](Bench& bench) {
    bench.device.sends_nothing = true;
    bench.run(seconds{14});
  });
  add("drops a bit of the mode", {}, [](Bench& bench) {
    bench.device.modes_known = output_mode::kOrientation | output_mode::kTemperature;
    bench.run(seconds{4});
  });
  add("text", {}, [](Bench& bench) {
    bench.device.sends_text = true;
    run_measuring(bench);
  });
  add("sync in", config_with([](auto& c) { c.sync_in = SyncIn{0x5, 3, 29491}; }), run_measuring);
  add("sync in, set up already", config_with([](auto& c) {
        c.sync_in = SyncIn{0x5, 3, 29491};
      }),
      [](Bench& bench) {
        set_up_already(bench.device);
        run_measuring(bench);
      });
  add("sync in that it does not know", config_with([](auto& c) {
        c.sync_in = SyncIn{0x15, 3, 29491};
      }),
      [](Bench& bench) {
        set_up_already(bench.device);
        bench.device.sync_modes_known = 0x7;
        bench.run(seconds{5});
      });
  add("sync in as it is", config_with([](auto& c) {
        c.sync_in = SyncIn{2, 4, 5};
      }),
      [](Bench& bench) {
        set_up_already(bench.device);
        bench.device.sync_mode = 2, bench.device.sync_skip = 4, bench.device.sync_offset = 5;
        bench.run(seconds{3});
      });
  add("the right device", config_with([](auto& c) { c.device_id = 0x00300123; }), run_measuring);
  add("another device", config_with([](auto& c) { c.device_id = 0x00300124; }), run_measuring);
  const auto on_a_bus = [](std::size_t devices) {
    return config_with([devices](auto& c) { c.bus_devices = devices; });
  };
  const auto xbus = [](std::uint16_t devices, bool measuring, bool set_up) {
    return [devices, measuring, set_up](Bench& bench) {
      bench.device.id = 0x00100042;
      bench.device.n_devices = devices;
      bench.device.measuring = measuring;
      if (set_up) set_up_already(bench.device);
      bench.run(seconds{3});
    };
  };
  add("three on a bus", on_a_bus(3), xbus(3, false, false));
  add("three on a bus that measure", on_a_bus(3), xbus(3, true, true));
  add("two of three on a bus", on_a_bus(3), xbus(2, false, false));
  add("none on a bus", on_a_bus(1), xbus(0, false, false));
  add("a bus instead of a device", {}, xbus(1, false, false));
  add("a device instead of a bus", on_a_bus(1), [](Bench& bench) { bench.run(seconds{3}); });
  add("stalls", {}, [](Bench& bench) {
    run_measuring(bench);
    bench.stalled = true;
    bench.run(milliseconds{3500});
    bench.stalled = false;
    bench.run(seconds{1});
  });
  add("loses power", {}, [](Bench& bench) {
    run_measuring(bench);
    bench.device.powered = false;
    bench.run(seconds{18});
    bench.device.powered = true;
    bench.device.measuring = false;
    bench.run(seconds{4});
  });
  add("slow and silent", config_with([](auto& c) { c.rate_hz = 10.0; }), [](Bench& bench) {
    bench.run(seconds{3});
    bench.device.measuring = false;
    bench.device.powered = false;
    bench.run(seconds{4});
  });
  add("starts anew", {}, [](Bench& bench) {
    run_measuring(bench);
    bench.device.measuring = false;
    bench.device.mode = output_mode::kOrientation;
    bench.device.send(frame(mid::kWakeUp));
    bench.run(seconds{2});
  });
  add("sends something else", {}, [](Bench& bench) {
    run_measuring(bench);
    bench.device.mode = output_mode::kOrientation;
    bench.run(seconds{3});
  });
  add("wakes up after it was given up", {}, [](Bench& bench) {
    bench.device.never_answers = mid::kReqDid;
    bench.run(seconds{10});
    bench.device.never_answers.reset();
    bench.device.send(frame(mid::kWakeUp));
    bench.run(seconds{2});
  });
  for (const double rate_hz : {100.0, 333.0, 350.0, 399.0, 400.0}) {
    add("rates", config_with([rate_hz](auto& c) { c.rate_hz = rate_hz; }),
        [](Bench& bench) { bench.run(milliseconds{700}); });
  }
  for (const double baud : {0.0, 47'700.0, 47'800.0, 52'400.0, 52'600.0}) {
    add("lines", config_with([baud](auto& c) { c.baud = baud, c.stop_bits = baud > 50'000.0 ? 2 : 1; }),
        [](Bench& bench) { bench.run(milliseconds{700}); });
  }
  add("long frames on a bus", config_with([](auto& c) { c.bus_devices = 7, c.baud = 300'000.0; }),
      [](Bench& bench) { bench.run(milliseconds{700}); });
  add("a bus too long for its line", config_with([](auto& c) { c.bus_devices = 7; }),
      [](Bench& bench) { bench.run(milliseconds{700}); });
  const auto mtdata2 = [](MtSessionConfig::Output output) {
    return config_with([output](auto& c) { c.output = output; });
  };
  for (const auto output : {MtSessionConfig::Output::kAsDevice, MtSessionConfig::Output::kLegacy,
                            MtSessionConfig::Output::kMtData2}) {
    for (const std::uint32_t step : {100U, 99U, 118U, 200U}) {
      add("MTData2 comes", mtdata2(output), [step](Bench& bench) {
        run_deaf(
            bench, [step](int i) { return wanted_mtdata2(5000U + step * static_cast<std::uint32_t>(i)); },
            milliseconds{10}, 58);
      });
    }
    add("a device of MTData2", mtdata2(output), [](Bench& bench) {
      bench.device.mode = 0;
      bench.device.settings =
          output_settings::kNoAcceleration | output_settings::kNoRate | output_settings::kNoField;
      bench.device.refuses[mid::kOutputConfiguration] = 0x04;
      bench.run(seconds{3});
    });
  }
  for (const int permille : {840, 860, 1000, 1140, 1160, 1300}) {
    add("data at another rate", {}, [permille](Bench& bench) {
      run_deaf(
          bench, [](int i) { return mtdata(static_cast<std::uint16_t>(65530 + i)); },
          milliseconds{10} * permille / 1000, 45);
    });
  }
  for (const double force_mps2 : {0.9, 1.1, 499.0, 501.0}) {
    for (const double rate_radps : {0.0, 49.9, 50.1}) {
      add("data that may be none", {}, [force_mps2, rate_radps](Bench& bench) {
        run_deaf(
            bench,
            [&](int i) {
              return mtdata(static_cast<std::uint16_t>(i), {0.0, force_mps2, 0.0}, {rate_radps, 0.0, 0.0});
            },
            milliseconds{10}, 45);
      });
    }
  }
  return all;
}

TEST(MtSession, WholeConversations) {
  std::string text;
  for (const Conversation& one : conversations()) {
    Bench bench(one.config);
    one.run(bench);
    text += "-- " + std::string(one.name) + '\n' + bench.diary.text() + "id " +
            std::to_string(bench.session.device_id().value_or(0)) + '\n';
  }
  test::expect_recorded("drivers/xsens_mt/conversations.txt", text);
}

TEST(MtSession, AcknowledgedOutputsOfEveryKind) {
  std::string text;
  MtSessionConfig config;
  config.output = MtSessionConfig::Output::kMtData2;
  const std::vector<std::vector<std::uint16_t>> lists{
      {0x1020, 0xFFFF, 0x1060, 0xFFFF, 0x4020, 100, 0x8020, 100, 0xE020, 0xFFFF},
      {0x4020, 100, 0x8020, 50},
      {0x8020, 100},
      {0x4020, 99, 0x8020, 100},
      {0x4020, 100},
      {}};
  for (const auto& list : lists) {
    MtSession session(config);
    test::SessionDiary diary(session);
    Bytes acknowledged;
    for (const std::uint16_t word : list) append(acknowledged, be16(word));
    Scanner to_device;
    for (int ms = 0; ms < 2000; ++ms) {
      const HostTime now = host_time_from_ns(1'000'000LL * ms);
      to_device.append(diary.step(now), now);
      Frame f;
      while (to_device.next(f)) {
        if (f.mid == mid::kGoToConfig) session.on_bytes(frame(0x31), now);
        if (f.mid == mid::kReqDid) session.on_bytes(frame(mid::kDeviceId, u32(7)), now);
        if (f.mid == mid::kReqConfiguration) session.on_bytes(configuration(1152, 0, 1, 0, 0, 0, 7), now);
        if (f.mid == mid::kOutputConfiguration) session.on_bytes(frame(0xC1, acknowledged), now);
        if (f.mid == mid::kGoToMeasurement) {
          session.on_bytes(frame(0x11), now);
          session.on_bytes(wanted_mtdata2(1000), now);
        }
      }
    }
    text += "--\n" + diary.text();
  }
  test::expect_recorded("drivers/xsens_mt/acknowledged_outputs.txt", text);
}

}  // namespace
}  // namespace imuscope::xsens
