// PartnerEnds: the components that stand by are told that the process of their partner has ended.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/component/standby.hpp"
#include "core/dds/node.hpp"

namespace invar::tools {

class PartnerEnds {
 public:
  /// Set-up; `standby` outlives this.
  void add(Standby& standby) { standbys_.push_back(&standby); }
  /// From processes on other PCs: the `invar run` that started them publishes that they ended.
  void hear(dds::Node& node, const std::string& cell);
  /// From processes on this PC: whether they live. Once each round.
  void look() const;

 private:
  std::vector<Standby*> standbys_;
  std::unique_ptr<dds::Connection> ends_;
};

}  // namespace invar::tools
