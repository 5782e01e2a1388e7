/// What a sample of an S-IMU costs behind the estimator: in the modeller (wavelet variance and refits) and in
/// the publisher (a line of its file, a row of its message, the message), at the rates that sensors have and
/// for one and six of them. The ratio is that to one S-IMU at 100 Hz in the same run.

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdlib>
#include <ctime>
#include <random>
#include <string>
#include <vector>

#include "configuration/config.h"
#include "models/noise/model.h"
#include "publish/lcm_publisher.h"
#include "service/pipeline/live_models.h"
#include "service/run/broadcast.h"
#include "service/run/run_folder.h"
#include "tools/benchmarks/bench_report.h"
#include "tools/benchmarks/own_folder.h"

namespace {

using namespace imuscope;

constexpr double kRefitEvery_s = 60.0;

Configuration vehicle(int studies, double rate_hz) {
  std::string text =
      "[run]\nname = \"cost\"\n[[device]]\nname = \"reference\"\nrole = \"reference\"\nprotocol = "
      "\"ixblue_stdbin\"\n";
  for (int i = 0; i < studies; ++i) {
    text += fmt::format(
        "[[device]]\nname = \"imu{}\"\nrole = \"study\"\nprotocol = \"ixblue_stdbin\"\nrate_hz = {:.1f}\n", i,
        rate_hz);
  }
  auto read = parse_configuration(text, "cost.toml");
  if (!read) throw std::runtime_error(read.error().text());
  return std::move(*read);
}

double thread_time_s() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Rows as they come: white noise, all devices sample by sample, a drive that is a motion throughout.
class Rows {
 public:
  Rows(int studies, double rate_hz) : studies_(studies), rate_hz_(rate_hz) {}

  template <typename Take>
  void give(double seconds, const Take& take) {
    const auto n = static_cast<std::int64_t>(seconds * rate_hz_);
    for (std::int64_t k = 0; k < n; ++k) {
      for (int i = 0; i < studies_; ++i) {
        ErrorRecord record{};
        record.study = static_cast<std::size_t>(i);
        record.row.time = HostTime{from_seconds(1000.0 + static_cast<double>(k) / rate_hz_)};
        record.row.utc = {UtcTime{std::chrono::seconds(1'773'480'600)} + record.row.time.time_since_epoch(),
                          18, true};
        record.row.counter = k;
        record.row.regime = Regime::kDynamic;
        record.row.gyro_valid = record.row.accel_valid = true;
        for (auto* vector : {&record.row.e_gyro_radps, &record.row.e_accel_mps2,
                             &record.row.predicted_omega_s_radps, &record.row.predicted_f_s_mps2}) {
          for (double& component : *vector) component = noise_[next_++ % noise_.size()];
        }
        record.row.predicted_f_s_mps2[2] -= 9.81;
        record.speed = VehicleSpeed{};
        record.first_reference_time = HostTime{std::chrono::seconds(1000)};
        take(record);
      }
    }
  }

 private:
  static std::vector<double> drawn() {
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal(0.0, 0.01);
    std::vector<double> noise(100'003);
    for (double& value : noise) value = normal(random);
    return noise;
  }
  int studies_;
  double rate_hz_;
  std::vector<double> noise_ = drawn();
  std::size_t next_ = 0;
};

double modeller_ns(int studies, double rate_hz, double seconds) {
  const Configuration configuration = vehicle(studies, rate_hz);
  const auto spec = noise::parse_model(configuration.noise.model);
  std::size_t refits = 0;
  LiveModels models(configuration, *spec, [&](const Refit&) { ++refits; });
  models.set_options(*spec, kRefitEvery_s);
  Rows rows(studies, rate_hz);
  const double begin_s = thread_time_s();
  rows.give(seconds, [&](const ErrorRecord& record) { models.add(record); });
  models.finish();
  return (thread_time_s() - begin_s) * 1e9 / (seconds * rate_hz * studies);
}

double publisher_ns(int studies, double rate_hz, double seconds, const std::filesystem::path& scratch) {
  const Configuration configuration = vehicle(studies, rate_hz);
  const bench::OwnFolder own(scratch);
  std::vector<SImuFileInfo> infos;
  for (const auto index : configuration.study_indices())
    infos.push_back({configuration.devices[index].name, 0.0});
  auto folder = RunFolder::create(own.path() / "run", infos, true);
  if (!folder) throw std::runtime_error(folder.error().text());
  Broadcast broadcast(configuration);
  broadcast.open(LcmPublisher::unconnected("COST"), false);
  Rows rows(studies, rate_hz);
  const double begin_s = thread_time_s();
  rows.give(seconds, [&](const ErrorRecord& record) {
    (*folder)->on_error(record);
    broadcast.on_error(record);
  });
  broadcast.finish();
  const double ns = (thread_time_s() - begin_s) * 1e9 / (seconds * rate_hz * studies);
  if (auto closed = (*folder)->close(); !closed) throw std::runtime_error(closed.error().text());
  return ns;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"What a sample costs in the modeller and in the publisher, by rate and number of S-IMUs"};
  std::string json;
  int rounds = 3;
  double seconds = 130.0;
  std::string scratch = std::filesystem::temp_directory_path().string();
  app.add_option("--json", json, "writes the rows there");
  app.add_option("--rounds", rounds, "medians of so many");
  app.add_option("--seconds", seconds, "of samples; beyond 120 there are two refits");
  app.add_option("--scratch", scratch, "where a folder is made, and removed again");
  CLI11_PARSE(app, argc, argv);
  try {
    std::vector<bench::Row> table;
    for (const char* part : {"modeller", "publisher"}) {
      double one_at_100_hz = 0.0;
      for (const int studies : {1, 6}) {
        for (const double rate_hz : {100.0, 400.0, 1000.0, 2000.0}) {
          std::vector<double> costs;
          for (int round = 0; round < rounds; ++round) {
            costs.push_back(part[0] == 'm' ? modeller_ns(studies, rate_hz, seconds)
                                           : publisher_ns(studies, rate_hz, seconds, scratch));
          }
          const double ns = bench::median(costs);
          if (one_at_100_hz == 0.0) one_at_100_hz = ns;
          bench::Row row;
          row.group = "rows";
          row.what = fmt::format("a sample in the {}, {} S-IMU{} at {:.0f} Hz", part, studies,
                                 studies > 1 ? "s" : "", rate_hz);
          row.ratio = ns / one_at_100_hz;
          row.against = "x one S-IMU at 100 Hz";
          row.value = ns;
          row.reference = one_at_100_hz;
          row.unit = "ns";
          table.push_back(row);
        }
      }
    }
    return bench::finish(table, json);
  } catch (const std::exception& error) {
    fmt::print(stderr, "row_cost: {}\n", error.what());
    return 1;
  }
}
