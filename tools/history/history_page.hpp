// The page and the JSON of a machine's history of calibrations.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tools/history/drift.hpp"
#include "tools/report/left_out.hpp"
#include "tools/report/page.hpp"

namespace invar::tools {

/// The calibrations of one kind.
struct KindHistory {
  std::string kind;
  std::vector<Calibration> calibrations;
  std::vector<NameHistory> names;
  std::optional<double> accuracy;  // wanted, in the unit of its errors
  Due due;
};

/// "moved", "moved by more than its sigma, as chance does", "within its sigma", "no sigma is known".
std::string verdict_words(NameHistory::Verdict verdict);
/// "due 2026-12-03 09:30, 5.2 days after the last: the error of the tool along x reaches 2 um (two sigma)"
std::string due_words(const KindHistory& history);
/// Times sigma of the number of a name that moved farthest; NaN where no sigma is known.
double times_sigma(const NameHistory& name);

report::Page history_page(const std::string& folder, const std::vector<KindHistory>& kinds,
                          const report::LeftOut& left_out);
nlohmann::json history_json(const std::vector<KindHistory>& kinds, const report::LeftOut& left_out);

}  // namespace invar::tools
