/// The whole live service on a simulated vehicle: devices on pseudo-terminals, handshakes, 100 Hz, LCM,
/// recording, Ctrl-C, replay. In a network of its own, so that runs beside it on this machine are not heard.

#include <gtest/gtest.h>
#include <sched.h>
#include <cctype>
#include <chrono>
#include <cmath>
#include <fstream>
#include <imuscope/calibration_t.hpp>
#include <imuscope/dynamics_t.hpp>
#include <imuscope/error_t.hpp>
#include <imuscope/event_t.hpp>
#include <imuscope/navigation_t.hpp>
#include <imuscope/noise_model_t.hpp>
#include <imuscope/status_t.hpp>
#include <imuscope/virtual_imu_t.hpp>
#include <lcm/lcm-cpp.hpp>
#include <map>
#include <regex>
#include <sstream>

#include "demo_vehicle.h"
#include "logs/mcap/reader.h"
#include "logs/mcap/ros_messages.h"
#include "mounting_compare.h"
#include "programs.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

using Eigen::Vector3d;
constexpr double kDeg = 180.0 / 3.14159265358979323846;
constexpr int kRun_s = 60;

/// Everything that was published, as it came.
struct Listener {
  std::vector<status_t> statuses;
  std::vector<navigation_t> navigations;
  std::map<std::string, std::vector<calibration_t>> calibrations;
  std::map<std::string, std::vector<error_row_t>> errors;
  std::vector<noise_model_t> models;
  std::map<std::string, std::vector<dynamics_t>> dynamics;

  void on_status(const lcm::ReceiveBuffer*, const std::string&, const status_t* m) { statuses.push_back(*m); }
  void on_navigation(const lcm::ReceiveBuffer*, const std::string&, const navigation_t* m) {
    navigations.push_back(*m);
  }
  void on_calibration(const lcm::ReceiveBuffer*, const std::string&, const calibration_t* m) {
    calibrations[m->name].push_back(*m);
  }
  void on_error(const lcm::ReceiveBuffer*, const std::string&, const error_t* m) {
    auto& rows = errors[m->name];
    rows.insert(rows.end(), m->rows.begin(), m->rows.end());
  }
  void on_model(const lcm::ReceiveBuffer*, const std::string&, const noise_model_t* m) {
    models.push_back(*m);
  }
  void on_dynamics(const lcm::ReceiveBuffer*, const std::string& channel, const dynamics_t* m) {
    dynamics[channel].push_back(*m);
  }
};

struct TruthRow {
  double time_s, lat_deg, lon_deg, height_m, v_n, v_e, v_d, roll_deg, pitch_deg, heading_deg;
};

std::vector<TruthRow> read_truth(const std::filesystem::path& file) {
  std::vector<TruthRow> rows;
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  while (std::getline(in, line)) {
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream fields(line);
    TruthRow r{};
    fields >> r.time_s >> r.lat_deg >> r.lon_deg >> r.height_m >> r.v_n >> r.v_e >> r.v_d >> r.roll_deg >>
        r.pitch_deg >> r.heading_deg;
    rows.push_back(r);
  }
  return rows;
}

/// The S-IMU's sample counter in each row of an error process.
std::vector<std::int64_t> counters_of(const std::filesystem::path& file) {
  std::vector<std::int64_t> counters;
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  EXPECT_EQ(line.rfind("time_s,utc_s,counter,", 0), 0U) << line;
  while (std::getline(in, line))
    counters.push_back(std::stoll(line.substr(line.find(',', line.find(',') + 1) + 1)));
  return counters;
}

/// What a log of LCM events has on a channel, as it was sent.
std::vector<std::vector<std::uint8_t>> messages_in(const std::filesystem::path& file,
                                                   const std::string& channel) {
  std::vector<std::vector<std::uint8_t>> messages;
  lcm::LogFile log(file.string(), "r");
  EXPECT_TRUE(log.good()) << file;
  while (const lcm::LogEvent* event = log.readNextEvent()) {
    const auto* bytes = static_cast<const std::uint8_t*>(event->data);
    if (event->channel == channel) messages.emplace_back(bytes, bytes + event->datalen);
  }
  return messages;
}

