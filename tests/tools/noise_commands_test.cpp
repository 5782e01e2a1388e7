/// `imuscope wv`, `fit` and `compare` as a user meets them: output, messages and exit codes.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <functional>
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

TEST_F(NoiseCommands, TheOneColumnBesideTimesAndCounterNeedsNoName) {
  std::string iso = "time,count,x\n";
  std::string gps = "gps_week,tow,x\n";
  std::string alone = "x\n";
  for (int i = 0; i < 64; ++i) {
    const auto value = std::to_string((i * 37 % 11) - 5.0);
    iso += fmt::format("2026-01-02T03:04:{:04.1f}Z,{},{}\n", 0.1 * i, i, value);
    gps += fmt::format("2400,{:.1f},{}\n", 100'000.0 + 0.1 * i, value);
    alone += value + "\n";
  }
  const auto of = [&](const std::string& name, const std::string& text, const std::string& options) {
    return run("wv " + write(name, text) + " --json " + options);
  };
  const auto wanted = of("alone.csv", alone, "-r 10");
  ASSERT_EQ(wanted.exit_code, 0) << wanted.err;
  EXPECT_EQ(of("gps.csv", gps, "").out, wanted.out);
  EXPECT_EQ(of("iso.csv", iso, "--counter count").exit_code, 0);
  EXPECT_EQ(of("time.csv", "time_s\n" + alone.substr(2), "-r 10").out, wanted.out);
  const auto two = of("iso.csv", iso, "");
  EXPECT_EQ(two.exit_code, 2);
  EXPECT_THAT(two.err, HasSubstr("give --column; its columns are time, count, x"));
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

TEST_F(NoiseCommands, ExportWritesWhatFitPrintedForEveryTool) {
  const auto fit =
      run("fit " + white("w.csv", 5) + " -c gyro_x --rate 100 --model WN+RW --unit deg/s --json");
  ASSERT_EQ(fit.exit_code, 0) << fit.err;
  const auto file = write("gyro_x.json", fit.out);
  for (const auto& [tool, key] : std::vector<std::pair<std::string, std::string>>{
           {"kalibr", "gyroscope_noise_density: "},
           {"ros", "angular_velocity_covariance: ["},
           {"px4", "EKF2_GYR_NOISE\t"},
           {"kf-gins", "  arw: ["},
           {"state-space", "\"schema\": \"imuscope/state-space 1\""}}) {
    const auto result = run(std::string("export ").append(file).append(" --to ").append(tool));
    EXPECT_EQ(result.exit_code, 0) << tool << ": " << result.err;
    EXPECT_THAT(result.out, HasSubstr(key)) << tool;
  }
  // 1 deg/s of white noise at 100 Hz is a density of 0.1 deg/s/sqrt(Hz).
  const auto kalibr = run("export " + file + " --to kalibr").out;
  const auto at = kalibr.find("gyroscope_noise_density: ");
  EXPECT_NEAR(std::stod(kalibr.substr(at + 25)), 0.1 * 0.017453, 0.00005);
}

TEST_F(NoiseCommands, ExportTakesOneImuAndRegimeOfARunAndAsksWhereThereAreSeveral) {
  const auto fit = run("fit " + white("w.csv", 6) + " -c gyro_x --rate 100 --model WN --unit rad/s --json");
  ASSERT_EQ(fit.exit_code, 0) << fit.err;
  nlohmann::json models{{"schema", "imuscope/models 1"}, {"models", nlohmann::json::array()}};
  for (const char* regime : {"static", "dynamic"}) {
    auto model = nlohmann::json::parse(fit.out);
    model["name"] = "mtx1";
    model["axis"] = "gyro_x";
    model["regime"] = regime;
    models["models"].push_back(model);
  }
  const auto file = write("models.json", models.dump());
  const auto asked = run("export " + file + " --to kalibr");
  EXPECT_EQ(asked.exit_code, 2);
  EXPECT_THAT(asked.err, HasSubstr("dynamic, static; give --regime"));
  const auto wrong = run("export " + file + " --to kalibr --regime parked");
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("parked"));
  EXPECT_EQ(run("export " + file + " --to kalibr --regime static --name mtx1").exit_code, 0);
}

TEST_F(NoiseCommands, SeveralFilesAreFittedTogetherAndTestedForBeingOneProcess) {
  const std::string files = white("a.csv", 7) + " " + white("b.csv", 8) + " " + white("c.csv", 9);
  const auto result = run("fit " + files + " -c gyro_x --rate 100 --model WN+RW --select --json");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto json = nlohmann::json::parse(result.out);
  EXPECT_EQ(json.at("model"), "WN");
  EXPECT_EQ(json.at("n"), 3 * 4096);
  EXPECT_EQ(json.at("replicates").size(), 3U);
  EXPECT_EQ(json.at("homogeneity").at("dof"), 2);
  EXPECT_GT(json.at("homogeneity").at("p_value").get<double>(), 1e-3);
  ASSERT_EQ(json.at("ranking").size(), 3U);
  EXPECT_TRUE(json.at("ranking").at(0).contains("cv_wvic"));
  const auto table = run("fit " + files + " -c gyro_x --rate 100 --model WN+RW --select");
  EXPECT_THAT(table.out, HasSubstr("near-stationarity"));
  EXPECT_THAT(table.out, HasSubstr("replicate 3"));
}

TEST_F(NoiseCommands, ConservativeAmplitudesComeOnRequestAndAreLarger) {
  const auto result =
      run("fit " + white("w.csv", 10) + " -c gyro_x --rate 100 --model WN -u m/s^2 --conservative --json");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto json = nlohmann::json::parse(result.out);
  EXPECT_GT(json.at("conservative").at("parameters").at(0).at("value").get<double>(),
            json.at("parameters").at(0).at("ci_high").get<double>());
  EXPECT_TRUE(json.at("conservative").at("parameters").at(0).at("ci_low").is_null());
}

TEST_F(NoiseCommands, ARegimeAndACounterMakeGapsInTheSignal) {
  // Rows 0..7 static, 8..11 dynamic, 12..19 static, with the counter jumping by 3 after row 15.
  std::string text = "counter,e,regime\n";
  for (int i = 0; i < 20; ++i) {
    text += std::to_string(i + (i > 15 ? 3 : 0)) + "," + std::to_string((i * 37) % 11) + "," +
            (i < 8 || i > 11 ? "static" : "dynamic") + "\n";
  }
  const auto result =
      run("wv " + write("errors.csv", text) + " -r 1 -c e --where regime=static --counter counter --json");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto json = nlohmann::json::parse(result.out);
  EXPECT_EQ(json.at("n"), 16);
  ASSERT_EQ(json.at("wv").size(), 3U);
  EXPECT_EQ(json.at("wv").at(0).at("n_coefficients"), 7 + 3 + 3);
  EXPECT_EQ(json.at("wv").at(2).at("n_coefficients"), 1);
}

/// Rows at 10 Hz of which the second half comes 1,000 s later; `stamp` writes a time since the first row.
std::string with_a_gap(const char* header, const std::function<std::string(double)>& stamp) {
  std::string text = std::string(header) + "\n";
  for (int i = 0; i < 64; ++i) {
    const double time_s = 0.1 * i + (i < 32 ? 0.0 : 1000.0);
    text += stamp(time_s) + "," + std::to_string((i * 37) % 11) + "\n";
  }
  return text;
}

TEST_F(NoiseCommands, TimesOfEveryKindMakeGapsAndTellTheRate) {
  const auto plain = [](double t) { return fmt::format("{:.3f}", t + 12.0); };
  const auto iso = [](double t) {
    const double of_day = t + 86'000.0;  // across midnight
    const int day = of_day < 86'400.0 ? 1 : 2;
    const double s = of_day - 86'400.0 * (day - 1);
    return fmt::format("2026-03-{:02d}T{:02d}:{:02d}:{:06.3f}+01:00", day, static_cast<int>(s) / 3600,
                       static_cast<int>(s) / 60 % 60, std::fmod(s, 60.0));
  };
  const auto gps = [](double t) {
    const double tow = t + 604'700.0;  // across the end of a week
    return fmt::format("{},{:.3f}", tow < 604'800.0 ? 2400 : 2401, std::fmod(tow, 604'800.0));
  };
  const struct {
    const char* header;
    std::function<std::string(double)> stamp;
    const char* options;
  } cases[] = {{"time_s,x", plain, ""},
               {"when,x", plain, "--time when"},
               {"utc,x", iso, "--rate 10"},
               {"gps_week,tow,x", gps, ""},
               {"a,b,x", gps, "--time a,b"}};
  for (const auto& c : cases) {
    const auto file = write("t.csv", with_a_gap(c.header, c.stamp));
    const auto result = run("wv " + file + " -c x --json " + c.options);
    ASSERT_EQ(result.exit_code, 0) << c.header << result.err;
    const auto json = nlohmann::json::parse(result.out);
    EXPECT_NEAR(json.at("rate_hz").get<double>(), 10.0, 1e-9) << c.header;
    EXPECT_EQ(json.at("n"), 64);
    EXPECT_EQ(json.at("wv").at(0).at("n_coefficients"), 62) << c.header;
  }
  const auto glued =
      run("wv " + write("t.csv", with_a_gap("time_s,x", plain)) + " -c x -r 10 --time none --json");
  EXPECT_EQ(nlohmann::json::parse(glued.out).at("wv").at(0).at("n_coefficients"), 63);
}

