// OpensslObject: owners of libcrypto's objects, and what to say when a call of it fails.
#pragma once

#include <openssl/evp.h>
#include <openssl/pkcs7.h>
#include <openssl/x509.h>

#include <memory>
#include <string>

namespace invar::tools {

template <auto release>
struct OpensslRelease {
  template <class T>
  void operator()(T* object) const {
    release(object);
  }
};
using OpensslFile = std::unique_ptr<BIO, OpensslRelease<BIO_free>>;
using OpensslKey = std::unique_ptr<EVP_PKEY, OpensslRelease<EVP_PKEY_free>>;
using OpensslCertificate = std::unique_ptr<X509, OpensslRelease<X509_free>>;
using OpensslName = std::unique_ptr<X509_NAME, OpensslRelease<X509_NAME_free>>;
using OpensslRevocations = std::unique_ptr<X509_CRL, OpensslRelease<X509_CRL_free>>;
using OpensslSigned = std::unique_ptr<PKCS7, OpensslRelease<PKCS7_free>>;

/// Throws std::runtime_error with the library's own reason unless `done`.
void require_openssl(bool done, const std::string& what);

}  // namespace invar::tools
