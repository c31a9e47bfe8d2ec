// The files that `invar new` copies: folders of examples/, as texts inside the program.
#pragma once

#include <span>
#include <string_view>

namespace invar::tools {

struct TemplateFile {
  std::string_view kind;     // component, cell, map
  std::string_view example;  // the name that stands in texts and file names in the place of the user's
  std::string_view file;
  std::string_view text;
};

std::span<const TemplateFile> template_files();

}  // namespace invar::tools
