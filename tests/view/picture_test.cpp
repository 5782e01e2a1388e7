/// What the page is told of what was heard: all rows, in bounded memory, whatever comes.

#include "view/picture.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "example_messages.h"
#include "publish/message_codec.h"
#include "view/thinned_curve.h"

namespace imuscope::view {
namespace {

using nlohmann::json;

template <typename Message>
bool hear(Picture& picture, const Message& message) {
  return picture.hear(encode_message(message));
}

imuscope::error_t errors(std::int64_t sequence, double begin_s, int rows, const std::string& name = "mtx1") {
  imuscope::error_t m = test::example_error(name);
  m.sequence = sequence;
  m.rows.clear();
  for (int i = 0; i < rows; ++i) {
    error_row_t row{};
    row.time_s = begin_s + 0.01 * i;
    row.e_gyro_x_radps = 1e-3 * i;
    row.e_accel_z_mps2 = -0.1 * i;
    m.rows.push_back(row);
  }
  m.n_rows = element_count(m.rows);
  return m;
}

TEST(Picture, APartHoldsWhatIsNewAndTheNextOneDoesNot) {
  Picture picture;
  (void)picture.part();  // the first is always whole
  ASSERT_TRUE(hear(picture, test::example_status()));
  ASSERT_TRUE(hear(picture, test::example_calibration()));
  ASSERT_TRUE(hear(picture, test::example_navigation()));
  ASSERT_TRUE(hear(picture, test::example_odometry()));
  ASSERT_TRUE(hear(picture, test::example_wavelet_variance()));
  ASSERT_TRUE(hear(picture, test::example_noise_model()));
  ASSERT_TRUE(hear(picture, test::example_event("kerb")));
  ASSERT_TRUE(hear(picture, errors(0, 20.0, 10)));
  EXPECT_TRUE(picture.has_news());
  const json part = json::parse(picture.part(R"(,"silent_s":0.5)"));
  EXPECT_EQ(part.at("kind"), "part");
  EXPECT_EQ(part.at("status").at("state"), "degraded");
  EXPECT_EQ(part.at("status").at("devices").at(0).at("rate_hz"), 99.9);
  EXPECT_EQ(part.at("status").at("alarms").at(0).at("remedy"), "run ip route add");
  EXPECT_EQ(part.at("imus").at("mtx1").at("calibration").at("sd_psi_deg").at(0), 0.1);
  EXPECT_EQ(part.at("imus").at("mtx1").at("variances").at(0).at("ci_high").at(1), 7e-7);
  EXPECT_EQ(part.at("imus").at("mtx1").at("models").at(0).at("model"), "WN");
  EXPECT_EQ(part.at("navigation").at("lat_deg"), 46.5);
  EXPECT_EQ(part.at("marks").at(0).at("text"), "kerb");
  EXPECT_EQ(part.at("silent_s"), 0.5);
  const json& rows = part.at("errors").at("mtx1").at("rows");
  ASSERT_EQ(rows.size(), 70U);
  EXPECT_NEAR(rows.at(7 * 9), 20.09, 1e-9);
  EXPECT_NEAR(rows.at(7 * 9 + 1), 9e-3, 1e-9);
  EXPECT_NEAR(rows.at(7 * 9 + 6), -0.9, 1e-9);
  EXPECT_FALSE(picture.has_news());
  const json none = json::parse(picture.part());
  EXPECT_FALSE(none.contains("status"));
  EXPECT_FALSE(none.contains("navigation"));
  EXPECT_FALSE(none.contains("marks"));
  EXPECT_TRUE(none.at("imus").empty());
  EXPECT_TRUE(none.at("errors").empty());
}

TEST(Picture, TheWholeHoldsThePastAndTakesNothingFromTheParts) {
  Picture picture;
  for (int i = 0; i < 50; ++i) hear(picture, errors(i, 0.1 * i, 10));
  hear(picture, test::example_calibration());
  const json whole = json::parse(picture.whole());
  EXPECT_EQ(whole.at("kind"), "whole");
  const json& past = whole.at("errors").at("mtx1").at("past");
  ASSERT_EQ(past.size(), 50U * 13U);
  EXPECT_NEAR(past.at(1), 0.0, 1e-12);
  EXPECT_NEAR(past.at(2), 9e-3, 1e-12) << "the most of the first tenth of a second";
  EXPECT_NEAR(past.at(11), -0.9, 1e-12) << "the least of the accelerometer's z";
  EXPECT_EQ(whole.at("imus").at("mtx1").at("convergence").size(), 4U);
  EXPECT_EQ(json::parse(picture.part()).at("kind"), "whole") << "pages that knew nothing of it get all";
  hear(picture, errors(50, 5.0, 10));
  EXPECT_EQ(json::parse(picture.whole()).at("rows"), 510);
  const json part = json::parse(picture.part());
  EXPECT_EQ(part.at("rows"), 510);
  EXPECT_EQ(part.at("errors").at("mtx1").at("rows").size(), 70U);
}

TEST(Picture, MessagesThatAreMissingAreCountedAndABeginningIsNone) {
  Picture picture;
  hear(picture, errors(7, 0.0, 1));
  hear(picture, errors(8, 0.1, 1));
  hear(picture, errors(11, 0.4, 1));
  EXPECT_EQ(picture.messages_lost(), 2U);
  hear(picture, errors(0, 0.0, 1));
  EXPECT_EQ(picture.messages_lost(), 2U);
}

TEST(Picture, AServiceThatBeganAnewIsAnotherPicture) {
  Picture picture;
  hear(picture, test::example_status());
  hear(picture, test::example_wavelet_variance());
  const json before = json::parse(picture.part());
  auto again = test::example_status();
  again.uptime_s = 0.5;
  hear(picture, again);
  const json after = json::parse(picture.part());
  EXPECT_EQ(after.at("kind"), "whole");
  EXPECT_NE(after.at("picture"), before.at("picture"));
  EXPECT_TRUE(after.at("imus").empty()) << "what the run before knew is gone";
}

TEST(Picture, TheTrackIsInMetresOfItsFirstPosition) {
  Picture picture;
  auto n = test::example_navigation();
  n.lat_deg = 46.0;
  n.lon_deg = 7.0;
  hear(picture, n);
  n.lat_deg += 0.001;
  hear(picture, n);
  n.lon_deg += 0.001;
  hear(picture, n);
  hear(picture, n);  // at rest: no further point
  const json track = json::parse(picture.whole()).at("track");
  ASSERT_EQ(track.size(), 6U);
  // One degree of latitude and of longitude at 46 degrees on WGS-84: 111.15 and 77.47 km (geodetic tables).
  EXPECT_NEAR(track.at(3), 111.15, 0.06);
  EXPECT_NEAR(track.at(4), 77.47, 0.06);
}

TEST(Picture, TheMountingIsDrawnOnceAndAgainOnlyWhereItChanged) {
  Picture picture;
  (void)picture.part();
  auto calibration = test::example_calibration();
  calibration.q_w = 1.0;
  calibration.q_x = calibration.q_y = calibration.q_z = 0.0;
  const auto drawing_after = [&] {
    hear(picture, calibration);
    const json part = json::parse(picture.part());
    return part.contains("mounting") ? part.at("mounting").get<std::string>() : "none";
  };
  const std::string first = drawing_after();
  EXPECT_NE(first.find("<svg"), std::string::npos);
  EXPECT_NE(first.find(calibration.name), std::string::npos);
  calibration.sd_r_x_m *= 0.9;
  EXPECT_EQ(drawing_after(), "none");
  calibration.r_x_m = 0.5 * calibration.r_x_m;
  EXPECT_NE(drawing_after(), "none");
  EXPECT_TRUE(json::parse(picture.whole()).contains("mounting"));
  // A mounting that nobody knows is not drawn.
  calibration.q_w = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(drawing_after(), "");
}

TEST(Picture, WhatNobodyKnowsIsNull) {
  Picture picture;
  auto n = test::example_navigation();
  n.lat_deg = kUnknown;
  n.time_s = kUnknown;
  hear(picture, n);
  auto e = errors(0, 1.0, 3);
  e.rows[1].e_gyro_x_radps = kUnknown;
  e.rows[2].time_s = kUnknown;
  hear(picture, e);
  auto c = test::example_calibration();
  c.psi_x_deg = std::numeric_limits<double>::infinity();
  hear(picture, c);
  const json whole = json::parse(picture.whole());
  EXPECT_TRUE(whole.at("navigation").at("lat_deg").is_null());
  EXPECT_TRUE(whole.at("track").empty());
  EXPECT_TRUE(whole.at("imus").at("mtx1").at("calibration").at("psi_deg").at(0).is_null());
  EXPECT_EQ(picture.time_s(), 12.5) << "of the calibration";
}

TEST(Picture, WhatAStrangerSendsWithoutEndIsBounded) {
  Picture picture;
  (void)picture.part();
  const std::string text = "</script>\n\x1b[2J\xff" + std::string(5000, 'x');
  for (int i = 0; i < 1000; ++i) {
    hear(picture, errors(i, 0.1 * i, 100, "imu" + std::to_string(i)));
    hear(picture, errors(i, i, 500));
    hear(picture, test::example_event(text));
    auto n = test::example_navigation();
    n.lat_deg = -90.0 + 0.18 * i;
    hear(picture, n);
    auto c = test::example_calibration();
    c.name = text;
    c.advice = text;
    hear(picture, c);
  }
  const std::string part = picture.part();
  const std::string whole = picture.whole();
  ASSERT_TRUE(json::accept(part));
  ASSERT_TRUE(json::accept(whole));
  const json told = json::parse(part);
  EXPECT_LE(told.at("errors").size(), Picture::kNamesMax);
  for (const auto& [name, news] : told.at("errors").items())
    EXPECT_LE(news.at("rows").size(), 7 * Picture::kRowsMax) << name;
  EXPECT_GT(told.at("rows_left_out"), 0) << "and what was left out is told";
  EXPECT_LE(told.at("track").size(), 2 * Picture::kTrackPointsMax);
  EXPECT_LE(told.at("marks").size(), Picture::kMarksMax);
  EXPECT_LT(whole.size(), 1'000'000U);
  EXPECT_EQ(whole.find('\x1b'), std::string::npos);
  for (std::uint8_t cut = 0; cut < 100; ++cut) {
    auto bytes = encode_message(test::example_status());
    bytes.resize(bytes.size() > cut ? bytes.size() - cut - 1 : 0);
    EXPECT_FALSE(picture.hear(bytes)) << "cut off";
  }
  EXPECT_FALSE(picture.hear({}));
}

TEST(ThinnedCurve, KeepsItsFirstPointAndItsShapeInBoundedMemory) {
  ThinnedCurve<1> curve(100);
  for (int i = 0; i < 100'000; ++i) curve.add({static_cast<double>(i)});
  const auto& points = curve.points();
  ASSERT_GE(points.size(), 50U);
  ASSERT_LE(points.size(), 100U);
  EXPECT_EQ(points.front()[0], 0.0);
  const double step = points[1][0];
  for (std::size_t i = 0; i < points.size(); ++i) EXPECT_EQ(points[i][0], step * static_cast<double>(i));
  EXPECT_GT(points.back()[0], 100'000.0 - step - 1.0);
}

}  // namespace
}  // namespace imuscope::view
