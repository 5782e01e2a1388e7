/// From raw bytes to noise models, many times: simulated devices write their byte streams on drives with a
/// stop a minute, `imuscope process` studies them, and what it says of the white noise of every axis, static
/// and dynamic, is held against the simulator's truth. An end that is not given is open.
///
///   noise_through_bytes [--drives 20] [--minutes 15] [--config config/demo.toml] [--world ideal|harsh]
///                       [--results FILE]
///
/// Exits 1 where a band is missed.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "goal_counts.h"
#include "tools/benchmarks/own_folder.h"

namespace {

namespace fs = std::filesystem;
using imuscope::Counts;
using nlohmann::json;

struct Options {
  int drives = 20;
  double minutes = 15.0;
  std::string config = "config/demo.toml";
  std::string world = "ideal";
  std::string results;
  std::string folder = fs::temp_directory_path().string();
  fs::path programs = fs::read_symlink("/proc/self/exe").parent_path();
};

void call(const std::string& command) {
  if (std::system((command + " >/dev/null").c_str()) != 0)
    throw std::runtime_error("this failed: " + command);
}

json read(const fs::path& file) {
  std::ifstream in(file);
  return json::parse(in);
}

/// The white noise of an axis in a regime, as a list of parameters has it.
const json* white_of(const json& entry) {
  for (const json& p : entry.at("parameters")) {
    if (p.at("process") == "WN" && p.at("name") == "sigma2") return &p;
  }
  return nullptr;
}

std::optional<double> true_white(const json& truth, const json& model) {
  for (const json& imu : truth.at("imus")) {
    if (imu.at("name") != model.at("name")) continue;
    for (const json& noise : imu.at("noise")) {
      if (noise.at("axis") != model.at("axis") || noise.at("regime") != model.at("regime")) continue;
      if (const json* p = white_of(noise)) return p->at("value").get<double>();
    }
  }
  return std::nullopt;
}

void add(const json& models, const json& truth, Counts& counts) {
  for (const json& model : models.at("models")) {
    const auto value = true_white(truth, model);
    const json* p = white_of(model);
    if (!value || p == nullptr) continue;
    const json& low = p->at("ci_low");
    const json& high = p->at("ci_high");
    const std::string name = fmt::format("{}.{}", model.at("regime").get<std::string>(),
                                         model.at("axis").get<std::string>().substr(0, 4));
    const bool told = !low.is_null() || !high.is_null();
    const bool held =
        (low.is_null() || low.get<double>() <= *value) && (high.is_null() || *value <= high.get<double>());
    imuscope::count(counts, name + ".told", told);
    imuscope::count(counts, name, held);
    if (told) imuscope::count(counts, model.at("regime").get<std::string>() + ".of_told", held);
  }
}

Counts drive(const Options& options, int number) {
  const bench::OwnFolder own(options.folder);
  const fs::path recording = own.path() / "recording";
  const fs::path out = own.path() / "run";
  call(fmt::format("'{}' record '{}' --minutes {} --seed {} --world {} --out '{}'",
                   (options.programs / "imusim").string(), options.config, options.minutes, number + 1,
                   options.world, recording.string()));
  call(fmt::format("'{}' process '{}' --out '{}' 2>/dev/null", (options.programs / "imuscope").string(),
                   (recording / "capture.lcm").string(), out.string()));
  Counts counts;
  add(read(out / "models.json"), read(recording / "truth.json"), counts);
  return counts;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"From raw bytes to noise models, many times, against the simulator's truth"};
  Options options;
  app.add_option("--drives", options.drives, "how many")->check(CLI::PositiveNumber);
  app.add_option("--minutes", options.minutes, "length of each drive");
  app.add_option("--config", options.config, "what is simulated")->check(CLI::ExistingFile);
  app.add_option("--world", options.world, "ideal, or harsh: crooked sensors, engine vibration, odd clocks")
      ->check(CLI::IsMember({"ideal", "harsh"}));
  app.add_option("--results", options.results, "keep counts here, and go on from there")->type_name("FILE");
  app.add_option("--folder", options.folder,
                 "where a folder for one recording at a time (100 MB) is made, and removed again");
  CLI11_PARSE(app, argc, argv);
  try {
    const std::string cell = fmt::format("{}/{:g}min", options.world, options.minutes);
    imuscope::Results results(options.results);
    while (results.done(cell) < options.drives) {
      const int number = results.done(cell);
      results.keep(cell, number + 1, drive(options, number));
    }
    const std::vector<imuscope::Band> bands{{"static.gyro", 91.0, 99.5},    {"static.acce", 91.0, 99.5},
                                            {"dynamic.gyro", 91.0, 99.5},   {"dynamic.acce", 91.0, 99.5},
                                            {"static.of_told", 93.0, 97.0}, {"dynamic.of_told", 93.0, 97.0}};
    return imuscope::judge(cell, bands, results.counts(cell)) ? 0 : 1;
  } catch (const std::exception& error) {
    fmt::print(stderr, "noise_through_bytes: {}\n", error.what());
    return 1;
  }
}