TEST_F(NoiseCommands, ARateThatContradictsTheTimesIsRefusedWithTheOneThatFits) {
  const auto file = write("t.csv", with_a_gap("time_s,x", [](double t) { return fmt::format("{:.3f}", t); }));
  for (const char* command : {"wv ", "fit -m WN "}) {
    const auto refused = run(command + file + " -c x --rate 100");
    EXPECT_EQ(refused.exit_code, 2);
    EXPECT_THAT(refused.err, HasSubstr("--rate 10 fits"));
    EXPECT_EQ(run(command + file + " -c x --rate 10.01").exit_code, 0);
  }
}

TEST_F(NoiseCommands, StampsOfArrivalInBurstsMakeNoGapsAndALostSampleOfEvenOnesDoes) {
  std::string bursts = "time_s,x\n";
  std::string lost = bursts;
  for (int i = 0; i < 400; ++i) {
    // Eight rows arrive together, after the last of them.
    const int last = 8 * (i / 8) + 8;
    bursts += fmt::format("{:.4f},{}\n", 0.01 * last, (i * 37) % 11);
    if (i % 100 != 50) lost += fmt::format("{:.4f},{}\n", 0.01 * i + 0.001 * ((i * 7) % 3), (i * 37) % 11);
  }
  const auto together = run("wv " + write("b.csv", bursts) + " -c x --rate 100 --json");
  ASSERT_EQ(together.exit_code, 0) << together.err;
  EXPECT_EQ(nlohmann::json::parse(together.out).at("wv").at(0).at("n_coefficients"), 399);
  const auto holes = run("wv " + write("l.csv", lost) + " -c x --json");
  ASSERT_EQ(holes.exit_code, 0) << holes.err;
  EXPECT_EQ(nlohmann::json::parse(holes.out).at("n"), 396);
  EXPECT_EQ(nlohmann::json::parse(holes.out).at("wv").at(0).at("n_coefficients"), 399 - 2 * 4);
}

