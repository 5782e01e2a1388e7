/// A committed capture guards the numbers over time, and shows that replay does not depend on speed or on the
/// way by which the capture came.

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <unistd.h>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <imuscope/error_t.hpp>
#include <map>
#include <sstream>
#include <thread>

#include "programs.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

constexpr std::array kFiles{"navigation.csv", "calibration_mtx1.csv", "errors_mtx1.csv"};
constexpr double kShareOfSd = 1e-6;

struct Table {
  std::vector<std::string> columns;
  std::map<double, std::vector<double>> rows;  ///< by time_s
};

Table read_table(const std::filesystem::path& file) {
  Table table;
  std::istringstream lines(read_text(file));
  std::string line;
  std::getline(lines, line);
  std::istringstream names(line);
  for (std::string name; std::getline(names, name, ',');) table.columns.push_back(name);
  while (std::getline(lines, line)) {
    std::istringstream fields(line);
    std::vector<double> row;
    for (std::string field; std::getline(fields, field, ',');)
      row.push_back(std::strtod(field.c_str(), nullptr));
    if (!row.empty()) table.rows[row.front()] = row;
  }
  return table;
}

/// Column of the sd that belongs to `name`; the column count where there is none.
std::size_t sd_column(const Table& table, const std::string& name) {
  static const std::map<std::string, std::string> kOtherNames{
      {"lat_deg", "sd_n_m"}, {"lon_deg", "sd_e_m"}, {"height_m", "sd_d_m"}};
  const auto other = kOtherNames.find(name);
  const std::string wanted = other != kOtherNames.end() ? other->second : "sd_" + name;
  const auto found = std::find(table.columns.begin(), table.columns.end(), wanted);
  return static_cast<std::size_t>(found - table.columns.begin());
}

/// How far a value of column `c` may be from the expected one.
double tolerance(const Table& expected, std::size_t c, const std::vector<double>& row) {
  constexpr double kMetresPerDeg = 111'320.0;
  const std::string& name = expected.columns[c];
  // Microseconds are written, of which the last may be rounded otherwise.
  if (name == "utc_s" || name == "gps_tow_s") return 1.1e-6;
  const std::size_t sd = sd_column(expected, name);
  if (sd < expected.columns.size()) {
    const bool is_position = name == "lat_deg" || name == "lon_deg";
    return kShareOfSd * row[sd] / (is_position ? kMetresPerDeg : 1.0);
  }
  double largest = 0.0;
  for (const auto& [time, values] : expected.rows) largest = std::max(largest, std::abs(values[c]));
  return kShareOfSd * largest;
}

/// Two loggers listen, one to the devices' bytes alone, while a player plays. On a busy PC a logger needs more than a
/// moment to open its socket, and to write what it has heard: both are waited for, 30 s at most.
constexpr const char* kPlayAndLog = R"sh(
port_hex=$1 bus=$2 speed=$3 capture=$4 all=$5 raw=$6
lcm-logger -f -q --lcm-url="$bus" "$all" & a=$!
lcm-logger -f -q --lcm-url="$bus" -c "IMUSCOPE_RAW_.*" "$raw" & b=$!
for _ in {1..300}; do
  [ "$(grep -c ":$port_hex " /proc/net/udp)" -ge 2 ] && break
  sleep 0.1
done
lcm-logplayer -s "$speed" --lcm-url="$bus" "$capture" >/dev/null
for _ in {1..30}; do
  sizes=$(stat -c %s "$all" "$raw")
  sleep 1
  [ "$sizes" = "$(stat -c %s "$all" "$raw")" ] && break
done
kill -INT $a $b
wait $a $b
)sh";

class Golden : public testing::Test {
 protected:
  /// The data of the events of a log whose channel begins so. Layout: LCM's log format, big-endian, 28 bytes
  /// before the channel.
  static std::vector<std::string> data_of(const std::filesystem::path& log,
                                          const std::string& channel_begin) {
    constexpr std::size_t kHeader = 28;
    constexpr std::size_t kChannelLength = 20;
    const std::string bytes = read_text(log);
    const auto number = [&](std::size_t at) {
      std::size_t value = 0;
      for (std::size_t i = 0; i < 4; ++i) value = value << 8U | static_cast<unsigned char>(bytes[at + i]);
      return value;
    };
    std::vector<std::string> found;
    for (std::size_t at = 0; at + kHeader <= bytes.size();) {
      const std::size_t channel = number(at + kChannelLength);
      const std::size_t data = number(at + kChannelLength + 4);
      if (bytes.compare(at + kHeader, channel_begin.size(), channel_begin) == 0)
        found.push_back(bytes.substr(at + kHeader + channel, data));
      at += kHeader + channel + data;
    }
    return found;
  }
  static int events(const std::filesystem::path& log, const std::string& channel_begin) {
    return static_cast<int>(data_of(log, channel_begin).size());
  }
  static int error_rows(const std::filesystem::path& log, const std::string& channel_begin) {
    int rows = 0;
    for (const auto& message : data_of(log, channel_begin)) {
      error_t errors;
      EXPECT_GT(errors.decode(message.data(), 0, static_cast<int>(message.size())), 0);
      rows += errors.n_rows;
    }
    return rows;
  }
  static int raw_events(const std::filesystem::path& log) { return events(log, "IMUSCOPE_RAW_"); }

