// SPDX-License-Identifier: Apache-2.0
#include "idl/authority.h"

#include <fcntl.h>
#include <openssl/pem.h>
#include <openssl/rand.h>
#include <openssl/x509v3.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <string_view>
#include <tuple>

#include "base/stream.h"
#include "base/time.h"
#include "base/whole_file.h"
#include "idl/keys.h"
#include "idl/openssl.h"

namespace relievo {
namespace {

namespace fs = std::filesystem;

constexpr const char* kHolders = "holders";  // certificates issued, NAME.pem
constexpr long kSecondsOfAYear = 365L * 24 * 3600;
constexpr long kAuthorityYears = 20;
constexpr long kIdentityYears = 10;

Status write_secret(const fs::path& file, const std::string& text) {
  const int fd = open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  const bool written = fd >= 0 && write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  const int error = errno;
  if (fd >= 0) close(fd);
  if (!written) return Error{"cannot write " + file.string() + ": " + write_failure(error)};
  return {};
}

openssl::Bio memory() {
  return openssl::Bio(BIO_new(BIO_s_mem()));
}

std::string pem(EVP_PKEY* key) {
  const openssl::Bio out = memory();
  PEM_write_bio_PrivateKey(out.get(), key, nullptr, nullptr, 0, nullptr, nullptr);
  return openssl::text_of(out.get());
}
std::string pem(X509* certificate) {
  const openssl::Bio out = memory();
  PEM_write_bio_X509(out.get(), certificate);
  return openssl::text_of(out.get());
}
std::string pem(X509_CRL* list) {
  const openssl::Bio out = memory();
  PEM_write_bio_X509_CRL(out.get(), list);
  return openssl::text_of(out.get());
}

Result<openssl::Key> new_key() {
  openssl::Key key(EVP_EC_gen("P-256"));
  if (!key) return openssl::failure("cannot make a key");
  return key;
}

bool extend(X509* certificate, X509* issuer, int kind, const char* value) {
  X509V3_CTX context;
  X509V3_set_ctx(&context, issuer, certificate, nullptr, nullptr, 0);
  const std::unique_ptr<X509_EXTENSION, openssl::Deleter<X509_EXTENSION_free>> extension(
      X509V3_EXT_conf_nid(nullptr, &context, kind, value));
  return extension && X509_add_ext(certificate, extension.get(), -1) == 1;
}

/// `issuer` null: an authority's, signed by itself.
Result<openssl::Certificate> new_certificate(const std::string& name, EVP_PKEY* key, X509* issuer,
                                             EVP_PKEY* issuer_key) {
  openssl::Certificate certificate(X509_new());
  std::array<unsigned char, 16> number{};
  const std::unique_ptr<BIGNUM, openssl::Deleter<BN_free>> serial(BN_new());
  bool ok = RAND_bytes(number.data(), static_cast<int>(number.size())) == 1;
  number[0] &= 0x7f;
  BN_bin2bn(number.data(), static_cast<int>(number.size()), serial.get());
  ok = ok && BN_to_ASN1_INTEGER(serial.get(), X509_get_serialNumber(certificate.get())) != nullptr;
  X509_set_version(certificate.get(), X509_VERSION_3);
  // From yesterday: clocks differ.
  X509_gmtime_adj(X509_getm_notBefore(certificate.get()), -24L * 3600);
  X509_gmtime_adj(X509_getm_notAfter(certificate.get()),
                  (issuer == nullptr ? kAuthorityYears : kIdentityYears) * kSecondsOfAYear);
  X509_NAME* subject = X509_get_subject_name(certificate.get());
  ok = ok && X509_NAME_add_entry_by_txt(subject, "CN", MBSTRING_ASC,
                                        reinterpret_cast<const unsigned char*>(name.c_str()), -1, -1, 0) == 1;
  X509* signer = issuer != nullptr ? issuer : certificate.get();
  ok = ok && X509_set_issuer_name(certificate.get(), X509_get_subject_name(signer)) == 1 &&
       X509_set_pubkey(certificate.get(), key) == 1;
  if (issuer == nullptr) {
    ok = ok && extend(certificate.get(), signer, NID_basic_constraints, "critical,CA:TRUE") &&
         extend(certificate.get(), signer, NID_key_usage, "critical,digitalSignature,keyCertSign,cRLSign");
  } else {
    ok = ok && extend(certificate.get(), signer, NID_basic_constraints, "critical,CA:FALSE");
  }
  ok = ok && extend(certificate.get(), signer, NID_subject_key_identifier, "hash") &&
       (issuer == nullptr ||
        extend(certificate.get(), signer, NID_authority_key_identifier, "keyid:always")) &&
       X509_sign(certificate.get(), issuer != nullptr ? issuer_key : key, EVP_sha256()) > 0;
  if (!ok) return openssl::failure("cannot make a certificate for " + name);
  return certificate;
}

Result<std::string> sign(const std::string& document, X509* certificate, EVP_PKEY* key) {
  const openssl::Bio in(BIO_new_mem_buf(document.data(), static_cast<int>(document.size())));
  constexpr int kFlags = PKCS7_DETACHED | PKCS7_TEXT;
  const openssl::Signed document_signed(PKCS7_sign(certificate, key, nullptr, in.get(), kFlags));
  const openssl::Bio out = memory();
  if (!document_signed || BIO_reset(in.get()) != 1 ||
      SMIME_write_PKCS7(out.get(), document_signed.get(), in.get(), kFlags) != 1)
    return openssl::failure("cannot sign");
  return openssl::text_of(out.get());
}

constexpr std::string_view kXmlHead = "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n";
constexpr std::string_view kAllDomains = "<domains><id_range><min>0</min><max>230</max></id_range></domains>";

/// Everything authenticated, all samples and all discovery encrypted, each topic by permission.
std::string governance() {
  return std::string(kXmlHead) + "<dds><domain_access_rules><domain_rule>" + std::string(kAllDomains) +
         "<allow_unauthenticated_participants>false</allow_unauthenticated_participants>"
         "<enable_join_access_control>true</enable_join_access_control>"
         "<discovery_protection_kind>ENCRYPT</discovery_protection_kind>"
         "<liveliness_protection_kind>ENCRYPT</liveliness_protection_kind>"
         "<rtps_protection_kind>SIGN</rtps_protection_kind>"
         "<topic_access_rules><topic_rule><topic_expression>*</topic_expression>"
         "<enable_discovery_protection>true</enable_discovery_protection>"
         "<enable_liveliness_protection>true</enable_liveliness_protection>"
         "<enable_read_access_control>true</enable_read_access_control>"
         "<enable_write_access_control>true</enable_write_access_control>"
         "<metadata_protection_kind>NONE</metadata_protection_kind>"
         "<data_protection_kind>ENCRYPT</data_protection_kind>"
         "</topic_rule></topic_access_rules></domain_rule></domain_access_rules></dds>\n";
}

std::string topics(const char* verb, std::initializer_list<const char*> names) {
  std::string text = std::string("<") + verb + "><topics>";
  for (const char* name : names) text += std::string("<topic>relievo/") + name + "</topic>";
  return text + "</topics><partitions><partition>*</partition></partitions></" + verb + ">";
}

std::string permissions(const std::string& name, KeyRole role) {
  const auto in = [now_ns = utc_now_ns()](std::int64_t seconds) {
    return utc_text(now_ns + seconds * kNanosecondsPerSecond, "%Y-%m-%dT%H:%M:%S");
  };
  const bool publisher = role == KeyRole::kPublisher;
  return std::string(kXmlHead) + "<dds><permissions><grant name=\"" + (publisher ? "publisher" : "watcher") +
         "\"><subject_name>CN=" + name + "</subject_name><validity><not_before>" + in(-24L * 3600) +
         "</not_before><not_after>" + in(kIdentityYears * kSecondsOfAYear) +
         "</not_after></validity><allow_rule>" + std::string(kAllDomains) +
         (publisher ? topics("publish", {"info", "frame", "status", "key_frame_request", "clock_question",
                                         "clock_answer"})
                    : topics("publish", {"key_frame_request", "clock_question"})) +
         (publisher ? topics("subscribe", {"info", "frame", "status", "key_frame_request", "clock_question",
                                           "clock_answer"})
                    : topics("subscribe", {"info", "frame", "status", "clock_answer"})) +
         "</allow_rule><default>DENY</default></grant></permissions></dds>\n";
}

struct Authority {
  openssl::Certificate certificate;
  openssl::Key key;
};

Result<Authority> open_authority(const fs::path& folder) {
  std::error_code error;
  if (!fs::exists(folder / key_files::kAuthorityKey, error) && !error)
    return Error{
        folder.string() + " is no authority: " + key_files::kAuthorityKey +
        " is missing (relievo keys init makes one; only the machine where that was done can give keys)"};
  for (const char* file : {key_files::kAuthorityKey, key_files::kAuthority, key_files::kRevoked})
    if (auto s = check_readable(folder, file); !s) return s.error();
  Authority authority;
  auto certificate = openssl::read_certificate(folder / key_files::kAuthority);
  if (!certificate) return certificate.error();
  // Keys made by a clock that is behind would have expired too early.
  if (auto s = check_clock("the keys in " + folder.string(), openssl::start_ns(certificate->get())); !s)
    return s.error();
  if (utc_now_ns() >= openssl::expiry_ns(certificate->get()))
    return Error{"the authority in " + folder.string() + " has expired on " +
                 utc_text(openssl::expiry_ns(certificate->get())) +
                 ": make a new one (relievo keys init --keys DIR), and new keys for everybody"};
  auto key = openssl::read_key(folder / key_files::kAuthorityKey);
  if (!key) return key.error();
  return Authority{std::move(certificate).value(), std::move(key).value()};
}

/// All serials, anew: a list says when it was made.
Result<std::string> revocation_list(const Authority& authority, const std::vector<KeyHolder>& holders) {
  const openssl::RevocationList list(X509_CRL_new());
  const std::unique_ptr<ASN1_TIME, openssl::Deleter<ASN1_TIME_free>> now(ASN1_TIME_new());
  const std::unique_ptr<ASN1_TIME, openssl::Deleter<ASN1_TIME_free>> end(ASN1_TIME_new());
  X509_gmtime_adj(now.get(), -24L * 3600);
  X509_gmtime_adj(end.get(), kAuthorityYears * kSecondsOfAYear);
  bool ok = X509_CRL_set_version(list.get(), 1) == 1 &&
            X509_CRL_set_issuer_name(list.get(), X509_get_subject_name(authority.certificate.get())) == 1 &&
            X509_CRL_set1_lastUpdate(list.get(), now.get()) == 1 &&
            X509_CRL_set1_nextUpdate(list.get(), end.get()) == 1;
  for (const KeyHolder& holder : holders) {
    if (!holder.revoked) continue;
    BIGNUM* number = nullptr;
    ok = ok && BN_hex2bn(&number, holder.serial.c_str()) > 0;
    const std::unique_ptr<BIGNUM, openssl::Deleter<BN_free>> owned(number);
    const std::unique_ptr<ASN1_INTEGER, openssl::Deleter<ASN1_INTEGER_free>> serial(
        BN_to_ASN1_INTEGER(number, nullptr));
    std::unique_ptr<X509_REVOKED, openssl::Deleter<X509_REVOKED_free>> entry(X509_REVOKED_new());
    ok = ok && X509_REVOKED_set_serialNumber(entry.get(), serial.get()) == 1 &&
         X509_REVOKED_set_revocationDate(entry.get(), now.get()) == 1 &&
         X509_CRL_add0_revoked(list.get(), entry.get()) == 1;
    if (ok) static_cast<void>(entry.release());  // the list's now
  }
  ok = ok && X509_CRL_sort(list.get()) == 1 &&
       X509_CRL_sign(list.get(), authority.key.get(), EVP_sha256()) > 0;
  if (!ok) return openssl::failure("cannot make the list of revoked keys");
  return pem(list.get());
}

/// Into an existing folder.
Status write_keys(const fs::path& folder, const Authority& authority, const std::string& name, KeyRole role,
                  const std::string& revoked, std::string& certificate_pem) {
  auto key = new_key();
  if (!key) return key.error();
  auto certificate = new_certificate(name, key->get(), authority.certificate.get(), authority.key.get());
  if (!certificate) return certificate.error();
  const auto governance_signed = sign(governance(), authority.certificate.get(), authority.key.get());
  if (!governance_signed) return governance_signed.error();
  const auto permissions_signed =
      sign(permissions(name, role), authority.certificate.get(), authority.key.get());
  if (!permissions_signed) return permissions_signed.error();
  certificate_pem = pem(certificate->get());
  if (auto s = write_secret(folder / key_files::kPrivate, pem(key->get())); !s) return s;
  const std::pair<const char*, std::string> files[] = {
      {key_files::kAuthority, pem(authority.certificate.get())},
      {key_files::kIdentity, certificate_pem},
      {key_files::kGovernance, *governance_signed},
      {key_files::kPermissions, *permissions_signed},
      {key_files::kRevoked, revoked},
  };
  for (const auto& [file, text] : files)
    if (auto s = write_whole_file(folder / file, text); !s) return s;
  return {};
}

/// Where root keeps the keys of a service's user, that user reads what root writes.
Status give_to_owner_of(const fs::path& folder, const fs::path& file) {
  struct stat owner {};
  if (geteuid() != 0 || stat(folder.c_str(), &owner) != 0) return {};
  if (chown(file.c_str(), owner.st_uid, owner.st_gid) == 0) return {};
  return Error{"cannot give " + file.string() + " to the owner of " + folder.string() + ": " +
               write_failure(errno)};
}

/// Beside those of the same name, which can be revoked still.
Status add_holder(const fs::path& folder, const std::string& name, const std::string& certificate_pem) {
  const fs::path file = folder / kHolders / (name + ".pem");
  std::error_code error;
  if (fs::exists(file, error)) {
    const auto before = openssl::read_certificate(file);
    if (!before) return before.error();
    // '+' is in no name.
    const fs::path aside = folder / kHolders / (name + "+" + openssl::serial_of(before->get()) + ".pem");
    fs::rename(file, aside, error);
    if (error) return Error{"cannot write " + aside.string() + ": " + error.message()};
  }
  if (auto s = write_whole_file(file, certificate_pem); !s) return s;
  return give_to_owner_of(folder, file);
}

/// A folder that gets its name when all is in it, or else is gone.
class NewFolder {
 public:
  static Result<NewFolder> create(const fs::path& path) {
    std::error_code error;
    const bool taken = fs::is_directory(path, error) ? !fs::is_empty(path, error) : fs::exists(path, error);
    if (taken) return Error{path.string() + " exists already: nothing was changed"};
    fs::path parent = fs::absolute(path, error).lexically_normal();
    if (!parent.has_filename()) parent = parent.parent_path();
    NewFolder folder;
    folder.named_ = path;
    folder.final_ = parent;
    const fs::path part = parent.string() + ".part";
    fs::create_directories(parent.parent_path(), error);
    const bool made = !error && fs::create_directory(part, error);
    if (error) return Error{"cannot make " + path.string() + ": " + error.message()};
    if (!made) return Error{part.string() + " is in the way: remove it"};  // which is not ours
    folder.path_ = part;
    fs::permissions(folder.path_, fs::perms::owner_all, error);
    return folder;
  }
  NewFolder(NewFolder&& other) noexcept
      : named_(std::exchange(other.named_, {})),
        path_(std::exchange(other.path_, {})),
        final_(std::exchange(other.final_, {})) {}
  NewFolder& operator=(NewFolder&&) = delete;
  ~NewFolder() {
    std::error_code ignored;
    if (!path_.empty()) fs::remove_all(path_, ignored);
  }
  const fs::path& path() const { return path_; }
  Error failed(const Error& error) const { return told_of(named_, error, path_); }
  Status keep() {
    std::error_code error;
    fs::rename(path_, final_, error);
    if (error) return Error{"cannot make " + named_.string() + ": " + error.message()};
    path_.clear();
    return {};
  }

