// SPDX-License-Identifier: Apache-2.0
#include "capture/pattern/repeating.h"

#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include "capture/pattern/bcsl.h"

namespace relievo {
namespace {

constexpr int kLongestRun = 6;

/// A cycle over the graph whose vertices are words of `length` colours without equal neighbours and whose
/// arcs are the colours that may follow: each word of length + 1 colours comes once (de Bruijn), by
/// Hierholzer's algorithm. Returns the colours, the first `length` of them again at the end.
std::vector<int> word_cycle(int base, int length) {
  std::size_t words = 1;
  for (int i = 0; i < length; ++i) words *= static_cast<std::size_t>(base);
  const std::size_t tail = words / static_cast<std::size_t>(base);
  std::size_t start = 0;  // 0101...
  for (int i = 0; i < length; ++i) start = start * static_cast<std::size_t>(base) + (i % 2 != 0);
  std::vector<int> next(words, 1);  // of each word: the step from its last colour to the next one to try
  std::vector<std::size_t> walk{start};
  std::vector<std::size_t> path;
  while (!walk.empty()) {
    const std::size_t at = walk.back();
    if (int& step = next[at]; step < base) {
      const auto colour = (at + static_cast<std::size_t>(step++)) % static_cast<std::size_t>(base);
      walk.push_back(at % tail * static_cast<std::size_t>(base) + colour);
    } else {
      path.push_back(at);
      walk.pop_back();
    }
  }
  std::reverse(path.begin(), path.end());
  std::vector<int> colours;
  for (int i = length; i > 1; --i) {  // the first word's colours but the last
    std::size_t word = path.front();
    for (int k = 1; k < i; ++k) word /= static_cast<std::size_t>(base);
    colours.push_back(static_cast<int>(word % static_cast<std::size_t>(base)));
  }
  for (const std::size_t word : path)
    colours.push_back(static_cast<int>(word % static_cast<std::size_t>(base)));
  return colours;
}

}  // namespace

Result<Pattern> make_repeating_pattern(int base, int first_stripe, int stripes) {
  std::vector<Primary> palette = default_palette(base);
  if (base < 3 || palette.empty())
    return Error{"base is " + std::to_string(base) + ": one slide has 3 to 6 colours"};
  if (stripes < 2) return Error{"a pattern needs at least 2 stripes, not " + std::to_string(stripes)};
  if (first_stripe < 0) return Error{"the first stripe cannot be " + std::to_string(first_stripe)};
  long long runs = base;
  int run = 0;
  const long long needed = static_cast<long long>(first_stripe) + stripes - 1;
  do {
    runs *= base - 1;
    ++run;
  } while (runs < needed && run < kLongestRun);
  if (runs < needed) {
    return Error{std::to_string(stripes) + " stripes from stripe " + std::to_string(first_stripe) +
                 " are too many for one slide of base " + std::to_string(base) + ": at most " +
                 std::to_string(runs + 1)};
  }
  const std::vector<int> colours = word_cycle(base, run);
  const auto begin = colours.begin() + first_stripe;
  return Pattern{base, 1, std::move(palette), std::vector<int>(begin, begin + stripes), Scheme::kOneSlide};
}

Result<Pattern> make_scheme_pattern(Scheme scheme, int base, int slides, int first_stripe, int stripes,
                                    CodePath path) {
  if (scheme == Scheme::kOneSlide) return make_repeating_pattern(base, first_stripe, stripes);
  Result<Pattern> pattern = make_pattern(base, slides, first_stripe, stripes, path);
  if (pattern) pattern->scheme = scheme;
  return pattern;
}

int unique_run(const Pattern& pattern) {
  for (int run = 1; run <= pattern.boundaries(); ++run) {
    std::set<std::vector<int>> seen;
    bool unique = true;
    for (int b = 0; unique && b + run <= pattern.boundaries(); ++b) {
      std::vector<int> colours;
      for (int i = 0; i <= run; ++i) colours.push_back(pattern.digit(b + i, 0));
      unique = seen.insert(std::move(colours)).second;
    }
    if (unique) return run;
  }
  return pattern.boundaries() + 1;
}

}  // namespace relievo
