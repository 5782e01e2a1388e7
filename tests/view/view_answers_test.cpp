/// What the page is told, whole, and a run folder as messages.

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>

#include "example_messages.h"
#include "publish/message_codec.h"
#include "tests/support/lcm_text.h"
#include "tests/support/recorded_answer.h"
#include "tests/support/shared_data.h"
#include "view/message_json.h"
#include "view/picture.h"
#include "view/player.h"
#include "view/recorded_messages.h"

namespace imuscope::view {
namespace {

using nlohmann::json;

constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();

template <typename Message>
bool tell(Picture& picture, const Message& message) {
  return picture.hear(encode_message(message));
}

calibration_t whole_calibration(double time_s, const std::string& name = "mtx1") {
  calibration_t m = test::example_calibration();
  m.name = name;
  m.time_s = time_s;
  double next = 0.001 * time_s;
  for (double* value : {&m.psi_x_deg, &m.psi_y_deg, &m.psi_z_deg, &m.r_x_m, &m.r_y_m, &m.r_z_m, &m.t_d_ms,
                        &m.sd_psi_x_deg, &m.sd_psi_y_deg, &m.sd_psi_z_deg, &m.sd_r_x_m, &m.sd_r_y_m,
                        &m.sd_r_z_m, &m.sd_t_d_ms, &m.goal_sd_psi_deg, &m.goal_sd_r_m, &m.goal_sd_t_d_ms})
    *value = next += 0.125;
  m.q_w = 0.8;
  m.q_x = 0.36;
  m.q_y = 0.48;
  m.q_z = 0.0;
  m.psi_x_observable = m.r_y_observable = m.t_d_observable = 1;
  m.validity = calibration_t::CONVERGING;
  return m;
}

navigation_t whole_navigation(double time_s) {
  navigation_t m = test::example_navigation();
  m.time_s = time_s;
  m.lat_deg = 46.5 + 1e-5 * time_s;
  m.lon_deg = 8.6 - 2e-5 * time_s;
  double next = time_s;
  for (double* value : {&m.v_n_mps, &m.v_e_mps, &m.v_d_mps, &m.roll_deg, &m.pitch_deg, &m.heading_deg,
                        &m.sd_n_m, &m.sd_e_m, &m.sd_heading_deg})
    *value = next += 0.25;
  return m;
}

imuscope::error_t whole_errors(std::int64_t sequence, double begin_s, int n,
                               const std::string& name = "mtx1") {
  imuscope::error_t m = test::example_error(name);
  m.sequence = sequence;
  m.validity = imuscope::error_t::CONVERGING;
  m.rows.clear();
  for (int i = 0; i < n; ++i) {
    error_row_t row{};
    row.time_s = begin_s + 0.01 * i;
    const double e = 0.001 * (i % 2 == 0 ? i : -i);
    row.e_gyro_x_radps = e + 0.1;
    row.e_gyro_y_radps = i == 1 ? kNothing : 2 * e;
    row.e_gyro_z_radps = 3 * e;
    row.e_accel_x_mps2 = 4 * e;
    row.e_accel_y_mps2 = 5 * e - 1;
    row.e_accel_z_mps2 = 6 * e;
    m.rows.push_back(row);
  }
  m.n_rows = element_count(m.rows);
  return m;
}

std::string lines(const std::string& text) { return json::parse(text).dump(1) + '\n'; }

TEST(ViewWhole, PartsAndTheWholeOfAPicture) {
  Picture picture;
  std::string text = lines(picture.part());
  text += lines(picture.whole());
  for (int k = 0; k < 3; ++k) {
    status_t status = test::example_status();
    status.sequence = k;
    status.uptime_s = 60.0 + k;
    EXPECT_TRUE(tell(picture, status));
    EXPECT_TRUE(tell(picture, whole_calibration(10.0 + k)));
    EXPECT_TRUE(tell(picture, whole_calibration(10.5 + k, "mtx2")));
    EXPECT_TRUE(tell(picture, whole_navigation(10.25 + k)));
    EXPECT_TRUE(tell(picture, test::example_odometry()));
    EXPECT_TRUE(tell(picture, whole_errors(2 * k, 11.0 + k, 4)));
    EXPECT_TRUE(tell(picture, whole_errors(k, 11.125 + k, 3, "mtx2")));
    if (k == 1) {
      EXPECT_TRUE(tell(picture, test::example_wavelet_variance()));
      EXPECT_TRUE(tell(picture, test::example_noise_model()));
      EXPECT_TRUE(tell(picture, test::example_event("kerb")));
      EXPECT_TRUE(tell(picture, test::example_event("bridge")));
    }
    EXPECT_TRUE(picture.has_news());
    text += lines(picture.part(R"(,"silent_s":0.5)"));
    EXPECT_FALSE(picture.has_news());
  }
  text += lines(picture.whole());
  EXPECT_EQ(picture.rows(), 21U);
  EXPECT_EQ(picture.messages_lost(), 2U);
  EXPECT_DOUBLE_EQ(picture.time_s(), 13.145);
  test::expect_recorded("view/picture.txt", text);
}

TEST(ViewWhole, NothingOfAMessageThatIsNoneIsTaken) {
  Picture picture;
  (void)picture.part();
  const auto navigation = encode_message(whole_navigation(1.0));
  EXPECT_FALSE(picture.hear(std::span(navigation).first(7)));
  EXPECT_FALSE(picture.hear(std::span(navigation).first(8)));
  EXPECT_FALSE(picture.hear(std::span(navigation).first(navigation.size() - 1)));
  EXPECT_FALSE(tell(picture, test::example_pc_clock()));
  const auto event = encode_message(test::example_event());
  EXPECT_FALSE(picture.hear(std::span(event).first(event.size() - 1)));
  EXPECT_FALSE(picture.has_news());
  EXPECT_TRUE(picture.hear(navigation));
  EXPECT_TRUE(picture.has_news());
}

TEST(ViewWhole, APictureGoesOnOrBeginsAnew) {
  const auto number_of = [](const std::string& part) { return json::parse(part).at("picture").get<int>(); };
  Picture picture;
  EXPECT_EQ(number_of(picture.whole()), 0);
  const auto told = [&](std::int64_t sequence, double uptime_s) {
    status_t status = test::example_status();
    status.sequence = sequence;
    status.uptime_s = uptime_s;
    EXPECT_TRUE(tell(picture, status));
    return number_of(picture.whole());
  };
  EXPECT_EQ(told(5, 60.0), 0);
  EXPECT_EQ(told(6, 60.0), 0);
  EXPECT_EQ(told(7, 59.0), 0) << "its count goes on";
  EXPECT_EQ(told(7, 59.0), 0);
  EXPECT_EQ(told(7, 58.0), 1);
  EXPECT_EQ(told(0, 58.0), 1) << "its time stands still";
  EXPECT_EQ(told(0, 1.0), 2);
  Picture other;
  tell(other, whole_navigation(5.0));
  picture.become(other);
  EXPECT_TRUE(picture.has_news());
  EXPECT_EQ(number_of(picture.whole()), 3);
  EXPECT_EQ(json::parse(picture.part()).at("kind"), "whole");
  EXPECT_EQ(json::parse(picture.part()).at("kind"), "part");
  picture.tell_all_next();
  EXPECT_TRUE(picture.has_news());
  EXPECT_EQ(json::parse(picture.part()).at("kind"), "whole");
  picture.begin_anew();
  EXPECT_TRUE(picture.has_news());
  EXPECT_EQ(picture.time_s(), 0.0);
}

TEST(ViewWhole, APictureHoldsNoMoreThanItsBounds) {
  Picture picture;
  (void)picture.part();
  for (std::size_t i = 0; i <= Picture::kNamesMax; ++i)
    tell(picture, whole_calibration(1.0, "imu" + std::to_string(i)));
  EXPECT_EQ(json::parse(picture.whole()).at("imus").size(), Picture::kNamesMax);
  const auto more = static_cast<int>(Picture::kMarksMax) + 1;
  for (int i = 0; i < more; ++i) tell(picture, test::example_event("mark " + std::to_string(i)));
  EXPECT_EQ(json::parse(picture.whole()).at("marks").size(), Picture::kMarksMax);
  EXPECT_EQ(json::parse(picture.part()).at("marks").at(0).at("text"), "mark 1");
  tell(picture, test::example_event("one more"));
  EXPECT_EQ(json::parse(picture.part()).at("marks").size(), 1U);
  Picture full;
  (void)full.part();
  for (int k = 0; k < 11; ++k) tell(full, whole_errors(k, 0.1 * k, 400));
  const json part = json::parse(full.part());
  EXPECT_EQ(part.at("errors").at("mtx1").at("rows").size(), 7 * Picture::kRowsMax);
  EXPECT_EQ(part.at("rows"), 4400);
  EXPECT_EQ(part.at("rows_left_out"), 4400 - Picture::kRowsMax);
  for (std::size_t k = 0; k <= Picture::kPastMax; ++k) tell(full, whole_errors(11, 2.0, 1));
  EXPECT_EQ(json::parse(full.whole()).at("errors").at("mtx1").at("past").size(), 13 * Picture::kPastMax);
}

TEST(ViewWhole, ATrackIsDrawnStepByStepAndWherePlacesAreSome) {
  Picture picture;
  (void)picture.part();
  const auto go = [&](double lat_deg, double lon_deg) {
    navigation_t m = whole_navigation(1.0);
    m.lat_deg = lat_deg;
    m.lon_deg = lon_deg;
    tell(picture, m);
  };
  go(90.1, 0.0);
  go(0.0, 360.1);
  go(kNothing, 0.0);
  EXPECT_EQ(json::parse(picture.part()).at("track").size(), 0U);
  go(45.0, 179.9999);
  go(45.0 + 0.4 / 111'131.7, 179.9999);  // 0.4 m of a meridian's degree, GRS-80
  go(45.0 + 0.6 / 111'131.7, 179.9999);
  go(45.0, -179.9999);  // over the date line
  go(45.0, 539.9999 - 360.0);
  const json track = json::parse(picture.part()).at("track");
  ASSERT_EQ(track.size(), 8U);
  EXPECT_EQ(track.at(0), 0.0);
  EXPECT_EQ(track.at(1), 0.0);
  EXPECT_EQ(track.at(3), 0.6);
  EXPECT_NEAR(track.at(4), 2e-4 * 78'846.8, 0.06);  // a degree of longitude at 45 degrees
  EXPECT_EQ(track.at(5), 0.0);
  EXPECT_EQ(track.at(6), 0.0);
}

TEST(ViewWhole, WhatNobodyKnowsIsNull) {
  status_t status = test::example_status();
  status.refit_duration_s = status.devices[0].latency_ms = kNothing;
  status.devices[0].data_age_s = 0.123456789;
  status.reason = std::string(400, 'x') + "\n";
  std::string text = to_json(status).dump(1) + '\n';
  calibration_t calibration = whole_calibration(1.0);
  calibration.psi_x_deg = calibration.time_s = std::numeric_limits<double>::infinity();
  text += to_json(calibration).dump(1) + '\n';
  navigation_t navigation = whole_navigation(2.0);
  navigation.lat_deg = navigation.gnss_age_s = kNothing;
  navigation.lon_deg = 8.123456789012;
  text += to_json(navigation).dump(1) + '\n';
  text += to_json(test::example_odometry()).dump(1) + '\n';
  text += to_json(test::example_wavelet_variance()).dump(1) + '\n';
  text += to_json(test::example_noise_model()).dump(1) + '\n';
  std::string numbers;
  for (const double value : {0.0, 1.0 / 3.0, -1234567.0, 1e-9, kNothing}) {
    append_number(numbers, value);
    numbers += ' ';
  }
  test::expect_recorded("view/json.txt", text + numbers + '\n');
}

/// Encoded, by the fingerprint that it begins with.
std::string message_words(const std::vector<std::uint8_t>& message) {
  static const test::LcmText kReader;
  const auto begins_as = [&](std::int64_t hash) {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < 8; ++i) value = value << 8U | message[i];
    return static_cast<std::uint64_t>(hash) == value;
  };
  const std::map<std::string, std::int64_t> types{{"navigation_t", navigation_t::getHash()},
                                                  {"calibration_t", calibration_t::getHash()},
                                                  {"error_t", imuscope::error_t::getHash()},
                                                  {"noise_model_t", noise_model_t::getHash()},
                                                  {"wavelet_variance_t", wavelet_variance_t::getHash()},
                                                  {"status_t", status_t::getHash()}};
  for (const auto& [name, hash] : types)
    if (begins_as(hash)) return kReader.text(name, message);
  return "another message\n";
}

void write_file(const std::filesystem::path& path, const std::string& text) { std::ofstream(path) << text; }

std::string table(const std::string& header, int columns, const std::vector<double>& times_s) {
  std::string text = header + '\n';
  for (const double time_s : times_s) {
    text += fmt::format("{}", time_s);
    for (int i = 1; i < columns; ++i) text += fmt::format(",{}", 10 * i + time_s);
    text += '\n';
  }
  return text;
}

std::filesystem::path write_run_folder() {
  const auto folder = test::scratch_folder();
  write_file(
      folder / "navigation.csv",
      table("time_s,lat_deg,lon_deg,height_m,v_n_mps,v_e_mps,v_d_mps,roll_deg,pitch_deg,heading_deg,sd_n_m,"
            "sd_e_m,sd_heading_deg",
            13, {0.125, 0.375, 0.625}) +
          "nan,1,2,3\n");
  write_file(
      folder / "calibration_left.csv",
      table("time_s,psi_x_deg,psi_y_deg,psi_z_deg,q_w,q_x,q_y,q_z,r_x_m,r_y_m,r_z_m,t_d_ms,sd_psi_x_deg,"
            "sd_psi_y_deg,sd_psi_z_deg,sd_r_x_m,sd_r_y_m,sd_r_z_m,sd_t_d_ms",
            19, {0.25, 0.5}));
  std::string errors =
      "time_s,e_gyro_x_radps,e_gyro_y_radps,e_gyro_z_radps,e_accel_x_mps2,e_accel_y_mps2,e_accel_z_mps2,regime\n";
  for (int i = 0; i < 16; ++i)
    errors += fmt::format("{},{},{},{},{},,{},{}\n", 0.02 * i, i + 0.1, i + 0.2, i + 0.3, i + 0.4, i + 0.6,
                          i < 8 ? "static" : "dynamic");
  write_file(folder / "errors_left.csv", errors);
  write_file(folder / "models.json", R"({"models":[
    {"name":"left","axis":"gyro_x","regime":"static","unit":"rad/s","n":6000,"model":"WN+RW","intervals":"quick",
     "identifiable":true,"j_test":{"p_value":0.25},
     "parameters":[{"process":"WN","name":"sigma2","unit":"a","value":1.5},{"process":"RW","name":"gamma2","unit":"b"}],
     "wv":[{"tau_s":0.02,"value":1,"ci_low":2,"ci_high":3,"n":4,"fitted":5},{"tau_s":0.04,"n":-4}]},
    {"name":"left","axis":"accel_z","regime":"dynamic","unit":"m/s^2","n":1e300,"model":"WN","identifiable":1,
     "parameters":3,"wv":[]},
    {"name":"left","axis":"accel_y","wv":7},
    {"name":"../up","axis":"accel_z","wv":[]},
    {"name":"right","axis":"gyro_y","wv":[{"tau_s":0.5,"value":6,"ci_low":7,"ci_high":8,"n":9,"fitted":10}]}]})");
  write_file(folder / "run.json",
             R"({"name":"rich","version":"1.2","configuration_sha256":"abc","duration_s":12.5,
    "devices":[
    {"name":"airins","role":"reference","protocol":"csv_imu","rate_hz":200,"samples":1},
    {"name":"left","role":"study","protocol":"xsens_mt","problem":"loose","rate_hz":100,"samples":11,
     "samples_lost":12,"late":13,"refused":14,"frames_dropped":15,"bad_checksums":16,"clock_resets":17,
     "time_budget":{"latency_s":0.004,"clock_drift_ppm":-11.5}},
    {"name":"right","role":"study"},{"name":"../up","role":"study"}]})");
  return folder;
}

TEST(ViewWhole, ARunFolderAsMessages) {
  auto recording = open_recording(write_run_folder());
  ASSERT_TRUE(recording) << recording.error().text();
  std::string text;
  std::vector<std::uint8_t> message;
  std::optional<RecordedMessages::Place> place;
  std::string after_place;
  int n = 0;
  while ((*recording)->next(message)) {
    const std::string words = message_words(message);
    text += words;
    if (place) after_place += words;
    if (++n == 9) place = (*recording)->place();
    EXPECT_EQ((*recording)->place().has_value(), n >= 5) << n << ": what comes first cannot be entered";
  }
  test::expect_recorded("view/run_folder.txt", text);
  ASSERT_TRUE(place);
  ASSERT_TRUE((*recording)->go_to(*place));
  std::string again;
  while ((*recording)->next(message)) again += message_words(message);
  EXPECT_EQ(again, after_place);
  ASSERT_TRUE((*recording)->rewind());
  std::string anew;
  while ((*recording)->next(message)) anew += message_words(message);
  EXPECT_EQ(anew, text);
  ASSERT_TRUE((*recording)->go_to({{1, 2}})) << "a place of another recording is its beginning";
  ASSERT_TRUE((*recording)->next(message));
  EXPECT_EQ(text.find(message_words(message)), 0U);
}

TEST(ViewWhole, HowARecordingIsPlayed) {
  auto recording = open_recording(write_run_folder());
  ASSERT_TRUE(recording);
  auto player = Player::open(std::move(*recording));
  ASSERT_TRUE(player) << player.error().text();
  EXPECT_EQ((*player)->length_s(), 0.625);
  std::string text;
  const auto add = [&](const std::string& part) {
    if (part.empty()) {
      text += "nothing\n";
      return;
    }
    const json told = json::parse(part);
    text += fmt::format("{} {} {} {}\n", told.at("kind").get<std::string>(), told.at("picture").get<int>(),
                        told.at("time_s").get<double>(), told.at("play").dump());
  };
  add((*player)->whole());
  add((*player)->turn(0.125));
  (*player)->on_said(R"({"play":2})");
  add((*player)->turn(0.125));
  (*player)->on_said(R"({"pause":true})");
  add((*player)->turn(0.125));
  add((*player)->turn(0.125));
  (*player)->on_said(R"({"seek_s":0.25})");
  add((*player)->turn(0.0));
  (*player)->on_said(R"({"seek_s":99})");
  add((*player)->turn(0.0));
  (*player)->on_said("nonsense");
  add((*player)->turn(0.1));
  (*player)->on_said(R"({"play":20})");
  add((*player)->turn(0.0));
  add((*player)->turn(0.01));
  (*player)->on_said(R"({"play":10})");
  add((*player)->turn(0.01));
  add((*player)->turn(1.0));
  add((*player)->turn(1.0));
  test::expect_recorded("view/played.txt", text);
}

}  // namespace
}  // namespace imuscope::view
