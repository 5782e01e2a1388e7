#include "firmware_sim/imusim/world.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "firmware_sim/devices/can_encoder.h"
#include "firmware_sim/devices/gnss_talker.h"
#include "firmware_sim/devices/greis_receiver.h"
#include "firmware_sim/devices/pulse_output.h"
#include "firmware_sim/devices/stdbin_unit.h"
#include "firmware_sim/devices/xsens_mti.h"
#include "firmware_sim/devices/xsens_mtx.h"
#include "firmware_sim/devices/xsens_xbus.h"
#include "firmware_sim/faults/faulty_device.h"
#include "firmware_sim/imusim/sensor_faults.h"
#include "firmware_sim/motion/degrees.h"
#include "firmware_sim/motion/draw.h"

namespace imusim {
namespace {

constexpr double kDrawnRotationSd_rad = 2.0 / kDegPerRad;
constexpr double kDrawnLeverArmSd_m = 0.3;
constexpr double kClockSkewMax_ppm = 30.0;  // MTx manual: worst case
// What a short differentiator makes of the reference gyro's white noise.
constexpr double kRotationAccelerationSd_degps2 = 0.024;

/// North-east-down to north-west-up, the world of an MTx.
const Eigen::DiagonalMatrix<double, 3>& C_ned_nwu() {
  static const Eigen::DiagonalMatrix<double, 3> flip(1.0, -1.0, -1.0);
  return flip;
}

ImuErrors errors_of(const SImuSimulation& study, RegimeSwitch regime_switch, Random& random) {
  ImuErrors errors = draw_mtx(study.draw, random);
  errors.regime_switch = regime_switch;
  const auto take_over = [](TriadErrors& drawn, const TriadErrors& given,
                            const std::optional<Eigen::Vector3d>& bias,
                            const std::optional<Eigen::Vector3d>& scale) {
    drawn.bias = bias.value_or(drawn.bias);
    drawn.scale = scale.value_or(drawn.scale);
    drawn.misalignment = given.misalignment;
    drawn.g_sensitivity = given.g_sensitivity;
    drawn.range = given.range;
    drawn.quantisation = given.quantisation;
    drawn.low_pass_hz = given.low_pass_hz;
  };
  take_over(errors.gyro, study.gyro, study.gyro_bias_radps, study.gyro_scale);
  take_over(errors.accel, study.accel, study.accel_bias_mps2, study.accel_scale);
  errors.temperature = study.temperature.value_or(Temperature{});
  errors.gyro_white = study.gyro_white;
  return errors;
}

std::shared_ptr<const Motion> motion_of(const Configuration& configuration) {
  Scenario scenario = configuration.scenario;
  const bool harsh = configuration.world == WorldKind::kHarsh;
  scenario.engine_runs = harsh;
  scenario.rough_road_to_hz = harsh ? kWheelHop_hz : 0.0;
  return std::make_shared<Motion>(scenario);
}

/// The line that a device shares; the end where it is the first on its line, or on none.
std::vector<XbusLine>::iterator bus_of(std::vector<XbusLine>& buses, const PlayedDevice& played) {
  return std::find_if(buses.begin(), buses.end(), [&](const XbusLine& bus) {
    return played.bus_id > 0 && bus.owner.name == played.line_owner;
  });
}

/// What the R-IMU adds to the truth in its own navigation solution: constant attitude errors, and position
/// and velocity errors that wander as those of a unit aided by plain GNSS.
class NavigationSolution {
 public:
  NavigationSolution(const Configuration& configuration, const std::string& name)
      : reference_(configuration.reference) {
    Random random(configuration.scenario.seed, name + "/solution");
    attitude_error_ = draw3(random, 1.0).cwiseProduct(reference_.attitude_sd_rad);
    for (int axis = 0; axis < 3; ++axis) {
      const std::string stream = name + "/solution_" + "ned"[axis];
      const AxisNoise position{0.0, {{position_sd_m[axis] * position_sd_m[axis], 1.0 / kPositionTau_s}}};
      const AxisNoise velocity{0.0, {{kVelocitySd_mps * kVelocitySd_mps, 1.0 / kVelocityTau_s}}};
      position_.emplace_back(same_in_both(position), RegimeSwitch::kContinuous,
                             Random(configuration.scenario.seed, stream + "p"));
      velocity_.emplace_back(same_in_both(velocity), RegimeSwitch::kContinuous,
                             Random(configuration.scenario.seed, stream + "v"));
    }
  }