/// The demo's configuration with its ports in `folder`, a refit every 15 s, regimes that a person names, and a
/// virtual IMU of two unlike thirds.
std::filesystem::path configuration_in(const std::filesystem::path& folder) {
  return DemoVehicle()
      .ports_in(folder / "ports")
      .set("noise.refit_interval_s", 15.0)
      .set("regimes.by", "labels")
      .set("record.mcap", true)
      .set("virtual_imu.imus", std::vector<std::string>{"mtx1", "mtx3"})
      .set("virtual_imu.gyro_x", std::vector<double>{0.25, 0.75})
      .write(folder / "live.toml");
}

double wrapped_deg(double angle) { return std::remainder(angle, 360.0); }

class LiveRun : public testing::Test {
 protected:
  void SetUp() override {
    if (unshare(CLONE_NEWNET) != 0) GTEST_SKIP() << "a private network namespace needs root";
    ASSERT_EQ(std::system("ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo"), 0);
  }

  void listen(lcm::LCM& bus) {
    // Clients of live data keep short queues; this one wants every message.
    constexpr int kQueue = 1000;
    bus.subscribe("IMUSCOPE_STATUS", &Listener::on_status, &heard_);
    bus.subscribe("IMUSCOPE_NAVIGATION", &Listener::on_navigation, &heard_);
    bus.subscribe("IMUSCOPE_CALIBRATION_.*", &Listener::on_calibration, &heard_)->setQueueCapacity(kQueue);
    bus.subscribe("IMUSCOPE_ERROR_.*", &Listener::on_error, &heard_)->setQueueCapacity(kQueue);
    bus.subscribe("IMUSCOPE_NOISE_MODEL_.*", &Listener::on_model, &heard_);
    bus.subscribe("IMUSCOPE_DYNAMICS_.*", &Listener::on_dynamics, &heard_);
  }

  void check_status() {
    ASSERT_GE(heard_.statuses.size(), static_cast<std::size_t>(kRun_s - 10));
    const auto& status = heard_.statuses[heard_.statuses.size() - 3];
    EXPECT_EQ(status.state, "running") << status.reason;
    ASSERT_EQ(status.n_devices, 5);
    // While an MTx is set up its counter runs on: losses count from the moment in which all devices stream.
    const auto streaming =
        std::find_if(heard_.statuses.begin(), heard_.statuses.end(), [](const status_t& s) {
          return std::all_of(s.devices.begin(), s.devices.end(),
                             [](const device_status_t& device) { return device.state == "streaming"; });
        });
    ASSERT_LT(streaming - heard_.statuses.begin(), 20);
    for (std::size_t i = 0; i < 5; ++i) {
      const auto& device = status.devices[i];
      EXPECT_EQ(device.state, "streaming") << device.name << ": " << device.problem;
      EXPECT_EQ(device.samples_lost, streaming->devices[i].samples_lost) << device.name;
      EXPECT_EQ(device.samples_refused, 0) << device.name;
      EXPECT_EQ(device.bad_checksums, 0) << device.name;
    }
    EXPECT_EQ(status.capture_lost, 0);
  }

  void check_navigation(const nlohmann::json& truth, const std::vector<TruthRow>& rows) {
    ASSERT_GE(heard_.navigations.size(), static_cast<std::size_t>(5 * kRun_s));
    const auto& nav = heard_.navigations.back();
    // Truth is written ten times a second, on the tags of the R-IMU's epochs; the message between two of them
    // is compared with a straight line.
    std::tm utc{};
    std::istringstream text(truth.at("t0_utc").get<std::string>());
    text >> std::get_time(&utc, "%Y-%m-%dT%H:%M:%S");
    const std::string fraction =
        std::regex_replace(truth.at("t0_utc").get<std::string>(), std::regex(".*(\\.[0-9]+)Z"), "0$1");
    const double t_s =
        static_cast<double>(nav.utime) * 1e-6 - static_cast<double>(timegm(&utc)) - std::stod(fraction);
    ASSERT_GT(t_s, 0.0);
    const auto next =
        std::find_if(rows.begin(), rows.end(), [&](const TruthRow& row) { return row.time_s > t_s; });
    ASSERT_NE(next, rows.end());
    ASSERT_NE(next, rows.begin());
    const auto& a = *(next - 1);
    const auto& b = *next;
    const double u = (t_s - a.time_s) / (b.time_s - a.time_s);
    constexpr double kMetresPerDeg = 111'200.0;
    const double north_m = (nav.lat_deg - (a.lat_deg + u * (b.lat_deg - a.lat_deg))) * kMetresPerDeg;
    const double east_m = (nav.lon_deg - (a.lon_deg + u * (b.lon_deg - a.lon_deg))) * kMetresPerDeg *
                          std::cos(nav.lat_deg / kDeg);
    // RTK of 1 cm; the straight line over 0.1 s is good to 2.5 m/s^2 * 0.1^2 / 8 = 3 mm.
    EXPECT_LT(std::hypot(north_m, east_m), 0.06);
    EXPECT_LT(std::abs(nav.height_m - (a.height_m + u * (b.height_m - a.height_m))), 0.10);
    EXPECT_LT(std::abs(wrapped_deg(nav.heading_deg - a.heading_deg -
                                   u * wrapped_deg(b.heading_deg - a.heading_deg))),
              0.3);
  }