TEST_F(NoiseCommands, NotANumberCountsAsAGapOnRequest) {
  const auto file = write("gap.csv", "1\n2\nnan\n3\n5\n4\n");
  const auto refused = run("wv " + file + " -r 1");
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.err, HasSubstr("--nan-is-gap"));
  const auto taken = run("wv " + file + " -r 1 --nan-is-gap --json");
  ASSERT_EQ(taken.exit_code, 0) << taken.err;
  EXPECT_EQ(nlohmann::json::parse(taken.out).at("wv").at(0).at("n_coefficients"), 1 + 2);
}

TEST_F(NoiseCommands, AQuotedCellMayHoldSeparatorsAndACellMaySayThatItsValueIsMissing) {
  std::string table = "name;utc;gyro_x\n";
  for (int i = 0; i < 200; ++i) {
    table += "\"a; # b\";\"2024-02-28T23:59:" + std::string(i < 100 ? "0" : "1") +
             std::to_string(i / 10 % 10) + "." + std::to_string(i % 10) + "00Z\";" +
             (i == 50    ? "n/a"
              : i == 150 ? ""
                         : std::to_string(i % 7)) +
             "\n";
  }
  const auto file = write("quoted.csv", table);
  EXPECT_THAT(run("wv " + file + " -c gyro_x").err, HasSubstr("--nan-is-gap"));
  const auto taken = run("wv " + file + " -c gyro_x --nan-is-gap --json");
  ASSERT_EQ(taken.exit_code, 0) << taken.err;
  const auto json = nlohmann::json::parse(taken.out);
  EXPECT_EQ(json.at("n"), 198);
  EXPECT_NEAR(json.at("rate_hz").get<double>(), 10.0, 1e-9);
}

