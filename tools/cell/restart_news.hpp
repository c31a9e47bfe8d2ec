// Tells the cell about processes that ended and are started again, in their place.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "core/base/time.hpp"
#include "core/config/cell.hpp"

namespace invar::tools {

/// Takes part in the cell from the first such news on, unless told to be ready: a cell in which all is well is not burdened.
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
    std::int32_t process = 0;  // its id
  };
  /// Takes part from now on, so that its news are quick: a component on another PC stands by for one of this process.
  void be_ready(const config::CellProcess& process) noexcept;
  /// A notice, and the process's status in its place: a standby on another PC takes over by it, and `invar status` shows it
  /// instead of a process that does not answer.
  void tell(const config::CellProcess& process, const End& end) noexcept;

 private:
  struct Parts;
  template <class Act>
  void with_parts(const config::CellProcess& process, Act act) noexcept;
  const config::Cell& cell_;
  std::unique_ptr<Parts> parts_;
  bool failed_ = false;
};

}  // namespace invar::tools