  void check_calibration(const nlohmann::json& imu) {
    const std::string name = imu.at("name");
    const auto& messages = heard_.calibrations[name];
    ASSERT_GE(messages.size(), 100U) << name;
    for (std::size_t i = 1; i < messages.size(); ++i)
      ASSERT_EQ(messages[i].sequence, messages[i - 1].sequence + 1);
    const auto& c = messages.back();
    const Vector3d psi_deg =
        kDeg * rotation_between_b(matrix_of(imu.at("C_b_s")),
                                  Eigen::Quaterniond(c.q_w, c.q_x, c.q_y, c.q_z).toRotationMatrix());
    constexpr double kSds = 4.0;
    EXPECT_LT(std::abs(psi_deg[0]), kSds * c.sd_psi_x_deg) << name;
    EXPECT_LT(std::abs(psi_deg[1]), kSds * c.sd_psi_y_deg) << name;
    EXPECT_LT(std::abs(psi_deg[2]), kSds * c.sd_psi_z_deg) << name;
    EXPECT_LT(c.sd_psi_z_deg, 0.2) << name << ": half a minute of driving shows more than that";
    const Vector3d r_m = vector_of(imu.at("r_bs_b_m"));
    EXPECT_LT(std::abs(c.r_x_m - r_m[0]), kSds * c.sd_r_x_m) << name;
    EXPECT_LT(std::abs(c.r_y_m - r_m[1]), kSds * c.sd_r_y_m) << name;
    EXPECT_LT(std::abs(c.r_z_m - r_m[2]), kSds * c.sd_r_z_m) << name;
    // The pace of the pseudo-terminals adds up to some milliseconds of a loaded machine's scheduling.
    EXPECT_NEAR(c.t_d_ms, imu.at("t_d_s").get<double>() * 1e3, 5.0) << name;
  }

  void check_errors(const nlohmann::json& imu, const std::filesystem::path& folder) {
    const std::string name = imu.at("name");
    const auto& rows = heard_.errors[name];
    ASSERT_GE(rows.size(), 1500U) << name;
    Vector3d mean = Vector3d::Zero();
    for (const auto& row : rows) mean += Vector3d(row.e_gyro_x_radps, row.e_gyro_y_radps, row.e_gyro_z_radps);
    mean /= static_cast<double>(rows.size());
    // The S bias is in the error, not taken out of it: turn-on bias plus a Gauss-Markov process of 0.1 deg/s
    // (4 sd).
    const Vector3d bias = vector_of(imu.at("gyro_bias_radps"));
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(mean[i] * kDeg, bias[i] * kDeg, 0.4) << name << " axis " << i;
    // Every row that the service wrote was published, from the first one heard to the last.
    const auto written = counters_of(folder / ("errors_" + name + ".csv"));
    const auto first = std::find(written.begin(), written.end(), rows.front().counter);
    ASSERT_GE(written.end() - first, static_cast<std::ptrdiff_t>(rows.size())) << name;
    for (std::size_t i = 0; i < rows.size(); ++i)
      ASSERT_EQ(first[static_cast<std::ptrdiff_t>(i)], rows[i].counter) << name;
    // None is missing but those for which the reference came too late, which the service counts: a machine
    // that holds the simulator back for a tenth of a second does that.
    std::int64_t lost = 0;
    for (std::size_t i = 1; i < rows.size(); ++i) lost += rows[i].counter - rows[i - 1].counter - 1;
    const auto run = read_json(folder / "run.json");
    const auto& devices = run.at("devices");
    const auto own = std::find_if(devices.begin(), devices.end(),
                                  [&](const nlohmann::json& device) { return device.at("name") == name; });
    ASSERT_NE(own, devices.end()) << name;
    const auto late = own->at("late").get<std::int64_t>();
    EXPECT_LE(lost, late) << name;
    constexpr std::int64_t kLateMax = 50;  // half a second of the minute
    EXPECT_LE(late, kLateMax) << name;
  }