TEST_F(NoiseCommands, ShortAndConstantSignalsHaveTheVarianceThatThereIs) {
  const auto two = run("wv " + write("two.csv", "1\n3\n") + " -r 1 --json");
  ASSERT_EQ(two.exit_code, 0) << two.err;
  EXPECT_EQ(nlohmann::json::parse(two.out).at("wv").at(0).at("value"), 1.0);
  std::string eight;
  for (const int v : {1, 2, 4, 1, 0, 3, 5, 2}) eight += std::to_string(v) + "\n";
  const auto power = run("wv " + write("eight.csv", eight) + " -r 1 --json");
  ASSERT_EQ(power.exit_code, 0) << power.err;
  const auto levels = nlohmann::json::parse(power.out).at("wv");
  ASSERT_EQ(levels.size(), 3U);
  EXPECT_EQ(levels.at(2).at("n_coefficients"), 1);
  EXPECT_TRUE(levels.at(2).at("ci_high").is_number());
  for (const char* value : {"0", "7"}) {
    std::string text;
    for (int i = 0; i < 16; ++i) text += std::string(value) + "\n";
    const auto constant = run("wv " + write("constant.csv", text) + " -r 1 --json");
    ASSERT_EQ(constant.exit_code, 0) << constant.err;
    EXPECT_EQ(nlohmann::json::parse(constant.out).at("wv").at(3).at("value"), 0.0);
  }
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
        BadInput{"Infinity", "i.csv", "1\ninf\n2\n3\n", "fit {} -r 1 -m WN", 1, "sample 1"},
        BadInput{"AllNotANumber", "g.csv", "nan\nnan\nnan\n", "wv {} -r 1 --nan-is-gap", 1, "at least 2"},
        BadInput{"AllZeros", "0.csv", "0\n0\n0\n0\n", "fit {} -r 1 -m WN", 1, "constant"},
        BadInput{"TwoSamples", "2.csv", "1\n2\n", "fit {} -r 1 -m WN+RW", 1, "2 parameters"},
        BadInput{"NegativeRate", "p.csv", "1\n2\n", "fit {} -r -100 -m WN", 2, "rate"},
        BadInput{"RateNotANumber", "x.csv", "1\n2\n", "wv {} -r nan", 2, "rate"},
        BadInput{"TooManyLevels", "l.csv", "1\n2\n3\n5\n", "wv {} -r 1 -l 9", 1, "at most 2 levels"},
        BadInput{"WvUnknownUnit", "h.csv", "1\n2\n", "wv {} -r 1 -u furlong", 2, "furlong"},
        BadInput{"WhereWithoutEquals", "a.csv", "a,b\n1,2\n", "wv {} -r 1 -c a --where b", 2, "COLUMN=VALUE"},
        BadInput{"FallingCounter", "d.csv", "a,b\n1,2\n2,1\n", "wv {} -r 1 -c a --counter b", 1,
                 "line 3: the counter goes from 2 to 1"},
        BadInput{"TimeGoesBack", "tb.csv", "time_s,a\n1,2\n2,3\n1.5,1\n3,1\n", "wv {} -c a", 1, "row 3"},
        BadInput{"NoTime", "nt.csv", "time_s,a\n1,2\nlater,3\n", "wv {} -c a", 1, "'later' is no time"},
        BadInput{"MissingTime", "mt.csv", "b,a\n1,2\n2,3\n", "wv {} -c a --time tme", 2, "no column 'tme'"},
        BadInput{"ColumnOfARawFile", "b.f64", "12345678", "wv {} -r 1 -c 1", 2, "no columns"},
        BadInput{"HalfANumber", "9.f64", "123456789", "wv {} -r 1", 1, "9 bytes"},
        BadInput{"ExportToNobody", "j1.json", "{}", "export {} --to matlab", 2, "kalibr, openvins, "},
        BadInput{"ExportOfNoFit", "j2.json", "{}", "export {} --to kalibr", 1, "not a fit"},
        BadInput{"ExportOfNoJson", "j3.json", "WN", "export {} --to kalibr", 1, "is not JSON"},
        BadInput{"Constant", "k.csv", "2\n2\n2\n2\n", "fit {} -r 1 -m WN", 1, "constant"},
        BadInput{"UnknownTerm", "u.csv", "1\n2\n3\n", "fit {} -r 1 -m WN+FLICKER", 2, "FLICKER"},
        BadInput{"UnknownWeights", "v.csv", "1\n2\n3\n", "fit {} -r 1 -m WN -w best", 2, "optimal"},
        BadInput{"UnknownUnit", "y.csv", "1\n2\n3\n", "fit {} -r 1 -m WN -u furlong", 2, "furlong"},
        BadInput{"TooFewLevels", "f.csv", "1\n2\n4\n1\n", "fit {} -r 1 -m WN+2*GM", 1, "5 parameters"},
        BadInput{"NotAFit", "j.json", "{}", "compare {} /dev/null", 1, "fit"}),
    [](const auto& test) { return std::string(test.param.name); });

}  // namespace
