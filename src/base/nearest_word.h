#pragma once

/// "Did you mean ...?" for a word that a person mistyped.

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace imuscope {

/// Levenshtein distance: insertions, deletions and changes of one character.
std::size_t edit_distance(std::string_view a, std::string_view b);

/// The candidate that is nearest in spelling; empty where none is near.
std::string nearest_word(std::string_view word, const std::vector<std::string>& candidates);

}  // namespace imuscope
