/// `imuscope wv`, `fit` and `compare` as a user meets them: output, messages and exit codes.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <string>

#include "tests/support/shared_data.h"

namespace {

using imuscope::test::program_path;
using imuscope::test::scratch_folder;
using testing::HasSubstr;

struct Outcome {
  int exit_code = -1;
  std::string out;
  std::string err;
};

std::string read_file(const std::filesystem::path& path) {
  std::ifstream in(path);
  return {std::istreambuf_iterator<char>(in), {}};
}

Outcome imuscope(const std::filesystem::path& folder, const std::string& arguments) {
  const auto out = folder / "stdout.txt";
  const auto err = folder / "stderr.txt";
  const std::string command = "'" + program_path("imuscope").string() + "' " + arguments + " >'" +
                              out.string() + "' 2>'" + err.string() + "'";
  const int status = std::system(command.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, read_file(out), read_file(err)};
}

class NoiseCommands : public testing::Test {
 protected:
  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return "'" + (folder_ / name).string() + "'";
  }
  Outcome run(const std::string& arguments) const { return imuscope(folder_, arguments); }

  std::string white(const std::string& name, unsigned seed) const {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    std::string text = "time_s,gyro_x,gyro_y\n";
    for (int i = 0; i < 4096; ++i) {
      text += std::to_string(0.01 * i) + "," + std::to_string(normal(random)) + ",0.5 # trailing words\n";
    }
    return write(name, text);
  }

  std::filesystem::path folder_ = scratch_folder();
};

TEST_F(NoiseCommands, WvPrintsTheDocumentedJsonForAColumnByNameAndByNumber) {
  const auto file = white("white.csv", 1);
  const auto by_name = run("wv " + file + " --rate 100 --column gyro_x --json");
  ASSERT_EQ(by_name.exit_code, 0) << by_name.err;
  const auto json = nlohmann::json::parse(by_name.out);
  EXPECT_EQ(json.at("n"), 4096);
  EXPECT_EQ(json.at("rate_hz"), 100.0);
  ASSERT_EQ(json.at("wv").size(), 12U);
  const auto& third = json.at("wv").at(2);
  EXPECT_EQ(third.at("level"), 3);
  EXPECT_DOUBLE_EQ(third.at("tau_s").get<double>(), 0.08);
  EXPECT_EQ(third.at("n_coefficients"), 4096 - 8 + 1);
  EXPECT_LT(third.at("ci_low").get<double>(), third.at("value").get<double>());
  EXPECT_GT(third.at("ci_high").get<double>(), third.at("value").get<double>());
  EXPECT_EQ(run("wv " + file + " --rate 100 --column 2 --json").out, by_name.out);
}

TEST_F(NoiseCommands, FitPrintsEveryDocumentedField) {
  const auto result =
      run("fit " + white("white.csv", 2) + " -c gyro_x --rate 100 --model WN+GM --unit rad/s --json");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto json = nlohmann::json::parse(result.out);
  for (const char* field : {"n", "rate_hz", "model", "weights", "wv", "parameters", "objective", "j_test",
                            "criterion", "identifiable", "warnings"}) {
    EXPECT_TRUE(json.contains(field)) << field;
  }
  EXPECT_EQ(json.at("weights"), "optimal");
  for (const char* field : {"level", "tau_s", "value", "ci_low", "ci_high", "fitted", "n_coefficients"}) {
    EXPECT_TRUE(json.at("wv").at(0).contains(field)) << field;
  }
  ASSERT_EQ(json.at("parameters").size(), 3U);
  EXPECT_EQ(json.at("parameters").at(1).at("process"), "GM1");
  EXPECT_EQ(json.at("parameters").at(1).at("name"), "beta");
  EXPECT_EQ(json.at("parameters").at(1).at("unit"), "1/s");
}

TEST_F(NoiseCommands, CompareReadsWhatFitPrintsAndTestsTheDifference) {
  for (const char* name : {"a", "b"}) {
    const auto fit = run("fit " + white(std::string(name) + ".csv", name[0] == 'a' ? 3U : 4U) +
                         " -c gyro_x --rate 100 --model WN --json");
    ASSERT_EQ(fit.exit_code, 0) << fit.err;
    write(std::string(name) + ".json", fit.out);
  }
  const auto result =
      run("compare '" + (folder_ / "a.json").string() + "' '" + (folder_ / "b.json").string() + "' --json");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto json = nlohmann::json::parse(result.out);
  EXPECT_EQ(json.at("test").at("dof"), 1);
  EXPECT_GT(json.at("test").at("p_value").get<double>(), 1e-4);
}

