/// Drivers against the simulator's devices, in simulated time: two programs from one manual that share no
/// code. Sessions must bring every device to its stream, whatever state it is found in.

#include <gtest/gtest.h>
#include <functional>
#include <map>

#include "drivers/greis/decoder.h"
#include "drivers/greis/session.h"
#include "drivers/xsens_mt/decoder.h"
#include "drivers/xsens_mt/session.h"
#include "firmware_sim/devices/greis_receiver.h"
#include "firmware_sim/devices/xsens_mti.h"
#include "firmware_sim/devices/xsens_mtx.h"
#include "firmware_sim/devices/xsens_xbus.h"
#include "firmware_sim/faults/faulty_device.h"

namespace imuscope {
namespace {

/// Counts samples of each device, from a time on.
class Sink final : public SampleSink {
 public:
  void on_sample(const Sample& sample) noexcept override {
    ++count[sample.device];
    last[sample.device] = sample;
  }
  std::map<DeviceIndex, int> count;
  std::map<DeviceIndex, Sample> last;
};

/// A device, its line without any delay, and the driver at the other end.
class Bench {
 public:
  Bench(imusim::Device& device, DeviceDecoder& decoder, DeviceSession& session)
      : device_(device), decoder_(decoder), session_(session) {}

  void run_until(double t_s) {
    constexpr double kStep_s = 0.005;
    std::vector<imusim::Emission> emissions;
    for (; now_s_ < t_s; now_s_ += kStep_s) {
      emissions.clear();
      device_.run_until(now_s_, emissions);
      const HostTime now{from_seconds(kHostBegin_s + now_s_)};
      for (const imusim::Emission& emission : emissions) {
        decoder_.push(emission.bytes, now, sink);
        session_.on_bytes(emission.bytes, now);
      }
      const auto said = session_.poll(now);
      if (!said.empty()) device_.receive(said, now_s_);
      if (streaming_since_s < 0.0 && session_.state() == SessionState::kStreaming) streaming_since_s = now_s_;
    }
  }

  Sink sink;
  double streaming_since_s = -1.0;

