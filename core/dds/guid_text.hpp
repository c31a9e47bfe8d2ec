// The GUID of a participant, writer or reader as text: how discovery knows them.
#pragma once

#include <fastdds/rtps/common/Guid.h>

#include <sstream>
#include <string>

namespace invar::dds {

/// Text of a GUID: its participant's prefix, "|", its entity.
template <class Id>
std::string guid_text(const Id& id) {
  std::ostringstream text;
  text << id;
  return text.str();
}

}  // namespace invar::dds
