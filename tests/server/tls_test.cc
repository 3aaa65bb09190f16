#include <openssl/pem.h>
#include <openssl/x509v3.h>

#include <cstdio>
#include <fstream>
#include <mutex>
#include <optional>
#include <sstream>
#include <thread>
#include <vector>

#include "core/base/error.h"
#include "server/http/http_server.h"
#include "server/webhooks/webhook_message.h"
#include "tests/server/running_service.h"

namespace voxdag::server {
namespace {

// Writes a self-signed certificate for 127.0.0.1, and its key. The certificate is not for
// localhost, because some containers do not resolve this name.
void make_certificate(const std::string& certificate_file, const std::string& key_file) {
  EVP_PKEY* key = EVP_EC_gen("P-256");
  X509* certificate = X509_new();
  X509_set_version(certificate, 2);
  ASN1_INTEGER_set(X509_get_serialNumber(certificate), 1);
  X509_gmtime_adj(X509_getm_notBefore(certificate), -3600);
  X509_gmtime_adj(X509_getm_notAfter(certificate), 3600);
  X509_set_pubkey(certificate, key);
  X509_NAME* name = X509_get_subject_name(certificate);
  X509_NAME_add_entry_by_txt(name, "CN", MBSTRING_ASC,
                             reinterpret_cast<const unsigned char*>("localhost"), -1, -1, 0);
  X509_set_issuer_name(certificate, name);
  X509_EXTENSION* names =
      X509V3_EXT_conf_nid(nullptr, nullptr, NID_subject_alt_name, "IP:127.0.0.1");
  X509_add_ext(certificate, names, -1);
  X509_sign(certificate, key, EVP_sha256());
  FILE* file = std::fopen(certificate_file.c_str(), "w");
  PEM_write_X509(file, certificate);
  std::fclose(file);
  file = std::fopen(key_file.c_str(), "w");
  PEM_write_PrivateKey(file, key, nullptr, nullptr, 0, nullptr, nullptr);
  std::fclose(file);
  X509_EXTENSION_free(names);
  X509_free(certificate);
  EVP_PKEY_free(key);
}

class Tls : public RunningService {
 protected:
  Tls() {
    config_.http.certificate_file = folder_.file("certificate.pem");
    config_.http.key_file = folder_.file("key.pem");
    make_certificate(config_.http.certificate_file, config_.http.key_file);
  }
};

// Over TLS, uploads, downloads and event streams work. A client that does not trust the certificate
// refuses to connect, and a plain HTTP request fails.
TEST_F(Tls, EncryptsEverything) {
  start();
  const std::string port = url().substr(url().rfind(':'));
  ASSERT_TRUE(url().starts_with("https://"));
  http_ = std::make_unique<HttpClient>(
      ClientOptions{"https://127.0.0.1" + port, "", config_.http.certificate_file, 60});
  ASSERT_EQ(put_scene("m.glb", scene_bytes()).status, 201);
  const std::string id = post_job({{"scene", "m.glb"}, {"resolution", 256}});
  std::string events;
  http_->stream(
      "/api/v1/jobs/" + id + "/events", {}, [](const ClientResponse&) { return true; },
      [&](std::string_view piece) {
        events += piece;
        return true;
      });
  EXPECT_NE(events.find("event: end"), std::string::npos);
  EXPECT_EQ(http_->get("/api/v1/jobs/" + id + "/dag").status, 200);
  HttpClient stranger({"https://127.0.0.1" + port, "", "", 60});
  EXPECT_THROW(stranger.get("/healthz"), Error);
  HttpClient plain({"http://127.0.0.1" + port, "", "", 60});
  EXPECT_THROW(plain.get("/healthz"), Error);
}

TEST_F(Tls, RejectsAKeyOfAnotherCertificate) {
  make_certificate(folder_.file("other.pem"), config_.http.key_file);
  EXPECT_THROW(start(), Error);
}

// A receiver of webhooks with TLS. It answers all requests with 204.
class TlsReceiver {
 public:
  explicit TlsReceiver(const TemporaryFolder& folder) : certificate_(folder.file("receiver.pem")) {
    HttpOptions options;
    options.port = 0;
    options.certificate_file = certificate_;
    options.key_file = folder.file("receiver.key");
    make_certificate(options.certificate_file, options.key_file);
    server_.emplace(options, [this](Request& request) {
      std::string body;
      request.read_body([&](std::string_view piece) {
        body += piece;
        return true;
      });
      const std::lock_guard lock(mutex_);
      received_.push_back({request.target.path, request.header("X-Voxdag-Signature"), body});
      Response response;
      response.status = 204;
      return response;
    });
    thread_ = std::thread([this] { server_->run(0); });
  }
  ~TlsReceiver() {
    server_->stop();
    thread_.join();
  }

