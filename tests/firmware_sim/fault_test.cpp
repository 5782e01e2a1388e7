/// Fault scripts: what each kind does to the bytes of a recording, against the same recording without it.

#include <gtest/gtest.h>
#include <algorithm>
#include <bit>
#include <cmath>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "firmware_sim/devices/xsens_encoder.h"
#include "firmware_sim/imusim/configuration.h"
#include "firmware_sim/imusim/fault_script.h"
#include "firmware_sim/imusim/record.h"
#include "tests/support/shared_data.h"

namespace imusim {
namespace {

using imuscope::test::scratch_folder;

constexpr double kHostBegin_s = 1000.0;
/// An MTx's frame of calibrated data without a field, with a counter.
constexpr std::size_t kMtFrame = 31;

Configuration plain_configuration() {
  const auto parsed = parse_configuration(R"(
[[device]]
name = "ref"
role = "reference"
protocol = "ixblue_stdbin"
transport = { baud = 460800 }
[[device]]
name = "a"
role = "study"
protocol = "xsens_mt"
[[device]]
name = "b"
role = "study"
protocol = "xsens_mt"
[[device]]
name = "gnss"
role = "gnss"
protocol = "greis"
[simulation]
duration_s = 30.0
seed = 3
[simulation.line]
reads = "messages"
read_jitter_us = 0.0
[[simulation.imu]]
name = "a"
clock_skew_ppm = 0.0
first_counter = 100
)",
                                          "test.toml");
  EXPECT_TRUE(parsed.has_value()) << (parsed ? "" : parsed.error().text);
  return *parsed;
}

struct Read {
  Bytes bytes;
  double at_s;
};

/// What a device sent, as the host read it.
struct Stream {
  Bytes bytes;
  std::vector<Read> reads;

  /// Offsets of the whole MTData frames.
  [[nodiscard]] std::vector<std::size_t> mt_frames() const {
    std::vector<std::size_t> found;
    for (std::size_t at = 0; at + kMtFrame <= bytes.size();) {
      unsigned sum = 0;
      for (std::size_t i = 1; i < kMtFrame; ++i) sum += bytes[at + i];
      const bool good =
          bytes[at] == 0xFA && bytes[at + 2] == xsens::kMtData && bytes[at + 3] == 26 && (sum & 0xFFU) == 0;
      if (good) found.push_back(at);
      at += good ? kMtFrame : 1;
    }
    return found;
  }
  [[nodiscard]] std::vector<int> mt_counters() const {
    std::vector<int> counters;
    for (const std::size_t at : mt_frames())
      counters.push_back(get_be<std::uint16_t>(std::span(bytes).subspan(at + 28, 2)));
    return counters;
  }
  /// Longest time without a read after `from_s`, and when it began.
  [[nodiscard]] std::pair<double, double> longest_silence() const {
    std::pair<double, double> longest{0.0, 0.0};
    for (std::size_t i = 1; i < reads.size(); ++i) {
      const double gap_s = reads[i].at_s - reads[i - 1].at_s;
      if (gap_s > longest.first) longest = {gap_s, reads[i - 1].at_s};
    }
    return longest;
  }
};

Stream stream_of(const std::filesystem::path& folder, const std::string& name) {
  std::ifstream file(folder / (name + ".bin"), std::ios::binary);
  Stream stream;
  stream.bytes.assign(std::istreambuf_iterator<char>(file), {});
  std::ifstream arrivals(folder / (name + ".arrivals.csv"));
  std::string line;
  std::getline(arrivals, line);
  char comma = 0;
  while (std::getline(arrivals, line)) {
    std::istringstream fields(line);
    std::size_t offset = 0;
    std::size_t count = 0;
    double arrival_ns = 0;
    fields >> offset >> comma >> count >> comma >> arrival_ns;
    stream.reads.push_back({Bytes(stream.bytes.begin() + static_cast<std::ptrdiff_t>(offset),
                                  stream.bytes.begin() + static_cast<std::ptrdiff_t>(offset + count)),
                            arrival_ns * 1e-9 - kHostBegin_s});
  }
  return stream;
}

class FaultScript : public testing::Test {
 protected:
  /// Records with a script, and checks that devices which it does not name send what they send without it.
  std::map<std::string, Stream> with(const std::string& script, const std::set<std::string>& named) {
    Configuration faulty = plain_configuration();
    const auto parsed = parse_faults(script, "faults.toml", faulty);
    EXPECT_TRUE(parsed) << (parsed ? "" : parsed.error().text);
    const auto recorded = record(faulty, {folder_ / "faulty", false, {}});
    EXPECT_TRUE(recorded) << (recorded ? "" : recorded.error().text);
    std::map<std::string, Stream> streams;
    for (const PlayedDevice& device : faulty.devices) {
      streams[device.name] = stream_of(folder_ / "faulty", device.name);
      if (!named.contains(device.name)) {
        EXPECT_TRUE(streams[device.name].bytes == clean(device.name).bytes) << device.name;
      }
    }
    return streams;
  }
  static const Stream& clean(const std::string& name) {
    static const std::filesystem::path folder = [] {
      std::filesystem::path made = scratch_folder() / "clean";
      EXPECT_TRUE(record(plain_configuration(), {made, false, {}}));
      return made;
    }();
    static std::map<std::string, Stream> streams;
    if (!streams.contains(name)) streams[name] = stream_of(folder, name);
    return streams[name];
  }
  static std::string refusal(const std::string& script) {
    Configuration faulty = plain_configuration();
    const auto parsed = parse_faults(script, "faults.toml", faulty);
    return parsed ? "accepted" : parsed.error().text;
  }

