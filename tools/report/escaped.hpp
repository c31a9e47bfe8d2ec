// A text as the content of a page, a drawing or an XML file: what would be markup stands there as letters.
#pragma once

#include <string>
#include <string_view>

namespace invar::report {

/// For HTML, SVG and XML, as content and within either kind of quotes. Control characters, which no XML may hold, become `\x1b`.
std::string escaped(std::string_view text);

}  // namespace invar::report
