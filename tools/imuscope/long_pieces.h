#pragma once

namespace imuscope::cli {

/// For commands whose axes are long: what the C library keeps of them for later would stand in memory beside
/// what is in use. From now on each long piece goes back to the system at once.
void give_long_pieces_back();

}  // namespace imuscope::cli
