#include "tests/drivers/support/streams.h"

#include <gtest/gtest.h>
#include <algorithm>
#include <fstream>
#include <iterator>
#include <random>
#include <stdexcept>

namespace imuscope::test {
namespace {

struct Placed {
  std::size_t begin;
  std::size_t end;
};

Bytes concatenate(const StreamUnderTest& stream, std::vector<Placed>& places) {
  Bytes all;
  for (const Bytes& frame : stream.frames) {
    places.push_back({all.size() - std::min(stream.lead, all.size()), all.size() + frame.size()});
    all.insert(all.end(), frame.begin(), frame.end());
    all.insert(all.end(), stream.separator.begin(), stream.separator.end());
  }
  return all;
}

/// Frames whose bytes do not meet [begin, end); with begin == end, those that the point does not split.
std::vector<Bytes> untouched(const StreamUnderTest& stream, const std::vector<Placed>& places,
                             std::size_t begin, std::size_t end) {
  std::vector<Bytes> kept;
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (places[i].end <= begin || places[i].begin >= end) kept.push_back(stream.frames[i]);
  }
  return kept;
}

struct Trials {
  std::size_t all = 0;
  std::size_t accidents = 0;
};

void expect_found(const StreamUnderTest& stream, const Bytes& faulty, const std::vector<Bytes>& expected,
                  const std::string& fault, Trials& trials) {
  const Bytes reads[] = {faulty};
  ++trials.all;
  bool appeared = false;
  std::size_t next = 0;
  for (const Bytes& frame : stream.scan(reads)) {
    if (next < expected.size() && frame == expected[next]) {
      ++next;
      continue;
    }
    const bool was_sent = std::find(stream.frames.begin(), stream.frames.end(), frame) != stream.frames.end();
    appeared = appeared || !(was_sent || stream.may_appear(frame));
  }
  if (appeared && stream.accidents_max > 0.0) {
    ++trials.accidents;
    return;
  }
  ASSERT_FALSE(appeared) << "a frame appeared that was not sent; " << fault;
  ASSERT_EQ(next, expected.size()) << "an untouched frame was lost; " << fault;
}

void expect_few_accidents(const StreamUnderTest& stream, const Trials& trials) {
  EXPECT_LE(static_cast<double>(trials.accidents), stream.accidents_max * static_cast<double>(trials.all))
      << trials.accidents << " accidents in " << trials.all << " faults";
}

}  // namespace

std::vector<Vector> load_vectors(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::vector<Vector> vectors;
  for (std::string line; std::getline(in, line);) {
    const auto colon = line.find(": ");
    if (line.empty() || line[0] == '#' || colon == std::string::npos) continue;
    Vector vector{line.substr(0, colon), {}};
    for (std::size_t i = colon + 2; i + 1 < line.size(); i += 2) {
      vector.bytes.push_back(static_cast<std::uint8_t>(std::stoul(line.substr(i, 2), nullptr, 16)));
    }
    vectors.push_back(std::move(vector));
  }
  return vectors;
}

const Bytes& vector_named(const std::vector<Vector>& vectors, std::string_view name) {
  for (const Vector& vector : vectors) {
    if (vector.name == name) return vector.bytes;
  }
  throw std::out_of_range("no vector " + std::string(name));
}

nlohmann::json load_json(const std::filesystem::path& file) {
  return nlohmann::json::parse(std::ifstream(file));
}

