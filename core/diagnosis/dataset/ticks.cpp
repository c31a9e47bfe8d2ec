#include "core/diagnosis/dataset/ticks.hpp"

#include "core/base/fault.hpp"
#include "core/base/quantity.hpp"
#include "core/diagnosis/dataset/statistics.hpp"

namespace invar::diagnosis {

void check_ticks(const physics::Model& model, const std::vector<double>& time,
                 const std::filesystem::path& file) {
  if (!model.controller || time.size() < 3) return;
  std::vector<double> steps;
  for (std::size_t i = 1; i < time.size(); ++i) steps.push_back(time[i] - time[i - 1]);
  const double step = median(std::move(steps)), ticks = step * model.controller->rate;
  if (ticks > 0.1 && ticks < 200.0) return;
  throw InputError{file.string() + (model.row_rate ? "" : ": column `" + model.signal("time")->column + "`"),
                   "has rows " + si(step, "s") + " apart, the model's controller has a period of " +
                       si(1.0 / model.controller->rate, "s"),
                   model.row_rate
                       ? "mend `rate` under `columns`, or the loop's under `controller`"
                       : "write the unit of the time into its header, such as `" +
                             model.signal("time")->column + " [ms]`, or the loop's rate into `controller`"};
}

}  // namespace invar::diagnosis