TEST_F(NoiseCommands, ARawFloat64FileGivesTheSameAsItsText) {
  std::string raw;
  std::string text;
  for (int i = 0; i < 64; ++i) {
    const double v = (i * 37 % 11) - 5.0;
    raw.append(reinterpret_cast<const char*>(&v), sizeof v);
    text += std::to_string(v) + "\n";
  }
  const auto from_raw = run("wv " + write("x.f64", raw) + " -r 10 --json");
  EXPECT_EQ(from_raw.exit_code, 0) << from_raw.err;
  EXPECT_EQ(from_raw.out, run("wv " + write("x.csv", text) + " -r 10 --json").out);
}

struct BadInput {
  const char* name;
  const char* file;  ///< nullptr: not written
  const char* content;
  const char* arguments;  ///< {} stands for the file
  int exit_code;
  const char* says;
};

class NoiseCommandsBadInput : public NoiseCommands, public testing::WithParamInterface<BadInput> {};

TEST_P(NoiseCommandsBadInput, IsToldInOneSentenceWithTheRightExitCode) {
  const BadInput& p = GetParam();
  std::string file = "'" + folder_.string() + "'";
  if (p.file != nullptr)
    file = p.content != nullptr ? write(p.file, p.content) : "'" + (folder_ / p.file).string() + "'";
  std::string arguments = p.arguments;
  arguments.replace(arguments.find("{}"), 2, file);
  const auto result = run(arguments);
  EXPECT_EQ(result.exit_code, p.exit_code) << result.err;
  EXPECT_THAT(result.err, HasSubstr(p.says));
  EXPECT_EQ(result.out, "");
}

INSTANTIATE_TEST_SUITE_P(
    Each, NoiseCommandsBadInput,
    testing::Values(
        BadInput{"Missing", "none.csv", nullptr, "wv {} -r 1", 1, "does not exist"},
        BadInput{"Folder", nullptr, nullptr, "wv {} -r 1", 1, "is a folder"},
        BadInput{"Empty", "e.csv", "", "wv {} -r 1", 1, "is empty"},
        BadInput{"OnlyComments", "c.csv", "# nothing\n", "wv {} -r 1", 1, "holds no numbers"},
        BadInput{"TextInANumber", "t.csv", "a,b\n1,2\n3,x4\n", "wv {} -r 1 -c b", 1,
                 "line 3, column 2: 'x4'"},
        BadInput{"MissingColumn", "m.csv", "gyro_x,gyro_y\n1,2\n", "wv {} -r 1 -c giro_y", 2,
                 "did you mean 'gyro_y'"},
        BadInput{"NoColumnChosen", "n.csv", "gyro_x,gyro_y\n1,2\n", "wv {} -r 1", 2, "gyro_x, gyro_y"},
        BadInput{"ShortRow", "s.csv", "1,2\n3\n", "wv {} -r 1 -c 2", 1, "line 2"},
        BadInput{"NoRate", "r.csv", "1\n2\n", "wv {}", 2, "--rate"},
        BadInput{"ZeroRate", "z.csv", "1\n2\n", "wv {} -r 0", 2, "rate"},
        BadInput{"RateIsText", "w.csv", "1\n2\n", "wv {} -r fast", 2, "rate"},
        BadInput{"OneSample", "o.csv", "1\n", "wv {} -r 1", 1, "at least 2"},
        BadInput{"NotANumber", "q.csv", "1\n2\nnan\n3\n", "wv {} -r 1", 1, "sample 2"},
        BadInput{"Constant", "k.csv", "2\n2\n2\n2\n", "fit {} -r 1 -m WN", 1, "constant"},
        BadInput{"UnknownTerm", "u.csv", "1\n2\n3\n", "fit {} -r 1 -m WN+FLICKER", 2, "FLICKER"},
        BadInput{"UnknownWeights", "v.csv", "1\n2\n3\n", "fit {} -r 1 -m WN -w best", 2, "optimal"},
        BadInput{"UnknownUnit", "y.csv", "1\n2\n3\n", "fit {} -r 1 -m WN -u furlong", 2, "furlong"},
        BadInput{"TooFewLevels", "f.csv", "1\n2\n4\n1\n", "fit {} -r 1 -m WN+2*GM", 1, "5 parameters"},
        BadInput{"NotAFit", "j.json", "{}", "compare {} /dev/null", 1, "fit"}),
    [](const auto& test) { return std::string(test.param.name); });

}  // namespace
