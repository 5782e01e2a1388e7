/// Whole programs from raw bytes: how many times faster than real time a replay and a study of a simulated
/// drive are, what memory they take, and how both grow with the number of S-IMUs and with the length of the
/// drive. Every run is a process of its own, so that its memory is its own; processor time of all its
/// threads, but wall time where threads, or two builds, are compared.

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <limits>
#include <stdexcept>

#include "tools/benchmarks/bench_report.h"
#include "tools/benchmarks/own_folder.h"

namespace {

namespace fs = std::filesystem;

constexpr double kGoalReplay = 830.0;  // times real time, 72 states, without refits
constexpr double kGoalStudy = 90.0;    // a drive of 15 minutes in 10 s, refits and report included

constexpr double kGoalBeside = 1.4;        // times as fast as the program as it was, without refits
constexpr double kGoalTwoThreads = 0.6;    // of one thread's wall time
constexpr double kGoalMemory_mb = 1500.0;  // of a study of ten hours by two threads
constexpr double kGoalReport = 0.05;       // of a study's processor time

struct Cost {
  double processor_s = std::numeric_limits<double>::infinity();
  double wall_s = std::numeric_limits<double>::infinity();
  double memory_mb = 0.0;
};

/// A program that runs without its output.
class Running {
 public:
  explicit Running(const std::vector<std::string>& command)
      : command_(fmt::format("{}", fmt::join(command, " "))) {
    std::vector<char*> arguments;
    for (const std::string& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
    arguments.push_back(nullptr);
    child_ = fork();
    if (child_ < 0) throw std::runtime_error("no process can be started");
    if (child_ != 0) return;
    const int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
    dup2(nowhere, STDOUT_FILENO);
    dup2(nowhere, STDERR_FILENO);
    execv(arguments[0], arguments.data());
    _exit(127);
  }

  /// Waits for its end. Throws where it fails: a benchmark of a failure says nothing.
  Cost cost() const {
    int status = 0;
    rusage usage{};
    if (wait4(child_, &status, 0, &usage) != child_ || !WIFEXITED(status) || WEXITSTATUS(status) != 0)
      throw std::runtime_error("this failed: " + command_);
    const auto seconds = [](const timeval& t) {
      return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
    };
    constexpr double kMbPerKib = 1024.0 * 1e-6;
    const std::chrono::duration<double> wall_s = std::chrono::steady_clock::now() - begun_;
    return {seconds(usage.ru_utime) + seconds(usage.ru_stime), wall_s.count(),
            static_cast<double>(usage.ru_maxrss) * kMbPerKib};
  }

 private:
  std::string command_;
  std::chrono::steady_clock::time_point begun_ = std::chrono::steady_clock::now();
  pid_t child_ = -1;
};

Cost run(const std::vector<std::string>& command) { return Running(command).cost(); }

/// A vehicle with `studies` MTx, a reference and a receiver; noise models refitted every `refit_s`.
std::string configuration(int studies, double refit_s) {
  constexpr const char* kDevice =
      "[[device]]\nname = \"{0}\"\nrole = \"{1}\"\nprotocol = \"{2}\"\nrate_hz = {3}\n{4}\n"
      "transport = {{ kind = \"serial\", port = \"/tmp/imuscope-bench/{0}\", baud = {5} }}\n\n";
  std::string text = fmt::format(
      "[run]\nname = \"bench\"\n\n[estimator]\nstates = \"full\"\n\n[noise]\nrefit_interval_s = {}\n\n",
      refit_s);
  text += fmt::format(kDevice, "airins", "reference", "ixblue_stdbin", 100.0, "axes = \"+x -y -z\"", 460800);
  text +=
      "[device.noise]\ngyro_white_deg_per_sqrt_h = 0.0015\naccel_white_ug_per_sqrt_hz = 10.0\n"
      "gyro_bias_sd_deg_per_h = 0.005\naccel_bias_sd_mps2 = 5e-4\n\n";
  for (int i = 1; i <= studies; ++i)
    text += fmt::format(kDevice, fmt::format("mtx{}", i), "study", "xsens_mt", 100.0, "", 115200);
  text += fmt::format(kDevice, "gnss", "gnss", "greis", 10.0, "antenna_lever_arm_b_m = [-0.50, 0.20, -1.30]",
                      115200);
  text += "[simulation]\nduration_s = 900.0\nseed = 1\n";
  for (int i = 1; i <= studies; ++i) {
    text += fmt::format(
        "[[simulation.imu]]\nname = \"mtx{}\"\nrotation_vector_b_s_deg = [0.8, -1.1, {:.1f}]\n"
        "lever_arm_b_m = [{:.2f}, -0.22, 0.12]\nlatency_ms = {:.1f}\n",
        i, 0.6 + 25.0 * (i - 1), 0.4 - 0.12 * (i - 1), 1.0 + 0.4 * i);
  }
  return text;
}

/// A recorded drive, with and without refits.
struct Drive {
  int studies;
  double minutes;
  fs::path folder;
  std::vector<std::string> inputs;
  fs::path with_refits;
  fs::path without_refits;
};

class Programs {
 public:
  /// @param bin  folder of imuscope and imusim
  Programs(fs::path scratch, fs::path bin) : scratch_(std::move(scratch)), bin_(std::move(bin)) {}

