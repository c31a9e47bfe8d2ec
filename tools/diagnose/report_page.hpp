// The page of a diagnosis: report.html.
#pragma once

#include <string>

#include "core/diagnosis/evidence/diagnosis.hpp"

namespace invar::diagnosis {

/// The self-contained page.
std::string page_text(const Case& data, const Diagnosis& diagnosis, const std::string& subject);

}  // namespace invar::diagnosis
