// Sentences, words, texts and places as they come out, held as they once were.
#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <sstream>
#include <system_error>

#include "base/digits.h"
#include "base/grouped.h"
#include "base/line_reader.h"
#include "base/missing_file.h"
#include "base/nearest_word.h"
#include "base/output_folder.h"
#include "base/text.h"
#include "base/wgs84.h"
#include "tests/support/file_content.h"
#include "tests/support/recorded_answer.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

using test::expect_recorded;

TEST(BaseWhole, SentencesSaidOnce) {
  std::string text;
  for (const auto& line : grouped({{"mtx1", "no temperature"},
                                   {"", "no temperature"},
                                   {"mtx2", "no temperature"},
                                   {"mtx1", "no temperature"},
                                   {"mtx2", "too short"},
                                   {"", "too long"},
                                   {"", "no temperature"},
                                   {"mtx1", "too short"}}))
    text += line + '\n';
  const std::vector<std::string> names{"mtx1", "mtx2", "mtx"};
  for (const auto& line :
       grouped_by_name({"mtx1: too short", "mtx2: too short", "mtx1, static: too long",
                        "mtx2, static: too long", "mtx2, moving: too long", "mtx: too short", "mtx1 is alone",
                        "mtx1:", "mtx1: ", "mtx1,", "mtx1, no colon", "mtx3: too short", "mtx1", "",
                        "mtx2: too short", "a: b", "mtx1, static, twice: so: it is", "mtx12: too short"},
                       names))
    text += line + '\n';
  expect_recorded("base/grouped.txt", text);
}

TEST(BaseWhole, WordsThatAreNear) {
  std::string text;
  for (const char* a : {"", "a", "rate", "rate_hz", "ratehz", "xyz", "gyro_x_radps"}) {
    for (const char* b : {"", "b", "rate", "rate_hz", "rtae", "gyro_y"})
      text += fmt::format("{} ", edit_distance(a, b));
    text += '\n';
  }
  const std::vector<std::string> words{"rate_hz", "baud", "device", "protocol", "bus_id", "a"};
  for (const char* word : {"rate", "ratehz", "bau", "bxxd", "bxxx", "xxxx", "devices", "protocoll_name",
                           "prot", "", "abcd", "bus", "busid", "deviation", "protoxxxxx"})
    text += fmt::format("{}: '{}'\n", word, nearest_word(word, words));
  expect_recorded("base/near_words.txt", text);
}

TEST(BaseWhole, PlacesOnTheEllipsoidAndBack) {
  std::string text;
  for (const double lat_deg : {-90.0, -89.9, -45.0, 0.0, 0.1, 30.0, 60.0, 89.999, 90.0}) {
    for (const double height_m : {-5000.0, 0.0, 100.0, 1e6, 3e7}) {
      const Geodetic at{lat_deg * 0.017453292519943295, -2.0, height_m};
      const auto xyz = ecef_of(at);
      const Geodetic back = geodetic_of(xyz);
      text += fmt::format("{:.6f} {:.6f} {:.6f} -> {:.12f} {:.12f} {:.6f}\n", xyz[0], xyz[1], xyz[2],
                          back.lat_rad, back.lon_rad, back.height_m);
    }
  }
  const Geodetic at{0.7, -1.1, 50.0};
  for (const double value : rotation_ecef_to_ned(at)) text += fmt::format("{:.12f}\n", value);
  for (const double value : ned_of({1.0, 20.0, 300.0}, at)) text += fmt::format("{:.9f}\n", value);
  // Near the centre the iteration has far to go.
  for (const double r_m : {1e4, 1e5, 1e6, 4e6}) {
    const Geodetic deep = geodetic_of({r_m, 0.5 * r_m, 0.7 * r_m});
    text += fmt::format("{:.9f} {:.9f} {:.3f}\n", deep.lat_rad, deep.lon_rad, deep.height_m);
  }
  expect_recorded("base/places.txt", text, 1e-9, 1e-9);
}

