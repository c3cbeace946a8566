// SPDX-License-Identifier: Apache-2.0
#include "idl/openssl.h"

#include <openssl/bn.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/x509v3.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <ctime>
#include <limits>

#include "base/time.h"
#include "base/whole_file.h"

namespace relievo::openssl {
namespace {

constexpr std::size_t kLargestFile = 1 << 20;  // lists of revoked keys grow, by some 40 bytes each

/// Of bytes that outlive it.
Bio reader_of(const std::string& bytes) {
  return Bio(BIO_new_mem_buf(bytes.data(), static_cast<int>(bytes.size())));
}

/// What OpenSSL would ask a person at the terminal for.
int no_password(char*, int, int, void*) {
  return -1;
}

std::int64_t utc_ns(const ASN1_TIME* time) {
  std::tm parts{};
  if (ASN1_TIME_to_tm(time, &parts) != 1) return 0;
  constexpr std::int64_t kLast_s = std::numeric_limits<std::int64_t>::max() / kNanosecondsPerSecond;
  return std::clamp<std::int64_t>(timegm(&parts), -kLast_s, kLast_s) * kNanosecondsPerSecond;
}

template <typename Owned, typename Read>
Result<Owned> read_pem(const std::filesystem::path& file, Read read, const char* what) {
  const auto bytes = read_whole_file(file, kLargestFile);
  if (!bytes) return bytes.error();
  Owned object(read(reader_of(*bytes).get()));
  if (!object) return failure(file.string() + " holds no " + what);
  return object;
}

}  // namespace

void Free::operator()(bio_st* object) const {
  BIO_free(object);
}
void Free::operator()(evp_pkey_st* object) const {
  EVP_PKEY_free(object);
}
void Free::operator()(x509_st* object) const {
  X509_free(object);
}
void Free::operator()(X509_crl_st* object) const {
  X509_CRL_free(object);
}
void Free::operator()(pkcs7_st* object) const {
  PKCS7_free(object);
}

Error failure(const std::string& what) {
  const unsigned long code = ERR_get_error();
  ERR_clear_error();
  const char* reason = code != 0 ? ERR_reason_error_string(code) : nullptr;
  return Error{reason != nullptr ? what + ": " + reason : what};
}

Result<Key> read_key(const std::filesystem::path& file) {
  return read_pem<Key>(
      file, [](BIO* bio) { return PEM_read_bio_PrivateKey(bio, nullptr, no_password, nullptr); },
      "private key without a password");
}

Result<Certificate> read_certificate(const std::filesystem::path& file) {
  return read_pem<Certificate>(
      file, [](BIO* bio) { return PEM_read_bio_X509(bio, nullptr, nullptr, nullptr); }, "certificate");
}

Result<RevocationList> read_revocation_list(const std::filesystem::path& file) {
  return read_pem<RevocationList>(
      file, [](BIO* bio) { return PEM_read_bio_X509_CRL(bio, nullptr, nullptr, nullptr); },
      "list of revoked keys");
}

Result<std::string> read_signed(const std::filesystem::path& file, X509* signer) {
  const auto bytes = read_whole_file(file, kLargestFile);
  if (!bytes) return bytes.error();
  BIO* content = nullptr;
  const Signed document(SMIME_read_PKCS7(reader_of(*bytes).get(), &content));
  const Bio owned_content(content);
  if (!document || content == nullptr) return failure(file.string() + " is no signed document");
  const std::unique_ptr<STACK_OF(X509), Deleter<[](STACK_OF(X509) * s) { sk_X509_free(s); }>> certificates(
      sk_X509_new_null());
  sk_X509_push(certificates.get(), signer);
  const std::unique_ptr<X509_STORE, Deleter<X509_STORE_free>> trusted(X509_STORE_new());
  X509_STORE_add_cert(trusted.get(), signer);
  // Out of its time it would be told as a forgery.
  X509_STORE_set_flags(trusted.get(), X509_V_FLAG_NO_CHECK_TIME);
  const Bio out(BIO_new(BIO_s_mem()));
  if (PKCS7_verify(document.get(), certificates.get(), trusted.get(), content, out.get(),
                   PKCS7_TEXT | PKCS7_NOINTERN) != 1)
    return failure(file.string() + " is not as the authority signed it");
  return text_of(out.get());
}

std::string text_of(BIO* memory) {
  char* data = nullptr;
  const long size = BIO_get_mem_data(memory, &data);
  return {data, static_cast<std::size_t>(size)};
}

std::string hex(const ASN1_INTEGER* number) {
  const std::unique_ptr<BIGNUM, Deleter<BN_free>> value(ASN1_INTEGER_to_BN(number, nullptr));
  const std::unique_ptr<char, Deleter<[](char* p) { OPENSSL_free(p); }>> text(BN_bn2hex(value.get()));
  return text.get();
}

std::string serial_of(const X509* certificate) {
  return hex(X509_get0_serialNumber(certificate));
}

std::int64_t start_ns(const X509* certificate) {
  return utc_ns(X509_get0_notBefore(certificate));
}

std::int64_t expiry_ns(const X509* certificate) {
  return utc_ns(X509_get0_notAfter(certificate));
}

std::string name_of(const X509* certificate) {
  std::array<char, 128> text{};
  X509_NAME_get_text_by_NID(X509_get_subject_name(certificate), NID_commonName, text.data(),
                            static_cast<int>(text.size()));
  return text.data();
}

std::string fingerprint(const X509* certificate) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int size = 0;
  X509_digest(certificate, EVP_sha256(), digest.data(), &size);
  std::string text;
  for (std::size_t i = 0; i < 8; ++i) {
    std::array<char, 3> byte{};
    std::snprintf(byte.data(), byte.size(), "%02x", digest[i]);
    text += byte.data();
  }
  return text;
}

}  // namespace relievo::openssl
