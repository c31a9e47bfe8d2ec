#include "tools/keys/documents.hpp"

#include "tools/report/escaped.hpp"

namespace invar::tools {

namespace {

using report::escaped;

constexpr const char* head =
    "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
    "<dds xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" xsi:noNamespaceSchemaLocation=\""
    "http://www.omg.org/spec/DDS-SECURITY/20170901/";

std::string domains(int domain) { return "<domains><id>" + std::to_string(domain) + "</id></domains>\n"; }

std::string topics(const char* kind, const std::set<std::string>& names) {
  if (names.empty()) return {};
  std::string text = std::string{"        <"} + kind + ">\n          <topics>\n";
  for (const std::string& name : names) text += "            <topic>" + escaped(name) + "</topic>\n";
  return text + "          </topics>\n        </" + kind + ">\n";
}

}  // namespace

std::string governance(int domain) {
  return std::string{head} +
         "omg_shared_ca_governance.xsd\">\n  <domain_access_rules>\n    <domain_rule>\n      " +
         domains(domain) +
         "      <allow_unauthenticated_participants>false</allow_unauthenticated_participants>\n"
         "      <enable_join_access_control>true</enable_join_access_control>\n"
         "      <discovery_protection_kind>ENCRYPT</discovery_protection_kind>\n"
         "      <liveliness_protection_kind>ENCRYPT</liveliness_protection_kind>\n"
         "      <rtps_protection_kind>NONE</rtps_protection_kind>\n"
         "      <topic_access_rules>\n"
         "        <topic_rule>\n"
         "          <topic_expression>*</topic_expression>\n"
         "          <enable_discovery_protection>true</enable_discovery_protection>\n"
         "          <enable_liveliness_protection>true</enable_liveliness_protection>\n"
         "          <enable_read_access_control>true</enable_read_access_control>\n"
         "          <enable_write_access_control>true</enable_write_access_control>\n"
         "          <metadata_protection_kind>ENCRYPT</metadata_protection_kind>\n"
         "          <data_protection_kind>NONE</data_protection_kind>\n"
         "        </topic_rule>\n"
         "      </topic_access_rules>\n    </domain_rule>\n  </domain_access_rules>\n</dds>\n";
}

std::string permissions(int domain, const std::string& subject, const Rights& rights, const std::string& from,
                        const std::string& until) {
  return std::string{head} + "omg_shared_ca_permissions.xsd\">\n  <permissions>\n    <grant name=\"" +
         escaped(rights.name) + "\">\n      <subject_name>" + escaped(subject) +
         "</subject_name>\n      <validity><not_before>" + from + "</not_before><not_after>" + until +
         "</not_after></validity>\n      <allow_rule>\n        " + domains(domain) +
         topics("publish", rights.writes) + topics("subscribe", rights.reads) +
         "      </allow_rule>\n      <default>DENY</default>\n    </grant>\n  </permissions>\n</dds>\n";
}

std::set<std::string> permitted_topics(const std::string& document, const std::string& kind) {
  const std::string begin = "<" + kind + ">", end = "</" + kind + ">", open = "<topic>", close = "</topic>";
  std::set<std::string> found;
  for (auto at = document.find(begin); at != std::string::npos; at = document.find(begin, at + 1)) {
    const auto last = document.find(end, at);
    for (auto topic = document.find(open, at); topic < last; topic = document.find(open, topic + 1)) {
      const auto from = topic + open.size();
      found.insert(document.substr(from, document.find(close, from) - from));
    }
  }
  return found;
}

}  // namespace invar::tools