  /// Plays the capture onto a bus of its own (other programs on this PC may be speaking on the usual one),
  /// with two loggers that listen: to everything, and to the devices' bytes alone.
  void play_and_log(const std::string& speed, const std::filesystem::path& all,
                    const std::filesystem::path& raw) const {
    constexpr int kFirstPort = 20000;
    const int port = kFirstPort + getpid() % 10000;
    const auto script = folder_ / "play_and_log.sh";
    std::ofstream{script} << kPlayAndLog;
    const std::string command = fmt::format(
        "bash {} {:04X} 'udpm://239.255.76.67:{}?ttl=0&recv_buf_size=4194304' {} {} {} {} >{} 2>&1",
        script.string(), port, port, speed, capture_.string(), all.string(), raw.string(),
        (folder_ / "tools.log").string());
    ASSERT_EQ(std::system(command.c_str()), 0) << read_text(folder_ / "tools.log");
  }

  void SetUp() override {
    if (unshare(CLONE_NEWNET) != 0) GTEST_SKIP() << "a private network namespace needs root";
    ASSERT_EQ(std::system("ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo"), 0);
    const auto unpack =
        "gzip -dc " + source_path("tests/golden/capture.lcm.gz").string() + " > " + capture_.string();
    ASSERT_EQ(std::system(unpack.c_str()), 0);
  }

  std::map<std::string, std::string> replay(const std::filesystem::path& capture, const std::string& name,
                                            const std::vector<std::string>& options = {}) {
    std::vector<std::string> arguments{"replay", capture.string(), "--out", (folder_ / name).string()};
    arguments.insert(arguments.end(), options.begin(), options.end());
    EXPECT_EQ(run_program("imuscope", arguments, folder_ / (name + ".log")), 0)
        << read_text(folder_ / (name + ".log"));
    std::map<std::string, std::string> texts;
    for (const char* file : kFiles) texts[file] = read_text(folder_ / name / file);
    return texts;
  }

  std::filesystem::path folder_ = scratch_folder();
  std::filesystem::path capture_ = folder_ / "capture.lcm";
};

TEST_F(Golden, ReplaysToTheNumbersThatWereCommitted) {
  (void)replay(capture_, "replay");
  for (const char* file : kFiles) {
    const auto expected = read_table(source_path("tests/golden") / file);
    const auto found = read_table(folder_ / "replay" / file);
    ASSERT_EQ(found.columns, expected.columns) << file;
    ASSERT_GE(expected.rows.size(), 10U) << file;
    for (const auto& [time, row] : expected.rows) {
      const auto same = found.rows.find(time);
      ASSERT_NE(same, found.rows.end()) << file << " at " << time << " s";
      for (std::size_t c = 0; c < row.size(); ++c) {
        EXPECT_NEAR(same->second[c], row[c], tolerance(expected, c, row))
            << file << " " << expected.columns[c] << " at " << time << " s";
      }
    }
  }
}

TEST_F(Golden, PacedAsRecordedItGivesTheSameAndTakesItsTime) {
  const auto fast = replay(capture_, "fast");
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EQ(replay(capture_, "paced", {"--realtime"}), fast);
  EXPECT_GT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(15)) << "18 s were recorded";
}

TEST_F(Golden, PublishesWhatItReplaysAndGivesTheSame) {
  const auto bus = folder_ / "bus.lcm";
  const auto texts = replay(capture_, "published", {"--lcm", "file://" + bus.string() + "?mode=w"});
  EXPECT_EQ(texts, replay(capture_, "quiet"));
  const auto rows = [&](const char* file) {
    const auto& text = texts.at(file);
    return static_cast<int>(std::count(text.begin(), text.end(), '\n')) - 1;
  };
  EXPECT_EQ(events(bus, "IMUSCOPE_NAVIGATION"), rows("navigation.csv"));
  EXPECT_EQ(events(bus, "IMUSCOPE_CALIBRATION_MTX1"), rows("calibration_mtx1.csv"));
  EXPECT_EQ(error_rows(bus, "IMUSCOPE_ERROR_MTX1"), rows("errors_mtx1.csv"));
  EXPECT_GE(events(bus, "IMUSCOPE_STATUS"), 15) << "one for each of the 18 s";
  EXPECT_EQ(run_program("imuscope",
                        {"replay", capture_.string(), "--out", (folder_ / "no").string(), "--lcm",
                         "tcpq://localhost:7700"},
                        folder_ / "no.log"),
            2);
}

TEST_F(Golden, PlayedByLcmLogplayerAndRecordedByLcmLoggerItReplaysToTheSame) {
  const auto copy = folder_ / "copy.lcm";
  const auto raw = folder_ / "raw.lcm";
  // The bus may lose a datagram, which is nobody's fault here: then the 18 s are played again, at last so
  // slowly that a busy PC keeps up.
  const auto wanted = raw_events(capture_);
  for (const char* speed : {"1", "1", "1", "0.5", "0.25"}) {
    play_and_log(speed, copy, raw);
    if (raw_events(copy) == wanted && raw_events(raw) == wanted) break;
  }
  ASSERT_EQ(raw_events(copy), wanted) << read_text(folder_ / "tools.log");
  ASSERT_EQ(raw_events(raw), wanted) << read_text(folder_ / "tools.log");
  const auto fast = replay(capture_, "fast");
  EXPECT_EQ(replay(copy, "copied"), fast);

  // The bytes alone, without what was run: they need the configuration, and have ticks of their own.
  EXPECT_EQ(run_program("imuscope", {"replay", raw.string(), "--out", (folder_ / "no").string()},
                        folder_ / "no.log"),
            2);
  EXPECT_NE(read_text(folder_ / "no.log").find("add --config"), std::string::npos);
  const auto alone = replay(raw, "alone", {"--config", source_path("tests/golden/golden.toml").string()});
  EXPECT_GT(alone.at("errors_mtx1.csv").size(), fast.at("errors_mtx1.csv").size() / 2);
}

}  // namespace
}  // namespace imuscope::test
