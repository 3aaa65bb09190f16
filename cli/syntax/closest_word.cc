#include "cli/syntax/closest_word.h"

#include <algorithm>
#include <cstddef>

namespace voxdag::cli {
namespace {

constexpr size_t kMinPrefix = 3;

// Returns the minimum number of insertions, deletions, replacements and swaps of neighbors that
// turn one word into the other (the optimal string alignment distance).
size_t edit_distance(const std::string& a, const std::string& b) {
  // rows[i][j] is the distance between the first i characters of `a` and the first j of `b`.
  std::vector<std::vector<size_t>> rows(a.size() + 1, std::vector<size_t>(b.size() + 1));
  for (size_t j = 0; j <= b.size(); ++j) rows[0][j] = j;
  for (size_t i = 1; i <= a.size(); ++i) {
    rows[i][0] = i;
    for (size_t j = 1; j <= b.size(); ++j) {
      const size_t replaced = rows[i - 1][j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      rows[i][j] = std::min({rows[i - 1][j] + 1, rows[i][j - 1] + 1, replaced});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        rows[i][j] = std::min(rows[i][j], rows[i - 2][j - 2] + 1);
    }
  }
  return rows.back().back();
}

// Returns the number of characters of a word, not counting leading dashes.
size_t length_of(const std::string& word) {
  return word.size() - std::min(word.find_first_not_of('-'), word.size());
}

}  // namespace

std::string closest_word(const std::string& typed, const std::vector<std::string>& words) {
  constexpr size_t kMaxLength = 64;
  if (typed.size() > kMaxLength) return "";
  std::string closest;
  size_t least = std::max<size_t>(1, length_of(typed) / 3) + 1;
  for (const std::string& word : words) {
    const bool is_beginning = length_of(typed) >= kMinPrefix && word.starts_with(typed);
    const size_t distance = is_beginning ? 1 : edit_distance(typed, word);
    if (distance >= least) continue;
    least = distance;
    closest = word;
  }
  return closest;
}

std::string suggestion(const std::string& typed, const std::vector<std::string>& words) {
  const std::string closest = closest_word(typed, words);
  return closest.empty() ? "" : "; did you mean " + closest + "?";
}

}  // namespace voxdag::cli
