#include "tools/keys/openssl_object.hpp"

#include <openssl/err.h>

#include <stdexcept>

namespace invar::tools {

void require_openssl(bool done, const std::string& what) {
  if (done) return;
  const char* reason = ERR_reason_error_string(ERR_get_error());
  throw std::runtime_error{"OpenSSL cannot " + what + (reason == nullptr ? "" : std::string{": "} + reason)};
}

}  // namespace invar::tools
