// SPDX-License-Identifier: Apache-2.0
// The other end of TLS, and certificates for this one, by OpenSSL alone.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "tests/support/socket_client.h"

namespace relievo::test {

/// Of a certificate, from now on.
struct Validity {
  long from_s = -60;
  long until_s = 90L * 24 * 3600;
};

/// Writes a new key, locked by `password` where that is not empty, and a certificate that it signs itself, as
/// PEM; false where that fails.
bool make_certificate(const std::filesystem::path& cert, const std::filesystem::path& key,
                      const std::string& common_name, const std::string& password = {},
                      Validity validity = {});

/// Trusts whatever certificate it is shown.
class TlsClient : public TcpClient {
 public:
  explicit TlsClient(std::uint16_t port);
  ~TlsClient() override;

  bool secured() const;           // the handshake came about
  std::string peer_name() const;  // of the certificate shown
  bool send(const std::string& bytes) override;

 protected:
  long read(char* into, std::size_t bytes) override;
  bool has_more() const override;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace relievo::test