Bytes load_bytes(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

Bytes bytes_of(std::string_view text) { return {text.begin(), text.end()}; }

std::vector<Sample> CollectingSink::of_kind(SampleKind kind) const {
  std::vector<Sample> kept;
  for (const Sample& sample : samples) {
    if (sample.kind == kind) kept.push_back(sample);
  }
  return kept;
}

void expect_every_split_keeps_all_frames(const StreamUnderTest& stream) {
  std::vector<Placed> places;
  const Bytes all = concatenate(stream, places);
  for (std::size_t at = 0; at <= all.size(); ++at) {
    const auto middle = all.begin() + static_cast<std::ptrdiff_t>(at);
    const Bytes reads[] = {Bytes(all.begin(), middle), Bytes(middle, all.end())};
    ASSERT_EQ(stream.scan(reads), stream.frames) << "split at byte " << at;
  }
  for (std::size_t size = 1; size <= 7; ++size) {
    std::vector<Bytes> reads;
    for (std::size_t at = 0; at < all.size(); at += size) {
      const auto begin = all.begin() + static_cast<std::ptrdiff_t>(at);
      reads.emplace_back(begin, begin + static_cast<std::ptrdiff_t>(std::min(size, all.size() - at)));
    }
    ASSERT_EQ(stream.scan(reads), stream.frames) << "reads of " << size << " bytes";
  }
}

void expect_every_bit_flip_loses_only_its_frame(const StreamUnderTest& given) {
  // Every checksum sees a single flipped bit.
  StreamUnderTest stream = given;
  stream.accidents_max = 0.0;
  Trials trials;
  std::vector<Placed> places;
  const Bytes all = concatenate(stream, places);
  for (std::size_t bit = 0; bit < 8 * all.size(); ++bit) {
    Bytes faulty = all;
    faulty[bit / 8] = static_cast<std::uint8_t>(faulty[bit / 8] ^ (1U << (bit % 8)));
    const auto expected = untouched(stream, places, bit / 8, bit / 8 + 1);
    ASSERT_NO_FATAL_FAILURE(expect_found(stream, faulty, expected, "bit " + std::to_string(bit), trials));
  }
}

void expect_every_cut_loses_only_its_frames(const StreamUnderTest& stream) {
  Trials trials;
  std::vector<Placed> places;
  const Bytes all = concatenate(stream, places);
  for (const std::size_t size : {1U, 2U, 3U, 8U, 31U}) {
    for (std::size_t at = 0; at + size <= all.size(); ++at) {
      Bytes faulty(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(at));
      faulty.insert(faulty.end(), all.begin() + static_cast<std::ptrdiff_t>(at + size), all.end());
      const auto expected = untouched(stream, places, at, at + size);
      ASSERT_NO_FATAL_FAILURE(
          expect_found(stream, faulty, expected,
                       "cut of " + std::to_string(size) + " bytes at " + std::to_string(at), trials));
    }
  }
  expect_few_accidents(stream, trials);
}

void expect_every_insertion_loses_only_its_frame(const StreamUnderTest& stream, std::uint32_t seed) {
  Trials trials;
  std::mt19937 random(seed);
  std::vector<Placed> places;
  const Bytes all = concatenate(stream, places);
  for (const std::size_t size : {1U, 2U, 5U}) {
    for (std::size_t at = 0; at <= all.size(); ++at) {
      Bytes faulty(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(at));
      for (std::size_t i = 0; i < size; ++i) faulty.push_back(static_cast<std::uint8_t>(random()));
      faulty.insert(faulty.end(), all.begin() + static_cast<std::ptrdiff_t>(at), all.end());
      // An insertion inside a frame touches it; between two frames it touches none.
      std::vector<Bytes> expected;
      for (std::size_t i = 0; i < places.size(); ++i) {
        const bool before = stream.lead > 0 ? at < places[i].begin : at <= places[i].begin;
        if (before || at >= places[i].end) expected.push_back(stream.frames[i]);
      }
      ASSERT_NO_FATAL_FAILURE(
          expect_found(stream, faulty, expected,
                       "insertion of " + std::to_string(size) + " at " + std::to_string(at), trials));
    }
  }
  expect_few_accidents(stream, trials);
}

void expect_no_frame_in_garbage_is_lost(const StreamUnderTest& stream, std::uint32_t seed) {
  const std::string_view lures = stream.lures;
  Trials trials;
  std::mt19937 random(seed);
  for (int run = 0; run < 300; ++run) {
    Bytes faulty;
    const auto garbage = [&] {
      const std::size_t size = random() % 200;
      for (std::size_t i = 0; i < size; ++i) {
        const bool lure = !lures.empty() && random() % 4 == 0;
        faulty.push_back(static_cast<std::uint8_t>(lure ? lures[random() % lures.size()] : random()));
      }
    };
    for (const Bytes& frame : stream.frames) {
      garbage();
      faulty.insert(faulty.end(), frame.begin(), frame.end());
      faulty.insert(faulty.end(), stream.separator.begin(), stream.separator.end());
    }
    garbage();
    ASSERT_NO_FATAL_FAILURE(
        expect_found(stream, faulty, stream.frames, "garbage run " + std::to_string(run), trials));
  }
  expect_few_accidents(stream, trials);
}

}  // namespace imuscope::test
