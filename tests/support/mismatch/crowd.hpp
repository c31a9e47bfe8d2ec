// Machines with one chief effect beside a crowd of small ones, as every real machine has them.
#pragma once

#include "tests/support/mismatch/machine.hpp"

namespace invar::test::mismatch {

/// As `make`, with three to six further effects of the plant, each of 0.5 to 4 % of the power (in units of the noise) that the
/// chief effect has. A chief of "none" is a crowd alone. The right verdict is `partly_explained`; no member of the crowd need
/// be named, and to name one is not false.
Machine make_crowded(const std::string& plant, const std::string& chief, double size, unsigned seed,
                     Trouble trouble = {});

/// Does a machine leave all that it does without its crowd (`bare`) far behind? Never where it does the same.
bool runs_away(const Machine& machine, const Machine& bare);

}  // namespace invar::test::mismatch
