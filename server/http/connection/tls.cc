#include "server/http/connection/tls.h"

#include <openssl/err.h>
#include <openssl/ssl.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <csignal>

#include "core/base/error.h"

namespace voxdag::server {
namespace {

// Returns the reason of OpenSSL's last error.
std::string openssl_reason() {
  const char* reason = ERR_reason_error_string(ERR_peek_last_error());
  return reason ? reason : "unknown reason";
}

}  // namespace

void TlsSession::Free::operator()(ssl_st* session) const { SSL_free(session); }
void TlsContext::Free::operator()(ssl_ctx_st* context) const { SSL_CTX_free(context); }

ssize_t TlsSession::outcome(int result) {
  if (result > 0) return result;
  switch (SSL_get_error(ssl_.get(), result)) {
    case SSL_ERROR_WANT_READ:
      return kNeedsRead;
    case SSL_ERROR_WANT_WRITE:
      return kNeedsWrite;
    case SSL_ERROR_ZERO_RETURN:
      return 0;
    default:
      return kBroken;
  }
}

ssize_t TlsSession::handshake() {
  if (!ssl_) return 1;
  ERR_clear_error();
  return outcome(SSL_accept(ssl_.get()));
}

ssize_t TlsSession::read(int socket, char* data, size_t size) {
  if (ssl_) {
    ERR_clear_error();
    return outcome(SSL_read(ssl_.get(), data, static_cast<int>(std::min(size, size_t{1} << 20))));
  }
  for (;;) {
    const ssize_t got = recv(socket, data, size, 0);
    if (got >= 0) return got;
    if (errno == EINTR) continue;
    return errno == EAGAIN || errno == EWOULDBLOCK ? kNeedsRead : kBroken;
  }
}

ssize_t TlsSession::write(int socket, const char* data, size_t size) {
  if (ssl_) {
    ERR_clear_error();
    return outcome(SSL_write(ssl_.get(), data, static_cast<int>(std::min(size, size_t{1} << 20))));
  }
  for (;;) {
    const ssize_t sent = send(socket, data, size, MSG_NOSIGNAL);
    if (sent >= 0) return sent;
    if (errno == EINTR) continue;
    return errno == EAGAIN || errno == EWOULDBLOCK ? kNeedsWrite : kBroken;
  }
}

void TlsSession::shutdown() {
  if (!ssl_) return;
  ERR_clear_error();
  SSL_shutdown(ssl_.get());
}

TlsContext::TlsContext(const std::string& certificate_file, const std::string& key_file)
    : context_(SSL_CTX_new(TLS_server_method())) {
  const auto fail = [](const std::string& what) {
    ERR_clear_error();
    throw Error(ErrorCode::kInvalidInput, what);
  };
  if (!context_)
    fail("TLS: OpenSSL cannot be initialized (" + openssl_reason() +
         "): expected a working libssl");
  // If a client has closed its connection, OpenSSL's next write raises SIGPIPE. The signal would
  // end the process if it were not ignored.
  std::signal(SIGPIPE, SIG_IGN);
  SSL_CTX_set_min_proto_version(context_.get(), TLS1_2_VERSION);
  SSL_CTX_set_options(context_.get(), SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_COMPRESSION);
  SSL_CTX_set_mode(context_.get(),
                   SSL_MODE_ENABLE_PARTIAL_WRITE | SSL_MODE_ACCEPT_MOVING_WRITE_BUFFER);
  if (SSL_CTX_use_certificate_chain_file(context_.get(), certificate_file.c_str()) != 1)
    fail("TLS certificate " + certificate_file + " cannot be loaded (" + openssl_reason() +
         "): expected a readable PEM file");
  if (SSL_CTX_use_PrivateKey_file(context_.get(), key_file.c_str(), SSL_FILETYPE_PEM) != 1)
    fail("TLS key " + key_file + " cannot be loaded (" + openssl_reason() +
         "): expected a readable PEM file");
  if (SSL_CTX_check_private_key(context_.get()) != 1)
    fail("TLS key " + key_file + " does not belong to the certificate " + certificate_file +
         ": expected the private key of this certificate");
}

TlsSession TlsContext::session(int socket) const {
  TlsSession session;
  session.ssl_.reset(SSL_new(context_.get()));
  if (!session.ssl_ || SSL_set_fd(session.ssl_.get(), socket) != 1)
    throw Error(
        ErrorCode::kOutOfMemory,
        "out of memory: OpenSSL cannot open another TLS session, expected more free memory");
  return session;
}

}  // namespace voxdag::server
