#include "core/dds/bundle.hpp"

#include <sstream>

namespace invar::dds {

std::vector<std::uint8_t> write_membership(const Membership& membership) {
  std::string text = "is\t" + membership.process + "\t\n";
  for (const auto& topic : membership.written) text += "writes\t" + topic.topic + '\t' + topic.type + '\n';
  for (const auto& topic : membership.wanted) text += "wants\t" + topic + "\t\n";
  return {text.begin(), text.end()};
}

Membership read_membership(const std::vector<std::uint8_t>& bytes) {
  Membership membership;
  std::istringstream text{std::string{bytes.begin(), bytes.end()}};
  std::string word, topic, type;
  while (std::getline(text, word, '\t') && std::getline(text, topic, '\t') && std::getline(text, type)) {
    if (word == "is") membership.process = topic;
    if (word == "writes") membership.written.push_back({topic, type});
    if (word == "wants") membership.wanted.push_back(topic);
  }
  return membership;
}

}  // namespace invar::dds
