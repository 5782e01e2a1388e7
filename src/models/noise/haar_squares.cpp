/// Sums of squared coefficients of a whole run, every level while its sums are in a cache.
///
/// The levels follow one another along the run, tile by tile: each goes as far as the sums of the level before
/// it reach, so that what one leaves the next one finds in the first-level cache, and the longer supports find
/// theirs in the second-level one. Levels with supports beyond that are taken strip by strip.

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>

#include "models/noise/haar_levels.h"
#include "models/noise/work_memory.h"

// Other processors than x86 have their widest registers anyhow. What chooses between clones runs before
// ThreadSanitizer has set itself up, and would end the program.
#if defined(__SANITIZE_THREAD__) || !defined(__x86_64__)
#define IMUSCOPE_CLONES
#else
#define IMUSCOPE_CLONES __attribute__((target_clones("avx2", "default")))
#endif

namespace imuscope::noise {
namespace {

/// Four neighbouring samples at once; the same arithmetic in two halves where the processor has no wider
/// registers, so that the result does not depend on it.
using Lanes = double __attribute__((vector_size(32)));
constexpr std::size_t kLanes = 4;
/// Two of them in turn, so that no addition waits for the one before.
constexpr std::size_t kStep = 2 * kLanes;
/// Positions that a level is taken at before the next one is: these and the supports of the nine lowest levels
/// stay in a first-level cache of 32 kB.
constexpr std::size_t kTile = 1024;
/// Doubles of a line of the cache.
constexpr std::size_t kLine = 8;
/// Levels whose supports together, 256 kB, stay in a second-level cache.
constexpr int kLowLevels = 15;
constexpr std::size_t kLowSupport = std::size_t{1} << static_cast<unsigned>(kLowLevels);
/// Doubles of a strip of the higher levels, which stays in a second-level cache, too.
constexpr std::size_t kStripDoubles = 32768;

/// G-1. One level at four positions: squares are added, and at f stand the sums of the next level.
inline void take_lanes(double* f, std::size_t n, Lanes& squares) {
  Lanes older;
  Lanes newer;
  std::memcpy(&older, f, sizeof(Lanes));
  std::memcpy(&newer, f + n, sizeof(Lanes));
  const Lanes difference = newer - older;
  squares += difference * difference;
  const Lanes sum = older + newer;
  std::memcpy(f, &sum, sizeof(Lanes));
}

/// G-1. The squares of a level at `length` positions, whose two sums are n places apart; leaves the sums of the
/// next level there. Reads run ahead of writes, so that the next positions find what they need.
IMUSCOPE_CLONES double take_positions(double* f, std::size_t n, std::size_t length) {
  Lanes even{};
  Lanes odd{};
  std::size_t s = 0;
  for (; s + kStep <= length; s += kStep) {
    take_lanes(f + s, n, even);
    take_lanes(f + s + kLanes, n, odd);
  }
  const Lanes both = even + odd;
  double squares = (both[0] + both[1]) + (both[2] + both[3]);
  for (; s < length; ++s) {
    const double difference = f[s + n] - f[s];
    squares += difference * difference;
    f[s] += f[s + n];
  }
  return squares;
}

/// The samples of a run less the first of them.
class Samples {
 public:
  explicit Samples(std::span<const double> run) : run_(run), first_(run.front()) {}

  void read(std::size_t begin, std::span<double> out) const {
    const auto length = static_cast<Eigen::Index>(out.size());
    Eigen::Map<Eigen::ArrayXd>(out.data(), length) =
        Eigen::Map<const Eigen::ArrayXd>(run_.data() + begin, length) - first_;
  }
  /// Asks the memory for what is read next.
  void fetch(std::size_t begin, std::size_t end) const {
    for (std::size_t i = begin; i < end; i += kLine) __builtin_prefetch(run_.data() + i);
  }

 private:
  std::span<const double> run_;
  double first_;
};

/// Some columns of the sums of the low levels, which are taken as rows of kLowSupport, row after row.
class Strip {
 public:
  Strip(const double* sums, std::size_t width) : sums_(sums), width_(width) {}

  void read(std::size_t begin, std::span<double> out) const {
    std::size_t row = begin / width_;
    std::size_t column = begin % width_;
    while (!out.empty()) {
      const std::size_t length = std::min(width_ - column, out.size());
      std::copy_n(sums_ + row * kLowSupport + column, length, out.begin());
      out = out.subspan(length);
      column = 0;
      ++row;
    }
  }
  /// Asks the memory for what is read next.
  void fetch(std::size_t begin, std::size_t end) const {
    std::size_t row = begin / width_;
    std::size_t column = begin % width_;
    for (std::size_t i = begin; i < end; i += kLine) {
      __builtin_prefetch(sums_ + row * kLowSupport + column);
      column += kLine;
      if (column < width_) continue;
      column -= width_;
      ++row;
    }
  }

