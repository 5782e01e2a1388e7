#include "long_pieces.h"

#include <malloc.h>

namespace imuscope::cli {

void give_long_pieces_back() {
  // Smaller ones are taken too often for that, and two threads would wait for each other's pages.
  constexpr int kLongPiece_bytes = 4 << 20;
  mallopt(M_MMAP_THRESHOLD, kLongPiece_bytes);
}

}  // namespace imuscope::cli
