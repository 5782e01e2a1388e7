/// Forged captures of growing size through replay and study: how much is written for how much is read, and
/// how time grows. Each kind of forgery makes one thing as bad as it can be; all begin with the
/// records of an honest capture, so that they get past the first look.
///
///   imuscope_forged_captures [--mb 4 16 64] [--kinds NAME...] [--config FILE] [--scratch DIR]
///
/// Exits 0 only where every output is within its bound and no time grows faster than the size.

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <imuscope/applied_model_t.hpp>
#include <imuscope/event_t.hpp>
#include <imuscope/exception_t.hpp>
#include <imuscope/raw_t.hpp>
#include <limits>
#include <map>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "capture/capture_writer.h"
#include "capture/event_log_reader.h"
#include "publish/message_codec.h"
#include "tools/benchmarks/own_folder.h"

namespace {

namespace fs = std::filesystem;
using imuscope::LogEvent;

/// docs/security.md: what is made of a capture.
constexpr double kGrowthMax = 20.0;
constexpr double kFixedMax_mb = 4.0;
/// Exponent of time over size between the two largest captures; the rest is start-up and the machine.
constexpr double kExponentMax = 1.25;
/// Shorter runs are start-up, and tell no exponent.
constexpr double kTellingSeconds = 0.5;
constexpr std::int64_t kDay_ns = 86'400'000'000'000;

/// Writes records until the file has its size.
class Forger {
 public:
  Forger(const fs::path& file, const std::vector<LogEvent>& honest, std::size_t bytes)
      : honest_(honest), bytes_(bytes), writer_(create(file)) {}

  [[nodiscard]] bool full() const { return written_ >= bytes_; }
  /// Of the honest records that were put, us.
  [[nodiscard]] std::int64_t end_utime() const { return end_utime_; }

  void put(const LogEvent& event) {
    writer_.append(event.channel, event.utime, event.data);
    constexpr std::size_t kHeader = 28;
    written_ += kHeader + event.channel.size() + event.data.size();
    if (constexpr std::size_t kBlock = 1U << 20U; writer_.pending_bytes() > kBlock) flush();
  }

  template <typename Message>
  void put(const char* channel, const Message& message) {
    put({0, message.utime, channel, imuscope::encode_message(message)});
  }

  /// The honest capture as far as the size allows; `change` may bend its reads, the first ones aside.
  void put_reads(const std::function<void(imuscope::raw_t&, std::int64_t index)>& change) {
    std::int64_t index = 0;
    for (const LogEvent& event : honest_) {
      if (full()) return;
      auto raw = imuscope::decode_message<imuscope::raw_t>(event.data);
      constexpr std::int64_t kHonestFirst = 2'000;
      if (raw && ++index > kHonestFirst) {
        change(*raw, index - kHonestFirst);
        raw->n_bytes = static_cast<std::int32_t>(raw->bytes.size());
        put({0, raw->utime, event.channel, imuscope::encode_message(*raw)});
      } else {
        put(event);
      }
      end_utime_ = event.utime;
    }
    throw std::runtime_error("the honest capture is shorter than what is to be made of it");
  }

  /// A share of the size in honest records; what is put after them has a run to belong to.
  void put_honest() {
    const std::size_t bytes = bytes_;
    constexpr std::size_t kShare = 4;
    bytes_ /= kShare;
    put_reads([](auto&, auto) {});
    bytes_ = bytes;
  }

  void close() {
    flush();
    if (!writer_.close()) throw std::runtime_error("the forged capture cannot be written");
  }

 private:
  static imuscope::CaptureWriter create(const fs::path& file) {
    auto writer = imuscope::CaptureWriter::create(file);
    if (!writer) throw std::runtime_error(writer.error().what);
    return std::move(*writer);
  }
  void flush() {
    if (!writer_.flush()) throw std::runtime_error("the forged capture cannot be written");
  }

