// A check of an option's number whose message a person can read (CLI11 prints the largest double, all 309 digits of it).
#pragma once

#include <CLI/CLI.hpp>

#include <cmath>
#include <string>

namespace invar::tools {

/// For `option->check(positive())`: a finite number above zero.
inline CLI::Validator positive() {
  return {[](std::string& text) {
            double value = 0.0;
            const bool good = CLI::detail::lexical_cast(text, value) && std::isfinite(value) && value > 0.0;
            return good ? std::string{} : "`" + text + "` is not a number above 0";
          },
          "POSITIVE"};
}

}  // namespace invar::tools
