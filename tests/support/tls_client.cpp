// SPDX-License-Identifier: Apache-2.0
#include "tests/support/tls_client.h"

#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <openssl/x509.h>

#include <cstdio>

namespace relievo::test {
namespace {

struct Free {
  void operator()(EVP_PKEY* key) const { EVP_PKEY_free(key); }
  void operator()(X509* certificate) const { X509_free(certificate); }
  void operator()(SSL_CTX* context) const { SSL_CTX_free(context); }
  void operator()(SSL* tls) const { SSL_free(tls); }
  void operator()(std::FILE* file) const { std::fclose(file); }
};
template <typename T>
using Owned = std::unique_ptr<T, Free>;

std::string common_name(X509* certificate) {
  char name[128] = "";
  X509_NAME_get_text_by_NID(X509_get_subject_name(certificate), NID_commonName, name, sizeof name);
  return name;
}

}  // namespace

bool make_certificate(const std::filesystem::path& cert, const std::filesystem::path& key,
                      const std::string& common_name, const std::string& password, Validity validity) {
  const Owned<EVP_PKEY> pair(EVP_EC_gen("P-256"));
  const Owned<X509> made(X509_new());
  if (!pair || !made) return false;
  X509_set_version(made.get(), 2);
  ASN1_INTEGER_set(X509_get_serialNumber(made.get()), 1);
  X509_gmtime_adj(X509_getm_notBefore(made.get()), validity.from_s);
  X509_gmtime_adj(X509_getm_notAfter(made.get()), validity.until_s);
  X509_set_pubkey(made.get(), pair.get());
  X509_NAME* name = X509_get_subject_name(made.get());
  X509_NAME_add_entry_by_txt(name, "CN", MBSTRING_ASC,
                             reinterpret_cast<const unsigned char*>(common_name.c_str()), -1, -1, 0);
  X509_set_issuer_name(made.get(), name);
  if (X509_sign(made.get(), pair.get(), EVP_sha256()) == 0) return false;
  const Owned<std::FILE> cert_file(std::fopen(cert.c_str(), "w")), key_file(std::fopen(key.c_str(), "w"));
  return cert_file && key_file && PEM_write_X509(cert_file.get(), made.get()) == 1 &&
         PEM_write_PrivateKey(key_file.get(), pair.get(), password.empty() ? nullptr : EVP_aes_128_cbc(),
                              reinterpret_cast<const unsigned char*>(password.data()),
                              static_cast<int>(password.size()), nullptr, nullptr) == 1;
}

struct TlsClient::State {
  Owned<SSL_CTX> context{SSL_CTX_new(TLS_client_method())};
  Owned<SSL> tls{SSL_new(context.get())};
  bool secured = false;
};

TlsClient::TlsClient(std::uint16_t port) : TcpClient(port), state_(std::make_unique<State>()) {
  SSL_set_fd(state_->tls.get(), descriptor());
  state_->secured = connected() && SSL_connect(state_->tls.get()) == 1;
}

TlsClient::~TlsClient() = default;

bool TlsClient::secured() const {
  return state_->secured;
}

std::string TlsClient::peer_name() const {
  const Owned<X509> shown(SSL_get1_peer_certificate(state_->tls.get()));
  return shown ? common_name(shown.get()) : "";
}

bool TlsClient::send(const std::string& bytes) {
  return SSL_write(state_->tls.get(), bytes.data(), static_cast<int>(bytes.size())) ==
         static_cast<int>(bytes.size());
}

long TlsClient::read(char* into, std::size_t bytes) {
  return SSL_read(state_->tls.get(), into, static_cast<int>(bytes));
}

bool TlsClient::has_more() const {
  return SSL_has_pending(state_->tls.get()) == 1;
}

}  // namespace relievo::test