  void check_models() {
    ASSERT_FALSE(heard_.models.empty());
    const auto& models = heard_.models.back().models;
    const auto found = std::find_if(models.begin(), models.end(), [](const axis_noise_model_t& m) {
      return m.axis == "gyro_x" && m.regime == "dynamic";
    });
    ASSERT_NE(found, models.end());
    EXPECT_EQ(found->model, "WN+2*GM");
    // The first level's wavelet variance is half the variance of the fast part: Table II's white noise in
    // motion, 0.654 (deg/s)^2. 1500 samples and more know it to 4 %, and the fit follows.
    ASSERT_FALSE(found->fitted.empty());
    const double white_deg2 = 2.0 * found->fitted.front() * kDeg * kDeg;
    EXPECT_NEAR(white_deg2, 0.654, 0.15 * 0.654);
  }

  static void check_dynamics(const std::string& channel, const std::vector<dynamics_t>& messages) {
    SCOPED_TRACE(channel);
    for (std::size_t i = 1; i < messages.size(); ++i)
      EXPECT_EQ(messages[i].sequence, messages[i - 1].sequence + 1);
    const dynamics_t& last = messages.back();
    std::string capitals = last.name;
    for (char& c : capitals) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    EXPECT_EQ("IMUSCOPE_DYNAMICS_" + capitals, channel);
    EXPECT_GT(last.n_dynamic, 500);
    ASSERT_EQ(last.n_covariates, 15);
    const auto& omega_z = last.covariates[2];
    EXPECT_EQ(omega_z.name + " " + omega_z.unit, "omega_z rad/s");
    EXPECT_GT(omega_z.rms, 0.02) << "the vehicle turns";
    EXPECT_GE(omega_z.largest, omega_z.rms);
    const auto& f_z = last.covariates[11];
    EXPECT_EQ(f_z.name + " " + f_z.unit, "f_z m/s^2");
    // mtx3 hangs upside down; the others' third axes point down as that of b does.
    EXPECT_NEAR(f_z.mean, last.name == "mtx3" ? 9.8 : -9.8, 0.3) << "specific force on the road";
    ASSERT_EQ(last.n_axes, 6);
    for (const auto& axis : last.axes) {
      EXPECT_GT(axis.r2, 0.0) << axis.axis;
      EXPECT_LT(axis.r2, 1.0) << axis.axis;
      EXPECT_GT(axis.f, 0.0) << axis.axis;
      EXPECT_GE(axis.p_value, 0.0) << axis.axis;
      EXPECT_LE(axis.p_value, 1.0) << axis.axis;
    }
  }

  /// What a person named while the run was recorded becomes the regimes of its study.
  static void check_labels(const std::filesystem::path& folder) {
    const auto out = folder / "study";
    ASSERT_EQ(run_program("imuscope",
                          {"process", (folder / "live" / "capture.lcm").string(), "--out", out.string()},
                          folder / "process.log"),
              0)
        << read_text(folder / "process.log");
    const auto regimes = read_json(out / "regimes.json");
    EXPECT_EQ(regimes.at("by"), "labels");
    ASSERT_EQ(regimes.at("regimes").size(), 1U);
    EXPECT_EQ(regimes.at("regimes")[0].at("name"), "town");
    const double town_s = regimes.at("regimes")[0].at("total_s").get<double>();
    EXPECT_GT(town_s, 1.0);
    EXPECT_LT(town_s, static_cast<double>(kRun_s));
    std::ifstream in(out / "errors_mtx1.csv");
    std::map<std::string, int> rows;
    std::string line;
    std::getline(in, line);
    while (std::getline(in, line)) ++rows[line.substr(line.rfind(',') + 1)];
    EXPECT_NEAR(rows["town"], 100.0 * town_s, 3.0);
    EXPECT_GT(rows[""], 100) << "before and after nothing was named";
  }