  // What is clean is read before the test's own folder is made, which empties it.
  FaultScript() {
    for (const char* name : {"ref", "a", "b", "gnss"}) (void)clean(name);
    folder_ = scratch_folder();
  }
  std::filesystem::path folder_;
};

std::size_t differing(const Bytes& a, const Bytes& b) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) count += a[i] != b[i] ? 1 : 0;
  return count;
}

TEST_F(FaultScript, TheSameSeedAndScriptGiveTheSameBytes) {
  const std::string script =
      "[[fault]]\nkind = \"flip\"\nat_s = 1\nshare = 0.01\n[[fault]]\nkind = \"garbage\"\nat_s = 2\n"
      "share = 0.1\n";
  const auto first = with(script, {"ref", "a", "b", "gnss"});
  const auto second = with(script, {"ref", "a", "b", "gnss"});
  for (const auto& [name, stream] : first) {
    EXPECT_TRUE(stream.bytes == second.at(name).bytes) << name;
    EXPECT_FALSE(stream.bytes == clean(name).bytes) << name;
  }
}

TEST_F(FaultScript, FlipsTurnOneBitOfTheirShareOfBytesWhileTheyLast) {
  const auto a =
      with("[[fault]]\nkind = \"flip\"\ndevice = \"a\"\nat_s = 10\nfor_s = 10\nshare = 0.01\n", {"a"})
          .at("a");
  ASSERT_EQ(a.bytes.size(), clean("a").bytes.size());
  // 1000 messages of 31 bytes: 310 flips, 5 sigma 90.
  EXPECT_NEAR(static_cast<double>(differing(a.bytes, clean("a").bytes)), 310.0, 90.0);
  for (std::size_t i = 0; i < a.bytes.size(); ++i)
    ASSERT_LE(std::popcount(static_cast<unsigned>(a.bytes[i] ^ clean("a").bytes[i])), 1);
  const std::size_t third = a.bytes.size() / 3 - 1000;
  EXPECT_TRUE(std::equal(a.bytes.begin(), a.bytes.begin() + static_cast<std::ptrdiff_t>(third),
                         clean("a").bytes.begin()));
}

TEST_F(FaultScript, TheLogTellsWhatEachFaultDid) {
  const auto made = with(
      "[[fault]]\nkind = \"flip\"\ndevice = \"a\"\nat_s = 10\nfor_s = 5\nshare = 0.01\n"
      "[[fault]]\nkind = \"unplug\"\ndevice = \"b\"\nat_s = 10\nfor_s = 2\n",
      {"a", "b"});
  std::ifstream in(folder_ / "faulty" / "fault_log.json");
  const auto log = nlohmann::json::parse(in).at("faults");
  ASSERT_EQ(log.size(), 2U);
  EXPECT_EQ(log[0].at("device"), "a");
  EXPECT_EQ(log[0].at("kind"), "flip");
  EXPECT_EQ(log[0].at("bytes_hit").get<std::size_t>(), differing(made.at("a").bytes, clean("a").bytes));
  EXPECT_LE(log[0].at("hit"), log[0].at("bytes_hit"));
  EXPECT_EQ(log[1].at("bytes_hit").get<std::size_t>(), clean("b").bytes.size() - made.at("b").bytes.size());
  EXPECT_EQ(log[1].at("hit").get<std::size_t>(),
            clean("b").mt_counters().size() - made.at("b").mt_counters().size());
}

