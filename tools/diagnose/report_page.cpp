#include "tools/report/page.hpp"

#include "tools/diagnose/report.hpp"

namespace invar::diagnose {

void write_page(const Case& data, const Diagnosis& d, const std::string& subject,
                const std::filesystem::path& file) {
  report::Page page{"Mismatch diagnosis", subject};
  page.callout(verdict_sentence(data, d));
  page.write(file);
}

}  // namespace invar::diagnose
