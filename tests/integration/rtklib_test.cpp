/// RTKLIB as it is installed, between a receiver's log and the filter: its solutions by file and over TCP.

#include <gtest/gtest.h>

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <fstream>
#include <sstream>
#include <thread>

#include "drivers/greis/decoder.h"
#include "drivers/rtklib_pos/decoder.h"
#include "drivers/transport/net_stream.h"
#include "programs.h"
#include "tests/drivers/support/streams.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

using namespace std::chrono_literals;

constexpr double kEarthRadius_m = 6.37e6;

/// Skips where RTKLIB (Debian package rtklib) is not installed.
#define IMUSCOPE_NEEDS_RTKLIB(program)                                  \
  do {                                                                  \
    if (!std::filesystem::exists("/usr/bin/" program))                  \
      GTEST_SKIP() << "needs " program " of the Debian package rtklib"; \
  } while (false)

std::vector<Sample> rtklib_samples(const std::filesystem::path& file) {
  rtklib_pos::DecoderConfig config;
  config.clock = ClockMapConfig::fixed({}, 1.0);
  rtklib_pos::Decoder decoder(config);
  CollectingSink sink;
  decoder.push(load_bytes(file), {}, sink);
  decoder.finish({}, sink);
  EXPECT_EQ(decoder.counters().bad_contents, 0U);
  return sink.samples;
}

TEST(Rtklib, AJavadLogBecomesASinglePointSolutionThatAgreesWithTheReceiversOwn) {
  IMUSCOPE_NEEDS_RTKLIB("convbin");
  IMUSCOPE_NEEDS_SHARED("data/streams/greis/javad.jps");
  const auto folder = scratch_folder();
  const auto log = folder / "log.txt";
  std::filesystem::copy_file(shared_path("data/streams/greis/javad.jps"), folder / "rover.jps");
  const auto in = [&](const char* name) { return (folder / name).string(); };
  ASSERT_EQ(run_program("/usr/bin/convbin",
                        {"-r", "javad", "-v", "3.03", "-od", "-os", "-o", in("rover.obs"), "-n",
                         in("rover.nav"), in("rover.jps")},
                        log),
            0);
  ASSERT_EQ(run_program("/usr/bin/rnx2rtkp",
                        {"-p", "0", "-t", "-o", in("rover.pos"), in("rover.obs"), in("rover.nav")}, log),
            0);
  const auto solutions = rtklib_samples(folder / "rover.pos");
  ASSERT_EQ(solutions.size(), 130U);

  greis::DecoderConfig config;
  config.clock = ClockMapConfig::fixed({}, 1.0);
  greis::Decoder decoder(config);
  CollectingSink own;
  decoder.push(load_bytes(folder / "rover.jps"), {}, own);
  ASSERT_EQ(own.samples.size(), 129U);  // the last epoch is cut by the end of the file
  for (std::size_t i = 0; i < own.samples.size(); ++i) {
    const GnssData& a = own.samples[i].gnss;
    const GnssData& b = solutions[i].gnss;
    EXPECT_EQ(b.solution, GnssSolution::kSingle);
    // Same second, to the receiver's clock offset.
    ASSERT_NEAR(to_seconds(own.samples[i].utc - solutions[i].utc), 0.0, 1e-3) << i;
    EXPECT_LT(kEarthRadius_m * std::abs(a.latitude_rad - b.latitude_rad), 10.0);
    EXPECT_LT(kEarthRadius_m * std::abs(a.longitude_rad - b.longitude_rad), 10.0);
    EXPECT_LT(std::abs(a.height_m - b.height_m), 30.0);
  }
}

/// A pipe that str2str reads as its input file.
class Fifo {
 public:
  explicit Fifo(std::filesystem::path path) : path_(std::move(path)) {
    EXPECT_EQ(mkfifo(path_.c_str(), 0600), 0);
    fd_ = open(path_.c_str(), O_RDWR | O_CLOEXEC);
    EXPECT_GE(fd_, 0);
  }
  Fifo(const Fifo&) = delete;
  Fifo& operator=(const Fifo&) = delete;
  ~Fifo() { close(fd_); }
  void write_all(std::span<const std::uint8_t> bytes) const {
    while (!bytes.empty()) {
      const ssize_t n = write(fd_, bytes.data(), bytes.size());
      ASSERT_GT(n, 0);
      bytes = bytes.subspan(static_cast<std::size_t>(n));
    }
  }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
  int fd_ = -1;
};

std::unique_ptr<NetStream> connect_when_it_listens(std::uint16_t port) {
  for (int attempt = 0; attempt < 100; ++attempt) {
    if (auto stream = NetStream::open({NetSettings::Kind::kTcp, "127.0.0.1", port}))
      return std::move(*stream);
    std::this_thread::sleep_for(100ms);
  }
  return nullptr;
}