  void fill(const MotionState& state, double step_s, stdbin::Telegram& telegram) {
    const bool aligning = state.t_s < reference_.alignment_s;
    const Eigen::Vector3d error = attitude_error_ * kDegPerRad;
    const Eigen::Vector3d sd = reference_.attitude_sd_rad * kDegPerRad;
    const double heading_rad =
        state.heading_rad + attitude_error_.z() + (aligning ? kHeadingErrorWhileAligning_rad : 0.0);
    telegram.heading_roll_pitch_deg =
        Eigen::Vector3d(wrapped_deg(heading_rad), state.roll_rad * kDegPerRad + error.x(),
                        -(state.pitch_rad * kDegPerRad + error.y()));
    telegram.heading_roll_pitch_sd_deg =
        Eigen::Vector3d(aligning ? kHeadingErrorWhileAligning_rad * kDegPerRad : sd.z(), sd.x(), sd.y());
    const GeodeticPosition place = displaced(state.position, next(position_, step_s));
    telegram.position =
        stdbin::Position{place.latitude_rad * kDegPerRad, wrapped_deg(place.longitude_rad), place.height_m};
    telegram.position_sd = stdbin::PositionSd{position_sd_m[0], position_sd_m[1], 0.0, position_sd_m[2]};
    const Eigen::Vector3d v = state.v_n_mps + next(velocity_, step_s);
    telegram.speed_neu_mps = Eigen::Vector3d(v.x(), v.y(), -v.z());
    telegram.speed_sd_neu_mps = Eigen::Vector3d::Constant(kVelocitySd_mps);
    telegram.sensor_status = {stdbin::kSensorDataReady, 0U};
    telegram.user_status =
        stdbin::kUserGpsValid | stdbin::kUserTimeValid |
        (aligning ? stdbin::kUserHrpInvalid | stdbin::kUserAlignment : stdbin::kUserNavigation);
  }

 private:
  static constexpr std::array<double, 3> position_sd_m = {1.0, 1.0, 1.5};
  static constexpr double kPositionTau_s = 300.0;
  static constexpr double kVelocitySd_mps = 0.02;
  static constexpr double kVelocityTau_s = 60.0;
  static constexpr double kHeadingErrorWhileAligning_rad = 20.0 / kDegPerRad;

  static Eigen::Vector3d next(std::vector<NoiseSource>& sources, double step_s) {
    const double north = sources[0].next(Regime::kStatic, step_s);
    const double east = sources[1].next(Regime::kStatic, step_s);
    const double down = sources[2].next(Regime::kStatic, step_s);
    return {north, east, down};
  }

