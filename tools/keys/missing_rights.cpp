#include "tools/keys/missing_rights.hpp"

#include <fnmatch.h>

#include <algorithm>
#include <fstream>
#include <iterator>

#include "core/dds/identity.hpp"
#include "tools/keys/documents.hpp"
#include "tools/keys/rights.hpp"

namespace invar::tools {

namespace {

bool is_permitted(const std::string& topic, const std::set<std::string>& permitted) {
  return permitted.contains(topic) ||
         std::any_of(permitted.begin(), permitted.end(), [&](const std::string& pattern) {
           return fnmatch(pattern.c_str(), topic.c_str(), 0) == 0;
         });
}

std::string lacking(const char* what, const std::set<std::string>& needed,
                    const std::set<std::string>& permitted) {
  std::string text;
  for (const std::string& topic : needed)
    if (!is_permitted(topic, permitted))
      text += (text.empty() ? std::string{what} + " `" : ", `") + topic + "`";
  return text;
}

}  // namespace

std::vector<Fault> missing_rights(LoadedCell& cell, const std::set<std::string>& names) {
  const dds::KeyFolder keys{cell.cell->security->keys};
  std::vector<Fault> faults;
  for (const Rights& needed : rights_of(cell)) {
    std::ifstream stream{keys.permissions(needed.name)};
    if (!names.contains(needed.name) || !stream) continue;
    const std::string document{std::istreambuf_iterator<char>{stream}, {}};
    const std::string writes = lacking("write", needed.writes, permitted_topics(document, "publish"));
    const std::string reads = lacking("read", needed.reads, permitted_topics(document, "subscribe"));
    if (writes.empty() && reads.empty()) continue;
    faults.push_back(
        {keys.permissions(needed.name).string(),
         "does not permit to " + writes + (writes.empty() || reads.empty() ? "" : ", and to ") + reads,
         "it is of an earlier cell file or Invar: `invar keys CELL` signs all anew; bring `public` and "
         "the folders of this PC's names here"});
  }
  return faults;
}

}  // namespace invar::tools
