/// Recordings: a seek gives the picture that playing gives, and what a stranger's folder says is bounded.

#include "view/player.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <fstream>
#include <nlohmann/json.hpp>
#include <vector>

#include "example_messages.h"
#include "publish/lcm_publisher.h"
#include "publish/message_codec.h"
#include "tests/results/report/synthetic_run.h"
#include "tests/support/shared_data.h"
#include "view/recorded_messages.h"

namespace imuscope::view {
namespace {

using nlohmann::json;

constexpr int kSeconds = 60;

/// A capture of a service that published for a while: S-IMU, navigation, status.
std::filesystem::path write_capture(int seconds = kSeconds) {
  auto file = test::scratch_folder() / "capture.lcm";
  auto bus = LcmPublisher::open("file://" + file.string() + "?mode=w");
  EXPECT_TRUE(bus) << bus.error().text();
  for (int tenth = 0; tenth < 10 * seconds; ++tenth) {
    const double t = 0.1 * tenth;
    auto navigation = test::example_navigation();
    navigation.time_s = t;
    navigation.lat_deg = 46.0 + 1e-5 * t;
    bus->publish(navigation, "NAVIGATION");
    auto calibration = test::example_calibration();
    calibration.time_s = t;
    calibration.sd_psi_x_deg = 1.0 / (1.0 + t);
    bus->publish(calibration, "CALIBRATION", "mtx1");
    auto errors = test::example_error();
    errors.rows.clear();
    for (int i = 0; i < 10; ++i) {
      error_row_t row{};
      row.time_s = t + 0.01 * i;
      row.counter = 10 * tenth + i;
      row.e_gyro_x_radps = 1e-3 * (tenth % 7);
      errors.rows.push_back(row);
    }
    errors.n_rows = element_count(errors.rows);
    bus->publish(errors, "ERROR", "mtx1");
    if (tenth % 10 == 0) {
      auto status = test::example_status();
      status.uptime_s = t;
      bus->publish(status, "STATUS");
    }
    if (tenth == 300) bus->publish(test::example_event("kerb"), "EVENT");
  }
  return file;
}

std::unique_ptr<Player> player_of(const std::filesystem::path& path) {
  auto recording = open_recording(path);
  EXPECT_TRUE(recording) << recording.error().text();
  if (!recording) return nullptr;
  auto player = Player::open(std::move(*recording));
  EXPECT_TRUE(player) << player.error().text();
  return player ? std::move(*player) : nullptr;
}

/// The whole picture, without the number of its beginning and without how it is played.
json content_of(const Player& player) {
  json whole = json::parse(player.whole());
  whole.erase("picture");
  whole.erase("play");
  return whole;
}

std::string seek(double time_s) { return json{{"seek_s", time_s}}.dump(); }

TEST(Player, PlaysEveryRowInTheTimeItTook) {
  auto player = player_of(write_capture());
  ASSERT_TRUE(player);
  EXPECT_NEAR(player->length_s(), kSeconds - 0.01, 1e-6);
  std::size_t rows = 0;
  double before_s = -1.0;
  json last;
  for (int turn = 0; turn < 2000; ++turn) {
    const std::string text = player->turn(0.1);
    if (text.empty()) break;
    last = json::parse(text);
    const json& news = last.at("errors");
    if (!news.contains("mtx1")) continue;
    if (news.at("mtx1").contains("past")) {
      rows += 10 * news.at("mtx1").at("past").size() / 13;  // the first part is the whole
      continue;
    }
    const json& flat = news.at("mtx1").at("rows");
    for (std::size_t i = 0; i < flat.size(); i += 7) {
      EXPECT_GT(flat.at(i), before_s);
      before_s = flat.at(i);
      ++rows;
    }
    EXPECT_NEAR(last.at("time_s"), 0.1 * (turn + 1), 0.25);
  }
  EXPECT_EQ(rows, 100U * kSeconds);
  EXPECT_EQ(last.at("play").at("playing"), false) << "it ends";
  EXPECT_TRUE(player->turn(0.1).empty());
  player->on_said(R"({"play":1})");
  EXPECT_LT(json::parse(player->turn(0.1)).at("time_s"), 1.0) << "and begins again";
}

TEST(Player, ASeekGivesThePictureThatPlayingGives) {
  const auto capture = write_capture();
  auto playing = player_of(capture);
  auto seeking = player_of(capture);
  ASSERT_TRUE(playing && seeking);
  while (playing->time_s() < 40.0) (void)playing->turn(0.1);
  seeking->on_said(R"({"pause":true})");
  seeking->on_said(seek(55.0));
  (void)seeking->turn(0.1);
  EXPECT_NEAR(seeking->time_s(), 55.0, 0.11);
  seeking->on_said(seek(10.0));
  (void)seeking->turn(0.1);
  EXPECT_NEAR(seeking->time_s(), 10.0, 0.11) << "backwards";
  seeking->on_said(seek(playing->time_s()));
  const json told = json::parse(seeking->turn(0.1));
  EXPECT_EQ(told.at("kind"), "whole");
  EXPECT_EQ(content_of(*seeking), content_of(*playing));
  EXPECT_EQ(told.at("marks").at(0).at("text"), "kerb");
  EXPECT_TRUE(seeking->turn(0.1).empty()) << "paused";
}

/// A recording that counts what is read of it, and may be one that nobody can enter but at its beginning.
class Counted final : public RecordedMessages {
 public:
  Counted(std::unique_ptr<RecordedMessages> recording, bool has_places, std::size_t& read)
      : recording_(std::move(recording)), has_places_(has_places), read_(read) {}
  bool next(std::vector<std::uint8_t>& message) override {
    ++read_;
    return recording_->next(message);
  }
  Result<void> rewind() override { return recording_->rewind(); }
  [[nodiscard]] std::optional<Place> place() const override {
    return has_places_ ? recording_->place() : std::nullopt;
  }
  Result<void> go_to(const Place& place) override { return recording_->go_to(place); }

