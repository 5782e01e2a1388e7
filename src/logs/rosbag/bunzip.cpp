#include "logs/rosbag/bunzip.h"

#include <bzlib.h>
#include <algorithm>

namespace imuscope::rosbag {
namespace {

/// Room is made as bytes come, so that a chunk that claims much and holds little takes little.
constexpr std::size_t kGrow = std::size_t{4} << 20U;

struct Stream {
  bz_stream state{};
  bool is_open = BZ2_bzDecompressInit(&state, 0, 0) == BZ_OK;
  Stream() = default;
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;
  ~Stream() {
    if (is_open) BZ2_bzDecompressEnd(&state);
  }
};

}  // namespace

bool bunzip(mcap::Bytes packed, std::size_t size, std::string& out) {
  out.clear();
  Stream stream;
  if (!stream.is_open) return false;
  // The library reads through a pointer to what it does not change. Chunks are far below 4 GiB.
  stream.state.next_in = const_cast<char*>(reinterpret_cast<const char*>(packed.data()));
  stream.state.avail_in = static_cast<unsigned>(packed.size());
  std::size_t filled = 0;
  while (filled < size) {
    if (filled == out.size()) out.resize(std::min(size, out.size() + std::max(kGrow, out.size())));
    const std::size_t room = out.size() - filled;
    stream.state.next_out = out.data() + filled;
    stream.state.avail_out = static_cast<unsigned>(room);
    const int result = BZ2_bzDecompress(&stream.state);
    const std::size_t written = room - stream.state.avail_out;
    filled += written;
    if (result != BZ_OK || (written == 0 && stream.state.avail_in == 0)) break;
  }
  out.resize(filled);
  return filled == size;
}

}  // namespace imuscope::rosbag