 private:
  const double* sums_;
  std::size_t width_;
};

/// How far a level has come.
struct Front {
  std::size_t n = 0;     ///< places from a sum to the one that its samples end before
  std::size_t done = 0;  ///< positions taken
  double squares = 0.0;
};

/// Takes a level at all positions that `ready` sums allow; whole steps only, unless they are the last.
void advance(Front& front, double* f, std::size_t ready, bool is_last) {
  if (ready <= front.done + front.n) return;
  std::size_t length = ready - front.n - front.done;
  if (!is_last) length -= length % kStep;
  front.squares += take_positions(f + front.done, front.n, length);
  front.done += length;
}

/// Levels first..last of what is in `source`, n places from a sum of the first level to the one after it, and
/// leaves at `f` the sums of the level after them.
/// @param f    room for all of the source, or its own memory: a tile is read before it is written
/// @param add  takes level, sum and count
template <typename Source, typename Add>
void take_levels(const Source& source, std::span<double> f, int first, int last, std::size_t n,
                 const Add& add) {
  std::array<Front, std::numeric_limits<std::size_t>::digits> room;
  const std::span<Front> fronts = std::span(room).first(static_cast<std::size_t>(last - first + 1));
  for (Front& front : fronts) {
    front.n = n;
    n *= 2;
  }
  // Spread over the levels, the next tile comes from the memory while they are computed.
  const std::size_t share = (kTile / fronts.size() / kLine + 1) * kLine;
  for (std::size_t begin = 0; begin < f.size(); begin += kTile) {
    const std::size_t end = std::min(begin + kTile, f.size());
    const std::size_t next_end = std::min(end + kTile, f.size());
    source.read(begin, f.subspan(begin, end - begin));
    std::size_t ready = end;
    std::size_t fetched = end;
    for (Front& front : fronts) {
      const std::size_t fetch_end = std::min(fetched + share, next_end);
      source.fetch(fetched, fetch_end);
      fetched = fetch_end;
      advance(front, f.data(), ready, end == f.size());
      ready = front.done;
    }
  }
  for (const Front& front : fronts) {
    if (front.done > 0) add(first, front.squares, front.done);
    ++first;
  }
}

/// What the longest strip of a run takes; no strip is narrower than a line of the cache.
std::size_t strip_doubles(std::size_t length) {
  return std::max(kStripDoubles, (length / kLowSupport + 1) * kLine);
}

/// Levels kLowLevels + 1..last from the sums of kLowSupport samples. Positions a whole number of such sums apart
/// meet on all these levels and meet no others: strip by strip of them, with the strip's width for the distance
/// of two sums.
/// @param memory  strip_doubles(run.size()) of them
template <typename Add>
void take_high_levels(std::span<const double> sums, int last, double* memory, const Add& add) {
  const std::size_t longer = sums.size() % kLowSupport;  // columns before it have a row more
  for (std::size_t begin = 0; begin < std::min(kLowSupport, sums.size());) {
    const bool is_longer = begin < longer;
    const std::size_t rows = sums.size() / kLowSupport + (is_longer ? 1 : 0);
    const std::size_t most = std::max(std::size_t{1}, kStripDoubles / rows / kLine) * kLine;
    const std::size_t width = std::min((is_longer ? longer : kLowSupport) - begin, most);
    take_levels(Strip(sums.data() + begin, width), {memory, rows * width}, kLowLevels + 1, last, width, add);
    begin += width;
  }
}

int levels_of(std::span<const double> run, std::span<const LevelSum> sums) {
  return std::min(static_cast<int>(sums.size()), highest_level(run.size()));
}

/// Doubles that add_squares_by() needs for its strip.
std::size_t strip_of(std::span<const double> run, std::span<const LevelSum> sums) {
  return levels_of(run, sums) > kLowLevels ? strip_doubles(run.size()) : 0;
}

/// @param work   as long as the run, or the run itself
/// @param strip  strip_of() doubles
void add_squares_by(std::span<const double> run, double* work, double* strip, std::span<LevelSum> sums) {
  const int levels = levels_of(run, sums);
  if (levels < 1) return;
  const auto add = [&](int level, double sum, std::size_t count) {
    auto& total = sums[static_cast<std::size_t>(level - 1)];
    total.sum_of_squares += sum * std::ldexp(1.0, -2 * level);  // 1 / (2n)^2
    total.count += count;
  };
  take_levels(Samples(run), {work, run.size()}, 1, std::min(levels, kLowLevels), 1, add);
  if (levels > kLowLevels) take_high_levels({work, run.size() - kLowSupport + 1}, levels, strip, add);
}

}  // namespace

void add_squares(std::span<const double> run, std::span<LevelSum> sums) {
  // In one piece: the library gives memory back to the system where more than twice the largest piece is free,
  // and takes it anew, page by page, at the next call.
  const WorkMemory memory(run.size() + strip_of(run, sums));
  add_squares_by(run, memory.data(), memory.data() + run.size(), sums);
}

void add_squares_in_place(std::span<double> run, std::span<LevelSum> sums) {
  const WorkMemory strip(strip_of(run, sums));
  add_squares_by(run, run.data(), strip.data(), sums);
}

}  // namespace imuscope::noise