  [[nodiscard]] Drive record(int studies, double minutes) const {
    Drive drive{studies, minutes, scratch_ / fmt::format("drive_{}_{:g}", studies, minutes), {}, {}, {}};
    fs::create_directories(drive.folder);
    const fs::path config = drive.folder / "bench.toml";
    drive.with_refits = config;
    drive.without_refits = drive.folder / "no_refits.toml";
    constexpr double kRefit_s = 60.0;
    constexpr double kNever_s = 1e5;
    write(drive.with_refits, configuration(studies, kRefit_s));
    write(drive.without_refits, configuration(studies, kNever_s));
    run({bin_ / "imusim", "record", config, "--minutes", fmt::format("{:g}", minutes), "--out",
         drive.folder});
    // One of the devices alone would be taken for the whole; the capture is measured on its own.
    for (const auto& file : fs::directory_iterator(drive.folder)) {
      if (file.path().extension() == ".bin")
        drive.inputs.push_back(file.path().stem().string() + "=" + file.path().string());
    }
    std::sort(drive.inputs.begin(), drive.inputs.end());
    return drive;
  }

  [[nodiscard]] Cost replay(const Drive& drive, bool refits) const {
    return work("replay", drive.inputs, refits ? drive.with_refits : drive.without_refits);
  }
  [[nodiscard]] Cost replay_capture(const Drive& drive) const {
    return work("replay", {drive.folder / "capture.lcm"}, drive.without_refits);
  }
  [[nodiscard]] Cost process(const Drive& drive) const {
    return work("process", drive.inputs, drive.with_refits);
  }
  /// report.html of the last study, once more.
  [[nodiscard]] Cost report() const { return run({bin_ / "imuscope", "report", scratch_ / "run"}); }
  [[nodiscard]] Cost process_by(const Drive& drive, const char* threads) const {
    return work("process", drive.inputs, drive.with_refits, {"--threads", threads});
  }
  /// Two studies at once, of one thread each: until both are done.
  [[nodiscard]] Cost process_two_at_once(const Drive& drive) const {
    const auto words = [&](const char* out) {
      return words_of("process", drive.inputs, drive.with_refits, {"--threads", "1"}, out);
    };
    const Running beside(words("run_beside"));
    const Cost one = Running(words("run")).cost();
    const Cost other = beside.cost();
    return {one.processor_s + other.processor_s, std::max(one.wall_s, other.wall_s),
            one.memory_mb + other.memory_mb};
  }

 private:
  static void write(const fs::path& file, const std::string& text) {
    std::ofstream out(file);
    if (!(out << text).flush()) throw std::runtime_error(file.string() + " cannot be written");
  }

  [[nodiscard]] Cost work(const char* command, const std::vector<std::string>& inputs, const fs::path& config,
                          const std::vector<std::string>& more = {}) const {
    return run(words_of(command, inputs, config, more, "run"));
  }

  [[nodiscard]] std::vector<std::string> words_of(const char* command, const std::vector<std::string>& inputs,
                                                  const fs::path& config,
                                                  const std::vector<std::string>& more,
                                                  const char* out) const {
    std::vector<std::string> words{bin_ / "imuscope", command};
    words.insert(words.end(), inputs.begin(), inputs.end());
    words.insert(words.end(), more.begin(), more.end());
    words.insert(words.end(), {"--config", config, "--out", scratch_ / out});
    return words;
  }

