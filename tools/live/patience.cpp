#include "tools/live/patience.hpp"

#include <algorithm>
#include <cstdlib>
#include <iostream>

#include "tools/live/interrupt.hpp"

namespace invar::tools {

Patience::Patience(std::string said, std::chrono::milliseconds left)
    : said_{std::move(said)}, left_{left}, watch_{[this] { watch(); }} {}

Patience::~Patience() {
  is_over_ = true;
  watch_.join();
}

void Patience::watch() const {
  const auto look = std::min(std::chrono::milliseconds{50}, left_);
  auto left = left_;
  while (!is_over_) {
    std::this_thread::sleep_for(look);
    if (!interrupted()) continue;
    left -= look;
    if (left.count() > 0) continue;
    std::cerr << said_ << std::endl;
    std::_Exit(130);
  }
}

}  // namespace invar::tools
