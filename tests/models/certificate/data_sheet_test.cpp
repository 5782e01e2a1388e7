#include "models/certificate/data_sheet.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <vector>

#include "tests/support/shared_data.h"

namespace imuscope::certificate {
namespace {

using nlohmann::json;
using testing::HasSubstr;

json value_of(const char* axes, const char* term, double value, const char* unit) {
  return {{"axes", axes},      {"term", term},       {"value", value},  {"unit", unit},
          {"kind", "typical"}, {"document", "DS-1"}, {"revision", "B"}, {"page", 4}};
}

/// Not json itself: of one value in braces compilers make a copy or a list.
json document_of(const std::vector<json>& values) {
  return {{"schema", "imuscope.data_sheets/1"},
          {"parts", json::array({{{"part", "P1"}, {"values", values}}})}};
}

Result<DataSheet> read(const json& document, const std::string& part = "") {
  return read_data_sheet(document, part, "sheets.json");
}

TermValue term(Term which, double value, std::optional<double> low, std::optional<double> high,
               noise::Knowledge knowledge) {
  TermValue out;
  out.term = which;
  out.value = value;
  out.ci_low = low;
  out.ci_high = high;
  out.knowledge = knowledge;
  return out;
}

AxisCertificate axis_of(const char* name, std::vector<TermValue> terms) {
  AxisCertificate axis;
  axis.name = name;
  axis.terms = std::move(terms);
  return axis;
}

// Each value has its document and page, in units that are its term's.
TEST(DataSheet, PartsThatAreShippedAreRead) {
  std::ifstream in(imuscope::test::source_path("docs/examples/data_sheets.json"));
  const json document = json::parse(in, nullptr, false);
  ASSERT_TRUE(document.is_object());
  for (const auto& part : document.at("parts")) {
    const auto sheet = read(document, part.at("part").get<std::string>());
    ASSERT_TRUE(sheet) << sheet.error().text();
    EXPECT_EQ(sheet->values.size(), part.at("values").size());
  }
}

// BMI088: 160 ug/sqrt(Hz) along x and y, 190 along z; 0.014 deg/s/sqrt(Hz).
TEST(DataSheet, AShippedPartWithAnAxisOfItsOwn) {
  std::ifstream in(imuscope::test::source_path("docs/examples/data_sheets.json"));
  const auto sheet = read(json::parse(in, nullptr, false), "BMI088");
  ASSERT_TRUE(sheet) << sheet.error().text();
  const auto walk_of = [](double value, double low, double high) {
    return std::vector{term(Term::kRandomWalk, value, low, high, noise::Knowledge::kFitted)};
  };
  const auto rows = beside(
      *sheet, {axis_of("gyro_x", walk_of(0.84, 0.8, 0.9)), axis_of("accel_x", walk_of(0.094, 0.09, 0.1)),
               axis_of("accel_z", walk_of(0.094, 0.09, 0.1))});
  ASSERT_EQ(rows.size(), 3U);
  EXPECT_NEAR(rows[0].stated.value, 0.014 * 60.0, 1e-12);
  EXPECT_NEAR(rows[1].stated.value, 160e-6 * 9.80665 * 60.0, 1e-12);
  EXPECT_NEAR(rows[2].stated.value, 190e-6 * 9.80665 * 60.0, 1e-12);
  EXPECT_EQ(rows[1].verdict, Verdict::kAgrees);
  EXPECT_EQ(rows[2].verdict, Verdict::kBetter);
}

// Once by hand: 2.8 mdeg/s/sqrt(Hz) are 0.0028 * 60 deg/sqrt(h); 70 ug/sqrt(Hz) are 70e-6 * 9.80665 * 60.
TEST(DataSheet, UnitsOfMakersBecomeThoseOfTheCertificate) {
  const auto sheet = read(
      document_of({value_of("gyro", "N", 2.8, "mdeg/s/sqrt(Hz)"), value_of("accel", "N", 70.0, "ug/sqrt(Hz)"),
                   value_of("gyro", "B", 0.002, "deg/s"), value_of("accel_z", "B", 0.015, "mg")}));
  ASSERT_TRUE(sheet) << sheet.error().text();
  EXPECT_NEAR(sheet->values[0].value, 0.168, 1e-12);
  EXPECT_NEAR(sheet->values[1].value, 0.04118793, 1e-9);
  EXPECT_NEAR(sheet->values[2].value, 7.2, 1e-12);
  EXPECT_NEAR(sheet->values[3].value, 15.0, 1e-12);
  EXPECT_EQ(sheet->values[3].page, "4");
}

TEST(DataSheet, NoValueCountsWithoutDocumentRevisionAndPage) {
  for (const char* key : {"document", "revision", "page"}) {
    json value = value_of("gyro", "N", 2.8, "mdeg/s/sqrt(Hz)");
    value.erase(key);
    const auto sheet = read(document_of({value}));
    ASSERT_FALSE(sheet) << key;
    EXPECT_THAT(sheet.error().text(), HasSubstr(std::string("value 1 of P1 has no ") + key));
    value[key] = "";
    EXPECT_FALSE(read(document_of({value}))) << key;
  }
}

TEST(DataSheet, WhatIsWrongIsSaid) {
  const auto refused = [](const json& document, const std::string& words, const std::string& part = "") {
    const auto sheet = read(document, part);
    ASSERT_FALSE(sheet) << words;
    EXPECT_THAT(sheet.error().text(), HasSubstr(words));
  };
  const json good = value_of("gyro", "N", 2.8, "deg/s/sqrt(Hz)");
  const auto with = [&](const char* key, const json& value) {
    json changed = good;
    changed[key] = value;
    return document_of({changed});
  };
  refused(json::parse("[1", nullptr, false), "is no file of data sheets");
  refused(json::object(), "is no file of data sheets");
  refused(with("axes", "mag"), "has no axes");
  refused(with("term", "W"), "has no term");
  refused(with("unit", "ug/sqrt(Hz)"), "deg/sqrt(h), deg/s/sqrt(Hz)");
  refused(with("kind", "guessed"), "of kind 'guessed'");
  refused(with("value", -1.0), "no positive value");
  refused(with("value", "2.8"), "no positive value");
  refused(document_of(json::array()), "P1 has no values");
  refused(document_of({7}), "is no object");
  refused(document_of({good}), "holds no part P2", "P2");
  json two = document_of({good});
  two["parts"].push_back(two["parts"][0]);
  two["parts"][1]["part"] = "P2";
  refused(two, "give --part; there is P1, P2");
  EXPECT_EQ(read(two, "P2")->part, "P2");
}

TEST(DataSheet, AVerdictNeedsTheWholeInterval) {
  using enum noise::Knowledge;
  const auto sheet = read(
      document_of({value_of("gyro", "N", 1.0, "deg/sqrt(h)"), value_of("gyro_y", "N", 3.0, "deg/sqrt(h)"),
                   value_of("gyro", "B", 10.0, "deg/h"), value_of("accel", "N", 1.0, "m/s/sqrt(h)")}));
  ASSERT_TRUE(sheet);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto rows =
      beside(*sheet, {axis_of("gyro_x", {term(Term::kRandomWalk, 0.9, 0.8, 0.99, kFitted),
                                         term(Term::kBiasInstability, 9.0, {}, 9.0, kBound),
                                         term(Term::kRamp, 1.0, 0.9, 1.1, kFitted)}),
                      axis_of("gyro_y", {term(Term::kRandomWalk, 3.1, 2.9, 3.3, kFitted),
                                         term(Term::kBiasInstability, 11.0, {}, 11.0, kBound)}),
                      axis_of("gyro_z", {term(Term::kRandomWalk, 1.2, 1.1, 1.3, kFitted),
                                         term(Term::kBiasInstability, nan, {}, {}, kUnknown)})});
  ASSERT_EQ(rows.size(), 6U) << "the ramp is not stated, accelerometers were not recorded";
  EXPECT_EQ(rows[0].verdict, Verdict::kBetter);
  EXPECT_EQ(rows[1].verdict, Verdict::kBetter) << "a bound below what is stated";
  EXPECT_EQ(rows[2].verdict, Verdict::kAgrees) << "beside its own value, not the triad's";
  EXPECT_NEAR(rows[2].ratio, 3.1 / 3.0, 1e-12);
  EXPECT_EQ(rows[3].verdict, Verdict::kNotTold) << "a bound above says nothing";
  EXPECT_EQ(rows[4].verdict, Verdict::kWorse);
  EXPECT_EQ(rows[5].verdict, Verdict::kNotTold);
  const json written = to_json(*sheet, rows);
  EXPECT_EQ(written.at("rows").at(4).at("verdict"), "worse");
  EXPECT_TRUE(written.at("rows").at(5).at("value").is_null());
}

}  // namespace
}  // namespace imuscope::certificate
