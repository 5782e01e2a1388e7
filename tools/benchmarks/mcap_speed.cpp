/// A quarter of an hour of three S-IMUs and the reference as an MCAP file, out and in: 360,000
/// sensor_msgs/Imu and 10 Hz of everything else. The ratio is that to the CRC of the same bytes alone.

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <cmath>
#include <filesystem>
#include <imuscope/calibration_t.hpp>
#include <imuscope/navigation_t.hpp>
#include <random>
#include <string>
#include <vector>

#include "base/output_folder.h"
#include "logs/bag/bag_writer.h"
#include "logs/bag/message_json.h"
#include "logs/mcap/reader.h"
#include "logs/mcap/ros_messages.h"
#include "tools/benchmarks/bench_report.h"

namespace {

using namespace imuscope;

constexpr double kRate_hz = 100.0;
constexpr int kImus = 4;
constexpr double kGoal_s = 1.0;
constexpr const char* kFile = "speed.mcap";

/// Numbers as sensors send them: single precision, and noise in all their digits.
std::vector<double> noise() {
  std::mt19937 random(3);
  std::normal_distribution<float> normal;
  std::vector<double> values(100'003);
  for (double& value : values) value = normal(random);
  return values;
}

/// Takes `seconds` of a drive into a bag.
void fill(bag::BagWriter& writer, double seconds) {
  static const auto kNoise = noise();
  std::size_t next = 0;
  const auto draw = [&](double sd) { return sd * kNoise[next++ % kNoise.size()]; };
  constexpr std::int64_t kBegin_ns = 1'773'480'600'000'000'000;
  const auto n = static_cast<std::int64_t>(seconds * kRate_hz);
  const bag::WhiteVariance variance{{1e-4, 1e-4, 1e-4}, {1e-2, 1e-2, 1e-2}};
  for (std::int64_t k = 0; k < n; ++k) {
    const std::int64_t utc_ns = kBegin_ns + k * 10'000'000 + static_cast<std::int64_t>(draw(1e3));
    for (DeviceIndex device = 0; device < kImus; ++device) {
      Sample sample{};
      sample.kind = SampleKind::kImu;
      sample.device = device;
      sample.imu = ImuData{};
      sample.imu.flags = kGyroValid | kAccelValid;
      for (double& v : sample.imu.omega_radps) v = draw(0.01);
      for (double& v : sample.imu.f_mps2) v = draw(0.1);
      writer.add_sample(sample, utc_ns, variance);
    }
    constexpr int kSamplesPerRow = 10;
    if (k % kSamplesPerRow != 0) continue;
    Sample gnss{};
    gnss.kind = SampleKind::kGnss;
    gnss.device = kImus;
    gnss.gnss =
        GnssData{0.8 + draw(1e-6),     0.1 + draw(1e-6),
                 450.0 + draw(1.0),    {draw(10), draw(10), draw(1)},
                 {0.01, 0.01, 0.02},   {0.02, 0.02, 0.03},
                 GnssSolution::kFixed, kPositionValid | kVelocityValid | kHasPositionSd | kHasVelocitySd};
    writer.add_sample(gnss, utc_ns);
    navigation_t row{};
    row.time_s = static_cast<double>(k) / kRate_hz;
    for (double* v :
         {&row.lat_deg, &row.lon_deg, &row.height_m, &row.v_n_mps, &row.v_e_mps, &row.v_d_mps, &row.roll_deg,
          &row.pitch_deg, &row.heading_deg, &row.sd_n_m, &row.sd_e_m, &row.sd_d_m, &row.sd_v_n_mps,
          &row.sd_v_e_mps, &row.sd_v_d_mps, &row.sd_roll_deg, &row.sd_pitch_deg, &row.sd_heading_deg})
      *v = std::sqrt(2.0) * draw(1.0);
    writer.add_navigation({row.lat_deg,
                           row.lon_deg,
                           row.height_m,
                           {draw(10), draw(10), draw(1)},
                           {draw(1), draw(1), draw(1)},
                           {1, 1, 1},
                           {1, 1, 1},
                           {1, 1, 1}},
                          utc_ns);
    writer.add_message("/imuscope/navigation", "navigation_t", bag::json_of(row), utc_ns);
    for (int i = 1; i < kImus; ++i) {
      calibration_t calibration{};
      for (double* v : {&calibration.psi_x_deg,    &calibration.psi_y_deg,    &calibration.psi_z_deg,
                        &calibration.q_w,          &calibration.q_x,          &calibration.q_y,
                        &calibration.q_z,          &calibration.r_x_m,        &calibration.r_y_m,
                        &calibration.r_z_m,        &calibration.t_d_ms,       &calibration.bg_x_radps,
                        &calibration.bg_y_radps,   &calibration.bg_z_radps,   &calibration.ba_x_mps2,
                        &calibration.ba_y_mps2,    &calibration.ba_z_mps2,    &calibration.sd_psi_x_deg,
                        &calibration.sd_psi_y_deg, &calibration.sd_psi_z_deg, &calibration.sd_r_x_m,
                        &calibration.sd_r_y_m,     &calibration.sd_r_z_m})
        *v = std::sqrt(2.0) * draw(1.0);
      writer.add_message(fmt::format("/imuscope/calibration/imu{}", i), "calibration_t",
                         bag::json_of(calibration), utc_ns);
    }
  }
}

struct Written {
  double time_s = 0.0;
  std::uint64_t messages = 0;
};

Written write(const OutputFolder& folder, mcap::Compression compression, double seconds) {
  Written written;
  const double begun = bench::processor_time_s();
  auto file = folder.begin(kFile);
  if (!file) throw std::runtime_error(file.error().text());
  bag::BagWriter writer({"ros2", "bench", compression, std::size_t{4} << 20U},
                        [&](std::string_view bytes) { file->write(bytes); },
                        {"reference", "imu1", "imu2", "imu3", "gnss"});
  fill(writer, seconds);
  writer.finish();
  if (auto closed = file->close(); !closed) throw std::runtime_error(closed.error().text());
  written.time_s = bench::processor_time_s() - begun;
  written.messages = writer.messages();
  return written;
}

/// Every message read, every IMU's decoded.
double read(const std::filesystem::path& path, std::uint64_t expected, double& crc_s) {
  const double begun = bench::processor_time_s();
  auto reader = mcap::Reader::open(path);
  if (!reader) throw std::runtime_error(reader.error().text());
  std::uint64_t n = 0;
  double sum = 0.0;
  mcap::Imu imu;
  while (const auto message = reader->next()) {
    ++n;
    if (message->topic->schema == "sensor_msgs/msg/Imu" && mcap::read(message->data, imu))
      sum += imu.angular_velocity[0];
  }
  const double time_s = bench::processor_time_s() - begun;
  if (n != expected || !std::isfinite(sum))
    throw std::runtime_error("the file does not hold what was written");
  // The CRC alone, over as many bytes.
  std::uint64_t bytes = 0;
  auto again = mcap::Reader::open(path);
  while (const auto message = again->next()) bytes += message->data.size();
  const std::string block(std::size_t{1} << 20U, 'x');
  const double crc_begun = bench::processor_time_s();
  std::uint32_t value = 0;
  for (std::uint64_t n_bytes = 0; n_bytes < bytes; n_bytes += block.size())
    value = mcap::crc32_of(mcap::bytes_of(block), value);
  if (value == 0) throw std::runtime_error("a CRC of many bytes is hardly zero");
  crc_s = bench::processor_time_s() - crc_begun;
  return time_s;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("A quarter of an hour as an MCAP file, out and in.");
  double minutes = 15.0;
  int rounds = 3;
  std::string scratch = ".";
  std::string json;
  app.add_option("--minutes", minutes, "Of the drive")->check(CLI::Range(0.1, 600.0));
  app.add_option("--rounds", rounds, "Of which the median counts")->check(CLI::Range(1, 100));
  app.add_option("--scratch", scratch, "Folder for the file");
  app.add_option("--json", json, "Write the rows here");
  CLI11_PARSE(app, argc, argv);
  const auto folder = OutputFolder::open(scratch);
  if (!folder) return 1;
  std::vector<bench::Row> rows;
  const auto add = [&](const std::string& what, double time_s, double crc_s, bool has_goal) {
    bench::Row row;
    row.group = "mcap";
    row.what = what;
    row.ratio = time_s / crc_s;
    row.against = "x the CRC alone";
    // The goal is of a quarter of an hour.
    constexpr double kMinutes = 15.0;
    if (has_goal)
      row.goal =
          bench::Goal{bench::Goal::Side::kAtMost, kGoal_s * minutes / kMinutes, bench::Goal::Of::kValue};
    row.value = time_s;
    row.reference = crc_s;
    row.unit = "s";
    rows.push_back(row);
  };
  const double seconds = 60.0 * minutes;
  const auto n_imu = static_cast<int>(kImus * kRate_hz * seconds);
  for (const auto& [name, compression] :
       {std::pair{"zstd", mcap::Compression::kZstd}, std::pair{"lz4", mcap::Compression::kLz4}}) {
    std::vector<double> out_s, in_s, crc_s;
    for (int i = 0; i < rounds; ++i) {
      const auto written = write(*folder, compression, seconds);
      double crc = 0.0;
      in_s.push_back(read(std::filesystem::path(scratch) / kFile, written.messages, crc));
      out_s.push_back(written.time_s);
      crc_s.push_back(crc);
    }
    add(fmt::format("out, {} Imu and 10 Hz of the rest, {}", n_imu, name), bench::median(out_s),
        bench::median(crc_s), true);
    add(fmt::format("in, {} Imu and 10 Hz of the rest, {}", n_imu, name), bench::median(in_s),
        bench::median(crc_s), true);
  }
  folder->remove(kFile);
  return bench::finish(rows, json);
}
