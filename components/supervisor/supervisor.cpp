#include "components/supervisor/supervisor.hpp"

#include <algorithm>
#include <utility>

#include "core/base/shown.hpp"

namespace invar::supervisor {

namespace {

void visit(const std::map<std::string, std::vector<std::string>>& dependents, const std::string& component,
           std::set<std::string>& seen, std::vector<std::string>& order) {
  if (!seen.insert(component).second) return;
  if (const auto found = dependents.find(component); found != dependents.end())
    for (const std::string& next : found->second) visit(dependents, next, seen, order);
  order.push_back(component);  // after all that it feeds
}

}  // namespace

std::vector<std::string> downstream(const std::map<std::string, std::vector<std::string>>& dependents,
                                    const std::set<std::string>& failed) {
  std::set<std::string> seen;
  std::vector<std::string> order;
  for (const std::string& component : failed) visit(dependents, component, seen, order);
  std::erase_if(order, [&](const std::string& component) { return failed.contains(component); });
  return order;
}

void Supervisor::activate() {
  last_heard_.clear();
  lost_.clear();
  failed_.clear();
  put_down_.clear();
  began_ = last_step_ = now();
}

void Supervisor::step(const Tick& tick) noexcept {
  if (simulated_time || !view_.heard) return;  // in simulated time a process that is lost stops time itself
  try {
    forgive_own_gap(tick);
    watch_processes(tick);
    watch_components();
    bring_back();
  } catch (const std::exception&) {
    fail("the supervisor lost its view of the cell");
  }
}

/// Who was stopped (a debugger, a PC that slept, a starved host) heard nobody meanwhile: it waits anew before it judges.
void Supervisor::forgive_own_gap(const Tick& tick) {
  const Duration gap = tick.now - last_step_;
  last_step_ = tick.now;
  // To deactivate takes what the others take to answer, and those are heard meanwhile.
  if (std::exchange(acted_, false) || gap <= Duration::seconds(0.5 * parameters_.timeout)) return;
  began_ = tick.now;
  for (auto& [process, heard] : last_heard_)
    if (!lost_.contains(process)) heard = tick.now;
  view_.notify(
      false, name,
      "the supervisor itself was stopped for " + shown(gap.in_seconds(), 3) + " s: it waits anew for all");
}

void Supervisor::watch_processes(const Tick& tick) {
  for (const std::string& process : view_.heard()) last_heard_[process] = tick.now;
  for (const std::string& process : view_.processes) {
    // One that was never heard of is starting: nothing depends on it yet that would have to be made safe.
    const auto heard = last_heard_.find(process);
    const double patience = heard == last_heard_.end() ? parameters_.start_timeout : parameters_.timeout;
    const Instant since = heard == last_heard_.end() ? began_ : heard->second;
    const bool silent = tick.now - since > Duration::seconds(patience);
    if (silent && lost_.insert(process).second) {
      view_.notify(true, process,
                   "process `" + process + "` is lost: not heard of for " + shown(patience) + " s");
      std::set<std::string> components;
      for (const auto& [component, home] : view_.process_of)
        if (home == process) components.insert(component);
      make_safe(components);
    } else if (!silent && lost_.erase(process) > 0) {
      view_.notify(false, process, "process `" + process + "` is back");
    }
  }
}

void Supervisor::watch_components() {
  std::set<std::string> newly;
  for (const auto& [component, seen] : view_.components()) {
    if (!seen.in_error) {
      failed_.erase(component);
    } else if (failed_.insert(component).second) {
      view_.notify(true, component, "component `" + component + "` is in error: " + seen.failure);
      newly.insert(component);
    }
  }
  if (!newly.empty()) make_safe(newly);
}

void Supervisor::make_safe(const std::set<std::string>& failed) {
  if (!parameters_.make_safe) return;
  for (const std::string& component : downstream(view_.dependents, failed)) {
    const auto home = view_.process_of.find(component);
    if (home == view_.process_of.end() || lost_.contains(home->second)) continue;
    acted_ = true;
    const std::string refusal = view_.deactivate(component);
    if (refusal.empty() && std::find(put_down_.begin(), put_down_.end(), component) == put_down_.end())
      put_down_.push_back(component);
    view_.notify(!refusal.empty(), component,
                 refusal.empty()
                     ? "component `" + component +
                           "` was deactivated: it needs what was lost; when that is back, activate it"
                     : "component `" + component + "` cannot be deactivated: " + refusal);
  }
}

bool Supervisor::has_all_it_needs(const std::string& component,
                                  const std::map<std::string, CellView::Seen>& seen) const {
  const auto lives = [&](const std::string& one) {
    const auto home = view_.process_of.find(one);
    return home == view_.process_of.end() || !lost_.contains(home->second);
  };
  return lives(component) &&
         std::all_of(view_.dependents.begin(), view_.dependents.end(), [&](const auto& source) {
           const auto& [writer, readers] = source;
           if (std::find(readers.begin(), readers.end(), component) == readers.end()) return true;
           const auto found = seen.find(writer);
           return lives(writer) && found != seen.end() && found->second.active;
         });
}

/// What was deactivated here for want of others, when those are back: upstream first. One that acts on a device by being
/// active is left to a person, who is told.
void Supervisor::bring_back() {
  if (put_down_.empty() || !view_.activate) return;
  const auto seen = view_.components();
  for (std::size_t i = put_down_.size(); i-- > 0;) {
    const std::string component = put_down_[i];
    const auto found = seen.find(component);
    if (found == seen.end() || !has_all_it_needs(component, seen)) continue;
    put_down_.erase(put_down_.begin() + static_cast<std::ptrdiff_t>(i));
    if (found->second.active) continue;  // a person was quicker
    const std::string mend = "`invar lifecycle CELL " + component + " activate`";
    if (view_.held.contains(component)) {
      view_.notify(false, component, "what component `" + component + "` needs is back: " + mend);
      continue;
    }
    acted_ = true;
    const std::string refusal = view_.activate(component);
    view_.notify(!refusal.empty(), component,
                 refusal.empty()
                     ? "component `" + component + "` is active again: what it needs is back"
                     : "component `" + component + "` cannot be activated (" + refusal + "): " + mend);
  }
}

}  // namespace invar::supervisor