  ReferenceSimulation reference_;
  Eigen::Vector3d attitude_error_;
  std::vector<NoiseSource> position_;
  std::vector<NoiseSource> velocity_;
};

}  // namespace

World::World(const Configuration& configuration, Beginning beginning, double begin_s)
    : configuration_(configuration), motion_(motion_of(configuration)) {
  if (configuration_.world == WorldKind::kHarsh) {
    const double given_ppm = configuration_.line.clock.rate_ppm;
    const auto suspends = configuration_.line.clock.suspends;
    configuration_.line.clock =
        PcClock::drawn(Random(configuration_.scenario.seed, "pc clock"), configuration_.scenario.duration_s);
    if (configuration_.has_pc_rate) configuration_.line.clock.rate_ppm = given_ppm;
    configuration_.line.clock.suspends = suspends;
  }
  std::size_t next_study = 0;
  for (const PlayedDevice& played : configuration_.devices) {
    switch (played.role) {
      case Role::kStudy:
        add_study(played, configuration_.studies[next_study++], beginning, begin_s);
        break;
      case Role::kReference:
        add_reference(played, beginning, begin_s);
        break;
      case Role::kGnss:
        add_gnss(played, begin_s);
        break;
      case Role::kOdometry:
        add_wheels(played, begin_s);
        break;
      case Role::kTime:
        add_pulses(played, begin_s);
        break;
    }
  }
  add_buses(beginning, begin_s);
}

void World::add(const PlayedDevice& played, std::unique_ptr<Device> device) {
  const std::vector<Fault> faults = configuration_.faults_of(played.name);
  if (!faults.empty()) {
    device = std::make_unique<FaultyDevice>(
        std::move(device), faults, Random(configuration_.scenario.seed, played.name + "/faults"),
        Configuration::is_on_can(played) ? FaultyDevice::Wire::kFrames : FaultyDevice::Wire::kBytes);
  }
  devices_.push_back({played, std::move(device)});
}

void World::add_study(const PlayedDevice& played, const SImuSimulation& study, Beginning beginning,
                      double begin_s) {
  // Every property is drawn in the same order whether it is given or not: giving one changes no other.
  Random random(configuration_.scenario.seed, played.name + "/unit");
  const Eigen::Vector3d drawn_rotation = draw3(random, kDrawnRotationSd_rad);
  const Eigen::Vector3d drawn_lever_arm = draw3(random, kDrawnLeverArmSd_m);
  const double drawn_skew = random.uniform(-kClockSkewMax_ppm, kClockSkewMax_ppm);
  const auto drawn_counter = static_cast<std::uint16_t>(random.bits() & 0xFFFFU);
  const double drawn_phase = random.uniform();

  SImuTruth truth;
  truth.name = played.name;
  truth.model = study.model;
  truth.sends_temperature = study.temperature.has_value();
  truth.can_output = study.can_output;
  truth.mounting.C_b_s = rotation_from_vector(study.rotation_vector_b_s_rad.value_or(drawn_rotation));
  truth.mounting.r_bs_b_m = study.r_bs_b_m.value_or(drawn_lever_arm);
  truth.errors = errors_of(study, study.draw.regime_switch, random);
  Random unseen(configuration_.scenario.seed, played.name + "/imperfections");
  draw_imperfections(study_imperfections(configuration_.world), unseen, truth.errors);
  truth.latency_s = study.latency_s;
  truth.clock_skew_ppm = study.clock_skew_ppm.value_or(drawn_skew);
  truth.period_s = 1.0 / played.rate_hz / (1.0 + truth.clock_skew_ppm * 1e-6);
  truth.first_sample_s = drawn_phase * truth.period_s;
  truth.first_counter = study.first_counter.value_or(drawn_counter);
  if (const auto bus = bus_of(buses_, played); bus != buses_.end()) {  // its head samples for all
    truth.latency_s = bus->clock.latency_s;
    truth.clock_skew_ppm = bus->clock.clock_skew_ppm;
    truth.period_s = bus->clock.period_s;
    truth.first_sample_s = bus->clock.first_sample_s;
    truth.first_counter = bus->clock.first_counter;
  }
  studies_.push_back(truth);
  add_imu(played,
          std::make_shared<ImuModel>(*motion_, truth.mounting, truth.errors, configuration_.scenario.seed,
                                     played.name),
          truth, beginning, begin_s);
}

void World::add_reference(const PlayedDevice& played, Beginning beginning, double begin_s) {
  Random random(configuration_.scenario.seed, played.name + "/unit");
  ImuErrors errors = draw_reference(configuration_.reference.noise, played.rate_hz, random);
  Random unseen(configuration_.scenario.seed, played.name + "/imperfections");
  draw_imperfections(reference_imperfections(configuration_.world, configuration_.reference.noise), unseen,
                     errors);
  SImuTruth clock;
  clock.name = played.name;
  clock.latency_s = configuration_.reference.latency_s;
  clock.first_counter = static_cast<std::uint16_t>(random.bits() & 0xFFFFU);
  clock.clock_skew_ppm =
      played.protocol == Protocol::kXsensMt ? random.uniform(-kClockSkewMax_ppm, kClockSkewMax_ppm) : 0.0;
  clock.period_s = 1.0 / played.rate_hz / (1.0 + clock.clock_skew_ppm * 1e-6);
  // Anywhere within a period, on the 0.1 ms grid in which StdBin counts time.
  clock.first_sample_s = std::floor(random.uniform() * clock.period_s * 1e4) * 1e-4;
  const double periods = std::max(0.0, std::ceil((begin_s - clock.first_sample_s) / clock.period_s));
  reference_ = {played.name, errors, clock.first_sample_s, clock.period_s};
  first_reference_sample_s_ = clock.first_sample_s + periods * clock.period_s;
  add_imu(played,
          std::make_shared<ImuModel>(*motion_, Mounting{}, errors, configuration_.scenario.seed, played.name),
          clock, beginning, begin_s);
}

void World::add_imu(const PlayedDevice& played, const std::shared_ptr<ImuModel>& imu, const SImuTruth& clock,
                    Beginning beginning, double begin_s) {
  auto observer = std::make_shared<OnTrueSample>();
  observers_.emplace_back(played.name, observer);
  const Eigen::Matrix3d C_frame_device = played.C_device_frame.transpose();
  const std::shared_ptr<const Motion> motion = motion_;
  auto faults = std::make_shared<SensorFaults>(configuration_.faults_of(played.name));
  const auto sample = [motion, imu, observer, faults](double t_s, std::int64_t counter) {
    ImuReading reading = imu->sample_at(t_s);
    if (*observer) (*observer)({t_s, counter, reading, motion->regime_at(t_s)});
    faults->apply(t_s, reading);
    return reading;
  };

  if (played.protocol == Protocol::kXsensCan) {
    CanNode::Options options;
    options.rate_hz = played.rate_hz;
    options.first_s = clock.first_sample_s;
    options.clock_skew_ppm = clock.clock_skew_ppm;
    options.latency_s = clock.latency_s;
    auto node = std::make_unique<CanNode>(
        options, [sample, C_frame_device, output = clock.can_output, first = clock.first_counter,
                  step_s = 1.0 / played.rate_hz](double t_s, double device_s, std::int64_t index) {
          // Increments of the interval that ends now: what is felt in its middle, for its length.
          const double felt_s = output == MtiOutput::kIncrements ? t_s - 0.5 * step_s : t_s;
          const ImuReading reading = sample(felt_s, first + index);
          MtiGroup group;
          group.output = output;
          group.sample_time_100us = static_cast<std::uint32_t>(std::llround(device_s * 1e4));
          group.counter = static_cast<std::uint16_t>(first + index);
          group.delta_v_mps = step_s * (C_frame_device * reading.f_mps2);
          group.f_mps2 = C_frame_device * reading.f_mps2;
          group.omega_radps = C_frame_device * reading.omega_radps;
          group.rotation_vector_rad = step_s * group.omega_radps;
          return mti_frames(group);
        });
    node->skip_to(begin_s);
    add(played, std::move(node));
    return;
  }

  constexpr std::uint32_t kFirstDeviceId = 0x00300001;
  const auto device_id = kFirstDeviceId + static_cast<std::uint32_t>(devices_.size());
  if (played.protocol == Protocol::kXsensMt) {
    const Eigen::Matrix3d C_device_b = imu->mounting().C_b_s.transpose() * played.C_device_frame;
    const auto message = [motion, imu, sample, C_frame_device, C_device_b](double t_s, std::int64_t counter) {
      const ImuReading reading = sample(t_s, counter);
      xsens::MtSample made;
      made.temperature_degC = imu->errors().temperature.at(t_s);
      made.acc_mps2 = C_frame_device * reading.f_mps2;
      made.gyr_radps = C_frame_device * reading.omega_radps;
      made.sensor_to_world = Eigen::Matrix3d(C_ned_nwu() * motion->state_at(t_s).C_b_n * C_device_b);
      return made;
    };
    if (played.bus_id > 0) return join_bus(played, message, clock);
    if (clock.model == XsensModel::kMti) {
      XsensMti::Options options;
      options.device_id = device_id;
      options.latency_s = clock.latency_s;
      options.clock_skew_ppm = clock.clock_skew_ppm;
      options.first_sample_s = clock.first_sample_s;
      options.first_packet = clock.first_counter;
      options.baud = played.baud;
      auto device = std::make_unique<XsensMti>(options, message, begin_s);
      if (beginning == Beginning::kStreaming)
        device->start_inertial(begin_s, static_cast<std::uint16_t>(std::lround(played.rate_hz)));
      return add(played, std::move(device));
    }
    XsensMtx::Options options;
    options.device_id = device_id;
    options.latency_s = clock.latency_s;
    options.clock_skew_ppm = clock.clock_skew_ppm;
    options.first_sample_s = clock.first_sample_s;
    options.first_counter = clock.first_counter;
    options.baud = played.baud;
    options.period = static_cast<std::uint16_t>(std::lround(115200.0 / played.rate_hz));
    options.sends_temperature = clock.sends_temperature;
    auto device = std::make_unique<XsensMtx>(options, message, begin_s);
    if (beginning == Beginning::kStreaming) device->start_calibrated(begin_s);
    return add(played, std::move(device));
  }

  StdbinUnit::Options options;
  options.utc_begin = configuration_.utc_begin;
  options.rate_hz = played.rate_hz;
  options.phase_100us = std::llround(clock.first_sample_s * 1e4);
  options.latency_s = clock.latency_s;
  options.first_counter = clock.first_counter;
  options.baud = played.baud;
  auto solution = std::make_shared<NavigationSolution>(configuration_, played.name);
  auto differentiator =
      std::make_shared<Random>(configuration_.scenario.seed, played.name + "/differentiator");
  const Eigen::Matrix3d C_b_device = C_frame_device * imu->mounting().C_b_s;
  auto unit = std::make_unique<StdbinUnit>(
      options,
      [motion, sample, solution, differentiator, C_frame_device, C_b_device, first = clock.first_counter,
       counter = std::int64_t{0}, step_s = 1.0 / played.rate_hz](double t_s) mutable {
        const ImuReading reading = sample(t_s, first + counter++);
        const MotionState state = motion->state_at(t_s);
        stdbin::Telegram telegram;
        solution->fill(state, step_s, telegram);
        telegram.raw_acceleration_mps2 = C_frame_device * reading.f_mps2;
        telegram.raw_rotation_rate_degps = C_frame_device * reading.omega_radps * kDegPerRad;
        telegram.rotation_acceleration_degps2 = C_b_device * state.omega_dot_ib_b_radps2 * kDegPerRad +
                                                draw3(*differentiator, kRotationAccelerationSd_degps2);
        return telegram;
      });
  unit->skip_to(begin_s);
  add(played, std::move(unit));
}

void World::join_bus(const PlayedDevice& played, XbusSampler sampler, const SImuTruth& clock) {
  auto bus = bus_of(buses_, played);
  if (bus == buses_.end()) bus = buses_.insert(bus, XbusLine{played, clock, {}});
  bus->by_bus_id.emplace(played.bus_id, std::move(sampler));
}

void World::add_buses(Beginning beginning, double begin_s) {
  constexpr std::uint32_t kFirstBusDeviceId = 0x00300101;
  for (const XbusLine& bus : buses_) {
    XsensXbus::Options options;
    std::vector<XbusSampler> samplers;
    for (const auto& [bus_id, sampler] : bus.by_bus_id) {
      options.bus_devices.push_back(kFirstBusDeviceId + static_cast<std::uint32_t>(samplers.size()));
      samplers.push_back(sampler);
    }
    options.latency_s = bus.clock.latency_s;
    options.clock_skew_ppm = bus.clock.clock_skew_ppm;
    options.first_sample_s = bus.clock.first_sample_s;
    options.first_counter = bus.clock.first_counter;
    options.baud = bus.owner.baud;
    options.period = static_cast<std::uint16_t>(std::lround(115200.0 / bus.owner.rate_hz));
    auto head = std::make_unique<XsensXbus>(
        options,
        [samplers](std::size_t place, double t_s, std::int64_t counter) {
          return samplers[place](t_s, counter);
        },
        begin_s);
    if (beginning == Beginning::kStreaming) head->start_calibrated(begin_s);
    add(bus.owner, std::move(head));
  }
}

void World::add_gnss(const PlayedDevice& played, double begin_s) {
  const GnssSimulation gnss = configuration_.gnss;
  auto random = std::make_shared<Random>(configuration_.scenario.seed, played.name + "/noise");
  const std::shared_ptr<const Motion> motion = motion_;
  const auto faults = std::make_shared<const SensorFaults>(configuration_.faults_of(played.name));
  const auto solve = [=, antenna = played.antenna_b_m](double t_s) {
    const MotionState state = motion->state_at(t_s + gnss.epoch_error_s);
    const GeodeticPosition place =
        displaced(position_at(state, antenna), draw3(*random, 1.0).cwiseProduct(gnss.position_sd_m));
    const Eigen::Vector3d v =
        velocity_at(state, antenna) + draw3(*random, 1.0).cwiseProduct(gnss.velocity_sd_mps);
    greis::Solution solution;
    solution.latitude_rad = place.latitude_rad;
    solution.longitude_rad = place.longitude_rad;
    solution.height_m = place.height_m;
    solution.north_mps = static_cast<float>(v.x());
    solution.east_mps = static_cast<float>(v.y());
    solution.up_mps = static_cast<float>(-v.z());
    // [SG] gives the plane's and the vertical standard deviations, [PG] and [VG] that of all three axes.
    const auto sd = [](double value) { return static_cast<float>(value); };
    solution.position_sd_m = sd(gnss.position_sd_m.norm());
    solution.velocity_sd_mps = sd(gnss.velocity_sd_mps.norm());
    solution.horizontal_position_sd_m = sd(gnss.position_sd_m.head<2>().norm());
    solution.vertical_position_sd_m = sd(gnss.position_sd_m.z());
    solution.horizontal_velocity_sd_mps = sd(gnss.velocity_sd_mps.head<2>().norm());
    solution.vertical_velocity_sd_mps = sd(gnss.velocity_sd_mps.z());
    faults->apply(t_s, solution);
    return solution;
  };
  const auto set_up = [&](auto options) {
    options.utc_begin = configuration_.utc_begin;
    options.rate_hz = played.rate_hz;
    options.latency_s = gnss.latency_s;
    options.baud = played.baud;
    return options;
  };
  if (played.protocol == Protocol::kGreis) {
    auto receiver = std::make_unique<GreisReceiver>(set_up(GreisReceiver::Options{}), solve);
    receiver->skip_to(begin_s);
    return add(played, std::move(receiver));
  }
  GnssTalker::Options options = set_up(GnssTalker::Options{});
  options.language = played.protocol == Protocol::kNmea  ? GnssTalker::Language::kNmea
                     : played.protocol == Protocol::kUbx ? GnssTalker::Language::kUbx
                                                         : GnssTalker::Language::kRtklib;
  auto talker = std::make_unique<GnssTalker>(options, solve);
  talker->skip_to(begin_s);
  add(played, std::move(talker));
}

void World::add_wheels(const PlayedDevice& played, double begin_s) {
  CanNode::Options options;
  options.rate_hz = played.rate_hz;
  options.latency_s = configuration_.wheels.latency_s;
  options.first_s = Random(configuration_.scenario.seed, played.name + "/unit").uniform() / played.rate_hz;
  // Front right, front left, rear right, rear left; b is forward-right-down, above the rear axle.
  constexpr double kWheelbase_m = 2.7;
  constexpr double kHalfTrack_m = 0.78;
  constexpr double kBelow_m = 0.5;
  auto wheels = std::make_shared<std::vector<WheelSpeed>>();
  for (const auto& [x, y, name] : {std::tuple{kWheelbase_m, kHalfTrack_m, "/fr"},
                                   {kWheelbase_m, -kHalfTrack_m, "/fl"},
                                   {0.0, kHalfTrack_m, "/rr"},
                                   {0.0, -kHalfTrack_m, "/rl"}}) {
    wheels->emplace_back(*motion_, Eigen::Vector3d(x, y, kBelow_m), configuration_.wheels.errors,
                         configuration_.scenario.seed, played.name + name);
  }
  auto node = std::make_unique<CanNode>(
      options, [motion = motion_, wheels](double t_s, double /*device_s*/, std::int64_t /*index*/) {
        std::array<double, 4> speeds_mps{};
        for (std::size_t i = 0; i < speeds_mps.size(); ++i) speeds_mps[i] = (*wheels)[i].shown_at(t_s);
        return std::vector<CanFrame>{wheel_frame(speeds_mps)};
      });
  node->skip_to(begin_s);
  add(played, std::move(node));
}

void World::add_pulses(const PlayedDevice& played, double begin_s) {
  auto output = std::make_unique<PulseOutput>(PulseOutput::Options{configuration_.utc_begin});
  output->skip_to(begin_s);
  add(played, std::move(output));
}

PulseLine World::pulse_line_of(const PlayedDevice& played) const {
  PulseLineOptions options;
  options.host_begin_ns = kHostBegin_ns;
  options.clock = configuration_.line.clock;
  options.wall_begin = configuration_.utc_begin;
  return {options, Random(configuration_.scenario.seed, played.name + "/line"),
          Random(configuration_.scenario.seed, played.name + "/quartz")};
}

PulseLine World::live_pulse_line_of(const PlayedDevice& played, std::int64_t host_begin_ns) const {
  PulseLineOptions options;
  options.host_begin_ns = host_begin_ns;
  options.wall_begin = configuration_.utc_begin;
  // The PC is a real one, which reads its own quartz.
  options.tells_steering = false;
  return {options, Random(configuration_.scenario.seed, played.name + "/line"),
          Random(configuration_.scenario.seed, played.name + "/quartz")};
}

CanLine World::can_line_of(const PlayedDevice& played) const {
  return {configuration_.can, Random(configuration_.scenario.seed, played.name + "/line")};
}

SerialLine World::line_of(const PlayedDevice& played) const {
  LineOptions options = configuration_.line;
  options.baud = played.baud;
  if (played.is_on_network()) options.reads = ReadModel::kMessages;
  options.host_begin_ns = kHostBegin_ns;
  // All devices hang on one host controller: its frames are common.
  options.usb_phase_s = Random(configuration_.scenario.seed, "usb").uniform(0.0, 1e-3);
  add_line_faults(configuration_.faults_of(played.name), options);
  for (const PcClock::Suspend& suspend : options.clock.suspends)
    options.unplugged.push_back({suspend.begin_s, suspend.end_s});
  return {options, Random(configuration_.scenario.seed, played.name + "/line")};
}

Outcome<void> check_faults(World& world) {
  for (const WorldDevice& device : world.devices()) {
    for (const Fault& fault : world.configuration().faults_of(device.played.name)) {
      if (fault.kind == FaultKind::kMissing && !device.device->leave_out(fault.blocks))
        return wrong_usage(fmt::format("device '{}' has no block '{}' that could be missing",
                                       device.played.name, fmt::join(fault.blocks, "', '")));
    }
    (void)device.device->leave_out({});
  }
  for (const PlayedDevice& played : world.configuration().devices) {
    if (!played.shares_line()) continue;
    for (const Fault& fault : world.configuration().faults_of(played.name)) {
      if (fault.kind != FaultKind::kStuck && fault.kind != FaultKind::kSaturation)
        return wrong_usage(
            fmt::format("device '{}' has no line of its own: give the fault to '{}', which owns it",
                        played.name, played.line_owner));
    }
  }
  return {};
}

void World::observe(const std::string& name, OnTrueSample on_sample) {
  for (auto& [observed, observer] : observers_) {
    if (observed != name) continue;
    *observer = std::move(on_sample);
    return;  // names are the devices' own: one device answers to each
  }
}

}  // namespace imusim