  /// run.mcap holds every sample that the run decoded, what was published, and corrected samples that show
  /// the reference's motion.
  void check_bag(const std::filesystem::path& live) {
    auto reader = mcap::Reader::open(live / "run.mcap");
    ASSERT_TRUE(reader) << reader.error().text();
    std::map<std::string, std::int64_t> counts;
    std::map<std::int64_t, Vector3d> reference;
    std::vector<std::pair<std::int64_t, Vector3d>> corrected;
    while (const auto message = reader->next()) {
      const std::string& topic = message->topic->name;
      ++counts[topic];
      mcap::Imu imu;
      if (topic == "/imu/airins/raw" && mcap::read(message->data, imu)) {
        const auto& w = imu.angular_velocity;
        reference[imu.header.stamp_ns] = Vector3d(w[0], -w[1], -w[2]);
      }
      if (topic == "/imu/mtx1/corrected" && mcap::read(message->data, imu)) {
        corrected.emplace_back(imu.header.stamp_ns, Vector3d(imu.angular_velocity.data()));
        EXPECT_GT(imu.angular_velocity_covariance[0], 0.0);
      }
    }
    EXPECT_TRUE(reader->losses().empty()) << reader->losses().front();
    const auto run = read_json(live / "run.json");
    for (const auto& device : run.at("devices")) {
      const auto name = device.at("name").get<std::string>();
      if (device.at("role") != "study") continue;
      EXPECT_EQ(counts["/imu/" + name + "/raw"], device.at("samples").get<std::int64_t>()) << name;
    }
    EXPECT_GE(counts["/imuscope/status"], static_cast<std::int64_t>(heard_.statuses.size()));
    EXPECT_GE(counts["/imuscope/navigation"], static_cast<std::int64_t>(heard_.navigations.size()));
    EXPECT_EQ(counts["/imuscope/navigation"], counts["/navigation/odometry"]);
    EXPECT_GE(counts["/imuscope/calibration/mtx1"],
              static_cast<std::int64_t>(heard_.calibrations["mtx1"].size()));
    EXPECT_GT(counts["/imuscope/noise_model/mtx1"], 0);
    EXPECT_GT(counts["/tf_static"], 3);
    EXPECT_GT(counts["/gnss/gnss/fix"], 400);
    // In the last ten seconds the mounting is known: the mean difference is the noise's, whose sd is 0.65
    // deg/s.
    ASSERT_GT(corrected.size(), 1500U);
    Vector3d sum = Vector3d::Zero();
    Vector3d turns = Vector3d::Zero();
    int n = 0;
    for (auto it = corrected.end() - 1000; it != corrected.end(); ++it) {
      const auto near = reference.lower_bound(it->first);
      if (near == reference.end()) continue;
      sum += it->second - near->second;
      turns += near->second.cwiseAbs();
      ++n;
    }
    ASSERT_GT(n, 900);
    EXPECT_LT((sum / n).norm(), 0.3 / kDeg) << sum.transpose() / n;
    EXPECT_GT(turns.norm() / n, 0.5 / kDeg) << "the vehicle moved";
  }

  /// The virtual IMU shows the reference's motion and the mean of its IMUs' biases, in b; the replay sends what the
  /// live run sent, to the bit.
  static void check_virtual_imu(const nlohmann::json& truth, const std::filesystem::path& folder) {
    const auto live = messages_in(folder / "live" / "capture.lcm", "IMUSCOPE_VIRTUAL");
    EXPECT_TRUE(live == messages_in(folder / "replay.events", "IMUSCOPE_VIRTUAL"));
    std::map<std::string, Vector3d> bias_b;
    std::map<std::string, Vector3d> place_b;
    for (const auto& imu : truth.at("imus")) {
      bias_b[imu.at("name")] = matrix_of(imu.at("C_b_s")).transpose() * vector_of(imu.at("gyro_bias_radps"));
      place_b[imu.at("name")] = vector_of(imu.at("r_bs_b_m"));
    }
    Vector3d sum = Vector3d::Zero();
    std::size_t rows = 0;
    virtual_imu_t last{};
    for (const auto& bytes : live) {
      ASSERT_GT(last.decode(bytes.data(), 0, static_cast<int>(bytes.size())), 0);
      for (const auto& row : last.rows) {
        if (!std::isfinite(row.e_gyro_x_radps)) continue;
        sum += Vector3d(row.e_gyro_x_radps, row.e_gyro_y_radps, row.e_gyro_z_radps);
        ++rows;
      }
    }
    ASSERT_GT(rows, 1500U);
    const Vector3d mean = sum / static_cast<double>(rows);
    const Vector3d of_mtx1(0.25, 0.5, 0.5);
    const Vector3d expected =
        of_mtx1.cwiseProduct(bias_b["mtx1"]) + (Vector3d::Ones() - of_mtx1).cwiseProduct(bias_b["mtx3"]);
    // As of each IMU alone, by the root of two less: 4 sd of turn-on bias and wandering bias.
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(mean[i] * kDeg, expected[i] * kDeg, 0.3) << i;
    for (int i = 0; i < 3; ++i)
      EXPECT_NEAR(last.place_of_x_m[i], 0.5 * (place_b["mtx1"][i] + place_b["mtx3"][i]), 0.1) << i;
  }

