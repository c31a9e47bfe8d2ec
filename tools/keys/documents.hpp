// Documents: governance and permissions of a secured cell in the XML of DDS Security 1.1, before they are signed.
#pragma once

#include <string>

#include "tools/keys/rights.hpp"

namespace invar::tools {

/// Which protection the traffic of the domain has: each submessage is encrypted, so that a forged or repeated heartbeat is refused
/// as well. To sign alone costs the same (`tests/bench/secured.cpp`).
[[nodiscard]] std::string governance(int domain);

/// Permissions of the certificate with this subject; `from` and `until` as XML writes times, in UTC.
[[nodiscard]] std::string permissions(int domain, const std::string& subject, const Rights& rights,
                                      const std::string& from, const std::string& until);

/// The topics of a document of `permissions`, which may be signed; `kind`: "publish" or "subscribe".
[[nodiscard]] std::set<std::string> permitted_topics(const std::string& document, const std::string& kind);

}  // namespace invar::tools
