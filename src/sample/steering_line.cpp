#include "sample/steering_line.h"

#include <algorithm>
#include <type_traits>

namespace imuscope {

static_assert(std::is_trivially_copyable_v<SteeringLine>);

void SteeringLine::observe(HostTime time, HostTime unsteered, double rate) noexcept {
  if (n_ == 0) shift_ = time - unsteered;
  if (n_ > 0 && time <= pieces_[(n_ - 1) % kPieces].time) return;
  pieces_[n_ % kPieces] = {time, unsteered + shift_, rate};
  ++n_;
}

HostTime SteeringLine::unsteered(HostTime time) const noexcept {
  if (n_ == 0) return time;
  const std::size_t oldest = n_ - std::min(n_, kPieces);
  std::size_t at = n_ - 1;
  while (at > oldest && pieces_[at % kPieces].time > time) --at;
  const Piece& piece = pieces_[at % kPieces];
  const Duration since = time - piece.time;
  return piece.unsteered + since + from_seconds(piece.rate * to_seconds(since));
}

double SteeringLine::rate() const noexcept { return n_ == 0 ? 0.0 : pieces_[(n_ - 1) % kPieces].rate; }

}  // namespace imuscope