 private:
  NewFolder() = default;
  fs::path named_, path_, final_;
};

std::string this_machine() {
  std::array<char, 65> name{};
  gethostname(name.data(), name.size() - 1);
  return valid_stream_name(name.data()) ? name.data() : "server";
}

}  // namespace

Status create_authority(const fs::path& folder) {
  auto fresh = NewFolder::create(folder);
  if (!fresh) return fresh.error();
  auto key = new_key();
  if (!key) return key.error();
  auto certificate = new_certificate("Relievo authority", key->get(), nullptr, nullptr);
  if (!certificate) return certificate.error();
  const Authority authority{std::move(certificate).value(), std::move(key).value()};
  if (auto s = write_secret(fresh->path() / key_files::kAuthorityKey, pem(authority.key.get())); !s)
    return fresh->failed(s.error());
  const auto nobody = revocation_list(authority, {});
  if (!nobody) return nobody.error();
  std::error_code error;
  fs::create_directory(fresh->path() / kHolders, error);
  const std::string name = this_machine();
  std::string holder;
  if (auto s = write_keys(fresh->path(), authority, name, KeyRole::kPublisher, *nobody, holder); !s)
    return fresh->failed(s.error());
  if (auto s = add_holder(fresh->path(), name, holder); !s) return fresh->failed(s.error());
  return fresh->keep();
}

Status issue_keys(const fs::path& folder, const std::string& name, KeyRole role, const fs::path& out) {
  if (!valid_stream_name(name))
    return Error{"'" + name +
                 "' cannot name keys: use up to 64 letters, digits, '_', '-' and '.', no dot first"};
  const auto authority = open_authority(folder);
  if (!authority) return authority.error();
  const auto holders = list_keys(folder);
  if (!holders) return holders.error();
  for (const KeyHolder& holder : *holders)
    if (holder.name == name && !holder.revoked && holder.expires_ns > utc_now_ns())
      return Error{"'" + name + "' has keys already, until " + utc_text(holder.expires_ns) +
                   ": choose another name, or revoke them first (relievo keys revoke " + name + ")"};
  const auto revoked = revocation_list(*authority, *holders);
  if (!revoked) return revoked.error();
  auto fresh = NewFolder::create(out);
  if (!fresh) return fresh.error();
  std::string holder;
  if (auto s = write_keys(fresh->path(), *authority, name, role, *revoked, holder); !s)
    return fresh->failed(s.error());
  // First, so that no keys are out there that nobody can revoke.
  if (auto s = add_holder(folder, name, holder); !s) return s;
  return fresh->keep();
}

Status renew_keys(const fs::path& folder) {
  const auto authority = open_authority(folder);
  if (!authority) return authority.error();
  const auto holders = list_keys(folder);
  if (!holders) return holders.error();
  const auto revoked = revocation_list(*authority, *holders);
  if (!revoked) return revoked.error();
  // Where it is damaged or gone, which renewing mends, they are this machine's as those made first.
  const auto before = openssl::read_certificate(folder / key_files::kIdentity);
  const std::string name = before ? openssl::name_of(before->get()) : this_machine();
  auto fresh = NewFolder::create(folder / "renewed");  // never kept: what is in it moves up
  if (!fresh) return fresh.error();
  std::string holder;
  if (auto s = write_keys(fresh->path(), *authority, name, KeyRole::kPublisher, *revoked, holder); !s)
    return told_of(folder, s.error(), fresh->path());
  if (auto s = add_holder(folder, name, holder); !s) return s;
  for (const char* file : key_files::kEach) {
    const fs::path made = fresh->path() / file, place = folder / file;
    if (auto s = give_to_owner_of(folder, made); !s) return s;
    std::error_code error;
    fs::rename(made, place, error);
    if (error)
      return Error{"cannot write " + place.string() + ": " + error.message() +
                   "; relievo keys renew, once more, mends it"};
  }
  return {};
}

Status revoke_keys(const fs::path& folder, const std::string& name) {
  const auto authority = open_authority(folder);
  if (!authority) return authority.error();
  auto holders = list_keys(folder);
  if (!holders) return holders.error();
  bool known = false, changed = false;
  for (KeyHolder& holder : *holders) {
    if (holder.name != name) continue;
    known = true;
    changed = changed || !holder.revoked;
    holder.revoked = true;
  }
  if (!known) return Error{"nobody named '" + name + "' has keys: see relievo keys list"};
  if (!changed) return Error{"the keys of '" + name + "' were revoked already"};
  const auto list = revocation_list(*authority, *holders);
  if (!list) return list.error();
  if (auto s = write_whole_file(folder / key_files::kRevoked, *list); !s) return s;
  return give_to_owner_of(folder, folder / key_files::kRevoked);
}

Result<std::vector<KeyHolder>> list_keys(const fs::path& folder) {
  if (const auto authority = open_authority(folder); !authority) return authority.error();
  const auto revoked = read_revoked(folder);
  if (!revoked) return revoked.error();
  std::vector<KeyHolder> holders;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder / kHolders, error)) {
    const auto certificate = openssl::read_certificate(entry.path());
    if (!certificate) return certificate.error();
    KeyHolder holder;
    holder.name = openssl::name_of(certificate->get());
    holder.serial = openssl::serial_of(certificate->get());
    holder.revoked = std::find(revoked->begin(), revoked->end(), holder.serial) != revoked->end();
    holder.expires_ns = openssl::expiry_ns(certificate->get());
    holders.push_back(std::move(holder));
  }
  if (error) return Error{"cannot read " + (folder / kHolders).string() + ": " + error.message()};
  std::sort(holders.begin(), holders.end(), [](const auto& a, const auto& b) {
    return std::tie(a.name, a.expires_ns) < std::tie(b.name, b.expires_ns);
  });
  return holders;
}

}  // namespace relievo
