// Finds the word that a user probably meant when the typed word is unknown.
#pragma once

#include <string>
#include <vector>

namespace voxdag::cli {

// Returns the most similar of `words`, or "" if none is similar. A word is similar if it begins
// with `typed`, which then needs three characters or more without leading dashes. A word is also
// similar if at most one edit, or one per three characters of `typed`, turns `typed` into it. An
// edit inserts, deletes or replaces a character, or swaps two neighbors.
std::string closest_word(const std::string& typed, const std::vector<std::string>& words);

// Returns "; did you mean WORD?", where WORD is closest_word(), or "" if no word is similar.
std::string suggestion(const std::string& typed, const std::vector<std::string>& words);

}  // namespace voxdag::cli