TEST_F(FaultScript, WhatAFaultOfAllDevicesDidIsToldOfEach) {
  const auto made =
      with("[[fault]]\nkind = \"flip\"\nat_s = 5\nfor_s = 15\nshare = 0.02\n", {"ref", "a", "b", "gnss"});
  std::ifstream in(folder_ / "faulty" / "fault_log.json");
  const auto log = nlohmann::json::parse(in).at("faults");
  ASSERT_EQ(log.size(), made.size());
  for (const auto& entry : log) {
    const std::string name = entry.at("device");
    EXPECT_EQ(entry.at("bytes_hit").get<std::size_t>(), differing(made.at(name).bytes, clean(name).bytes))
        << name;
  }
}

TEST_F(FaultScript, DroppedBytesAreGone) {
  const auto a =
      with("[[fault]]\nkind = \"drop\"\ndevice = \"a\"\nat_s = 10\nfor_s = 10\nshare = 0.01\n", {"a"})
          .at("a");
  const double lost = static_cast<double>(clean("a").bytes.size() - a.bytes.size());
  EXPECT_NEAR(lost, 310.0, 90.0);
}

TEST_F(FaultScript, DuplicatesComeRightBehindTheOriginal) {
  const auto a =
      with("[[fault]]\nkind = \"duplicate\"\ndevice = \"a\"\nat_s = 10\nfor_s = 10\nshare = 0.1\n", {"a"})
          .at("a");
  const std::vector<int> counters = a.mt_counters();
  std::size_t twice = 0;
  for (std::size_t i = 1; i < counters.size(); ++i) {
    twice += counters[i] == counters[i - 1] ? 1 : 0;
    ASSERT_LE(counters[i] - counters[i - 1], 1);
  }
  EXPECT_NEAR(static_cast<double>(twice), 100.0, 48.0);  // 1000 messages, 5 sigma
  EXPECT_EQ(counters.size() - twice, clean("a").mt_counters().size());
}

TEST_F(FaultScript, CutMessagesLoseOnlyThemselves) {
  const auto a =
      with("[[fault]]\nkind = \"cut\"\ndevice = \"a\"\nat_s = 10\nfor_s = 10\nshare = 0.1\n", {"a"}).at("a");
  const std::size_t lost = clean("a").mt_frames().size() - a.mt_frames().size();
  EXPECT_NEAR(static_cast<double>(lost), 100.0, 48.0);
}

TEST_F(FaultScript, GarbageLosesNoMessage) {
  const auto a =
      with("[[fault]]\nkind = \"garbage\"\ndevice = \"a\"\nat_s = 10\nfor_s = 10\nshare = 0.1\n", {"a"})
          .at("a");
  EXPECT_GT(a.bytes.size(), clean("a").bytes.size() + 1000);
  EXPECT_GE(a.mt_frames().size(), clean("a").mt_frames().size());
}

TEST_F(FaultScript, AStallHoldsTheReadsBackAndLosesNothing) {
  const auto a = with("[[fault]]\nkind = \"stall\"\ndevice = \"a\"\nat_s = 10\nfor_s = 2\n", {"a"}).at("a");
  EXPECT_TRUE(a.bytes == clean("a").bytes);
  const auto [silence_s, since_s] = a.longest_silence();
  EXPECT_NEAR(since_s, 10.0, 0.011);
  EXPECT_NEAR(since_s + silence_s, 12.0, 1e-6);
  const auto after =
      std::find_if(a.reads.begin(), a.reads.end(), [&](const Read& read) { return read.at_s > 11.0; });
  EXPECT_NEAR(static_cast<double>(after->bytes.size()), 200.0 * kMtFrame, 2.0 * kMtFrame);
}

