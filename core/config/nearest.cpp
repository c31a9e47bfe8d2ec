#include <algorithm>
#include <numeric>
#include <string>
#include <vector>

#include "core/config/yaml.hpp"

namespace invar::config {

namespace {

/// Letters inserted, left out, exchanged or swapped with their neighbour (the optimal string alignment distance).
std::size_t edits(std::string_view a, std::string_view b) {
  std::vector<std::size_t> before(b.size() + 1), above(b.size() + 1), row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    before = above;
    above = row;
    row[0] = i + 1;
    for (std::size_t j = 0; j < b.size(); ++j) {
      row[j + 1] = std::min({above[j + 1] + 1, row[j] + 1, above[j] + (a[i] == b[j] ? 0U : 1U)});
      if (i > 0 && j > 0 && a[i] == b[j - 1] && a[i - 1] == b[j])
        row[j + 1] = std::min(row[j + 1], before[j - 1] + 1);
    }
  }
  return row.back();
}

}  // namespace

std::string nearest(std::string_view word, const std::vector<std::string>& choices) {
  std::string best;
  constexpr std::size_t longest_word =
      64;  // nobody misspells a longer one, and the comparison takes its square
  if (word.size() > longest_word) return best;
  std::size_t best_distance = std::max<std::size_t>(1, word.size() / 3) + 1;
  for (const auto& choice : choices) {
    if (const std::size_t distance = edits(word, choice); distance < best_distance) {
      best_distance = distance;
      best = choice;
    }
  }
  return best;
}

std::string mend_name(const std::string& word, const std::vector<std::string>& names) {
  if (names.empty()) return "there is none";
  if (const std::string near = nearest(word, names); !near.empty()) return "did you mean `" + near + "`?";
  std::string text = "there are: ";
  for (const auto& name : names) text += (name == names.front() ? "" : ", ") + name;
  return text;
}

}  // namespace invar::config
