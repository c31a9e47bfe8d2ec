// OpensslObject: owners of libcrypto's objects.
#pragma once

#include <openssl/evp.h>
#include <openssl/pkcs7.h>
#include <openssl/x509.h>

#include <memory>

namespace invar::dds {

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

}  // namespace invar::dds