 private:
  std::unique_ptr<RecordedMessages> recording_;
  bool has_places_;
  std::size_t& read_;
};

TEST(Player, AJumpReadsLittleOfALongCaptureAndShowsWhatPlayingShows) {
  constexpr int kLong_s = 600;
  const auto file = write_capture(kLong_s);
  std::size_t read = 0;
  std::size_t read_by_playing = 0;
  auto jumping = Player::open(std::make_unique<Counted>(std::move(*open_recording(file)), true, read));
  auto playing =
      Player::open(std::make_unique<Counted>(std::move(*open_recording(file)), false, read_by_playing));
  ASSERT_TRUE(jumping && playing);
  const std::size_t all = read;
  for (const double to_s : {500.0, 590.0, 20.0, 300.0, 290.0}) {
    read = 0;
    for (auto* player : {&*jumping, &*playing}) {
      (*player)->on_said(seek(to_s));
      (void)(*player)->turn(0.0);
    }
    EXPECT_LT(read, all / 20) << "a jump to " << to_s << " s";
    EXPECT_EQ(content_of(**jumping), content_of(**playing)) << to_s;
  }
}

/// The tables of a run folder have places, too, each its own.
TEST(Player, AJumpInARunFolderReadsFromTheLastPictureAndShowsWhatPlayingShows) {
  const auto folder = test::scratch_folder();
  test::write_synthetic_run(folder, {});
  std::size_t read = 0;
  std::size_t read_by_playing = 0;
  auto jumping = Player::open(std::make_unique<Counted>(std::move(*open_recording(folder)), true, read));
  auto playing =
      Player::open(std::make_unique<Counted>(std::move(*open_recording(folder)), false, read_by_playing));
  ASSERT_TRUE(jumping && playing);
  const std::size_t all = read;
  for (const double to_s : {52.0, 58.0, 12.0, 41.0, 35.0}) {
    read = 0;
    for (auto* player : {&*jumping, &*playing}) {
      (*player)->on_said(seek(to_s));
      (void)(*player)->turn(0.0);
    }
    EXPECT_LT(read, all / 4) << "a jump to " << to_s << " s";
    EXPECT_EQ(content_of(**jumping), content_of(**playing)) << to_s;
  }
}

TEST(Player, OfSeveralSeeksTheLastOneHolds) {
  auto player = player_of(write_capture());
  ASSERT_TRUE(player);
  player->on_said(seek(50.0));
  player->on_said(seek(20.0));
  player->on_said("{\"seek_s\":");
  player->on_said(R"({"mark":"nobody is there to hear it"})");
  (void)player->turn(0.1);
  EXPECT_NEAR(player->time_s(), 20.0, 0.11);
  player->on_said(seek(1e300));
  (void)player->turn(0.1);
  EXPECT_NEAR(player->time_s(), player->length_s(), 0.11);
}

TEST(Player, PlayedFastThePartsHoldTheExtremesInsteadOfEveryRow) {
  auto player = player_of(write_capture());
  ASSERT_TRUE(player);
  player->on_said(R"({"play":60})");
  (void)player->turn(0.1);
  const std::string part = player->turn(0.1);
  EXPECT_LT(part.size(), 60'000U);
  EXPECT_EQ(json::parse(part).at("kind"), "whole");
  EXPECT_NEAR(player->time_s(), 12.0, 0.2);
}

TEST(RecordedMessages, OfARunFolderAreWhatItsFilesSay) {
  const auto folder = test::scratch_folder();
  test::write_synthetic_run(folder, {});
  auto player = player_of(folder);
  ASSERT_TRUE(player);
  EXPECT_NEAR(player->length_s(), 60.0, 0.5);
  player->on_said(seek(player->length_s()));
  (void)player->turn(0.1);
  const json whole = json::parse(player->whole());
  EXPECT_EQ(whole.at("status").at("state"), "recorded");
  EXPECT_EQ(whole.at("imus").size(), 2U);
  // The last row of the table, read here.
  std::ifstream table(folder / "calibration_mtx1.csv");
  std::string header;
  std::string row;
  std::getline(table, header);
  for (std::string line; std::getline(table, line);) row = line;
  const auto cell = [&](const std::string& name) {
    std::istringstream names(header);
    std::istringstream cells(row);
    std::string one;
    std::string value;
    while (std::getline(names, one, ',') && std::getline(cells, value, ','))
      if (one == name) return std::stod(value);
    ADD_FAILURE() << name;
    return 0.0;
  };
  const json& calibration = whole.at("imus").at("mtx1").at("calibration");
  EXPECT_NEAR(calibration.at("psi_deg").at(2), cell("psi_z_deg"), 1e-5 * std::abs(cell("psi_z_deg")));
  EXPECT_NEAR(calibration.at("sd_r_m").at(0), cell("sd_r_x_m"), 1e-5 * cell("sd_r_x_m"));
  const json models = json::parse(std::ifstream(folder / "models.json")).at("models");
  EXPECT_EQ(whole.at("imus").at("mtx1").at("variances").size(),
            static_cast<std::size_t>(std::count_if(
                models.begin(), models.end(), [](const json& one) { return one.at("name") == "mtx1"; })));
  std::ifstream errors(folder / "errors_mtx1.csv");
  std::uint64_t rows = 0;
  for (std::string line; std::getline(errors, line);) ++rows;
  std::ifstream second(folder / "errors_mtx2.csv");
  for (std::string line; std::getline(second, line);) ++rows;
  EXPECT_EQ(whole.at("rows"), rows - 2);
}

TEST(RecordedMessages, AFolderOfAStrangerEndsNothing) {
  const auto folder = test::scratch_folder();
  test::write_synthetic_run(folder, {});
  std::ofstream(folder / "errors_mtx1.csv")
      << "time_s,utc_s,counter,e_gyro_x_radps,e_gyro_y_radps,e_gyro_z_radps,e_accel_x_mps2,e_accel_y_mps2,"
         "e_accel_z_mps2,regime\n"
      << "nan,0,0,1,1,1,1,1,1,static\n1e300,0,0,1,1,1,1,1,1,static\n1e300,0,0,1,1,1,1,1,1,dynamic\n"
      << "-5,0,0,,x,1,1,1,1,</script>\n";
  std::ofstream(folder / "run.json")
      << R"({"devices":[{"name":"mtx1","role":"study"},{"name":"../../etc/passwd","role":"study"},7,null]})";
  std::ofstream(folder / "models.json") << R"({"models":[{"name":"mtx1","wv":[{"tau_s":"x"},7]},7]})";
  auto player = player_of(folder);
  ASSERT_TRUE(player);
  player->on_said(seek(1e308));
  (void)player->turn(0.1);
  EXPECT_TRUE(json::accept(player->whole()));
}

TEST(RecordedMessages, WhatIsNoRecordingIsTold) {
  const auto folder = test::scratch_folder();
  EXPECT_FALSE(open_recording(folder)) << "an empty folder";
  EXPECT_FALSE(open_recording(folder / "absent"));
  std::ofstream(folder / "notes.txt") << "no capture";
  EXPECT_FALSE(open_recording(folder / "notes.txt"));
  // A log without anything that a page shows.
  const auto log = folder / "raw.lcm";
  {
    auto bus = LcmPublisher::open("file://" + log.string() + "?mode=w");
    ASSERT_TRUE(bus);
    bus->publish(test::example_pc_clock(), "PC_CLOCK");
  }
  auto recording = open_recording(log);
  ASSERT_TRUE(recording);
  const auto player = Player::open(std::move(*recording));
  ASSERT_FALSE(player);
  EXPECT_NE(player.error().text().find("imuscope process"), std::string::npos);
}

}  // namespace
}  // namespace imuscope::view