  /// Attachments stand in the file as they are: those of the whole run, made when it had ended.
  void check_attachments(const std::filesystem::path& live) {
    const std::string bag = read_text(live / "run.mcap");
    for (const char* name : {"calibration.json", "run.json", "models.json", "report.html"}) {
      const std::string document = read_text(live / name);
      EXPECT_GT(document.size(), 100U) << name;
      EXPECT_NE(bag.find(document), std::string::npos) << name << " is not attached, or not as it is";
    }
    EXPECT_TRUE(read_json(live / "run.json").at("findings").is_array());
  }

  Listener heard_;
};

/// As a person does from another terminal.
void mark(lcm::LCM& bus, std::int64_t sequence, const std::string& text) {
  event_t event{};
  event.sequence = sequence;
  event.source = "test";
  event.text = text;
  bus.publish("IMUSCOPE_EVENT", &event);
}

TEST_F(LiveRun, PublishesWhatTheSimulatorKnowsAndReplaysToTheSameFiles) {
  const auto folder = scratch_folder();
  const auto configuration = configuration_in(folder);
  const auto truth_folder = folder / "truth";
  lcm::LCM bus("udpm://239.255.76.67:7667?ttl=0");
  ASSERT_TRUE(bus.good());
  listen(bus);

  BackgroundProgram vehicle("imusim",
                            {"live", configuration.string(), "--skip-static", "--seconds",
                             std::to_string(kRun_s + 30), "--out", truth_folder.string()},
                            folder / "imusim.log");
  BackgroundProgram service("imuscope", {"run", configuration.string(), "--out", (folder / "live").string()},
                            folder / "imuscope.log");
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(kRun_s);
  const auto town = end - std::chrono::seconds(20);
  const auto left_town = end - std::chrono::seconds(8);
  std::int64_t marked = 0;
  for (auto now = std::chrono::steady_clock::now(); now < end; now = std::chrono::steady_clock::now()) {
    bus.handleTimeout(100);
    if (marked == 0 && now >= town) mark(bus, marked++, "regime town");
    if (marked == 1 && now >= left_town) mark(bus, marked++, "regime end");
  }
  service.interrupt();
  ASSERT_EQ(service.wait(), 0) << read_text(folder / "imuscope.log");
  while (bus.handleTimeout(200) > 0) {
  }
  vehicle.interrupt();
  vehicle.wait();

  const auto truth = read_json(truth_folder / "truth.json");
  SCOPED_TRACE(read_text(folder / "imuscope.log"));
  check_status();
  check_navigation(truth, read_truth(truth_folder / "truth.csv"));
  for (const auto& imu : truth.at("imus")) {
    check_calibration(imu);
    check_errors(imu, folder / "live");
  }
  check_models();
  check_bag(folder / "live");
  check_attachments(folder / "live");
  // The modeller runs when nothing else wants to: on a loaded machine the last S-IMU's turn may come too
  // late.
  ASSERT_FALSE(heard_.dynamics.empty());
  for (const auto& [channel, messages] : heard_.dynamics) check_dynamics(channel, messages);
  check_labels(folder);

  // The recording gives the same estimates, to the last digit of every file.
  ASSERT_EQ(run_program(
                "imuscope",
                {"replay", (folder / "live" / "capture.lcm").string(), "--out", (folder / "replay").string(),
                 "--lcm", "file://" + (folder / "replay.events").string() + "?mode=w"},
                folder / "replay.log"),
            0)
      << read_text(folder / "replay.log");
  for (const char* name :
       {"navigation.csv", "calibration_mtx1.csv", "calibration_mtx2.csv", "calibration_mtx3.csv",
        "errors_mtx1.csv", "errors_mtx2.csv", "errors_mtx3.csv", "calibration.json"}) {
    const auto live = read_text(folder / "live" / name);
    EXPECT_GT(live.size(), 1000U) << name;
    EXPECT_TRUE(live == read_text(folder / "replay" / name))
        << name << " differs between live run and replay";
  }
  check_virtual_imu(truth, folder);
}

}  // namespace
}  // namespace imuscope::test