TEST(BaseWhole, CharactersAtTheEdgesOfUtf8) {
  std::string text;
  const auto add = [&](const std::string& bytes) {
    std::string shown;
    for (const char c : bytes) shown += fmt::format("{:02X}", static_cast<unsigned char>(c));
    const std::string out = printable("<" + bytes + ">");
    text += fmt::format("{} {} {}\n", shown, is_utf8(bytes),
                        out == "<" + bytes + ">" ? std::string("as it is") : out);
  };
  for (unsigned lead = 0; lead < 256; ++lead) {
    if (lead >= 0x30 && lead < 0x78) continue;
    for (const char* rest : {"", "\x80", "\xBF", "\x80\x80", "\x9F\xBF", "\xA0\x80", "\xBF\xBF",
                             "\x80\x80\x80", "\x8F\xBF\xBF", "\x90\x80\x80", "\xBF\xBF\xBF"}) {
      if (lead < 0xBF && rest[0] != '\0') continue;
      if (lead > 0xC4 && lead < 0xDE) continue;
      if (lead > 0xE2 && lead < 0xEC) continue;
      add(static_cast<char>(lead) + std::string(rest));
    }
  }
  add("\xE2\x28\xA1"), add("\xE2\x82\x28"), add("\xC2\x7F"), add("\xC2\xC0"), add("\xF0\x90\x28\xBC"),
      add("a\xC2\x80z");
  for (std::size_t longest = 0; longest < 14; ++longest)
    text +=
        fmt::format("{} '{}' '{}'\n", longest, one_line("a\xC3\xA9\xE2\x82\xAC\xF0\x9F\x98\x80z", longest),
                    one_line("short", longest));
  for (const std::string& name :
       {std::string("a"), std::string("A-z_09"), std::string(""), std::string("a b"), std::string("a.b"),
        std::string("@"), std::string("["), std::string("`"), std::string("{"), std::string("/"),
        std::string(":"), std::string(kDeviceNameMax, 'x'), std::string(kDeviceNameMax + 1, 'x')})
    text += fmt::format("{} {}\n", name.size() < 10 ? name : "long", is_device_name(name));
  text += device_file_name("errors", "mtx1", ".csv") + '\n';
  expect_recorded("base/texts.txt", text);
}

TEST(BaseWhole, NumbersBesideTheirGoals) {
  std::string text;
  for (const double value : {0.0, 0.01234, 0.9949, 0.9951, 1.0, 1.004, 9.949, 9.951, 10.4, 95.1, 99.4, 99.49,
                             99.5, 99.51, 100.4, 12345.6, 123456789.4}) {
    for (const double wanted : {0.0, 1.0, 9.95, 99.4, 100.0}) text += digits_beside(value, wanted) + ' ';
    text += '\n';
  }
  expect_recorded("base/digits.txt", text);
}

TEST(BaseWhole, LinesOfEveryLength) {
  std::string text;
  for (const std::size_t longest : {0U, 1U, 510U, 511U, 512U, 1022U, 2000U}) {
    std::string content;
    for (const std::size_t size : {0U, 1U, 509U, 510U, 511U, 512U, 513U, 1021U, 1022U, 1023U, 1500U})
      content += std::string(size, 'x') + '\n';
    for (const char* end : {"", "last"}) {
      std::istringstream in(content + end);
      std::string line;
      std::uint64_t passed = 7;
      while (read_line(in, line, longest, passed)) text += fmt::format("{}/{} ", line.size(), passed);
      text += fmt::format("| {} {}\n", line.size(), passed);
    }
  }
  expect_recorded("base/lines.txt", text);
}

TEST(BaseWhole, WhyAFileIsNotThere) {
  std::string text;
  for (const std::errc why : {std::errc{}, std::errc::no_such_file_or_directory, std::errc::not_a_directory,
                              std::errc::permission_denied, std::errc::io_error}) {
    const Error error = explain_missing(
        "the file a.csv", why == std::errc{} ? std::error_code{} : std::make_error_code(why), "give another");
    text += fmt::format("{} {}\n", static_cast<int>(error.kind), error.text());
  }
  const auto folder = test::scratch_folder();
  std::ofstream(folder / "a.txt") << "some text";
  std::ofstream(folder / "empty.txt");
  std::ofstream(folder / "large.txt") << "x";
  std::filesystem::resize_file(folder / "large.txt", kTextFileMax + 1);
  std::ofstream(folder / "largest.txt") << "x";
  std::filesystem::resize_file(folder / "largest.txt", kTextFileMax);
  ::mkfifo((folder / "pipe").c_str(), 0600);
  for (const char* name :
       {"a.txt", "empty.txt", "large.txt", "largest.txt", "pipe", "none", "a.txt/none", "."}) {
    const auto read = read_text_file(folder / name, "table", "give another");
    std::string sentence =
        read ? fmt::format("{} bytes {}", read->size(), read->substr(0, 20).c_str())
             : fmt::format("{} {}", static_cast<int>(read.error().kind), read.error().text());
    for (std::size_t at = sentence.find(folder.string()); at != std::string::npos;
         at = sentence.find(folder.string()))
      sentence.erase(at, folder.string().size());
    text += sentence + '\n';
  }
  expect_recorded("base/missing.txt", text);
}

