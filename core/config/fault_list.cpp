#include "core/config/fault_list.hpp"

#include <cctype>

#include "core/base/limits.hpp"

namespace invar::config {

namespace {

std::string kind_of(const std::string& what) {
  std::string kind;
  bool quoted = false;
  for (const char c : what) {
    if (c == '`') quoted = !quoted;
    if (!quoted && c != '`' && std::isdigit(static_cast<unsigned char>(c)) == 0) kind += c;
  }
  return kind;
}

}  // namespace

void FaultList::add(Fault fault) {
  if (!seen_.emplace(fault.where, fault.what).second) return;
  const std::string kind = kind_of(fault.what);
  if (++kinds_[kind] <= limits::faults_of_a_kind)
    kept_.push_back(std::move(fault));
  else
    first_beyond_.emplace(kind, std::move(fault));
}

void FaultList::withdraw(const std::string& where, const std::string& what) {
  const auto meant = [&](const Fault& fault) { return fault.where == where && fault.what == what; };
  if (std::erase_if(kept_, meant) == 0) return;
  seen_.erase({where, what});
  --kinds_[kind_of(what)];
}

std::vector<Fault> FaultList::all() const {
  std::vector<Fault> faults = kept_;
  for (const auto& [kind, fault] : first_beyond_) {
    const std::size_t more = kinds_.at(kind) - limits::faults_of_a_kind - 1;
    Fault last = fault;
    if (more > 0) last.what += " (and " + std::to_string(more) + " more of the kind)";
    faults.push_back(std::move(last));
  }
  return faults;
}

}  // namespace invar::config