  struct Received {
    std::string target, signature, body;
  };
  std::string url(const std::string& path) const {
    return "https://127.0.0.1:" + std::to_string(server_->port()) + path;
  }
  const std::string& certificate() const { return certificate_; }
  std::vector<Received> received() {
    const std::lock_guard lock(mutex_);
    return received_;
  }

 private:
  const std::string certificate_;
  std::mutex mutex_;  // guards received_
  std::vector<Received> received_;
  std::optional<HttpServer> server_;
  std::thread thread_;
};

class TlsWebhooks : public RunningService {
 protected:
  // Starts the service, and returns the id of a job with this webhook.
  std::string post_with(const std::string& webhook) {
    config_.webhooks.backoff_s = 0.01;
    start();
    EXPECT_EQ(put_scene("m.glb", scene_bytes()).status, 201);
    return post_job({{"scene", "m.glb"}, {"resolution", 64}, {"webhook", webhook}});
  }
  // Waits until the delivery of the job is in this state, and returns the member "webhook".
  Json until_webhook(const std::string& id, const std::string& state) {
    Json webhook;
    EXPECT_TRUE(until([&] { return (webhook = job(id)["webhook"])["state"] == state; })) << webhook;
    return webhook;
  }
};

TEST_F(TlsWebhooks, AreDelivered) {
  if (!client::supports_https()) GTEST_SKIP() << "cpp-httplib was built without TLS";
  TlsReceiver receiver(folder_);
  const std::string secret = "a secret of a test";
  std::ofstream(folder_.file("secret")) << secret << "\n";
  config_.webhooks.secret_file = folder_.file("secret");
  config_.webhooks.allow = {receiver.url("/hooks")};
  config_.webhooks.ca_file = receiver.certificate();
  const std::string id = post_with(receiver.url("/hooks/a"));
  const Json webhook = until_webhook(id, "delivered");
  EXPECT_EQ(webhook["status"], 204);
  EXPECT_EQ(webhook["attempts"], 1);
  const auto received = receiver.received();
  ASSERT_EQ(received.size(), 1u);
  EXPECT_EQ(received[0].target, "/hooks/a");
  EXPECT_EQ(received[0].signature, webhook_signature(secret, received[0].body));
  EXPECT_EQ(Json::parse(received[0].body)["id"], id);
}

// A receiver whose certificate is not trusted gets nothing.
TEST_F(TlsWebhooks, NeedATrustedCertificate) {
  if (!client::supports_https()) GTEST_SKIP() << "cpp-httplib was built without TLS";
  TlsReceiver receiver(folder_);
  config_.webhooks.allow = {receiver.url("/hooks")};
  config_.webhooks.max_attempts = 2;
  const Json webhook = until_webhook(post_with(receiver.url("/hooks/a")), "failed");
  EXPECT_EQ(webhook["attempts"], 2);
  EXPECT_EQ(webhook["status"], nullptr);
  EXPECT_NE(webhook["error"].get<std::string>().find("certificate"), std::string::npos) << webhook;
  EXPECT_TRUE(receiver.received().empty());
}

// The service does not start with a file of certificates that it could not use later.
TEST_F(TlsWebhooks, NeedAFileWithCertificates) {
  config_.webhooks.ca_file = folder_.file("ca.pem");
  const auto error = [&] {
    try {
      start();
    } catch (const Error& e) {
      return e.message();
    }
    stop();
    return std::string();
  };
  const auto error_of = [&](const std::string& text) {
    std::ofstream(config_.webhooks.ca_file) << text;
    return error();
  };
  EXPECT_NE(error(), "") << "there is no file";
  const std::string expected = "ca.pem: it has no certificate: expected a PEM file with at least";
  EXPECT_NE(error_of("").find(expected), std::string::npos);
  EXPECT_NE(error_of("text\n").find(expected), std::string::npos);
  make_certificate(folder_.file("ca.pem"), folder_.file("key.pem"));
  EXPECT_EQ(error(), "");
  std::stringstream certificate, key;
  certificate << std::ifstream(folder_.file("ca.pem")).rdbuf();
  key << std::ifstream(folder_.file("key.pem")).rdbuf();
  EXPECT_NE(error_of(key.str()).find(expected), std::string::npos);
  EXPECT_EQ(error_of(key.str() + certificate.str()), "");
  const std::string half = certificate.str().substr(0, certificate.str().size() / 2);
  EXPECT_NE(error_of(certificate.str() + half).find("OpenSSL cannot read it ("), std::string::npos);
}

}  // namespace
}  // namespace voxdag::server
