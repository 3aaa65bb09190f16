#include "server/webhooks/certificates.h"

#include <openssl/bio.h>
#include <openssl/err.h>
#include <openssl/pem.h>

#include <cstdint>
#include <memory>
#include <new>

#include "core/base/error.h"

namespace voxdag::server {
namespace {

constexpr uint64_t kMaxCertificateBytes = 16 << 20;

struct Free {
  void operator()(BIO* bio) const { BIO_free(bio); }
  void operator()(STACK_OF(X509_INFO) * entries) const {
    sk_X509_INFO_pop_free(entries, X509_INFO_free);
  }
};

}  // namespace

void check_certificates(FileSystem& files, const std::string& path) {
  const std::string text = read_small_file(files, path, kMaxCertificateBytes);
  const auto fail = [&](const std::string& what) {
    ERR_clear_error();
    throw Error(ErrorCode::kInvalidInput,
                path + ": " + what +
                    ": expected a PEM file with at least one certificate (webhooks.ca_file)");
  };
  ERR_clear_error();
  const std::unique_ptr<BIO, Free> bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
  if (!bio) throw std::bad_alloc();
  const std::unique_ptr<STACK_OF(X509_INFO), Free> entries(
      PEM_X509_INFO_read_bio(bio.get(), nullptr, nullptr, nullptr));
  if (!entries) {
    const char* reason = ERR_reason_error_string(ERR_peek_last_error());
    fail("OpenSSL cannot read it (" + std::string(reason ? reason : "unknown reason") + ")");
  }
  for (int i = 0; i < sk_X509_INFO_num(entries.get()); ++i)
    if (sk_X509_INFO_value(entries.get(), i)->x509) return;
  fail("it has no certificate");
}

}  // namespace voxdag::server