  const std::vector<LogEvent>& honest_;
  std::size_t bytes_;
  imuscope::CaptureWriter writer_;
  std::size_t written_ = 0;
  std::int64_t end_utime_ = 0;
};

imuscope::exception_t exception_of(std::int64_t utime, std::int64_t sequence, std::int8_t kind) {
  imuscope::exception_t message{};
  message.utime = utime;
  message.sequence = sequence;
  message.kind = kind;
  message.sample_sequence = -1;
  return message;
}

const std::map<std::string, std::function<void(Forger&)>> kKinds{
    {"honest", [](Forger& f) { f.put_reads([](auto&, auto) {}); }},
    {"pauses of just under a day",
     [](Forger& f) {
       f.put_reads([](auto& raw, std::int64_t i) {
         raw.arrival_ns += i * (kDay_ns - 1'000'000'000);
         raw.utime += i * (kDay_ns / 1000 - 1'000'000);
       });
     }},
    {"pauses of just under two minutes",
     [](Forger& f) {
       f.put_reads([](auto& raw, std::int64_t i) {
         constexpr std::int64_t kPause_us = 119'000'000;
         raw.arrival_ns += i * kPause_us * 1000;
         raw.utime += i * kPause_us;
       });
     }},
    {"one second between reads",
     [](Forger& f) {
       f.put_reads([](auto& raw, std::int64_t i) {
         raw.arrival_ns += i * 1'000'000'000;
         raw.utime += i * 1'000'000;
       });
     }},
    {"all at one instant",
     [](Forger& f) {
       std::int64_t first_ns = 0;
       f.put_reads([&](auto& raw, std::int64_t i) {
         if (i == 0) first_ns = raw.arrival_ns;
         raw.arrival_ns = first_ns;
       });
     }},
    {"stamps to and fro",
     [](Forger& f) {
       f.put_reads(
           [](auto& raw, std::int64_t i) { raw.arrival_ns += (i % 2 == 0 ? 1 : -1) * 5'000'000'000; });
     }},
    {"a read a byte",
     [](Forger& f) {
       f.put_reads(
           [](auto& raw, std::int64_t) { raw.bytes.resize(std::min<std::size_t>(raw.bytes.size(), 1)); });
     }},
    {"random bytes in reads",
     [](Forger& f) {
       std::mt19937_64 random(1);
       f.put_reads([&](auto& raw, std::int64_t) {
         if (!raw.bytes.empty()) raw.bytes[random() % raw.bytes.size()] = static_cast<std::uint8_t>(random());
       });
     }},
    {"one device alone",
     [](Forger& f) { f.put_reads([](auto& raw, std::int64_t) { raw.device = "mtx1"; }); }},
    {"damaged records",
     [](Forger& f) {
       std::mt19937_64 random(2);
       f.put_reads([&](auto& raw, std::int64_t i) {
         if (i % 10 == 0) raw.bytes.assign(random() % 64, 0xED);  // what looks like a sync word
       });
     }},
    {"messages that name regimes",
     [](Forger& f) {
       f.put_honest();
       for (std::int64_t i = 0; !f.full(); ++i) {
         imuscope::event_t message{};
         message.utime = f.end_utime() + i;
         message.sequence = i;
         message.source = "stranger";
         message.text = fmt::format("regime r{}", i);
         f.put("IMUSCOPE_EVENT", message);
       }
     }},
    {"messages of the longest text",
     [](Forger& f) {
       f.put_honest();
       for (std::int64_t i = 0; !f.full(); ++i) {
         imuscope::event_t message{};
         message.utime = f.end_utime() - 10'000'000 + i;
         message.sequence = i;
         message.text.assign(1000, '<');
         f.put("IMUSCOPE_EVENT", message);
       }
     }},
    {"skipped ticks",
     [](Forger& f) {
       f.put_honest();
       for (std::int64_t i = 0; !f.full(); ++i) {
         auto message = exception_of(f.end_utime(), i, imuscope::exception_t::SKIPPED_TICKS);
         message.tick = 2 * i;
         message.count = 1;
         f.put("IMUSCOPE_EXCEPTION", message);
       }
     }},
    {"refused samples",
     [](Forger& f) {
       f.put_honest();
       for (std::int64_t i = 0; !f.full(); ++i) {
         auto message = exception_of(f.end_utime(), i, imuscope::exception_t::REFUSED_SAMPLE);
         message.device = "mtx1";
         message.sample_sequence = i;
         message.tick = -1;
         message.count = 1'000'000;
         f.put("IMUSCOPE_EXCEPTION", message);
       }
     }},
    {"late samples",
     [](Forger& f) {
       f.put_honest();
       for (std::int64_t i = 0; !f.full(); ++i) {
         auto message = exception_of(f.end_utime(), i, imuscope::exception_t::LATE_SAMPLE);
         message.device = "mtx1";
         message.sample_sequence = i;
         message.tick = 100 + i;
         message.count = 1;
         f.put("IMUSCOPE_EXCEPTION", message);
       }
     }},
    {"noise models taken over",
     [](Forger& f) {
       f.put_honest();
       for (std::int64_t i = 0; !f.full(); ++i) {
         imuscope::applied_model_t message{};
         message.utime = f.end_utime();
         message.device = "mtx1";
         message.tick = i;
         f.put("IMUSCOPE_APPLIED_MODEL", message);
       }
     }},
};

struct Outcome {
  int exit_code = -1;
  double seconds = 0.0;  // of processor time
  double output_mb = 0.0;
};

double size_mb(const fs::path& folder) {
  double bytes = 0.0;
  std::error_code gone;
  for (const auto& entry : fs::recursive_directory_iterator(folder, gone))
    if (entry.is_regular_file()) bytes += static_cast<double>(entry.file_size());
  return 1e-6 * bytes;
}

Outcome run(const std::vector<std::string>& command, const fs::path& log, const fs::path& out) {
  std::vector<char*> arguments;
  for (const std::string& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  const pid_t child = fork();
  if (child < 0) throw std::runtime_error("no process can be started");
  if (child == 0) {
    constexpr mode_t kOwn = 0600;
    const int file = open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, kOwn);
    dup2(file, STDOUT_FILENO);
    dup2(file, STDERR_FILENO);
    execv(arguments[0], arguments.data());
    _exit(127);
  }
  int status = 0;
  rusage usage{};
  wait4(child, &status, 0, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  constexpr int kSignalled = 128;
  Outcome outcome;
  outcome.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : kSignalled + WTERMSIG(status);
  outcome.seconds = seconds(usage.ru_utime) + seconds(usage.ru_stime);
  outcome.output_mb = size_mb(out) + 1e-6 * static_cast<double>(fs::file_size(log));
  fs::remove_all(out);
  return outcome;
}

/// An honest drive of the simulator, longer than `mb`.
std::vector<LogEvent> honest_events(const fs::path& config, double mb, const fs::path& scratch) {
  // Three S-IMUs, reference and receiver of the demonstration leave some 10 MB a minute.
  constexpr double kMinutesPerMb = 0.15;
  const std::string simulator = fs::read_symlink("/proc/self/exe").parent_path() / "imusim";
  const fs::path folder = scratch / "honest";
  (void)run({simulator, "record", config, "--minutes", fmt::format("{:.1f}", 1.0 + kMinutesPerMb * mb),
             "--out", folder},
            scratch / "log", scratch / "none");
  auto log = imuscope::EventLogReader::open(folder / "capture.lcm");
  if (!log) throw std::runtime_error(log.error().what);
  std::vector<LogEvent> events;
  for (LogEvent event; log->next(event);) events.push_back(event);
  fs::remove_all(folder);
  return events;
}

/// Both commands over one kind at all sizes. False where a bound is broken.
bool measure(const std::string& kind, const std::vector<double>& sizes_mb,
             const std::vector<LogEvent>& honest, const fs::path& scratch) {
  const std::string program = fs::read_symlink("/proc/self/exe").parent_path() / "imuscope";
  bool ok = true;
  for (const char* command : {"replay", "process"}) {
    Outcome last;
    double last_mb = 0.0;
    for (const double mb : sizes_mb) {
      const fs::path capture = scratch / "forged.lcm";
      Forger forger(capture, honest, static_cast<std::size_t>(mb * 1e6));
      kKinds.at(kind)(forger);
      forger.close();
      const double input_mb = 1e-6 * static_cast<double>(fs::file_size(capture));
      const Outcome now =
          run({program, command, capture, "--out", scratch / "out"}, scratch / "log", scratch / "out");
      fs::remove(capture);
      const double growth = now.output_mb / input_mb;
      const double exponent = last.seconds > kTellingSeconds
                                  ? std::log(now.seconds / last.seconds) / std::log(input_mb / last_mb)
                                  : 0.0;
      const bool bounded = now.output_mb <= kGrowthMax * input_mb + kFixedMax_mb;
      const bool linear = exponent <= kExponentMax;
      const bool ended = now.exit_code < 128;
      ok = ok && bounded && linear && ended;
      fmt::print("{:34} {:8} {:7.1f} {:9.2f} {:8.2f} {:9.2f} {:5} {:6.2f} {}\n", kind, command, input_mb,
                 now.output_mb, growth, now.seconds, now.exit_code, exponent,
                 !ended     ? "CRASHED"
                 : !bounded ? "TOO MUCH"
                 : !linear  ? "NOT LINEAR"
                            : "");
      std::fflush(stdout);
      last = now;
      last_mb = input_mb;
    }
  }
  return ok;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Forged captures through replay and study: output and time by size");
  std::vector<double> sizes_mb{4.0, 16.0, 64.0};
  std::vector<std::string> kinds;
  std::string config = IMUSCOPE_DEMO_CONFIGURATION;
  std::string scratch = "build/forged_captures";
  app.add_option("--mb", sizes_mb, "sizes of the captures, rising");
  app.add_option("--kinds", kinds, "these kinds alone");
  app.add_option("--config", config, "vehicle whose honest drive is forged");
  app.add_option("--scratch", scratch, "folder for the captures and what becomes of them");
  CLI11_PARSE(app, argc, argv);
  try {
    const bench::OwnFolder own(scratch);
    const auto honest = honest_events(config, sizes_mb.back(), own.path());
    fmt::print("{:34} {:8} {:>7} {:>9} {:>8} {:>9} {:>5} {:>6}\n", "forged", "command", "in MB", "out MB",
               "out/in", "cpu s", "exit", "exp");
    bool ok = true;
    for (const auto& [kind, forge] : kKinds)
      if (kinds.empty() || std::find(kinds.begin(), kinds.end(), kind) != kinds.end())
        ok = measure(kind, sizes_mb, honest, own.path()) && ok;
    fmt::print("{}\n", ok ? "every bound holds" : "a bound is broken");
    return ok ? 0 : 1;
  } catch (const std::exception& error) {
    fmt::print(stderr, "forged_captures: {}\n", error.what());
    return 1;
  }
}