/// Reads `size` bytes, or what comes until nothing does for some seconds.
Bytes read_stream(NetStream& stream, std::size_t size) {
  Bytes all;
  std::vector<std::uint8_t> buffer(4096);
  while (all.size() < size) {
    pollfd waiting{stream.fd(), POLLIN, 0};
    if (poll(&waiting, 1, 10'000) <= 0) break;
    const IoResult result = stream.read(buffer);
    if (result.status == IoStatus::kGone) break;
    all.insert(all.end(), buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(result.n));
  }
  return all;
}

struct Place {
  double time_s;
  double lat_deg;
  double lon_deg;
  double height_m;
};

std::vector<Place> navigation_of(const std::filesystem::path& run) {
  std::ifstream in(run / "navigation.csv");
  std::vector<Place> places;
  std::string line;
  std::getline(in, line);
  EXPECT_EQ(line.rfind("time_s,utc_s,gps_week,gps_tow_s,lat_deg,lon_deg,height_m", 0), 0U) << line;
  while (std::getline(in, line)) {
    Place place{};
    char comma = 0;
    std::istringstream cells(line);
    // A replay of a receiver's own clock may know no UTC: its three cells are passed over, full or empty.
    cells >> place.time_s >> comma;
    for (int i = 0; i < 3; ++i) cells.ignore(32, ',');
    cells >> place.lat_deg >> comma >> place.lon_deg >> comma >> place.height_m;
    places.push_back(place);
  }
  return places;
}

TEST(Rtklib, AFixedSolutionThatStr2strSendsOverTcpDrivesTheFilter) {
  IMUSCOPE_NEEDS_RTKLIB("str2str");
  IMUSCOPE_NEEDS_SHARED("data/rtk_drive/gnss.pos");
  const auto folder = scratch_folder();
  constexpr std::uint16_t kPort = 29125;
  Fifo fifo(folder / "gnss.fifo");
  const BackgroundProgram server(
      "/usr/bin/str2str",
      {"-in", "file://" + fifo.path().string(), "-out", "tcpsvr://:" + std::to_string(kPort)},
      folder / "str2str.log");
  const auto stream = connect_when_it_listens(kPort);
  ASSERT_NE(stream, nullptr) << read_text(folder / "str2str.log");
  const Bytes sent = load_bytes(shared_path("data/rtk_drive/gnss.pos"));
  std::thread writer([&] {
    std::this_thread::sleep_for(500ms);  // until str2str has accepted the client
    // str2str drops what its client has not yet taken, and hands on whole blocks.
    constexpr std::size_t kBlock = 4096;
    for (std::size_t at = 0; at < sent.size(); at += kBlock) {
      fifo.write_all(std::span(sent).subspan(at, std::min(kBlock, sent.size() - at)));
      std::this_thread::sleep_for(5ms);
    }
    constexpr std::size_t kWholeBlock = 32768;
    fifo.write_all(Bytes(kWholeBlock, '\n'));
  });
  const Bytes came = read_stream(*stream, sent.size());
  writer.join();
  ASSERT_GE(came.size(), sent.size());
  ASSERT_TRUE(std::equal(sent.begin(), sent.end(), came.begin()));
  const auto received = folder / "gnss.pos";
  std::ofstream(received, std::ios::binary)
      .write(reinterpret_cast<const char*>(came.data()), static_cast<std::streamsize>(came.size()));

  const auto solutions = rtklib_samples(received);
  ASSERT_EQ(solutions.size(), 2197U);
  const auto run = folder / "run";
  const std::string imu = shared_path("data/rtk_drive/imu.csv").string();
  ASSERT_EQ(run_program("imuscope",
                        {"replay", "reference=" + imu, "again=" + imu, "gnss=" + received.string(),
                         "--config", source_path("config/rtklib_drive.toml").string(), "--out", run.string()},
                        folder / "replay.log"),
            0)
      << read_text(folder / "replay.log");

  // The solution of an IMU of this class follows the fixed positions to decimetres where they come every 0.25
  // s.
  const auto navigation = navigation_of(run);
  ASSERT_GT(navigation.size(), 4000U);
  const double t0_s = 1752003261.854;  // of the IMU's first row, in GPS time as the lines'
  double sum_m2 = 0.0;
  int n = 0;
  std::size_t next = 0;
  for (const Sample& solution : solutions) {
    const double time_s = static_cast<double>(to_ns(solution.time)) * 1e-9 - t0_s;
    while (next < navigation.size() && navigation[next].time_s < time_s - 0.05) ++next;
    if (next == navigation.size()) break;
    if (std::abs(navigation[next].time_s - time_s) > 0.051 || time_s < 120.0) continue;
    const double north_m =
        kEarthRadius_m * (navigation[next].lat_deg * M_PI / 180.0 - solution.gnss.latitude_rad);
    const double east_m = kEarthRadius_m * std::cos(solution.gnss.latitude_rad) *
                          (navigation[next].lon_deg * M_PI / 180.0 - solution.gnss.longitude_rad);
    sum_m2 += north_m * north_m + east_m * east_m;
    ++n;
  }
  ASSERT_GT(n, 1000);
  // Rows are up to 50 ms from the solution: at 16 m/s that alone is 0.4 m rms.
  EXPECT_LT(std::sqrt(sum_m2 / n), 1.0);
}

}  // namespace
}  // namespace imuscope::test
