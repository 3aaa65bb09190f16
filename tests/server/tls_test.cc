#include <openssl/pem.h>
#include <openssl/x509v3.h>

#include <cstdio>

#include "core/base/error.h"
#include "tests/server/running_service.h"

namespace voxdag::server {
namespace {

// Writes a self-signed certificate for 127.0.0.1, and its key. The certificate is not for
// localhost, because a container may not resolve this name.
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

}  // namespace
}  // namespace voxdag::server