TEST_F(FaultScript, InABurstReadsLieOnItsMultiples) {
  const auto a =
      with("[[fault]]\nkind = \"burst\"\ndevice = \"a\"\nat_s = 10\nfor_s = 5\nevery_s = 0.25\n", {"a"})
          .at("a");
  EXPECT_TRUE(a.bytes == clean("a").bytes);
  std::size_t bursts = 0;
  for (const Read& read : a.reads) {
    if (read.at_s < 10.0 || read.at_s > 15.0 + 1e-9) continue;
    const double quarters = read.at_s / 0.25;
    EXPECT_NEAR(quarters, std::round(quarters), 1e-5);
    ++bursts;
  }
  EXPECT_EQ(bursts, 20U);
}

TEST_F(FaultScript, AClockJumpShowsInCountersAndTagsButNotInTheRhythm) {
  const auto streams = with(
      "[[fault]]\nkind = \"clock_jump\"\ndevice = [\"a\", \"ref\"]\nat_s = 10\nby_s = 2\n", {"a", "ref"});
  const std::vector<int> jumped = streams.at("a").mt_counters();
  const std::vector<int> plain = clean("a").mt_counters();
  ASSERT_EQ(jumped.size(), plain.size());
  EXPECT_EQ(jumped[500], plain[500]);
  EXPECT_EQ(jumped[1500], plain[1500] + 200);
  for (std::size_t i = 0; i < plain.size(); ++i)
    ASSERT_EQ(streams.at("a").reads[i].at_s, clean("a").reads[i].at_s);
  const auto validity = [](const Stream& stream) {
    const Read& last = stream.reads.back();
    return get_be<std::uint32_t>(std::span(last.bytes).subspan(17, 4));
  };
  EXPECT_EQ(validity(streams.at("ref")), validity(clean("ref")) + 20000);
}

TEST_F(FaultScript, ASkewedClockSamplesMoreOften) {
  const auto a =
      with("[[fault]]\nkind = \"clock_skew\"\ndevice = \"a\"\nat_s = 10\nfor_s = 10\nppm = 10000\n", {"a"})
          .at("a");
  EXPECT_NEAR(static_cast<double>(a.mt_frames().size() - clean("a").mt_frames().size()), 10.0, 1.0);
}

TEST_F(FaultScript, ARestartedMtxIsSilentBootsAndCountsAnew) {
  const auto a = with("[[fault]]\nkind = \"restart\"\ndevice = \"a\"\nat_s = 10\nfor_s = 2\n", {"a"}).at("a");
  const auto [silence_s, since_s] = a.longest_silence();
  EXPECT_NEAR(since_s, 10.0, 0.011);
  EXPECT_NEAR(silence_s, 2.0 + 1.7, 0.02);  // and the boot
  const Bytes wake_up = xsens::frame(xsens::kWakeUp, {});
  EXPECT_NE(std::search(a.bytes.begin(), a.bytes.end(), wake_up.begin(), wake_up.end()), a.bytes.end());
  // Nobody answers: it measures with what it had stored, and its counter began at 0 with the boot.
  const std::vector<int> counters = a.mt_counters();
  const auto anew = std::adjacent_find(counters.begin(), counters.end(), std::greater<>());
  ASSERT_NE(anew, counters.end());
  EXPECT_NEAR(*std::next(anew), 50.0, 2.0);  // 0.5 s of waiting for WakeUpAck
}

TEST_F(FaultScript, WhatIsSentWhileUnpluggedIsLostAndTheCounterGoesOn) {
  const auto a = with("[[fault]]\nkind = \"unplug\"\ndevice = \"a\"\nat_s = 10\nfor_s = 2\n", {"a"}).at("a");
  const std::vector<int> counters = a.mt_counters();
  int longest = 0;
  for (std::size_t i = 1; i < counters.size(); ++i)
    longest = std::max(longest, counters[i] - counters[i - 1]);
  EXPECT_NEAR(longest, 201.0, 1.0);
  EXPECT_NEAR(a.longest_silence().first, 2.0, 0.02);
}

float float_at(const Bytes& bytes, std::size_t offset) {
  return std::bit_cast<float>(get_be<std::uint32_t>(std::span(bytes).subspan(offset, 4)));
}

