// Tells the cell about processes that ended and are started again, in their place.
#pragma once

#include <memory>
#include <string>

#include "core/base/time.hpp"
#include "core/config/cell.hpp"

namespace invar::tools {

/// Takes part in the cell from the first such news on: a cell in which all is well is not burdened.
class RestartNews {
 public:
  explicit RestartNews(const config::Cell& cell);
  ~RestartNews();
  RestartNews(const RestartNews&) = delete;
  RestartNews& operator=(const RestartNews&) = delete;

  struct End {
    std::string how;  // "status 137"
    std::uint32_t restarts = 0;
    Duration pause;
  };
  /// A notice; where there is a pause, `invar status` shows it instead of a process that does not answer.
  void tell(const config::CellProcess& process, const End& end) noexcept;

 private:
  struct Parts;
  const config::Cell& cell_;
  std::unique_ptr<Parts> parts_;
  bool failed_ = false;
};

}  // namespace invar::tools
