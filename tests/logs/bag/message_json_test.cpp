#include "logs/bag/message_json.h"

#include <gtest/gtest.h>
#include <cmath>
#include <imuscope/calibration_t.hpp>
#include <imuscope/error_t.hpp>
#include <imuscope/event_t.hpp>
#include <imuscope/navigation_t.hpp>
#include <imuscope/noise_model_t.hpp>
#include <nlohmann/json.hpp>

#include "publish/message_codec.h"
#include "tests/support/recorded_answer.h"

namespace imuscope::bag {
namespace {

using nlohmann::json;

TEST(MessageJson, EveryFieldHasItsNameAndValue) {
  navigation_t navigation{};
  navigation.utime = 1'700'000'000'123'456;
  navigation.lat_deg = 46.519971839107100;
  navigation.gnss_age_s = std::nan("");
  const auto text = message_text(encode_message(navigation));
  ASSERT_TRUE(text);
  EXPECT_EQ(text->type, "navigation_t");
  const auto document = json::parse(text->json);
  EXPECT_EQ(document.at("utime"), navigation.utime);
  EXPECT_EQ(document.at("lat_deg").get<double>(), navigation.lat_deg);
  EXPECT_TRUE(document.at("gnss_age_s").is_null());
}

TEST(MessageJson, MessagesInMessagesAndOddTextsComeWell) {
  error_t errors{};
  errors.name = "a \"b\"\n\xff";
  errors.rows.resize(2);
  errors.n_rows = 2;
  errors.rows[1].e_gyro_z_radps = 0.25;
  const auto text = message_text(encode_message(errors));
  ASSERT_TRUE(text);
  const auto document = json::parse(text->json);
  EXPECT_EQ(document.at("rows").at(1).at("e_gyro_z_radps"), 0.25);
  EXPECT_EQ(document.at("name").get<std::string>().substr(0, 6), "a \"b\"\n");
}

TEST(MessageJson, WhatIsNoMessageIsNone) {
  EXPECT_FALSE(message_text({}));
  const std::vector<std::uint8_t> junk(100, 7);
  EXPECT_FALSE(message_text(junk));
}

/// Every field of a message is in its schema, of its type, and told in the words of the type's comment.
TEST(MessageJson, TheSchemaDescribesTheMessage) {
  const auto schema = json::parse(schema_text("navigation_t"));
  EXPECT_EQ(schema.at("title"), "imuscope.navigation_t");
  const auto message = json::parse(json_of(navigation_t{}));
  for (const auto& [name, value] : message.items()) {
    ASSERT_TRUE(schema.at("properties").contains(name)) << name;
    EXPECT_EQ(schema.at("properties").at(name).at("type") == "string", value.is_string()) << name;
  }
  EXPECT_EQ(schema.at("properties").at("utime").at("type"), "integer");
  EXPECT_EQ(schema.at("properties").at("lat_deg").at("type"), "number");
  EXPECT_EQ(schema.at("properties").at("lat_deg").at("description"),
            "WGS-84 geodetic latitude of b's origin");
  const auto models = json::parse(schema_text("noise_model_t"));
  EXPECT_EQ(models.at("properties").at("models").at("items").at("properties").at("rate_hz").at("type"),
            "number");
  EXPECT_TRUE(schema_text("nothing_t").empty());
}

TEST(MessageJsonWhole, EveryTypeHasItsSchema) {
  std::string text;
  for (const char* type :
       {"calibration_t", "navigation_t", "error_t", "odometry_t", "status_t", "noise_model_t",
        "wavelet_variance_t", "dynamics_t", "pc_clock_t", "event_t", "virtual_imu_t", "nothing_t"})
    text += schema_text(type) + '\n';
  error_t errors{};
  errors.name = "a \"b\"\n";
  errors.n_rows = 2;
  errors.rows.resize(2);
  errors.rows[0].e_gyro_x_radps = -0.5;
  errors.rows[1].e_gyro_z_radps = std::nan("");
  text += json_of(errors) + '\n' + json_of(event_t{}) + '\n' + json_of(calibration_t{}) + '\n';
  const auto bytes = encode_message(errors);
  for (std::size_t size = 0; size < bytes.size(); size += 7) {
    if (message_text(std::span(bytes).first(size))) text += std::to_string(size) + '\n';
  }
  test::expect_recorded("logs/message_json.txt", text);
}

}  // namespace
}  // namespace imuscope::bag
