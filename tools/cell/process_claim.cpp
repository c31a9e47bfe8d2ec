#include "tools/cell/process_claim.hpp"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

#include "core/base/fault.hpp"

namespace invar::tools {

ProcessClaim::ProcessClaim(const config::Cell& cell, const std::string& process) {
  const std::string name = "invar/" + std::to_string(cell.domain) + "/" + cell.name + "/" + process;
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::copy_n(name.data(), std::min(name.size(), sizeof address.sun_path - 1), address.sun_path + 1);
  socket_ = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (socket_ < 0) return;  // a PC without such sockets runs unguarded
  if (bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0 || errno != EADDRINUSE)
    return;
  close(socket_);
  throw InputError{cell.file.string(),
                   "process `" + process + "` of cell `" + cell.name +
                       "` runs already on this PC in domain " + std::to_string(cell.domain),
                   "stop it first, or give this cell another `domain`"};
}

ProcessClaim::~ProcessClaim() {
  if (socket_ >= 0) close(socket_);
}

}  // namespace invar::tools
