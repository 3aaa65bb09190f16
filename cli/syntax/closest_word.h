// Finds the word that a user probably meant when the typed word is unknown.
#pragma once

#include <string>
#include <vector>

namespace voxdag::cli {

// Returns the most similar of `words`, or "" if none is similar. A word is similar if it begins
// with `typed` and `typed` has at least three characters. A word is also similar if few edits turn
// `typed` into it: at most one edit for each three characters of `typed`, or a single edit for a
// shorter `typed`. Leading dashes are not counted as characters. An edit inserts, deletes or
// replaces a character, or swaps two neighbors.
std::string closest_word(const std::string& typed, const std::vector<std::string>& words);

// Returns "; did you mean WORD?", where WORD is closest_word(), or "" if no word is similar.
std::string suggestion(const std::string& typed, const std::vector<std::string>& words);

}  // namespace voxdag::cli