 private:
  static constexpr double kHostBegin_s = 100.0;
  imusim::Device& device_;
  DeviceDecoder& decoder_;
  DeviceSession& session_;
  double now_s_ = 0.0;
};

imusim::xsens::MtSample at_rest(double /*t_s*/, std::int64_t counter) {
  imusim::xsens::MtSample sample;
  sample.acc_mps2 = {0.0, 0.0, 9.81};
  sample.gyr_radps = {0.001 * static_cast<double>(counter % 100), 0.0, 0.0};
  return sample;
}

/// Samples of device 0 between two times of a running bench.
int samples_between(Bench& bench, double begin_s, double end_s) {
  bench.run_until(begin_s);
  const int before = bench.sink.count[0];
  bench.run_until(end_s);
  return bench.sink.count[0] - before;
}

TEST(FarEnd, AnMtxIsSetUpFromItsFactorySetting) {
  imusim::XsensMtx device({}, at_rest, 0.0);
  xsens::MtDecoder decoder({});
  xsens::MtSession session({});
  Bench bench(device, decoder, session);
  bench.run_until(5.0);
  EXPECT_EQ(session.state(), SessionState::kStreaming) << session.problem();
  EXPECT_LT(bench.streaming_since_s, 3.0);
  EXPECT_NEAR(samples_between(bench, 5.0, 10.0), 500, 1);
  EXPECT_EQ(session.device_id(), 0x00300001U);
}

TEST(FarEnd, AnMtxThatStreamsWhatIsWantedIsTakenOverWithoutAWord) {
  imusim::XsensMtx device({}, at_rest, 0.0);
  device.start_calibrated(0.0);
  xsens::MtDecoder decoder({});
  xsens::MtSessionConfig config;
  config.layout = {xsens::output_mode::kCalibrated,
                   xsens::output_settings::kSampleCounter | xsens::output_settings::kNoField};
  xsens::MtSession session(config);
  Bench bench(device, decoder, session);
  EXPECT_NEAR(samples_between(bench, 0.5, 5.5), 500, 1);
  EXPECT_EQ(session.state(), SessionState::kStreaming);
  EXPECT_FALSE(session.device_id().has_value()) << "it was asked nothing";
  EXPECT_EQ(decoder.counters().samples_lost, 0U);
}

TEST(FarEnd, AnMtxThatLostPowerComesBack) {
  imusim::XsensMtx device({}, at_rest, 0.0);
  xsens::MtDecoder decoder({});
  xsens::MtSession session({});
  Bench bench(device, decoder, session);
  bench.run_until(6.0);
  device.power_cycle(6.0, 2.0);
  bench.run_until(14.0);
  EXPECT_EQ(session.state(), SessionState::kStreaming) << session.problem();
  EXPECT_NEAR(samples_between(bench, 14.0, 16.0), 200, 1);
  EXPECT_GE(decoder.counters().clock_resets, 1U);
}

TEST(FarEnd, AnMtiIsSetUpForMtData2) {
  imusim::XsensMti::Options options;
  options.has_gnss = true;
  imusim::XsensMti device(options, at_rest, 0.0);
  xsens::MtDecoder decoder({});
  xsens::MtSession session({});
  Bench bench(device, decoder, session);
  bench.run_until(5.0);
  EXPECT_EQ(session.state(), SessionState::kStreaming) << session.problem();
  EXPECT_NEAR(samples_between(bench, 5.0, 10.0), 500, 1);
  const auto lost = decoder.counters().samples_lost;
  bench.run_until(20.0);
  EXPECT_EQ(decoder.counters().samples_lost, lost);
}

TEST(FarEnd, SeveralMtxBehindAnXbusAreSetUpEachByItself) {
  imusim::XsensXbus::Options options;
  options.bus_devices = {0x00300101, 0x00300102, 0x00300103};
  imusim::XsensXbus device(
      options,
      [](std::size_t place, double, std::int64_t) {
        imusim::xsens::MtSample sample;
        sample.acc_mps2 = {static_cast<double>(place), 0.0, 9.81};
        return sample;
      },
      0.0);
  xsens::MtDecoderConfig config;
  config.bus = {xsens::BusDevice{0}, xsens::BusDevice{1}, xsens::BusDevice{2}};
  config.per_byte = byte_time(options.baud);
  xsens::MtDecoder decoder(config);
  xsens::MtSessionConfig session_config;
  session_config.bus_devices = options.bus_devices.size();
  session_config.baud = options.baud;
  xsens::MtSession session(session_config);
  Bench bench(device, decoder, session);
  bench.run_until(6.0);
  EXPECT_EQ(session.state(), SessionState::kStreaming) << session.problem();
  const auto before = bench.sink.count;
  bench.run_until(11.0);
  for (DeviceIndex i = 0; i < 3; ++i) {
    EXPECT_NEAR(bench.sink.count[i] - before.at(i), 500, 1) << i;
    EXPECT_NEAR(bench.sink.last[i].imu.f_mps2[0], static_cast<double>(i), 1e-6);
  }
}

TEST(FarEnd, AGreisReceiverIsAskedForWhatTheDecoderReads) {
  imusim::GreisReceiver device({}, [](double) {
    imusim::greis::Solution solution;
    solution.latitude_rad = 0.8;
    solution.longitude_rad = 0.1;
    solution.height_m = 400.0;
    solution.position_sd_m = 0.02F;
    solution.velocity_sd_mps = 0.02F;
    solution.horizontal_position_sd_m = 0.01F;
    solution.vertical_position_sd_m = 0.02F;
    solution.horizontal_velocity_sd_mps = 0.01F;
    solution.vertical_velocity_sd_mps = 0.02F;
    return solution;
  });
  greis::Decoder decoder({});
  greis::Session session({});
  Bench bench(device, decoder, session);
  EXPECT_NEAR(samples_between(bench, 3.0, 8.0), 50, 1);
  EXPECT_EQ(session.state(), SessionState::kStreaming) << session.problem();
  device.power_cycle(8.0, 1.0);
  bench.run_until(40.0);
  EXPECT_EQ(session.state(), SessionState::kStreaming) << session.problem();
  EXPECT_NEAR(samples_between(bench, 40.0, 45.0), 50, 1);
}

TEST(FarEnd, ANoisyLineCostsMessagesAndNeitherTheSetUpNorTheStream) {
  imusim::Fault fault;
  fault.kind = imusim::FaultKind::kFlip;
  fault.end_s = 1e6;
  fault.share = 0.001;
  imusim::FaultyDevice device(std::make_unique<imusim::XsensMtx>(imusim::XsensMtx::Options{}, at_rest, 0.0),
                              {fault}, imusim::Random(1, "noisy"));
  xsens::MtDecoder decoder({});
  xsens::MtSession session({});
  Bench bench(device, decoder, session);
  bench.run_until(10.0);
  EXPECT_EQ(session.state(), SessionState::kStreaming) << session.problem();
  // Of 31 bytes one in 32 messages is hit: 97 % come through.
  EXPECT_NEAR(samples_between(bench, 10.0, 30.0), 1939, 60);
  EXPECT_NEAR(static_cast<double>(decoder.counters().bad_checksums), 90.0, 60.0);
}

}  // namespace
}  // namespace imuscope
