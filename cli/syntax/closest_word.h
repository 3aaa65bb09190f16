// Finds the word that a user probably meant by a mistyped word.
#pragma once

#include <string>
#include <vector>

namespace voxdag::cli {

// Returns the most similar of `words`, or "" if none is similar. A word is similar if it begins
// with `typed` (three characters or more), or if few characters differ: at most a third of them,
// where two swapped neighbors count as one.
std::string closest_word(const std::string& typed, const std::vector<std::string>& words);

// Returns "; did you mean WORD?" for the most similar of `words`, or "" if none is similar.
std::string suggestion(const std::string& typed, const std::vector<std::string>& words);

}  // namespace voxdag::cli