  fs::path scratch_;
  fs::path bin_;
};

/// The fastest of the rounds: what other programs take from the caches makes a run slower, never faster.
void keep_fastest(Cost& kept, const Cost& now) {
  kept.processor_s = std::min(kept.processor_s, now.processor_s);
  kept.wall_s = std::min(kept.wall_s, now.wall_s);
  kept.memory_mb = std::max(kept.memory_mb, now.memory_mb);
}

bench::Row row_of(const std::string& what, double minutes, const Cost& cost, double goal) {
  constexpr double kSecondsPerMinute = 60.0;
  bench::Row row;
  row.group = "replay";
  row.what = what;
  row.reference = kSecondsPerMinute * minutes;
  row.ratio = *row.reference / cost.processor_s;
  row.against = "times faster than real time";
  row.value = cost.processor_s;
  row.unit = "s";
  row.memory_mb = cost.memory_mb;
  if (goal > 0.0) row.goal = bench::Goal{bench::Goal::Side::kAtLeast, goal};
  return row;
}

/// One S-IMU more, or the drive twice as long: cost by size.
struct Growth {
  std::vector<double> sizes;
  std::vector<double> seconds;
  std::vector<double> megabytes;
  void add(double size, const Cost& cost) {
    sizes.push_back(size);
    seconds.push_back(cost.processor_s);
    megabytes.push_back(cost.memory_mb);
  }
};

/// Wall time of one against another that ran in turn with it.
bench::Row row_of_walls(const std::string& what, const Cost& cost, const Cost& other, const char* against,
                        double ratio, bench::Goal goal) {
  bench::Row row;
  row.group = "replay";
  row.what = what;
  row.ratio = ratio;
  row.against = against;
  row.value = cost.wall_s;
  row.reference = other.wall_s;
  row.unit = "s of wall";
  row.memory_mb = cost.memory_mb;
  row.goal = goal;
  return row;
}

/// The programs beside those of another build, in turn.
std::vector<bench::Row> measure_beside(const Programs& programs, const Programs& others, double minutes,
                                       int rounds) {
  const Drive drive = programs.record(3, minutes);
  Cost raw;
  Cost raw_of_others;
  Cost capture;
  Cost capture_of_others;
  for (int round = 0; round < rounds; ++round) {
    keep_fastest(raw_of_others, others.replay(drive, false));
    keep_fastest(raw, programs.replay(drive, false));
    keep_fastest(capture_of_others, others.replay_capture(drive));
    keep_fastest(capture, programs.replay_capture(drive));
  }
  const auto row = [&](const char* what, const Cost& cost, const Cost& other) {
    return row_of_walls(fmt::format("{}, 3 S-IMUs, {:g} min", what, minutes), cost, other,
                        "times as fast as the other build", other.wall_s / cost.wall_s,
                        {bench::Goal::Side::kAtLeast, kGoalBeside});
  };
  return {row("raw bytes, no refits", raw, raw_of_others),
          row("capture, no refits", capture, capture_of_others)};
}

/// What two threads could reach on this machine: half of it where two cores give twice of one, more where they share
/// what one has to itself.
bench::Row machines_row(const std::string& what, const Cost& two_at_once, const Cost& one_thread) {
  bench::Row row;
  row.group = "replay";
  row.what = what;
  row.ratio = two_at_once.wall_s / (2.0 * one_thread.wall_s);
  row.against = "of the wall time of one after the other";
  row.value = two_at_once.wall_s;
  row.reference = 2.0 * one_thread.wall_s;
  row.unit = "s of wall";
  return row;
}

/// A study that takes minutes, by two threads and by one.
std::vector<bench::Row> measure_long(const Programs& programs, double hours) {
  constexpr double kMinutesPerHour = 60.0;
  const Drive drive = programs.record(3, kMinutesPerHour * hours);
  const Cost two_threads = programs.process_by(drive, "2");
  const Cost one_thread = programs.process_by(drive, "1");
  const Cost two_at_once = programs.process_two_at_once(drive);
  const auto what = fmt::format("whole study, two threads, 3 S-IMUs, {:g} h", hours);
  bench::Row memory;
  memory.group = "replay";
  memory.what = "memory of the " + what;
  memory.ratio = two_threads.memory_mb / kGoalMemory_mb;
  memory.against = "of what ten hours may take";
  memory.value = two_threads.memory_mb;
  memory.reference = kGoalMemory_mb;
  memory.unit = "MB";
  memory.goal = bench::Goal{bench::Goal::Side::kAtMost, 1.0};
  return {row_of_walls(what, two_threads, one_thread, "of the wall time of one thread",
                       two_threads.wall_s / one_thread.wall_s, {bench::Goal::Side::kAtMost, kGoalTwoThreads}),
          machines_row(fmt::format("two whole studies at once, a thread each, {:g} h", hours), two_at_once,
                       one_thread),
          memory};
}

std::vector<bench::Row> measure(const Programs& programs, double minutes, int rounds) {
  const std::vector<int> crowds{1, 2, 3, 6};
  std::vector<Drive> by_studies;
  for (const int n : crowds) by_studies.push_back(programs.record(n, minutes));
  const Drive& usual = by_studies[2];
  std::vector<Drive> by_length{programs.record(usual.studies, 0.5 * minutes), usual,
                               programs.record(usual.studies, 2.0 * minutes)};
  std::vector<Cost> crowd_costs(by_studies.size());
  std::vector<Cost> length_costs(by_length.size());
  Cost refits;
  Cost capture;
  Cost study;
  Cost report;
  Cost one_thread;
  Cost two_threads;
  Cost two_at_once;
  for (int round = 0; round < rounds; ++round) {
    for (std::size_t i = 0; i < by_studies.size(); ++i)
      keep_fastest(crowd_costs[i], programs.replay(by_studies[i], false));
    for (std::size_t i = 0; i < by_length.size(); ++i)
      keep_fastest(length_costs[i], programs.replay(by_length[i], false));
    keep_fastest(refits, programs.replay(usual, true));
    keep_fastest(capture, programs.replay_capture(usual));
    keep_fastest(study, programs.process(usual));
    keep_fastest(report, programs.report());
    keep_fastest(one_thread, programs.process_by(usual, "1"));
    keep_fastest(two_threads, programs.process_by(usual, "2"));
    keep_fastest(two_at_once, programs.process_two_at_once(usual));
  }
  std::vector<bench::Row> rows;
  const auto of = [&](const char* what) { return fmt::format("{}, 3 S-IMUs, {:g} min", what, minutes); };
  rows.push_back(row_of(of("raw bytes, no refits"), minutes, crowd_costs[2], kGoalReplay));
  rows.push_back(row_of(of("raw bytes, refits every minute"), minutes, refits, kGoalStudy));
  rows.push_back(row_of(of("capture, no refits"), minutes, capture, 0.0));
  rows.push_back(row_of(of("whole study with report"), minutes, study, kGoalStudy));
  rows.push_back(row_of_walls(of("whole study, two threads"), two_threads, one_thread,
                              "of the wall time of one thread", two_threads.wall_s / one_thread.wall_s,
                              {bench::Goal::Side::kAtMost, kGoalTwoThreads}));
  rows.push_back(machines_row(of("two whole studies at once, a thread each"), two_at_once, one_thread));
  bench::Row of_report = row_of(of("report.html"), minutes, report, 0.0);
  of_report.ratio = report.processor_s / study.processor_s;
  of_report.reference = study.processor_s;
  of_report.against = "of the whole study";
  of_report.goal = bench::Goal{bench::Goal::Side::kAtMost, kGoalReport};
  rows.push_back(of_report);
  Growth studies;
  for (std::size_t i = 0; i < by_studies.size(); ++i) {
    studies.add(crowds[i], crowd_costs[i]);
    if (crowds[i] == usual.studies) continue;
    rows.push_back(row_of(fmt::format("raw bytes, no refits, {} S-IMU{}, {:g} min", crowds[i],
                                      crowds[i] == 1 ? "" : "s", minutes),
                          minutes, crowd_costs[i], 0.0));
  }
  Growth lengths;
  for (std::size_t i = 0; i < by_length.size(); ++i) {
    lengths.add(by_length[i].minutes, length_costs[i]);
    if (by_length[i].minutes == minutes) continue;
    rows.push_back(row_of(fmt::format("raw bytes, no refits, 3 S-IMUs, {:g} min", by_length[i].minutes),
                          by_length[i].minutes, length_costs[i], 0.0));
  }
  rows.push_back(bench::growth_row("replay, with S-IMUs 1 to 6", studies.sizes, studies.seconds, 1.5));
  rows.push_back(bench::growth_row("replay, with the drive's length", lengths.sizes, lengths.seconds, 1.1));
  rows.push_back(
      bench::growth_row("replay's memory, with the drive's length", lengths.sizes, lengths.megabytes, 1.0));
  return rows;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Replay and study of simulated drives beside real time"};
  double minutes = 15.0;
  int rounds = 3;
  std::string scratch = fs::temp_directory_path().string();
  std::string json;
  std::string beside;
  app.add_option("--minutes", minutes, "length of the drive; half and twice it are also driven")
      ->check(CLI::Range(0.5, 240.0));
  app.add_option("--rounds", rounds, "of which the fastest counts")->check(CLI::Range(1, 100));
  app.add_option("--scratch", scratch,
                 "where a folder for recordings and results is made, and removed at the end")
      ->type_name("DIR");
  app.add_option("--beside", beside, "bin folder of another build: nothing but the two in turn, by wall time")
      ->type_name("DIR")
      ->check(CLI::ExistingDirectory);
  double hours = 0.0;
  app.add_option("--hours", hours,
                 "nothing but a study of a drive that long, by two threads and by one (1 GB an hour)")
      ->check(CLI::Range(0.1, 24.0))
      ->excludes("--beside");
  app.add_option("--json", json, "write the rows here")->type_name("FILE");
  CLI11_PARSE(app, argc, argv);
  try {
    const bench::OwnFolder folder(scratch);
    const Programs programs(folder.path(), fs::read_symlink("/proc/self/exe").parent_path());
    const auto rows = hours > 0.0      ? measure_long(programs, hours)
                      : beside.empty() ? measure(programs, minutes, rounds)
                                       : measure_beside(programs, {folder.path(), beside}, minutes, rounds);
    return bench::finish(rows, json);
  } catch (const std::exception& error) {
    fmt::print(stderr, "replay_speed: {}\n", error.what());
    return 1;
  }
}