TEST_F(FaultScript, StuckGyrosRepeatThemselvesWhileTheAccelerometersGoOn) {
  const auto a =
      with("[[fault]]\nkind = \"stuck\"\ndevice = \"a\"\nat_s = 10\nfor_s = 5\nsensors = \"gyro\"\n", {"a"})
          .at("a");
  const std::vector<std::size_t> frames = a.mt_frames();
  for (std::size_t k = 1001; k < 1499; ++k) {
    ASSERT_EQ(float_at(a.bytes, frames[k] + 16), float_at(a.bytes, frames[1001] + 16));
    ASSERT_NE(float_at(a.bytes, frames[k] + 4), float_at(a.bytes, frames[k + 1] + 4));
  }
  EXPECT_NE(float_at(a.bytes, frames[1600] + 16), float_at(a.bytes, frames[1601] + 16));
}

TEST_F(FaultScript, SaturatedSensorsShowTheirRange) {
  const auto a = with(
                     "[[fault]]\nkind = \"saturation\"\ndevice = \"a\"\nat_s = 10\nfor_s = 5\n"
                     "gyro_range_deg_per_s = 0.1\naccel_range_mps2 = 5\n",
                     {"a"})
                     .at("a");
  const std::vector<std::size_t> frames = a.mt_frames();
  float largest = 0.0F;
  for (std::size_t k = 1001; k < 1499; ++k) {
    EXPECT_EQ(std::abs(float_at(a.bytes, frames[k] + 12)), 5.0F);  // gravity
    largest = std::max(largest, std::abs(float_at(a.bytes, frames[k] + 16)));
  }
  EXPECT_FLOAT_EQ(largest, static_cast<float>(0.1 * 3.14159265358979323846 / 180.0));
}

/// Bodies of the messages with an id, in stream order.
std::vector<Bytes> greis_bodies(const Stream& stream, const std::string& header, std::size_t size) {
  std::vector<Bytes> bodies;
  auto at = stream.bytes.begin();
  while ((at = std::search(at, stream.bytes.end(), header.begin(), header.end())) != stream.bytes.end()) {
    const auto begin = at + static_cast<std::ptrdiff_t>(header.size());
    if (stream.bytes.end() - begin < static_cast<std::ptrdiff_t>(size)) break;
    bodies.emplace_back(begin, begin + static_cast<std::ptrdiff_t>(size));
    at = begin;
  }
  return bodies;
}

double double_le(const Bytes& bytes, std::size_t offset) {
  std::array<std::uint8_t, 8> raw{};
  std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(offset), 8, raw.begin());
  return std::bit_cast<double>(raw);
}

TEST_F(FaultScript, AnRtkJumpMovesThePositionOnlyAndStaysFixed) {
  const auto gnss = with(
                        "[[fault]]\nkind = \"rtk_jump\"\ndevice = \"gnss\"\nat_s = 5\nfor_s = 2\n"
                        "by_n_m = [3.0, 0.0, -1.0]\n",
                        {"gnss"})
                        .at("gnss");
  const auto jumped = greis_bodies(gnss, "PG01E", 29);
  const auto plain = greis_bodies(clean("gnss"), "PG01E", 29);
  ASSERT_EQ(jumped.size(), plain.size());
  constexpr double kMeridianRadius_m = 6.36e6;
  EXPECT_NEAR((double_le(jumped[60], 0) - double_le(plain[60], 0)) * kMeridianRadius_m, 3.0, 0.02);
  EXPECT_NEAR(double_le(jumped[60], 16) - double_le(plain[60], 16), 1.0, 1e-3);
  EXPECT_EQ(jumped[60][28], 4);  // fixed
  EXPECT_EQ(jumped[20], plain[20]);
  EXPECT_EQ(jumped[90], plain[90]);
  EXPECT_EQ(greis_bodies(gnss, "VG012", 17), greis_bodies(clean("gnss"), "VG012", 17));
}

TEST_F(FaultScript, ALostSolutionIsOfTheTypeGiven) {
  const auto gnss =
      with("[[fault]]\nkind = \"solution\"\ndevice = \"gnss\"\nat_s = 5\nfor_s = 2\ntype = \"float\"\n",
           {"gnss"})
          .at("gnss");
  const auto bodies = greis_bodies(gnss, "PG01E", 29);
  EXPECT_EQ(bodies[40][28], 4);
  EXPECT_EQ(bodies[60][28], 3);
  EXPECT_EQ(bodies[80][28], 4);
}

