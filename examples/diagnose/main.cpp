// Diagnoses a recording: diagnose MODEL.yaml RECORDING.csv
#include <core/base/fault.hpp>
#include <core/diagnosis/dataset/load.hpp>
#include <core/diagnosis/report/report.hpp>
#include <core/diagnosis/search/diagnose.hpp>
#include <core/model/model_file.hpp>

#include <iostream>

int main(int count, char** arguments) try {
  namespace diagnosis = invar::diagnosis;
  if (count != 3) throw invar::InputError{"call", "takes two files", "diagnose MODEL.yaml RECORDING.csv"};
  auto data = diagnosis::load_case(invar::model::load(arguments[1]), {arguments[2]});
  const auto found = diagnosis::diagnose(data, [](double, const std::string&) {});
  std::cout.precision(2);
  std::cout << diagnosis::name_of(found.verdict) << '\n';
  for (const auto& finding : found.findings)
    std::cout << diagnosis::title_of(finding) << " at " << diagnosis::place_of(data, finding.term) << ", "
              << diagnosis::sizes_of(data, found, finding) << ", probability " << finding.probability << '\n';
  for (const auto& row : found.heldout)  // on stretches that the fit did not see [the output's SI unit]
    std::cout << row.signal << ": RMS error " << row.before << " before, " << row.after << " after\n";
  return 0;
} catch (const invar::InputError& fault) {
  std::cerr << fault.what() << '\n';
  return 2;
}
