#include "capture/file_window.h"

#include <gtest/gtest.h>
#include <algorithm>
#include <vector>

#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

constexpr std::size_t kLength = 300'000;  // several windows

std::vector<std::uint8_t> content() {
  std::vector<std::uint8_t> bytes(kLength);
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<std::uint8_t>(i * i / 7);
  return bytes;
}

std::ifstream file_of(const std::vector<std::uint8_t>& bytes) {
  const auto path = test::scratch_folder() / "window.bin";
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  return std::ifstream(path, std::ios::binary);
}

TEST(FileWindow, GivesTheFileInWhateverPiecesItIsLookedAt) {
  const auto expected = content();
  for (const std::size_t piece : {1UL, 7UL, 65'535UL, 65'536UL, 65'537UL, 200'000UL}) {
    FileWindow window(file_of(expected));
    std::vector<std::uint8_t> got;
    for (auto there = window.look(piece); !there.empty(); there = window.look(piece)) {
      const std::size_t taken = std::min(piece, there.size());
      EXPECT_GE(there.size(), std::min(piece, kLength - got.size())) << got.size();
      got.insert(got.end(), there.begin(), there.begin() + static_cast<std::ptrdiff_t>(taken));
      window.pass(taken);
    }
    EXPECT_EQ(got, expected) << piece;
  }
}

TEST(FileWindow, ALookPassesNothing) {
  const auto expected = content();
  FileWindow window(file_of(expected));
  window.pass(window.look(10).size() > 10 ? 10 : 0);
  EXPECT_EQ(window.look(5).front(), expected[10]);
  EXPECT_EQ(window.look(100'000).front(), expected[10]);
}

TEST(FileWindow, MoreThanTheFileHasIsWhatItHas) {
  FileWindow window(file_of({1, 2, 3}));
  EXPECT_EQ(window.look(std::size_t{1} << 20U).size(), 3U);
  window.pass(3);
  EXPECT_TRUE(window.look(1).empty());
  FileWindow none{std::ifstream("/nowhere/at/all")};
  EXPECT_TRUE(none.look(1).empty());
}

}  // namespace
}  // namespace imuscope