TEST_F(FaultScript, MissingBlocksAreMissing) {
  const auto streams = with(
      "[[fault]]\nkind = \"missing\"\ndevice = \"ref\"\nat_s = 5\nfor_s = 2\nblocks = "
      "[\"raw_acceleration\"]\n"
      "[[fault]]\nkind = \"missing\"\ndevice = \"gnss\"\nat_s = 5\nfor_s = 2\nblocks = [\"SG\"]\n",
      {"ref", "gnss"});
  std::size_t without = 0;
  for (const Read& read : streams.at("ref").reads)
    without += (get_be<std::uint32_t>(std::span(read.bytes).subspan(3, 4)) & (1U << 28U)) == 0 ? 1 : 0;
  EXPECT_EQ(without, 200U);
  EXPECT_EQ(
      greis_bodies(clean("gnss"), "SG012", 17).size() - greis_bodies(streams.at("gnss"), "SG012", 17).size(),
      20U);
}

TEST_F(FaultScript, ARestartedReferenceAlignsAnew) {
  const auto ref =
      with("[[fault]]\nkind = \"restart\"\ndevice = \"ref\"\nat_s = 5\nfor_s = 1\n", {"ref"}).at("ref");
  EXPECT_NEAR(ref.longest_silence().first, 1.0 + 5.0, 0.02);
  const Read& after = ref.reads.back();
  // Header 25, angles 12 and 12, position 21 and 16, speeds 12 and 12, date 4, sensor status 8, user status.
  const auto user = get_be<std::uint32_t>(std::span(after.bytes).subspan(25 + 97, 4));
  EXPECT_NE(user & (1U << 26U), 0U);  // heading, roll and pitch invalid
  EXPECT_NE(user & (1U << 27U), 0U);  // alignment
  const auto counter = get_be<std::uint32_t>(std::span(after.bytes).subspan(21, 4));
  EXPECT_NEAR(counter, 100.0 * (30.0 - 11.0), 3.0);
}

TEST_F(FaultScript, RefusesWhatCannotBeWithItsPlace) {
  EXPECT_NE(refusal("x = \n").find("faults.toml:1: not TOML"), std::string::npos);
  EXPECT_NE(refusal("").find("no [[fault]]"), std::string::npos);
  EXPECT_NE(refusal("[[fault]]\nkind = \"sneeze\"\nat_s = 1\n").find("must be one of: flip"),
            std::string::npos);
  EXPECT_NE(refusal("[[fault]]\nkind = \"stall\"\n").find("needs at_s"), std::string::npos);
  EXPECT_NE(refusal("[[fault]]\nkind = \"flip\"\nat_s = 1\n").find("needs a share"), std::string::npos);
  EXPECT_NE(refusal("[[fault]]\nkind = \"stall\"\nat_s = 1\ndevice = \"c\"\n").find("names 'c'"),
            std::string::npos);
  EXPECT_NE(refusal("[[fault]]\nkind = \"stuck\"\nat_s = 1\ndevice = \"gnss\"\n").find("cannot befall"),
            std::string::npos);
  EXPECT_NE(refusal("[[fault]]\nkind = \"stall\"\nat_s = 1\nfro_s = 1\n").find("nearest is 'for_s'"),
            std::string::npos);
  Configuration faulty = plain_configuration();
  ASSERT_TRUE(parse_faults("[[fault]]\nkind = \"missing\"\nat_s = 1\ndevice = \"ref\"\nblocks = [\"moon\"]\n",
                           "faults.toml", faulty));
  const auto recorded = record(faulty, {folder_ / "refused", false, {}});
  ASSERT_FALSE(recorded);
  EXPECT_NE(recorded.error().text.find("'ref' has no block 'moon'"), std::string::npos);
}

TEST_F(FaultScript, TheExampleIsAcceptedForTheDemo) {
  auto demo = load_configuration(imuscope::test::source_path("config/demo.toml"));
  ASSERT_TRUE(demo);
  const auto loaded = load_faults(imuscope::test::source_path("config/faults.toml"), *demo);
  ASSERT_TRUE(loaded) << loaded.error().text;
  std::set<FaultKind> kinds;
  for (const Fault& fault : demo->faults) kinds.insert(fault.kind);
  EXPECT_EQ(kinds.size(), static_cast<std::size_t>(FaultKind::kSolution) + 1) << "every kind has its example";
}

}  // namespace
}  // namespace imusim
