// JobSpec: what the cell file states of every job.
#pragma once

#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include "core/component/parameters.hpp"
#include "core/config/yaml.hpp"

namespace invar::job {

/// Parameters of every job.
struct JobSpec {
  std::string name;
  std::string out = "out";
  void describe(auto& p) {
    p(name, "name", "name of the job in `invar job run`");
    p(out, "out", "folder for the files, created; relative to where the cell was started");
    if constexpr (requires { p.node(); }) check_folder(p.node(), "out", out);
  }
};

/// The job of this name; nullptr: there is none.
template <class Spec>
const Spec* named(const std::vector<Spec>& jobs, const std::string& wanted) {
  const auto job =
      std::find_if(jobs.begin(), jobs.end(), [&](const Spec& one) { return one.name == wanted; });
  return job == jobs.end() ? nullptr : &*job;
}

/// A fault where a job has the name of an earlier one.
template <class Spec>
void check_names(const config::Node& list, const std::vector<Spec>& jobs, std::set<std::string>& names) {
  const auto places = list.list();
  for (std::size_t i = 0; i < std::min(jobs.size(), places.size()); ++i)
    if (!jobs[i].name.empty() && !names.insert(jobs[i].name).second)
      places[i].fault("job `" + jobs[i].name + "` stands twice in this component", "rename one of them");
}

}  // namespace invar::job