TEST(BaseWhole, FilesAreWrittenInBlocksOfWholeLines) {
  const auto folder = test::scratch_folder();
  const auto opened = OutputFolder::open(folder);
  ASSERT_TRUE(opened);
  auto file = opened->begin("lines.csv");
  ASSERT_TRUE(file);
  const auto size = [&] { return std::filesystem::file_size(folder / "lines.csv"); };
  const std::string line = std::string(1023, 'x') + '\n';
  std::string sizes;
  for (int i = 0; i < 17; ++i) {
    file->write(line);
    sizes += fmt::format("{} ", size());
  }
  EXPECT_EQ(sizes, "0 0 0 0 0 0 0 8192 8192 8192 8192 8192 8192 8192 8192 16384 16384 ");
  file->write(std::string(8190, 'y') + '\n');
  EXPECT_EQ(size(), 17U * 1024U + 8191U);
  file->write(line);
  EXPECT_FALSE(file->problem());
  EXPECT_TRUE(file->close());
  EXPECT_EQ(size(), 18U * 1024U + 8191U);
  EXPECT_FALSE(file->is_open());
  EXPECT_TRUE(file->close()) << "a second time";
  {
    auto left_open = opened->begin("left.csv");
    ASSERT_TRUE(left_open);
    left_open->write("a\n");
  }
  EXPECT_EQ(test::content_of(folder / "left.csv"), "a\n");
  struct stat info {};
  ASSERT_EQ(::stat((folder / "left.csv").c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0700U, 0600U);
}

TEST(BaseWhole, NamesThatAreTakenAndFoldersOfTheirOwn) {
  const auto folder = test::scratch_folder();
  const auto opened = OutputFolder::open(folder);
  ASSERT_TRUE(opened);
  ASSERT_TRUE(opened->write_whole("a.txt", "one"));
  ASSERT_TRUE(opened->write_whole("a.txt", "two"));
  EXPECT_EQ(test::content_of(folder / "a.txt"), "two");
  EXPECT_FALSE(opened->create_new("a.txt").is_open());
  EXPECT_EQ(errno, EEXIST);
  EXPECT_TRUE(opened->create_new("b.txt").is_open());
  auto scratch = opened->scratch_file();
  ASSERT_TRUE(scratch);
  EXPECT_EQ(::write(scratch->get(), "abc", 3), 3);
  char back[3] = {};
  EXPECT_EQ(::pread(scratch->get(), back, 3, 0), 3);
  EXPECT_EQ(std::string(back, 3), "abc");
  Descriptor first = opened->create_new("c.txt");
  const int number = first.get();
  Descriptor second(std::move(first));
  EXPECT_EQ(second.get(), number);
  Descriptor third;
  third = std::move(second);
  EXPECT_EQ(third.get(), number);
  const int released = third.release();
  EXPECT_EQ(released, number);
  EXPECT_FALSE(third.is_open());
  EXPECT_EQ(::close(released), 0);
  auto inner = opened->sub_folder("in");
  ASSERT_TRUE(inner);
  ASSERT_TRUE(opened->sub_folder("in")) << "it is there already";
  ASSERT_TRUE(inner->write_whole("d.txt", "four"));
  ASSERT_TRUE(opened->take(*inner, "d.txt"));
  EXPECT_EQ(test::content_of(folder / "d.txt"), "four");
  EXPECT_FALSE(std::filesystem::exists(folder / "in" / "d.txt"));
  EXPECT_FALSE(opened->take(*inner, "d.txt"));
  EXPECT_FALSE(opened->sub_folder("a.txt")) << "a file";
  auto own = opened->scratch_folder();
  ASSERT_TRUE(own);
  ASSERT_TRUE(own->write_whole("e.txt", "five"));
  opened->remove("in");
  opened->remove("a.txt");
  std::size_t entries = 0;
  std::size_t folders = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    ++entries, folders += entry.is_directory() ? 1 : 0;
  EXPECT_EQ(entries, 4U) << "b, c, d and the folder of its own";
  EXPECT_EQ(folders, 1U);
  EXPECT_FALSE(OutputFolder::open(folder / "b.txt"));
}

TEST(BaseWhole, ADescriptorClosesAlsoTheFirst) {
  const int kept = ::dup(0);
  { const Descriptor first(0); }
  EXPECT_EQ(::fcntl(0, F_GETFD), -1);
  if (kept >= 0) {
    EXPECT_EQ(::dup2(kept, 0), 0);
    ::close(kept);
  }
}

}  // namespace
}  // namespace imuscope
