// OpensslObject: owners of libcrypto's objects, and the fault of a call that fails.
#pragma once

#include <string>

#include "core/dds/openssl_object.hpp"

namespace invar::tools {

using dds::OpensslCertificate;
using dds::OpensslFile;
using dds::OpensslKey;
using dds::OpensslName;
using dds::OpensslRelease;
using dds::OpensslRevocations;
using dds::OpensslSigned;

/// Throws std::runtime_error with the library's own reason unless `done`.
void require_openssl(bool done, const std::string& what);

}  // namespace invar::tools
