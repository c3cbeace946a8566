// SPDX-License-Identifier: Apache-2.0
// OpenSSL's objects as owned values, and PEM files. Internal to idl/.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "base/result.h"

// OpenSSL's own names of these are BIO, EVP_PKEY, X509, X509_CRL, PKCS7, ASN1_INTEGER.
struct bio_st;
struct evp_pkey_st;
struct x509_st;
struct X509_crl_st;
struct pkcs7_st;
struct asn1_string_st;

namespace relievo::openssl {

struct Free {
  void operator()(bio_st* object) const;
  void operator()(evp_pkey_st* object) const;
  void operator()(x509_st* object) const;
  void operator()(X509_crl_st* object) const;
  void operator()(pkcs7_st* object) const;
};
using Bio = std::unique_ptr<bio_st, Free>;
using Key = std::unique_ptr<evp_pkey_st, Free>;
using Certificate = std::unique_ptr<x509_st, Free>;
using RevocationList = std::unique_ptr<X509_crl_st, Free>;
using Signed = std::unique_ptr<pkcs7_st, Free>;

/// Of types that one file alone uses.
template <auto FreeIt>
struct Deleter {
  template <typename T>
  void operator()(T* object) const {
    FreeIt(object);
  }
};

/// "what: OpenSSL's reason". Empties OpenSSL's error queue.
Error failure(const std::string& what);

/// Fail where the file cannot be read or holds no such thing.
Result<Key> read_key(const std::filesystem::path& file);
Result<Certificate> read_certificate(const std::filesystem::path& file);
Result<RevocationList> read_revocation_list(const std::filesystem::path& file);

/// The text of a file that `signer` signed (S/MIME, detached, as DDS Security wants its documents), whenever
/// the signer is valid.
Result<std::string> read_signed(const std::filesystem::path& file, x509_st* signer);

/// What was written to a memory BIO.
std::string text_of(bio_st* memory);

/// The certificate's number, hexadecimal.
std::string serial_of(const x509_st* certificate);
std::string hex(const asn1_string_st* number);
std::int64_t start_ns(const x509_st* certificate);   // valid from, UTC
std::int64_t expiry_ns(const x509_st* certificate);  // to
/// Its common name.
std::string name_of(const x509_st* certificate);
/// The first 64 bits of its SHA-256, hexadecimal: names an authority.
std::string fingerprint(const x509_st* certificate);

}  // namespace relievo::openssl
